r"""Check a covariance exactly, and repair the effects of float64 roundings.

A covariance computed in float64, such as :math:`GG^T\sigma^2`, a Van Loan discretization or an inverse, is often not
exactly symmetric or semidefinite, because of a few roundings. The repair takes the mean of the matrix and its
transpose. If that is still not semidefinite, it adds :math:`\delta M_{ii}` to each variance, where δ is the smallest
sufficient power of two. Scale the matrix to ones on its diagonal. In the 2-norm, the distance to the nearest
semidefinite matrix is the size of its least negative eigenvalue (Halmos 1972), and δ is less than twice this distance,
or equals :data:`LEAST_SHIFT`.

Both changes are relative to the variances. A change of units by powers of two therefore changes neither.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

REPAIR_TOLERANCE = 2.0**-26
"""The largest repair, relative to the variances. It is half the digits of float64."""

LEAST_SHIFT = 2.0**-58
"""Smallest δ, with which the search begins."""


class Repair(NamedTuple):
    r"""Changes made to a covariance.

    Parameters
    ----------
    letter : letter of the covariance; `member` is its index in a cycle, from 0.
    asymmetry : largest :math:`|M_{ij} - M_{ji}|/\sqrt{M_{ii}M_{jj}}` that the mean removed.
    shift : δ, the relative increase of each variance.
    """

    letter: str
    member: int
    asymmetry: float
    shift: float

    def __str__(self) -> str:
        done = []
        if self.asymmetry:
            done.append(f"made symmetric (it missed that by {self.asymmetry:.1g} of its variances)")
        if self.shift:
            done.append(f"made semidefinite (its variances were raised by {self.shift:.1g} of themselves)")
        return f"{self.letter} was {' and '.join(done)}"


def in_floats(values: Any) -> bool:
    """Whether a matrix was given in floats, whose rounding errors a repair may undo."""
    if hasattr(values, "to_fractions"):
        return False
    dtype = getattr(values, "dtype", None)
    if isinstance(values, np.ndarray) and values.dtype.hasobject:
        return any(isinstance(each, (float, np.floating)) for each in values.ravel())
    if isinstance(dtype, np.dtype):
        return bool(np.issubdtype(dtype, np.floating))
    if isinstance(values, (list, tuple)):
        return any(in_floats(each) for each in values)
    return isinstance(values, float)


def repaired(letter: str, member: int, matrix: NDArray[Any], strictly: bool) -> tuple[NDArray[Any], Repair | None]:
    """Return the covariance, repaired if necessary, and the change.

    Parameters
    ----------
    matrix : (n, n), exact.
    strictly : whether it must be positive definite; its variances are then not raised.

    Raises
    ------
    ValueError : it needs a larger change than :data:`REPAIR_TOLERANCE`, or has a fault not due to rounding.
    """
    symmetric, asymmetry = matrix, 0.0
    if np.any(matrix != matrix.T):
        asymmetry = _asymmetry(matrix)
        if asymmetry > REPAIR_TOLERANCE:
            check_covariance(letter, matrix, strictly)
        symmetric = (matrix + matrix.T) / 2
    shift = 0.0
    if not strictly and not _semidefinite(symmetric):
        shift = _least_shift(symmetric)
        if shift > REPAIR_TOLERANCE:
            check_covariance(letter, symmetric, strictly)
        symmetric = _raised(symmetric, shift)
    check_covariance(letter, symmetric, strictly)
    changed = Repair(letter, member, asymmetry, shift) if asymmetry or shift else None
    return symmetric, changed


def _asymmetry(matrix: NDArray[Any]) -> float:
    largest = 0.0
    for i, j in np.argwhere(matrix != matrix.T):
        square = matrix[i, i] * matrix[j, j]
        if square <= 0:
            return math.inf
        largest = max(largest, math.sqrt((matrix[i, j] - matrix[j, i]) ** 2 / square))
    return largest


def _least_shift(matrix: NDArray[Any]) -> float:
    """Return the smallest power of two by which to raise the variances for semidefiniteness, or infinity."""
    if any(d < 0 or (d == 0 and np.any(row != 0)) for d, row in zip(matrix.diagonal(), matrix, strict=True)):
        return math.inf
    shift = LEAST_SHIFT
    while shift <= REPAIR_TOLERANCE:
        if _semidefinite(_raised(matrix, shift)):
            return shift
        shift *= 2
    return math.inf


def _raised(matrix: NDArray[Any], shift: float) -> NDArray[Any]:
    raised = matrix.copy()
    np.fill_diagonal(raised, matrix.diagonal() * (1 + Fraction(shift)))
    return raised


def _semidefinite(matrix: NDArray[Any]) -> bool:
    try:
        factor(matrix)
    except ValueError:
        return False
    return True


def factor(covariance: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return exact L and d of a symmetric matrix L diag(d) L'; L is lower triangular with a unit diagonal.

    Raises
    ------
    ValueError : the matrix is not positive semidefinite.
    """
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


def check_covariance(letter: str, matrix: NDArray[Any], strictly: bool) -> None:
    """Reject a matrix that is not exactly symmetric and semidefinite or, with `strictly`, definite.

    Raises
    ------
    ValueError : the matrix fails the test; the message names the entry or the eigenvalue, and the cure.
    """
    if np.any(matrix != matrix.T):
        i, j = np.argwhere(matrix != matrix.T)[0]
        raise ValueError(
            f"got {letter} with {float(matrix[i, j])!r} at ({i}, {j}) and {float(matrix[j, i])!r} at ({j}, {i}); "
            f"needed a symmetric matrix; take ({letter} + {letter}.T) / 2 if you mean their mean"
        )
    needed = "definite" if strictly else "semidefinite"
    try:
        definite = bool(np.all(factor(matrix)[1] > 0)) or not strictly
    except ValueError:
        definite = False
    if not definite:
        values = np.linalg.eigvalsh(matrix.astype(np.float64))
        cure = ""
        # such as G @ G.T in floats, or stored in few bits
        if not strictly and abs(values[0]) < 2.0**-10 * abs(values[-1]):
            more = 2 * max(-values[0], 2.0**-52 * values[-1])
            cure = (
                "; it misses that by no more than roundings may: compute its entries as Fractions, or add a little to "
                f"its diagonal, {more:.0e} or more"
            )
        raise ValueError(
            f"got {letter} with a least eigenvalue near {values[0]:.3g}; needed a positive {needed} matrix: "
            f"no variance may be {'zero or ' if strictly else ''}negative, in any direction{cure}"
        )
