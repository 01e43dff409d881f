"""Whether an exact symmetric matrix is positive definite or semidefinite, and its factors."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import rationals


def is_definite(matrix: NDArray[Any], strictly: bool = False) -> bool:
    """Whether an exact symmetric matrix, (n, n) Fractions, is positive semidefinite or, with `strictly`, definite.

    Its eigenvalues are real. None of them is negative if and only if the signs of the characteristic polynomial
    alternate, where zeros have either sign (Descartes); none is zero if and only if the constant term is not.
    """
    coefficients = rationals(matrix).charpoly().coeffs()
    alternate = all(c >= 0 for c in coefficients[::-2]) and all(c <= 0 for c in coefficients[-2::-2])
    return bool(alternate and not (strictly and coefficients[0] == 0))


def factor(covariance: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return exact L and d of a symmetric matrix L diag(d) L'; L is lower triangular with a unit diagonal."""
    rest, n = covariance.copy(), len(covariance)
    lower = np.array([[Fraction(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)
    d = np.array([Fraction(0)] * n, dtype=object)
    for j in range(n):
        d[j] = rest[j, j]
        if d[j] < 0 or (d[j] == 0 and np.any(rest[j + 1 :, j] != 0)):
            raise ValueError("not positive semidefinite")
        if d[j] > 0:
            lower[j + 1 :, j] = rest[j + 1 :, j] / d[j]
            rest[j + 1 :, j + 1 :] -= np.multiply.outer(lower[j + 1 :, j], rest[j, j + 1 :])
    return lower, d
