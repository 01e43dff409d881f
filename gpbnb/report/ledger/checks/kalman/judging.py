"""Judge printed bounds of the rounded filter, (102)-(125), by the largest errors that roundings can cause.

A printed right side with one ε allows the errors that this ε gives with any |ε| ≤ β, in each entry. It must allow the
largest error in each instance, and no more in the instances whose signs let every rounding error add up.
"""

from __future__ import annotations

import ast
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from gpbnb.report.ledger.checks.kalman import algebra
from gpbnb.report.ledger.checks.kalman.worst_case import Instance, Names
from gpbnb.report.ledger.corrections import load_corrections
from gpbnb.report.ledger.finding import Finding, compare
from gpbnb.report.ledger.first_order import FirstOrder, quantity
from gpbnb.report.ledger.formula import OPERATORS, Relation, Undefined
from gpbnb.report.ledger.statements import Statement


@dataclass(frozen=True)
class ChainComparison:
    """How a printed chain compares with the largest errors.

    Parameters
    ----------
    right : whether it allows each error, and no more where all roundings add up.
    times : the largest error in four digits over what the last side allows; infinite if it allows none.
    """

    right: bool
    times: float


def judge(printed: Statement, instances: Iterable[Instance]) -> ChainComparison:
    """Compare each chain of a statement with the largest errors in each instance.

    Raises
    ------
    Undefined : a chain has no value in any instance.
    """
    chains = [part for part in printed.parts if isinstance(part, Relation)]
    right, times, undefined, count = bool(chains), 0.0, 0, 0
    for instance, chain in itertools.product(instances, chains):
        count += 1
        try:
            sides = list(_allowed(chain, instance.names))
        except Undefined as error:
            right, undefined, last = False, undefined + 1, error
            continue
        if instance.emulated:
            times = max(times, _ratio(sides[0][0], sides[-1][0])) if sides else times
        else:
            right = right and _chain_holds(chain, sides, instance.tight)
    if undefined == count and count:
        raise last
    return ChainComparison(right, times)


def _allowed(chain: Relation, names: Names) -> Iterator[tuple[Any, Any, Any]]:
    """Yield for each side the error that it allows over β, its value without errors, and its slopes for ±ε."""
    found = []
    for sign in (1, -1):
        signed = {"epsilon": FirstOrder(Fraction(0), Fraction(sign)), "beta": FirstOrder(Fraction(0), Fraction(1))}
        links = chain.links(names | signed, Fraction)
        found.append([quantity(side) for side in (*(link.left for link in links[:1]), *(link.right for link in links))])
    for plus, minus in zip(*found, strict=True):
        yield np.maximum(abs(plus.slope), abs(minus.slope)), plus.value, (plus.slope, minus.slope)


def _chain_holds(chain: Relation, sides: list[tuple[Any, Any, Any]], tight: bool) -> bool:
    """Whether each side allows the error of the first, and whether the sides are related as printed."""
    if len(sides) < 2:
        return False
    (error, value, _), *others = sides
    symbols = _symbols(chain)
    first = {"<="} if "epsilon" not in chain.sides[1].text else {"<=", "=="}
    if symbols[0] not in first or not set(symbols) <= {"<=", "=="}:
        return False
    for allowed, zero, _ in others:
        if np.shape(zero) != np.shape(value) or np.any(zero != value) or np.any(error > allowed):
            return False
        if tight and np.any(error != allowed):
            return False
    for symbol, (a, _, slopes), (b, _, others_slopes) in zip(symbols[1:], others, others[1:], strict=False):
        if symbol == "==" and any(np.any(x != y) for x, y in zip(slopes, others_slopes, strict=True)):
            return False
        if np.any(a > b):
            return False
    return True


def _symbols(chain: Relation) -> list[str]:
    tree = chain.tree
    return [OPERATORS[type(op)][0] for op in tree.ops] if isinstance(tree, ast.Compare) else []


def _ratio(error: Any, allowed: Any) -> float:
    pairs = zip(np.ravel(error), np.ravel(allowed), strict=False)
    return max((float(e / a) if a else np.inf for e, a in pairs if e), default=0.0)


def bounded(
    printed: Statement,
    instances: Iterable[Instance],
    letters_of_algebra: Names,
    note: str,
    root: str,
    otherwise: str = "",
) -> Finding:
    """Judge a printed bound by the largest errors; the report's own algebra tells whether it has misprints as well.

    Parameters
    ----------
    instances : the largest errors.
    letters_of_algebra : letters of :mod:`gpbnb.report.ledger.checks.kalman.algebra`.
    note, root : why it is wrong.
    otherwise : what is misprinted as well, if the printed terms do not follow from the report's own algebra.
    """
    instances = tuple(instances)
    outcome = judge(printed, instances)
    if outcome.right:
        tight = sum(instance.tight for instance in instances)
        return compare(
            True,
            f"to first order, no error exceeds the right side in {len(instances)} instances, and it is the largest "
            f"possible error in {tight} of them",
        )
    follows = algebra.follows(printed, letters_of_algebra)
    allows = f"{outcome.times:.3g} times what the last side allows" if outcome.times < np.inf else "not allowed at all"
    return compare(
        False,
        f"the printed terms {'follow' if follows else 'do not follow'} from the report's own algebra; in four "
        f"digits, the error of an example filter is {allows}",
        otherwise_note=f"{note}{'' if follows else otherwise}{right_form(printed)}",
        root=root,
    )


def right_form(printed: Statement) -> str:
    """Say what the right statement is, if there is one."""
    correction = load_corrections().get(printed.id)
    corrected = correction and correction.applied(printed)
    return f"; the correct form is {corrected.printed}" if corrected else ""
