"""Decide whether printed relations hold for given values."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any

import sympy as sp

from gpbnb.arithmetic.formats import prints_as
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.ledger.formula import OPERATORS, Link, Relation

DIGITS = 50
"""Digits to which two sides are evaluated if they contain exponentials or roots."""
NOTHING = sp.Float("1e-40", DIGITS)
"""Largest difference that rounding errors of the evaluation can cause."""


def vanishes(expression: Any) -> bool:
    """Whether an expression or every entry of a matrix is zero.

    Rational values are compared exactly. Exponentials and roots of rational values are evaluated to 50 digits. An
    expression with symbols vanishes if it expands to zero.
    """
    if isinstance(expression, sp.MatrixBase):
        return all(vanishes(entry) for entry in expression)
    expression = sp.sympify(expression)
    if expression.free_symbols:
        return bool(sp.expand(expression) == 0)
    if expression.is_Rational:
        return bool(expression == 0)
    value = sp.N(expression, DIGITS)
    return bool(value.is_number and abs(value) < NOTHING)


def holds(link: Link) -> bool:
    """Whether one comparison holds; an equation between matrices of different shapes does not."""
    left, right = (matrix_of(side) for side in (link.left, link.right))
    shapes = [side.shape if isinstance(side, sp.MatrixBase) else () for side in (left, right)]
    if link.symbol in ("==", "!="):
        equal = shapes[0] == shapes[1] and vanishes(left - right)
        return equal == (link.symbol == "==")
    compare = next(function for name, function in OPERATORS.values() if name == link.symbol)
    return bool(compare(sp.N(left, DIGITS), sp.N(right, DIGITS)))


def hold(links: Iterable[Link]) -> bool:
    """Whether there is at least one comparison and all of them hold."""
    results = [holds(link) for link in links]
    return bool(results) and all(results)


def prints_side(value: Any, relation: Relation, *roundings: Rounding) -> bool:
    """Whether the last side of a relation is a number to which a value rounds.

    Parameters
    ----------
    value, roundings : as for :func:`gpbnb.arithmetic.formats.prints_as`.
    """
    side = relation.sides[-1].tree
    return isinstance(side, ast.Constant) and prints_as(value, relation.sides[-1].text, *roundings)


def matrix_of(value: Any) -> Any:
    """Return a SymPy matrix for nested lists, and any other value unchanged."""
    return sp.Matrix(value) if isinstance(value, list) else value
