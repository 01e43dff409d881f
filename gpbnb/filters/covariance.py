r"""Check a covariance exactly, and repair the effects of float64 roundings.

A covariance computed in float64, such as :math:`GG^T\sigma^2`, a Van Loan discretization or an inverse, is often not
exactly symmetric or semidefinite, because of a few roundings. The repair takes the mean of the matrix and its
transpose. If that is still not semidefinite, it adds :math:`\delta M_{ii}` to each variance, where δ is the smallest
sufficient power of two. Scale the matrix to ones on its diagonal. In the 2-norm, the distance to the nearest
semidefinite matrix is the size of its least negative eigenvalue (Halmos 1972), and δ is less than twice this distance,
or equals :data:`LEAST_SHIFT`.

Both changes are relative to the variances. A change of units by powers of two therefore changes neither.

A covariance that is close to singular may also become indefinite when a format stores it. Its stored variances are
then raised in the same way, and rounded again.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.definiteness import is_definite
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text

REPAIR_TOLERANCE = 2.0**-26
"""The largest repair of a covariance in float64, relative to the variances. It is half the digits of float64."""

LEAST_SHIFT = 2.0**-58
"""Smallest δ, with which the search begins."""

LARGEST_STORED_SHIFT = 0.5
"""Largest δ by which stored variances are raised."""


class Repair(NamedTuple):
    r"""Changes made to a covariance.

    Parameters
    ----------
    letter : letter of the covariance; `member` is its index in a cycle, from 0.
    asymmetry : largest :math:`|M_{ij} - M_{ji}|/\sqrt{M_{ii}M_{jj}}` that the mean removed.
    shift : δ, the relative increase of each variance.
    fmt : the format whose rounding made it indefinite; None for a covariance as given.
    """

    letter: str
    member: int
    asymmetry: float
    shift: float
    fmt: FloatFormat | FixedFormat | None = None

    def __str__(self) -> str:
        done = []
        if self.asymmetry:
            done.append(f"made symmetric (it missed that by {self.asymmetry:.1g} of its variances)")
        if self.shift:
            kind = "definite" if self.letter == "R" else "semidefinite"
            done.append(f"made {kind} (its variances were raised by {self.shift:.1g} of themselves)")
        stored = "" if self.fmt is None else f", stored in {format_text(self.fmt)},"
        return f"{self.letter}{stored} was {' and '.join(done)}"


def repair_tolerance(values: Any) -> float | None:
    """Return the largest repair of a matrix given in floats: half the digits of their type. None for other input.

    Such a matrix may have rounding errors, which a repair may undo.
    """
    dtype = getattr(values, "dtype", None)
    if isinstance(dtype, np.dtype) and np.issubdtype(dtype, np.floating):
        return max(REPAIR_TOLERANCE, math.sqrt(float(np.finfo(dtype).eps)))
    if isinstance(values, np.ndarray) and values.dtype.hasobject:
        values = values.ravel().tolist()
    if isinstance(values, (list, tuple)):
        return max((found for each in values if (found := repair_tolerance(each)) is not None), default=None)
    return REPAIR_TOLERANCE if isinstance(values, float) else None


def repaired(
    letter: str, member: int, matrix: NDArray[Any], strictly: bool, tolerance: float = REPAIR_TOLERANCE
) -> tuple[NDArray[Any], Repair | None]:
    """Return an exact covariance (n, n), repaired if necessary by at most the tolerance, and the change.

    Variances of one that must be positive definite, `strictly`, are not raised.
    """
    symmetric, asymmetry, shift = matrix, 0.0, 0.0
    try:
        if np.any(matrix != matrix.T):
            asymmetry = _asymmetry(matrix)
            if asymmetry > tolerance:
                check_covariance(letter, matrix, strictly)
            symmetric = (matrix + matrix.T) / 2
        if not strictly and not is_definite(symmetric):
            found = raised_until(symmetric, is_definite, LEAST_SHIFT, tolerance)
            if found is None:
                check_covariance(letter, symmetric, strictly)
            else:
                symmetric, shift = found
        check_covariance(letter, symmetric, strictly)
    except ValueError as error:
        raise ValueError(f"{error}; roundings are repaired up to {tolerance:.1g} of the variances") from None
    return symmetric, Repair(letter, member, asymmetry, shift) if asymmetry or shift else None


def raised_as_stored(
    fmt: FloatFormat | FixedFormat, letter: str, member: int, matrix: NDArray[Any], strictly: bool
) -> tuple[NDArray[Any], Repair] | None:
    """Return a covariance as a format stores it, with variances raised until it is definite, and the change.

    None if no change helps: a variance overflows, or becomes zero while a covariance does not. It is exact, (n, n), and
    indefinite as the format stores it; with `strictly` it must be positive definite.
    """

    def sound(candidate: NDArray[Any]) -> bool:
        return is_definite(candidate, strictly)

    def store(candidate: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(fmt.store(candidate).to_fractions(), dtype=object)

    try:
        found = raised_until(matrix, sound, least_shift(fmt), LARGEST_STORED_SHIFT, store)
    except OverflowError:
        return None
    return None if found is None else (found[0], Repair(letter, member, 0.0, found[1], fmt))


def least_shift(fmt: FloatFormat | FixedFormat | None) -> float:
    """Return the δ with which the search for stored variances begins; None is double-double."""
    if fmt is None:
        return 2.0**-104
    return float(fmt.unit_roundoff) if isinstance(fmt, FloatFormat) else LEAST_SHIFT


def _asymmetry(matrix: NDArray[Any]) -> float:
    largest = 0.0
    for i, j in np.argwhere(matrix != matrix.T):
        square = matrix[i, i] * matrix[j, j]
        if square <= 0:
            return math.inf
        largest = max(largest, math.sqrt((matrix[i, j] - matrix[j, i]) ** 2 / square))
    return largest


def raised_until(
    matrix: NDArray[Any],
    sound: Callable[[NDArray[Any]], bool],
    least: float,
    largest: float,
    store: Callable[[NDArray[Any]], NDArray[Any]] = lambda candidate: candidate,
) -> tuple[NDArray[Any], float] | None:
    """Raise the variances by a share δ of themselves, which is doubled until the matrix is sound.

    The matrix is exact, (n, n) or (p, n, n), whose members are raised alike; it is stored before it is judged and
    returned, with δ. None if no δ from `least` to `largest` suffices.
    """
    variances = np.diagonal(matrix, axis1=-2, axis2=-1)
    i = np.arange(matrix.shape[-1])
    shift = least
    while shift <= largest:
        raised = matrix.copy()
        raised[..., i, i] = variances * (1 + Fraction(shift))
        raised = store(raised)
        if sound(raised):
            return raised, shift
        shift *= 2
    return None


def check_covariance(letter: str, matrix: NDArray[Any], strictly: bool) -> None:
    """Reject a matrix that is not exactly symmetric and semidefinite or, with `strictly`, definite."""
    if np.any(matrix != matrix.T):
        i, j = np.argwhere(matrix != matrix.T)[0]
        raise ValueError(
            f"got {letter} with {float(matrix[i, j])!r} at ({i}, {j}) and {float(matrix[j, i])!r} at ({j}, {i}); "
            f"needed a symmetric matrix; take ({letter} + {letter}.T) / 2 if you mean their mean"
        )
    needed = "definite" if strictly else "semidefinite"
    if not is_definite(matrix, strictly):
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
