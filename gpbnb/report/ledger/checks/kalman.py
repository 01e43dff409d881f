"""Sections 12 to 14 on the Kalman filter: true values of their names, exact and to first order in ε.

Estimates, covariances, gains and closed loops come from the weighted least squares of prediction and measurement,
solved through the information matrix. The report's own error algebra gives every matrix one ε, so there matrices are
plain symbols.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact, max_norm, row_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters import forms
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.kalman import derivation as d
from gpbnb.report.kalman import ensembles, exact_step, report_bounds, smallest
from gpbnb.report.ledger.checks import kalman_errors
from gpbnb.report.ledger.checks.kalman_errors import FOUR
from gpbnb.report.ledger.first_order import FirstOrder
from gpbnb.report.ledger.judge import judge, read
from gpbnb.report.ledger.largest import ratio
from gpbnb.report.ledger.statements import Statement, statement

Names = dict[str, Any]


# -- the filter's equations, (98)-(101) and (109)-(111) -------------------------------------------

STATES, MEASUREMENTS, STEPS = 3, 2, 5


def _numbers(rng: np.random.Generator, rows: int, columns: int) -> sp.Matrix:
    return sp.Matrix(rows, columns, lambda i, j: sp.Integer(int(rng.integers(-9, 10))))


def _covariance(rng: np.random.Generator, size: int) -> sp.Matrix:
    half = _numbers(rng, size, size)
    return half * half.T + sp.eye(size)


@cache
def least_squares_run() -> dict[str, dict[int, sp.Matrix]]:
    """Return five steps of a random filter by least squares, with each matrix by letter and index."""
    rng, n, m = np.random.default_rng(98), STATES, MEASUREMENTS
    found: dict[str, dict[int, sp.Matrix]] = defaultdict(dict)
    found["x"][0], found["P"][0] = _numbers(rng, n, 1), _covariance(rng, n)
    for k in range(1, STEPS + 1):
        Phi, H, Q = _numbers(rng, n, n) / 10, _numbers(rng, m, n), _covariance(rng, n)
        R, z = _covariance(rng, m), _numbers(rng, m, 1)
        prior = Phi * found["P"][k - 1] * Phi.T + Q
        P = (prior.inv() + H.T * R.inv() * H).inv()
        F, u = P * prior.inv() * Phi, P * H.T * R.inv() * z
        now = {"H": H, "R": R, "z": z, "prior": prior, "P": P, "K": P * H.T * R.inv(), "F": F, "u": u}
        for letter, value in (now | {"x": F * found["x"][k - 1] + u}).items():
            found[letter][k] = value
        found["Phi"][k - 1], found["Q"][k - 1] = Phi, Q
    return found


def filter_steps() -> list[Names]:
    """Return the values of the letters of section 12 in two steps of the run."""
    run, found = least_squares_run(), []
    for k in (2, 3):
        names: Names = {
            letter: lambda index, values=run[letter]: values[int(index)]
            for letter in ("Phi", "H", "Q", "R", "z", "x", "P", "K", "F", "u")
        }
        names |= {"phi": names["Phi"], "x_star": names["x"], "k": sp.Integer(k), "numbers": sp.Rational}
        names |= {"P_kp": run["prior"][k], "I": sp.eye(STATES), "x_0": run["x"][0]}
        found.append(names | {"K_p": 2 * run["K"][k]})  # (101) contains this letter, which no equation defines
    return found


def noises() -> list[Names]:
    """Return noises of several sizes, whose products must be defined."""
    return [
        {"E": lambda product: 0, "w": lambda k, n=n: np.zeros((n, 1)), "v": lambda j, m=m: np.zeros((m, 1)),
         "T": np.transpose}
        for n, m in ((1, 1), (STATES, MEASUREMENTS))
    ]  # fmt: skip


def asterisk() -> Names:
    """Whether the x of (111) is the exact or the rounded estimate, for one state in four digits."""
    case = smallest.scalar(FOUR)
    true = exact_step.exact_step(*case)
    x, _, _ = smallest.rounded_step(FOUR, case)
    by_111 = true.transition @ case.x + true.gain @ case.z
    meant = "the rounded value of the estimate" if (x == by_111).all() else "the exact estimate"
    return {"x denotes": meant, "rounded": float(x[0]), "by_111": float(by_111[0])}


# -- the report's own error algebra, (102)-(125) --------------------------------------------------

H, R, B, NORM_X = sp.symbols("H R B norm_x", positive=True)


ALGEBRA: Names = {
    "n": d.N, "m": d.M, "k": d.K, "epsilon": d.EPS, "beta": d.BETA, "I": sp.Integer(1), "H_k": H, "R_k": R,
    "T": lambda x: x, "inv": lambda x: 1 / x, "numbers": sp.Rational,
}  # fmt: skip


def _at(index: sp.Expr, value: sp.Expr, name: str) -> Callable[[Any], Any]:
    """Return a letter that is known only at one index."""
    return lambda i: value if sp.expand(i - index) == 0 else sp.Symbol(f"{name}[{i}]")


@cache
def prediction() -> Names:
    """Return the letters of (102) and (103); the product in (100) is P_kp - Q."""
    error, phi = d.prediction_error(), sp.Symbol("phi", positive=True)
    return ALGEBRA | {
        "phi": _at(d.K - 1, phi, "phi"), "P": _at(d.K - 1, (d.PP - d.Q) / phi**2, "P"), "Q": _at(d.K - 1, d.Q, "Q"),
        "P_kp": d.PP, "P_hat_kp": d.PP + d.EPS * error, "P_tilde_kp": d.EPS * error,
    }  # fmt: skip


@cache
def covariance() -> Names:
    """Return the letters of (104), (105) and the line before (107), with K H P_kp = P_kp - P_k."""
    predicted = d.prediction_error().subs(d.Q, d.CQ * d.PP / d.P)
    error = d.covariance_error()
    return ALGEBRA | {
        "P_kp": d.PP, "P_k": d.P, "K_k": (d.PP - d.P) / (d.PP * H), "P_hat_kp": d.PP + d.EPS * predicted,
        "P_tilde_kp": d.EPS * predicted, "P_hat_k": d.P + d.EPS * error, "P_tilde_k": d.EPS * error,
    }  # fmt: skip


@cache
def gain() -> Names:
    """Return the letters of (106)-(108), with K = P H' R^-1 and the covariance of the line before (107)."""
    P, PP = d.KZ * R / H, d.KREST * R / H
    rounded = P + d.EPS * d.covariance_error().subs({d.P: P, d.PP: PP, d.CQ: 0}, simultaneous=True)
    error = d.gain_error()
    return ALGEBRA | {
        "P_k": P, "P_kp": PP, "P_hat_k": rounded, "R_hat_k": R / (1 + d.EPS), "K_k": d.KZ,
        "K_hat_k": d.KZ + d.EPS * error, "K_tilde_k": d.EPS * error,
    }  # fmt: skip


@cache
def loop() -> Names:
    """Return the letters of (112)-(116), with K H Phi = Phi - F and the gain of (108)."""
    K = (d.PHI - d.FK) / (d.PHI * H)
    F_hat, u_hat = d.FK + d.EPS * d.transition_error(), d.U + d.EPS * d.input_error()
    state = F_hat * d.X * (1 + (d.N + 1) * d.EPS) + u_hat * (1 + d.EPS)
    return ALGEBRA | {
        "phi": _at(d.K - 1, d.PHI, "phi"), "x": _at(d.K - 1, d.X, "x"), "K_k": K, "z_k": d.U / K, "u_k": d.U,
        "F_k": d.FK, "K_hat_k": K * (1 + d.EPS * d.gain_error().coeff(d.KZ)), "F_hat_k": F_hat, "u_hat_k": u_hat,
        "x_hat_k": state,
    }  # fmt: skip


@cache
def restated() -> Names:
    """Return the letters of (117): the closed loop and the input with the counts of (114)."""
    once = d.ONCE
    return loop() | {
        "F_hat_k": d.FK * (1 + once[0] * d.EPS),
        "u_hat_k": d.U * (1 + once[1] * d.EPS),
        "x_hat_k": d.FK * d.X + d.U + d.EPS * d.state_error(),
    }


@cache
def three_steps(twice: bool) -> Names:
    """Return the letters of three steps of (117), with roundings counted once, or twice as in (119)."""
    found = dict(ALGEBRA)
    loops, inputs = d.TWICE if twice else d.ONCE
    true = rounded = sp.Symbol("x_0")
    found["x_0"] = true
    for i in (1, 2, 3):
        F, u = sp.symbols(f"F_{i} u_{i}")
        F_hat, u_hat = F * (1 + d.ONCE[0] * d.EPS), u * (1 + d.ONCE[1] * d.EPS)
        found |= {f"F_{i}": F, f"u_{i}": u, f"F_hat_{i}": F_hat, f"u_hat_{i}": u_hat}
        true, rounded = F * true + u, F * (1 + loops * d.EPS) * rounded + u * (1 + inputs * d.EPS)
    linear = sp.diff(rounded, d.EPS).subs(d.EPS, 0)
    return found | {"x_3": true, "x_hat_3": true + d.EPS * linear, "x_tilde_3": d.EPS * linear}


@cache
def norms() -> Names:
    """Return the letters of (122), (124) and (125); each norm of an error is its bound by the report's algebra."""
    first, second = d.count_start(d.TWICE[0]), d.second_coefficient(*d.TWICE)
    values = {sp.Symbol(f"x_{k}"): NORM_X for k in "34k"}
    for k, number in (("3", 3), ("4", 4), ("k", d.K)):
        bound = d.BETA * (first * NORM_X + second * B)
        values[sp.Symbol(f"x_tilde_{k}")] = bound.subs(d.K, number)
    return ALGEBRA | {"epsilon": d.BETA, "B": B, "norm": values.__getitem__}


def follows(printed: Statement, letters: Names) -> str:
    """Say whether the printed terms follow from the report's own algebra; terms in other letters do not."""
    try:
        right = judge(printed, letters, "first order").holds
    except (ValueError, sp.PolynomialError):
        right = False
    return "follow" if right else "do not follow"


def errors(printed: Statement, letters: Names, *groups: Iterable[Mapping[str, Any]]) -> str:
    """Say whether the terms follow from the report's algebra, and how far an example filter exceeds the last side."""
    times = ratio(printed, *groups)
    allows = f"{times:.3g} times what the last side allows" if times < np.inf else "not allowed at all"
    return (
        f"the printed terms {follows(printed, letters)} from the report's own algebra; in four digits, the error of an "
        f"example filter is {allows}"
    )


# -- one rounded step, (102)-(117) ----------------------------------------------------------------


@dataclass(frozen=True)
class ByHand:
    """A step in four digits with P = H = Φ = 1: the gain, the covariance, and the gain of the second form."""

    R: float
    K: float
    P: float
    second: float


def by_hand(R: str) -> ByHand:
    fl, r = FOUR.round, Fraction(R)
    K = fl(1 / fl(1 + r))
    P = fl(1 - K)
    return ByHand(float(r), float(K), float(P), float(fl(P * fl(1 / r))))


@cache
def dropped_error() -> tuple[float, float]:
    """Return what the error of P_{k-1} makes of (103), and of the growth of (125) when k is doubled.

    The first is the error of P_kp in the second step of a filter with one state, over (2n + 1)β P_kp. One state has no
    sums that could cancel, so this error comes from the first step alone.
    """
    case = smallest.scalar(FOUR)
    _, _, rounded = smallest.rounded_step(FOUR, case, second=True)
    true = exact_step.exact_step(*case).P
    allowed = FOUR.unit_roundoff * report_bounds.prediction_count(1) * (true + case.Q)
    k, n, m = report_bounds.EXAMPLE
    growth = [report_bounds.coefficients(i * k, n, m, **report_bounds.ALL_CORRECTED).second for i in (1, 2)]
    return float((abs(rounded - true) / allowed)[0, 0]), growth[1] / growth[0]


@cache
def division_errors() -> tuple[Fraction, int]:
    """Return the largest relative error of 1/r in four digits, in units of β, and the count of numbers tried."""
    rng = np.random.default_rng(99)
    numbers = [Fraction(int(d), 1000) for d in rng.integers(1000, 10000, 200)]
    return max(abs(FOUR.round(1 / r) * r - 1) for r in numbers) / FOUR.unit_roundoff, len(numbers)


def division() -> Names:
    """Return the letters of the rounding of 1/R, with as many roundings as the largest error of a division asks."""
    roundings = int(np.ceil(float(division_errors()[0])))
    return ALGEBRA | {"R_hat_k": R / (1 + roundings * d.EPS)}


def counts() -> tuple[str, str]:
    """Return the counts of roundings in (112) and (113)."""
    loops, inputs = d.transition_error().coeff(d.FK), d.input_error().coeff(d.U)
    return sp.latex(loops), sp.latex(inputs)


def counted_twice() -> tuple[str, str]:
    """Return how many roundings of a closed loop and of an input are counted again after (117)."""
    loops, inputs = (sp.expand(again - once) for again, once in zip(d.TWICE, d.ONCE, strict=True))
    return sp.latex(loops), sp.latex(inputs)


def _cited(document: str, place: str, names: Names | None = None, side: int = -1) -> sp.Expr:
    """Return a side of an equation of a document."""
    chapter = {"hung1984": "II", "hung1982": "III"}[document]
    return statement(f"{document}.{chapter}.{place}").relation().sides[side].value(names)


def written_again(document: str) -> Names:
    """Which equation is (117) with (115) and (116)."""
    names = {"F_hat_k": _cited(document, "eq115"), "u_hat_k": _cited(document, "eq116")}
    again = _cited(document, "eq117", names)
    return {"equation": lambda phrase: sp.expand(again - _cited(document, f"eq{phrase.strip('()')}")) == 0}


def combined(document: str) -> Names:
    """Which two equations give (119) with the line before it."""

    def gives(phrase: str) -> bool:
        loops, inputs = (f"eq{number}" for number in re.findall(r"\((\d+)\)", phrase))
        names = {f"F_hat_{i}": _cited(document, loops, {"F_k": sp.Symbol(f"F_{i}")}) for i in (1, 2, 3)}
        names |= {f"u_hat_{i}": _cited(document, inputs, {"u_k": sp.Symbol(f"u_{i}")}) for i in (1, 2, 3)}
        difference = _cited(document, "s12.unnumbered-x-3", names) - _cited(document, "eq119", side=1)
        epsilon = sp.Symbol("epsilon")
        return all(
            sp.expand(each) == 0 for each in (difference.subs(epsilon, 0), difference.diff(epsilon).subs(epsilon, 0))
        )

    return {"equations": gives}


# -- several steps, (119)-(125) -------------------------------------------------------------------


@cache
def no_bound() -> str:
    """Say what the smallest counterexample to (125) loses, and by how much it moves the estimate."""
    case = smallest.scalar(FOUR)
    true, (x, _, P) = exact_step.exact_step(*case), smallest.rounded_step(FOUR, case)
    if P[0, 0] != 0:
        raise ArithmeticError("got a covariance from the counterexample to (125); needed one that is rounded to zero")
    deviations = float(abs(x - true.x)[0]) / math.sqrt(true.P[0, 0])
    return (
        "the counterexample has one state with $P=H=\\Phi=x_0=1$, $z=0$ and $R$ below the last digit; in every format, "
        "the computed covariance is zero, so all of its digits are lost. In four digits, the error of the estimate is "
        f"only {deviations:.2g} standard deviations of the exact estimate, but (125) does not allow it"
    )


def signs_of_121(printed: Statement) -> tuple[sp.Expr, sp.Expr]:
    """Return both sides of (121) over ε in an example where the terms of (120) have different signs."""
    x_0, u = Fraction(-3), Fraction(1)
    of_each = [d.count_start(d.TWICE[0])] + [d.count_input(*d.TWICE).subs(d.NTH, i) for i in (1, 2, 3)]
    of_start, *of_inputs = (int(count.subs({d.K: 3, d.N: 1, d.M: 1})) for count in of_each)
    names = {"n": 1, "m": 1, "epsilon": 1, "F_3": 1, "F_2": 1, "norm": abs}
    names |= {"u_1": u, "u_2": u, "u_3": u, "x_3": x_0 + 3 * u, "x_tilde_3": of_start * x_0 + sum(of_inputs) * u}
    link = printed.links(names, Fraction)[-1]
    return link.left, link.right


def assumed_norms() -> list[Names]:
    """Return F, u and B that bound ‖Fu‖ and ‖FFu‖, for a loop for which (21) and (22) do not fit and for one number."""
    found = []
    for closed, entered in (([["9/10", "9/10"], [0, 0]], [1, 1]), ([["3/2"]], [2])):
        F, u = exact(closed), exact(entered)
        norm, size = row_sum_norm(F), max_norm(u)
        names = {"norm": FirstOrder.norm, "F_k": FirstOrder(F), "u_k": FirstOrder(u[:, None]), "F": norm, "u": size,
                 "B": norm**2 * size}  # fmt: skip
        found += [{**names, "part": part, "tight": True} for part in (1, 2)]
        found += [{**names, "F": 2 * norm, "part": 1}, {**names, "u": 2 * size, "part": 2}]
        found += [{**names, "part": 3, "i": Fraction(i), "tight": i == 2} for i in range(3)]
    return found


def norm_of_two_steps() -> Fraction:
    """Return ‖FFu‖ of the first loop of :func:`assumed_norms`."""
    F, u = exact([["9/10", "9/10"], [0, 0]]), exact([1, 1])
    return max_norm(F @ F @ u)


def dependence() -> Names:
    """Whether the bound (125) grows with each of its six quantities."""

    def value(
        k: int = 3, n: int = 2, m: int = 1, x: int = 1, B: int = 1, beta: Fraction = FOUR.unit_roundoff
    ) -> Fraction:
        first, second = report_bounds.coefficients(k, n, m)
        return beta * (first * x + second * B)

    others = [value(k=4), value(n=3), value(m=2), value(x=2), value(B=2), value(beta=FOUR.unit_roundoff * 2)]
    grows = all(other > value() for other in others)
    return {"the bound": "depends on all six" if grows else "is independent of some of the six", "count": len(others)}


# -- the closing example: a year of steps of ten seconds ------------------------------------------

YEAR, STEP = 365 * 24 * 3600, 10  # seconds
GOAL, SIGNAL = 1, 6606  # mas a year; the experiment's goal, and the larger of the two drifts that relativity predicts
N, M = 10, 2


@cache
def coefficients() -> tuple[int, int]:
    """Return the factors of β‖x_k‖ and βB in (125), by the report's own algebra, for the example."""
    values = {d.K: Fraction(YEAR, STEP), d.N: N, d.M: M}
    derived = d.count_start(d.TWICE[0]), d.second_coefficient(*d.TWICE)
    first, second = (int(each.subs(values)) for each in derived)
    return first, second


def of_example(which: int, tolerance: Fraction = Fraction(1)) -> Names:
    """Return the numbers of the example with one coefficient of (125), and the β that meets a tolerance."""
    coefficient = coefficients()[which]
    return {
        "k": Fraction(YEAR, STEP), "n": Fraction(N), "m": Fraction(M), "expression": coefficient, "value": coefficient,
        "beta": tolerance / coefficient, "t": report_bounds.precision_for_coefficient(coefficient, tolerance),
    }  # fmt: skip


def ways_to_84(literal: str) -> str:
    """Name the misprints of one digit in the first coefficient that lead to the printed number."""
    misprints = report_bounds.one_digit_misprints(*report_bounds.EXAMPLE, literal)
    return " or ".join(f"${a}n+{b}m+{c}$" for a, b, c in misprints) or "no change of a single digit"


def printed_digits(which: int) -> str:
    """Say which digits the formula requires, and which the printed β requires."""
    beta = statement(f"hung1982.III.s12.example-beta-{('first', 'second')[which]}").number("beta").value
    needed = of_example(which)["t"]
    by_printed = report_bounds.precision_for_coefficient(1 / beta)
    return f"{needed}; for the printed β {by_printed}, since (8) gives $t={1 - math.log10(2 * float(beta)):.2f}$"


def smallest_changes() -> list[Names]:
    """Return for each precision the smallest decimal number that changes 1 when added to it, by trying."""
    found = []
    for t in range(1, 9):
        fl = FloatFormat(10, t).round
        tried = (Fraction(j, 2 * 10**t) for j in range(1, 101))
        beta = next((each for each in tried if fl(1 + each) > 1), Fraction(0))
        found.append({"t": Fraction(t), "beta": beta, "holds": fl(1 + beta * Fraction(999, 1000)) == 1})
    return found


# -- the remarks of section 13 --------------------------------------------------------------------


def refined() -> ensembles.Summary:
    """Summarize the stored runs of random filters with their contraction bounds."""
    (found,) = ensembles.merged([each._replace(kind="", form="") for each in ensembles.load()])
    return found


@cache
def needed_precision(base: int) -> int | None:
    """Return the fewest stored digits from which on the drift rates meet the tolerance at all checkpoints."""
    needed = None
    for found in sorted(year.load(), key=lambda each: each.case.precision, reverse=True):
        comparable = found.case._replace(precision=0) == year.YearCase(
            year.MODELS[0], base, 0, Rounding.NEAREST, forms.Form.HUNG
        )
        if comparable:
            if found.steps[-1] != YEAR // STEP or np.abs(found.rate).max() > GOAL:
                break
            needed = found.case.precision
    return needed


CHECKS = read(__name__, globals(), vars(kalman_errors))
