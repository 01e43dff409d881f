"""Compare printed bounds of rounding errors with the largest errors that occur.

A printed right side with one ε allows the errors that this ε gives with any |ε| ≤ β, in each entry. It must allow the
largest error in each instance, and no more in the instances that are ``tight``, where every rounding error adds up.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from gpbnb.report.ledger.first_order import FirstOrder, quantity
from gpbnb.report.ledger.formula import OPERATORS, Relation, Undefined
from gpbnb.report.ledger.statements import Statement

Names = Mapping[str, Any]


def _allowed(chain: Relation, names: Names) -> Iterator[tuple[Any, Any, Any]]:
    """Yield for each side the error that it allows over β, its value without errors, and its slopes for ±ε."""
    found = []
    for sign in (1, -1):
        signed = {"epsilon": FirstOrder(Fraction(0), Fraction(sign)), "beta": FirstOrder(Fraction(0), Fraction(1))}
        links = chain.links({**names, **signed}, Fraction)
        found.append([quantity(side) for side in (*(link.left for link in links[:1]), *(link.right for link in links))])
    for plus, minus in zip(*found, strict=True):
        yield np.maximum(abs(plus.slope), abs(minus.slope)), plus.value, (plus.slope, minus.slope)


def allows(chain: Relation, names: Names) -> bool:
    """Whether each side allows the error of the first, and whether the sides are related as printed."""
    sides, tree = list(_allowed(chain, names)), chain.tree
    if len(sides) < 2 or not isinstance(tree, ast.Compare):
        return False
    (error, value, _), *others = sides
    symbols = [OPERATORS[type(op)][0] for op in tree.ops]
    first = {"<="} if "epsilon" not in chain.sides[1].text else {"<=", "=="}
    if symbols[0] not in first or not set(symbols) <= {"<=", "=="}:
        return False
    for allowed, zero, _ in others:
        if np.shape(zero) != np.shape(value) or np.any(zero != value) or np.any(error > allowed):
            return False
        if names.get("tight") and np.any(error != allowed):
            return False
    for symbol, (a, _, slopes), (b, _, others_slopes) in zip(symbols[1:], others, others[1:], strict=False):
        if symbol == "==" and any(np.any(x != y) for x, y in zip(slopes, others_slopes, strict=True)):
            return False
        if np.any(a > b):
            return False
    return True


def ratio(printed: Statement, *groups: Iterable[Names]) -> float:
    """Return the largest error in four digits over what the last side allows; infinite if it allows none."""
    times = 0.0
    chains = [part for part in printed.parts if isinstance(part, Relation)]
    for names in (names for group in groups for names in group if names.get("emulated")):
        for chain in chains:
            try:
                sides = list(_allowed(chain, names))
            except Undefined:
                continue
            pairs = zip(np.ravel(sides[0][0]), np.ravel(sides[-1][0]), strict=False)
            times = max([times, *(float(e / a) if a else np.inf for e, a in pairs if e)])
    return times
