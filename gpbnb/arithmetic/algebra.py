"""Products and inverses of matrices over numbers of any kind with + − × ÷, in a stated order of operations.

The numbers may be Fractions, a processor's floats, elements of an array of a format, or objects with these operators.
Compiled loops and other fast versions are tested against these functions by ``==``.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.rational import exact, inverse_of

Matrix = Any
"""A two-dimensional array of numbers, with the operators of NumPy's arrays."""


def as_computed(value: Any) -> Any:
    """Return a result as it is: the numbers round themselves, or are exact."""
    return value


def product_in_order(a: Matrix, b: Matrix, rounded: Callable[[Any], Any] = as_computed) -> Matrix:
    """Multiply matrices (n, k) and (k, m), each entry summed from left to right and each operation rounded."""
    total = rounded(a[:, :1] * b[:1])
    for k in range(1, a.shape[1]):
        total = rounded(total + rounded(a[:, k : k + 1] * b[k : k + 1]))
    return total


class Inverse(NamedTuple):
    """The inverse of a matrix (m, m), and the m pivots of its elimination."""

    matrix: Matrix
    pivots: list[Any]


def inverse_in_order(a: Matrix, identity: Matrix, rounded: Callable[[Any], Any] = as_computed) -> Inverse:
    """Invert a matrix (m, m) by elimination without row exchanges and back substitution.

    With columns b (m, q) in place of the identity, solve a X = b. Some numbers refuse to divide by a pivot that is
    zero.
    """
    m = len(a)
    rows, columns = [a[i] for i in range(m)], [identity[i] for i in range(m)]
    for k in range(m):  # each row begins at the column of its pivot
        for i in range(k + 1, m):
            factor = rounded(rows[i][:1] / rows[k][:1])
            rows[i] = rounded(rows[i][1:] - rounded(factor * rows[k][1:]))
            columns[i] = rounded(columns[i] - rounded(factor * columns[k]))
    for k in range(m - 1, -1, -1):
        for i in range(k + 1, m):
            columns[k] = rounded(columns[k] - rounded(rows[k][i - k : i - k + 1] * columns[i]))
        columns[k] = rounded(columns[k] / rows[k][:1])
    return Inverse(np.stack(columns), [row[0] for row in rows])


class Algebra(NamedTuple):
    """How matrices of one kind of number are made, multiplied, inverted and rounded."""

    identity: Callable[[int], Matrix]  # that of a size
    times: Callable[[Matrix, Matrix], Matrix] = product_in_order
    invert: Callable[[Matrix, Matrix], Inverse] = inverse_in_order  # a matrix, with the identity
    rounded: Callable[[Any], Any] = as_computed  # for sums and differences; the others round their own operations


def rounded_algebra(numbers: Callable[[Any], Matrix], rounded: Callable[[Any], Any]) -> Algebra:
    """Return the algebra of numbers made from ints, in which a function rounds the result of each operation."""
    return Algebra(
        lambda n: numbers(np.eye(n, dtype=int)),
        partial(product_in_order, rounded=rounded),
        partial(inverse_in_order, rounded=rounded),
        rounded,
    )


def algebra_of(fmt: Any) -> Algebra:
    """Return the algebra of arrays of a format, or of arrays that record their operations."""
    return Algebra(fmt.eye, operator.matmul)


def _exact_inverse(a: Matrix, identity: Matrix) -> Inverse:
    """Invert without regard to the order, because nothing is rounded; a singular matrix raises LinAlgError."""
    return Inverse(inverse_of(a), [])


EXACT = Algebra(lambda n: exact(np.eye(n, dtype=int)), invert=_exact_inverse)
"""The algebra of Fractions, without rounding; its inverse has no pivots."""
