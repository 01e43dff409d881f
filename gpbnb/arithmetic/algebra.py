"""Products and inverses of matrices over numbers of any kind with + − × ÷, in a stated order of operations.

The numbers may be Fractions, a processor's floats, elements of an array of a format, or objects with these operators.
Compiled loops and other fast versions are tested against these functions by ``==``.
"""

from __future__ import annotations

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
    """Multiply two matrices, with each entry summed from left to right.

    Parameters
    ----------
    a (n, k), b (k, m) : matrices of the same kind of number.
    rounded : function applied to the result of each operation.
    """
    total = rounded(a[:, :1] * b[:1])
    for k in range(1, a.shape[1]):
        total = rounded(total + rounded(a[:, k : k + 1] * b[k : k + 1]))
    return total


class Inverse(NamedTuple):
    """The inverse of a matrix (m, m), and the m pivots of its elimination."""

    matrix: Matrix
    pivots: list[Any]


def inverse_in_order(a: Matrix, identity: Matrix, rounded: Callable[[Any], Any] = as_computed) -> Inverse:
    """Invert a matrix by elimination without row exchanges and back substitution.

    Parameters
    ----------
    a, identity : (m, m), in the same kind of number. With columns b (m, q) in place of the identity, the matrix
        returned solves a X = b.
    rounded : function applied to the result of each operation.

    Raises
    ------
    ZeroDivisionError : a pivot is zero, and the numbers refuse to divide by zero.
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
    """How matrices of one kind of number are made, multiplied, inverted and rounded.

    Parameters
    ----------
    identity : function that returns the identity matrix of a size.
    times : product of two matrices.
    invert : inverse of a matrix, from the matrix and the identity.
    rounded : function applied to sums and differences; `times` and `invert` round their own operations.
    """

    identity: Callable[[int], Matrix]
    times: Callable[[Matrix, Matrix], Matrix] = product_in_order
    invert: Callable[[Matrix, Matrix], Inverse] = inverse_in_order
    rounded: Callable[[Any], Any] = as_computed


def rounded_algebra(numbers: Callable[[Any], Matrix], rounded: Callable[[Any], Any]) -> Algebra:
    """Return the algebra in which a function rounds the result of each operation.

    Parameters
    ----------
    numbers : function that makes a matrix of numbers from a matrix of ints.
    rounded : function that rounds a number, or each number of an array.
    """
    return Algebra(
        lambda n: numbers(np.eye(n, dtype=int)),
        partial(product_in_order, rounded=rounded),
        partial(inverse_in_order, rounded=rounded),
        rounded,
    )


def _exact_inverse(a: Matrix, identity: Matrix) -> Inverse:
    """Invert without regard to the order, because nothing is rounded; a singular matrix raises LinAlgError."""
    return Inverse(inverse_of(a), [])


EXACT = Algebra(lambda n: exact(np.eye(n, dtype=int)), invert=_exact_inverse)
"""The algebra of Fractions, without rounding; its inverse has no pivots."""
