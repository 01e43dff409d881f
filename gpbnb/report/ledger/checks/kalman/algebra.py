"""Derive the report's own error algebra again, with the meaning of each letter of (102)-(125) to first order.

The report gives every matrix one ε, so matrices become plain symbols. Each function returns the derived values of the
letters in a group of equations. A printed chain is right if its sides agree to first order in ε.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import sympy as sp

from gpbnb.report.kalman import derivation as d
from gpbnb.report.ledger.formula import Undefined
from gpbnb.report.ledger.statements import Statement

H, R, B, NORM_X = sp.symbols("H R B norm_x", positive=True)
_BASIS = (d.PP, d.P, d.Q, d.CQ, d.KZ, d.KREST, d.PHI, d.FK, d.X, d.U, H, R)
COMMON: dict[str, Any] = {
    "n": d.N, "m": d.M, "k": d.K, "epsilon": d.EPS, "beta": d.BETA, "I": sp.Integer(1), "H_k": H, "R_k": R,
    "T": lambda x: x, "inv": lambda x: 1 / x,
}  # fmt: skip


def _at(index: sp.Expr, value: sp.Expr, name: str) -> Callable[[Any], Any]:
    """Return a letter that is known only at one index."""
    return lambda i: value if sp.expand(i - index) == 0 else sp.Symbol(f"{name}[{i}]")


@cache
def prediction() -> dict[str, Any]:
    """Return the letters of (102) and (103); the product in (100) is P_kp - Q."""
    error, phi = d.prediction_error(), sp.Symbol("phi", positive=True)
    return COMMON | {
        "phi": _at(d.K - 1, phi, "phi"), "P": _at(d.K - 1, (d.PP - d.Q) / phi**2, "P"), "Q": _at(d.K - 1, d.Q, "Q"),
        "P_kp": d.PP, "P_hat_kp": d.PP + d.EPS * error, "P_tilde_kp": d.EPS * error,
    }  # fmt: skip


@cache
def covariance() -> dict[str, Any]:
    """Return the letters of (104), (105) and the line before (107), with K H P_kp = P_kp - P_k."""
    predicted = d.prediction_error().subs(d.Q, d.CQ * d.PP / d.P)
    error = d.covariance_error()
    return COMMON | {
        "P_kp": d.PP, "P_k": d.P, "K_k": (d.PP - d.P) / (d.PP * H), "P_hat_kp": d.PP + d.EPS * predicted,
        "P_tilde_kp": d.EPS * predicted, "P_hat_k": d.P + d.EPS * error, "P_tilde_k": d.EPS * error,
    }  # fmt: skip


@cache
def gain() -> dict[str, Any]:
    """Return the letters of (106)-(108), with K = P H' R^-1 and the covariance of the line before (107)."""
    P, PP = d.KZ * R / H, d.KREST * R / H
    rounded = P + d.EPS * d.covariance_error().subs({d.P: P, d.PP: PP, d.CQ: 0}, simultaneous=True)
    error = d.gain_error()
    return COMMON | {
        "P_k": P, "P_kp": PP, "P_hat_k": rounded, "R_hat_k": R / (1 + d.EPS), "K_k": d.KZ,
        "K_hat_k": d.KZ + d.EPS * error, "K_tilde_k": d.EPS * error,
    }  # fmt: skip


@cache
def loop() -> dict[str, Any]:
    """Return the letters of (112)-(116), with K H Phi = Phi - F and the gain of (108)."""
    K = (d.PHI - d.FK) / (d.PHI * H)
    F_hat, u_hat = d.FK + d.EPS * d.transition_error(), d.U + d.EPS * d.input_error()
    state = F_hat * d.X * (1 + (d.N + 1) * d.EPS) + u_hat * (1 + d.EPS)
    return COMMON | {
        "phi": _at(d.K - 1, d.PHI, "phi"), "x": _at(d.K - 1, d.X, "x"), "K_k": K, "z_k": d.U / K, "u_k": d.U,
        "F_k": d.FK, "K_hat_k": K * (1 + d.EPS * d.gain_error().coeff(d.KZ)), "F_hat_k": F_hat, "u_hat_k": u_hat,
        "x_hat_k": state,
    }  # fmt: skip


@cache
def restated() -> dict[str, Any]:
    """Return the letters of (117): the closed loop and the input with the counts of (114)."""
    once = d.ONCE
    return loop() | {
        "F_hat_k": d.FK * (1 + once[0] * d.EPS),
        "u_hat_k": d.U * (1 + once[1] * d.EPS),
        "x_hat_k": d.FK * d.X + d.U + d.EPS * d.state_error(),
    }


@cache
def three_steps(twice: bool) -> dict[str, Any]:
    """Return the letters of three steps of (117), with roundings counted once, or twice as in (119)."""
    found = dict(COMMON)
    loops, inputs = d.TWICE if twice else d.ONCE
    exact = rounded = sp.Symbol("x_0")
    found["x_0"] = exact
    for i in (1, 2, 3):
        F, u = sp.symbols(f"F_{i} u_{i}")
        F_hat, u_hat = F * (1 + d.ONCE[0] * d.EPS), u * (1 + d.ONCE[1] * d.EPS)
        found |= {f"F_{i}": F, f"u_{i}": u, f"F_hat_{i}": F_hat, f"u_hat_{i}": u_hat}
        exact, rounded = F * exact + u, F * (1 + loops * d.EPS) * rounded + u * (1 + inputs * d.EPS)
    linear = sp.diff(rounded, d.EPS).subs(d.EPS, 0)
    return found | {"x_3": exact, "x_hat_3": exact + d.EPS * linear, "x_tilde_3": d.EPS * linear}


@cache
def norms() -> dict[str, Any]:
    """Return the letters of (122), (124) and (125); each norm of an error is its bound by the report's algebra."""
    first, second = d.count_start(d.TWICE[0]), d.second_coefficient(*d.TWICE)
    values = {sp.Symbol(f"x_{k}"): NORM_X for k in "34k"}
    for k, number in (("3", 3), ("4", 4), ("k", d.K)):
        bound = d.BETA * (first * NORM_X + second * B)
        values[sp.Symbol(f"x_tilde_{k}")] = bound.subs(d.K, number)
    return COMMON | {"epsilon": d.BETA, "B": B, "norm": values.__getitem__}


# -- comparison ---------------------------------------------------------------------------------------


def holds(printed: Statement, names: dict[str, Any]) -> bool:
    """Whether a printed chain holds to first order in ε.

    Both sides of an equation must agree. The right side of an inequality may omit terms of the left side that are
    negative for positive ε, because the report drops them. Any other difference is an error.
    """
    links = printed.links(names)
    return bool(links) and all(_agree(link.left, link.symbol, link.right) for link in links)


def follows(printed: Statement, names: dict[str, Any]) -> bool:
    """Whether a printed chain follows from the report's own algebra; a chain in other terms does not."""
    try:
        return holds(printed, names)
    except (Undefined, sp.PolynomialError):
        return False


def _agree(left: Any, symbol: str, right: Any) -> bool:
    if symbol not in ("==", "<="):
        return False
    if not _is_zero((left - right).subs(d.EPS, 0)):
        return False
    change = sp.diff(right - left, d.EPS).subs(d.EPS, 0)
    if _is_zero(change):
        return True
    return symbol == "<=" and _dropped(sp.diff(left, d.EPS).subs(d.EPS, 0), change)


def _dropped(left: Any, change: Any) -> bool:
    """Whether the change only removes whole negative terms of the left side."""
    terms = sp.Poly(sp.cancel(left), *_BASIS).as_dict()
    for powers, coefficient in sp.Poly(sp.cancel(change), *_BASIS).as_dict().items():
        before = terms.get(powers, sp.Integer(0))
        if sp.expand(before + coefficient) != 0 or not before.subs({d.N: 2, d.M: 3}) < 0:
            return False
    return True


def _is_zero(expression: Any) -> bool:
    return bool(sp.cancel(sp.expand(expression)) == 0)
