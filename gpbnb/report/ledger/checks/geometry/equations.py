"""Checks of hung1982, ch. IV, (1)-(12)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import sympy as sp

from gpbnb.report.geometry import derivation
from gpbnb.report.geometry.derivation import SEQUENCES
from gpbnb.report.ledger.agreement import hold, vanishes
from gpbnb.report.ledger.checks.geometry.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.statements import Statement, statement

H = sp.Symbol("h")
"""Scale of all small angles; first-order terms are derivatives by this scale at zero."""
PHASE = sp.Rational(4, 7)
"""Roll angle ωt of the case."""
ANGLES: Mapping[str, tuple[sp.Rational, ...]] = {
    "alpha": (sp.Rational(3, 2), sp.Rational(-5, 3), sp.Rational(7, 4)),
    "beta": (sp.Rational(2, 7), sp.Rational(9, 5), sp.Rational(-4, 3)),
    "gamma": (sp.Rational(-8, 5), sp.Rational(5, 6), sp.Rational(11, 7)),
    "theta": (sp.Rational(6, 7), sp.Rational(-9, 4), sp.Rational(5, 2)),
}
"""Three angles of each set, in units of `H`."""


def letters(scale: sp.Expr) -> dict[str, Any]:
    """Return the angles of the case by their printed names, times a scale, and the roll angle."""
    names: dict[str, Any] = {"matrix": sp.Matrix, "omega": sp.Integer(1), "t": PHASE}
    for name, values in ANGLES.items():
        names |= {f"{name}_{k}": scale * value for k, value in enumerate(values, 1)}
    return names


@cache
def rotation_to_first_order(name: str) -> tuple[sp.Matrix, sp.Matrix]:
    """Return the matrix of a set of angles at zero angles, and its derivative by their scale, from exact rotations.

    Raises
    ------
    ArithmeticError : the six orders of three rotations differ to first order.
    """
    found = []
    for sequence in SEQUENCES:
        matrix = derivation.exact([H * value for value in ANGLES[name]], sequence)
        found.append((matrix.subs(H, 0), matrix.diff(H).subs(H, 0)))
    if not all(vanishes(value - first) for values in found for value, first in zip(values, found[0], strict=True)):
        raise ArithmeticError("got orders of the turns that differ to first order; needed the same first order for all")
    return found[0]


_CHAINS = {
    "hung1982.IV.eq1": ("t", ("beta", "roll", "alpha")),
    "hung1982.IV.eq2": ("r", ("gamma", "beta", "roll", "theta")),
    "hung1982.IV.eq3": ("t", ("roll", "alpha")),
    "hung1982.IV.eq4": ("r", ("roll", "theta")),
}
"""Frame and factors of each printed chain, from left to right."""


def first_order(printed: Statement) -> bool:
    """Whether each matrix of a printed chain is the first order of the exact rotation, and the vectors are right."""
    frame, factors = _CHAINS[printed.id]
    matrices: list[sp.Matrix] = []

    def collect(rows: list[Any]) -> sp.Matrix:
        matrices.append(sp.Matrix(rows))
        return matrices[-1]

    names = {**letters(H), **{f"{axis}_{frame}": sp.Symbol(axis) for axis in "xyz"}, "matrix": collect}
    (link,) = printed.links(names)
    reading, *chain, vector = matrices
    product = sp.eye(3)
    for matrix in chain:
        product = product * matrix
    if len(chain) != len(factors) or link.symbol != "==" or not vanishes(link.right - product * vector):
        return False
    if reading != sp.Matrix(sp.symbols("x y z")) or link.left != reading or vector != sp.Matrix([1, 0, 0]):
        return False
    for matrix, name in zip(chain, factors, strict=True):
        zeroth, first = rotation(name)
        if not (vanishes(matrix.subs(H, 0) - zeroth) and vanishes(matrix.diff(H).subs(H, 0) - first)):
            return False
    return True


def rotation(name: str) -> tuple[sp.Matrix, sp.Matrix]:
    """Return a factor of a chain at zero angles, and its derivative by their scale."""
    return (derivation.turn(1, PHASE), sp.zeros(3, 3)) if name == "roll" else rotation_to_first_order(name)


@CHECKS.add(*_CHAINS)
def chains(printed: Statement) -> Finding:
    return compare(
        first_order(printed),
        "the equation is the exact chain of rotations to first order",
        note=(
            "this holds for each of the six orders of the three rotations; the report does not say which order it uses"
        ),
    )


def readings() -> dict[str, Any]:
    """Return the angles, and the readings of telescope and gyro to first order without misalignments."""
    names = letters(sp.Integer(1))
    for frame, angles in (("t", "alpha"), ("r", "theta")):
        vector = derivation.turn(1, PHASE) * rotation_to_first_order(angles)[1] * sp.Matrix([1, 0, 0])
        names |= {f"{axis}_{frame}": vector[k] for k, axis in enumerate("xyz")}
    for k in (1, 2, 3):
        names[f"phi_{k}"] = names[f"theta_{k}"] - names[f"alpha_{k}"]
        names[f"alpha_hat_{k}"], names[f"theta_hat_{k}"] = names[f"alpha_{k}"], names[f"theta_{k}"]
    return names


@CHECKS.add("hung1982.IV.eq5", "hung1982.IV.eq6", "hung1982.IV.eq7")
def derolled(printed: Statement) -> Finding:
    restored = printed.id.endswith("7")
    return compare(
        hold(printed.links(readings())),
        "both rows follow from (3) and (4)",
        note="only fragments remain in the scan; the text is restored from (5) and (6)" if restored else "",
    )


@CHECKS.add("hung1982.IV.eq8", "hung1982.IV.eq9")
def estimates(printed: Statement) -> Finding:
    name = r"\alpha" if printed.id.endswith("8") else r"\theta"
    changes = signs_to_change()
    signs = {", ".join("C" if k in (2, 5) else "S" if k in (3, 4) else "left side" for k in s) for s in changes}
    return compare(
        hold(printed.links(readings())),
        f"the right side is $[-{name}_3\\cos2\\omega t+{name}_2\\sin2\\omega t;\\ "
        f"{name}_3\\sin2\\omega t+{name}_2\\cos2\\omega t]$, with mean 0 over a roll; correcting it "
        f"takes at least {len(changes[0])} changes of sign; these signs stand before {' or '.join(sorted(signs))}",
        Verdict.MISPRINT if later_uses_are_right() else Verdict.WRONG,
        otherwise_note="as the scan shows it, the equation rolls the readings once more instead of derolling them; "
        f"the correct matrix is the inverse of (3), $[-\\hat{name}_3;\\hat{name}_2]=[[C,-S],[S,C]][y;z]$, as in (5) to "
        "(7). Nothing later uses the printed signs, as (10) to (12) hold for any estimates; but anyone who programs "
        "them measures no drift",
    )


@cache
def later_uses_are_right() -> bool:
    """Whether (5) to (7), which show the same computation, and (12), which uses its results, hold as printed."""
    others = [derolled(statement(f"hung1982.IV.eq{k}")).agrees for k in (5, 6, 7)]
    return all(others) and error_of_drift(statement("hung1982.IV.eq12")).agrees is True


@cache
def signs_to_change() -> tuple[tuple[int, ...], ...]:
    """Return the smallest sets of signs of (8) whose change turns it into a deroll."""
    return derivation.fewest_signs()


@CHECKS.add("hung1982.IV.eq12")
def error_of_drift(printed: Statement) -> Finding:
    names = readings()
    for k in (2, 3):
        alpha, theta = sp.Rational(k, 11), sp.Rational(-7, k)  # errors of the estimates
        estimate = (names[f"theta_{k}"] + theta) - (names[f"alpha_{k}"] + alpha)  # (7) with estimates
        names |= {f"Deltaalpha_{k}": alpha, f"Deltatheta_{k}": theta, f"Deltaphi_{k}": estimate - names[f"phi_{k}"]}
    return compare(
        hold(printed.links(names)),
        "subtracting (7) from (7) with estimated angles gives this error for both angles",
        note=(
            "this holds for any estimates; with estimates from (8) and (9) as printed, the errors are as "
            "large as the angles"
        ),
    )


@CHECKS.add("hung1982.IV.deroll-matrix")
def deroll_matrix(printed: Statement) -> Finding:
    names = letters(sp.Integer(1))
    seven = statement("hung1982.IV.eq7").relation()
    columns = [
        seven.value({**names, "y_r": sp.Integer(y), "z_r": sp.Integer(z), "y_t": sp.S.Zero, "z_t": sp.S.Zero})
        for y, z in ((1, 0), (0, 1))
    ]
    rolled = derivation.turn(1, PHASE)[1:, 1:]
    undoes = vanishes(sp.Matrix.hstack(*columns) * rolled - sp.eye(2))
    return compare(
        printed.says("operation") == ("deroll" if undoes else "roll"),
        "the matrix in (7) times the roll matrix is the identity",
    )
