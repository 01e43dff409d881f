"""Factors of covariances: exact, or with each operation rounded, and what they stand for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import Matrix, inverse_in_order
from gpbnb.arithmetic.definiteness import factor
from gpbnb.arithmetic.lanes import recorded
from gpbnb.filters.steps import if_holds, root_of_factors


def upper_factors(covariance: NDArray[Any]) -> NDArray[Any]:
    """Return exact factors U D U' of a covariance (n, n): D is the diagonal, U the unit triangle above it."""
    lower, d = factor(covariance[::-1, ::-1])
    return np.triu(lower[::-1, ::-1], 1) + np.diag(d[::-1])


# -- in a format -------------------------------------------------------------------------------------------------------


def factors(a: Matrix) -> tuple[Matrix, Any]:
    """Return the factors of a = U D U' with D on the diagonal, and whether they are those of a covariance.

    They are not if an entry of D is negative, or if it is zero and an entry above it is not.
    """
    n = len(a)
    rows = [[a[i, j] for j in range(n)] for i in range(n)]
    found = [[each * 0 for each in row] for row in rows]
    definite = True
    for j in range(n - 1, -1, -1):
        d = found[j][j] = rows[j][j]
        above = [rows[i][j] for i in range(j)]
        definite = definite & (d >= 0)
        for each in above:
            definite = definite & ((d != 0) | (each == 0))
        column = if_holds(d != 0, _quotients(above, d), [each * 0 for each in above])
        for i in range(j):
            found[i][j] = column[i]
            for k in range(i + 1):
                rows[k][i] = rows[k][i] - column[k] * above[i]
    return np.stack([np.stack(row) for row in found]), definite


def _quotients(above: list[Matrix], d: Matrix) -> Callable[[], list[Matrix]]:
    return lambda: [each / d for each in above]


def inverse(a: Matrix) -> tuple[Matrix, Any]:
    """Return the inverse of a covariance, and whether all pivots are positive."""
    found = inverse_in_order(a, a.format.eye(len(a)))
    definite: Any = True
    for pivot in found.pivots:
        definite = definite & np.all(pivot > 0)
    return found.matrix, definite


def factors_of_each(fmt: Any, tag: Any, matrices: NDArray[Any], found: NDArray[Any]) -> bool:
    """Fill in the factors of packed covariances (p, n, n, ...); return whether all are definite."""
    return _of_each(factors, fmt, tag, matrices, found)


def inverses_of_each(fmt: Any, tag: Any, matrices: NDArray[Any], found: NDArray[Any]) -> bool:
    """Fill in the inverses of packed covariances (p, n, n, ...); return whether all are definite."""
    return _of_each(inverse, fmt, tag, matrices, found)


def roots_of_each(fmt: Any, tag: Any, factors: NDArray[Any]) -> NDArray[Any]:
    """Return the roots of covariances for their packed factors (p, n, n, ...)."""
    (found,) = recorded(root_of_factors, factors.shape[1:3]).run(fmt, factors, tag=tag)
    return found


def _of_each(
    function: Callable[[Matrix], tuple[Matrix, Any]], fmt: Any, tag: Any, matrices: NDArray[Any], found: NDArray[Any]
) -> bool:
    found[:], definite = recorded(function, matrices.shape[1:3]).run(fmt, matrices, tag=tag)
    return bool(definite.all())
