r"""Decide exactly, and fast for large matrices, whether a symmetric matrix is positive definite or semidefinite.

A nonsingular T changes no sign: :math:`M = TAT^T` is definite if and only if A is. Floating-point eigenvectors
propose T, and integers compute M without an error. Gershgorin's circles, or a diagonal entry that is not positive,
decide. If neither does, M is better conditioned than A, and the next T starts from M. A matrix of rank r below n is
semidefinite if and only if the submatrix of r independent rows, with the same columns, is definite.

References
----------
Horn and Johnson, Matrix Analysis, theorems 4.5.8 (inertia) and 6.1.1 (circles).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpz_mat
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import integers

SMALL = 8
"""Up to this number of rows, exact elimination is faster than integers and eigenvectors."""

_BITS = 60  # of the integers that replace the entries of T
_TRANSFORMS = 20  # each gains about 50 bits of condition number


def is_definite(matrix: NDArray[Any], strictly: bool = False) -> bool:
    """Whether an exact symmetric matrix, (n, n) Fractions, is positive semidefinite or, with `strictly`, definite."""
    if len(matrix) > SMALL and (found := _by_congruence(matrix, strictly)) is not None:
        return found
    try:
        return bool(np.all(factor(matrix)[1] > 0)) or not strictly
    except ValueError:
        return False


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


def _by_congruence(matrix: NDArray[Any], strictly: bool) -> bool | None:
    """Decide by congruences; None if none of them does."""
    M, checked = integers(matrix)[0], False
    for _ in range(_TRANSFORMS):
        diagonal = np.diagonal(M)
        if (diagonal < 0).any():
            return False
        if (diagonal == 0).any():
            if strictly or M[diagonal == 0].any():
                return False
            M = M[np.ix_(diagonal > 0, diagonal > 0)]
            continue
        if (2 * diagonal > abs(M).sum(axis=1)).all():
            return True
        if (scaled := _scaled(M)) is None:
            return False
        if checked or not _is_singular(scaled):
            M = _transformed(M, scaled)
            continue
        rows = _independent(M)
        if strictly and len(rows) < len(M):
            return False
        M, checked = M[np.ix_(rows, rows)], True
    return None


def _scaled(M: NDArray[Any]) -> NDArray[np.float64] | None:
    """Scale the diagonal to 1/4 … 1 by powers of two, in float64; None if an entry shows that M is not semidefinite."""
    size = [entry.bit_length() for entry in np.diagonal(M)]
    scaled = np.empty(M.shape)
    for (i, j), entry in np.ndenumerate(M):
        if 2 * entry.bit_length() - 2 >= size[i] + size[j]:  # its square exceeds the product on the diagonal
            return None
        shift = (size[i] + 1) // 2 + (size[j] + 1) // 2 - _BITS
        scaled[i, j] = float(entry >> shift if shift > 0 else entry << -shift) * 2.0**-_BITS
    return scaled


def _is_singular(scaled: NDArray[np.float64]) -> bool:
    """Whether a matrix in float64 may be singular."""
    values = np.linalg.eigvalsh(scaled)
    return bool(values[0] < 2.0**-40 * values[-1])


def _transformed(M: NDArray[Any], scaled: NDArray[np.float64]) -> NDArray[Any]:
    """Return T M T' with rows of T near the eigenvectors of the scaled matrix, in the units of M."""
    _, vectors = np.linalg.eigh(scaled)
    half = [(entry.bit_length() + 1) // 2 for entry in np.diagonal(M)]
    powers = np.array([1 << (max(half) - each) for each in half], dtype=object)
    return _product(np.vectorize(int, otypes=[object])(np.rint(vectors.T * 2.0**_BITS)) * powers, M)


def _product(T: NDArray[Any], M: NDArray[Any]) -> NDArray[Any]:
    """Return T M T' of integers."""
    n = len(M)
    left = fmpz_mat(n, n, T.ravel().tolist())
    found = left * fmpz_mat(n, n, M.ravel().tolist()) * left.transpose()
    return np.array([int(entry) for entry in found.entries()], dtype=object).reshape(n, n)


def _independent(M: NDArray[Any]) -> list[int]:
    """List rows of an integer matrix that are independent, as many as its rank."""
    n = len(M)
    reduced, _, rank = fmpz_mat(n, n, M.ravel().tolist()).rref()
    return [next(j for j in range(n) if reduced[i, j]) for i in range(rank)]
