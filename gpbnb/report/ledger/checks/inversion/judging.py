"""Judge printed relations: each must hold wherever its symbols have their true values."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from gpbnb.report.ledger.checks.inversion.first_order import matrix
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.statements import Statement

Names = Mapping[str, Any]
SYMBOLS: dict[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "≈": operator.eq,  # to first order
    "<=": operator.le,
    ">=": lambda a, b: b <= a,
    "<": lambda a, b: a <= b and a != b,
    ">": lambda a, b: b <= a and a != b,
}
COMMON: dict[str, Any] = {
    "matrix": matrix,
    "norm": lambda x: x.norm(),
}
"""Functions of every environment."""


def holds(printed: Statement, environments: Iterable[Names], sharp: bool = True) -> bool:
    """Whether all printed relations hold in all environments.

    Parameters
    ----------
    printed : the statement.
    environments : the true values of its symbols, one mapping per instance.
    sharp : whether an inequality must be an equality in some environment, so that larger coefficients are detected.
    """
    attained: dict[int, bool] = {}
    for names in environments:
        for place, link in enumerate(printed.links({**COMMON, **names}, Fraction)):
            if not SYMBOLS[link.symbol](link.left, link.right):
                return False
            attained[place] = attained.get(place, False) or bool(link.left == link.right)
    return bool(attained) and (not sharp or all(attained.values()))


def says(printed: Statement, **expected: str) -> bool:
    """Whether the document prints the phrase expected for each label."""
    return all(printed.says(label) == phrase for label, phrase in expected.items())


def corrected(printed: Statement, form: str) -> Statement:
    """Return the statement with its intended form."""
    return replace(printed, form=form)


def slip(printed: Statement, environments: Iterable[Names], meant: str, recomputed: str, note: str) -> Finding:
    """Judge a statement that fails: it has a misprint if the intended form holds, otherwise it is wrong."""
    environments = tuple(environments)
    return compare(
        holds(printed, environments),
        recomputed,
        Verdict.MISPRINT if holds(corrected(printed, meant), environments) else Verdict.WRONG,
        otherwise_note=note,
    )
