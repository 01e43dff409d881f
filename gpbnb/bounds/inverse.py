r"""How far a computed inverse is from the true one: a proved bound, and the digits that are enough.

Sizes are in the column-sum norm (22).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from numbers import Real
from typing import Any

import numpy as np

from gpbnb.arithmetic import linalg, search
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounds import above
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, rationals, true_inverse
from gpbnb.arithmetic.rounding import Rounding, digit_unit, digits_text


def a_posteriori(a: Any, x: FloatArray) -> float:
    r"""Bound the error of a computed inverse from its residual, in exact fractions, and round the bound up.

    .. math:: R = I - AX, \qquad A^{-1} - X = XR\,(I - R)^{-1}, \qquad
        \|X - A^{-1}\| \le \frac{\|XR\|}{1 - \|R\|}

    Parameters
    ----------
    a : (n, n), a FloatArray, or exact numbers.
    x : (n, n), its computed inverse, or any other guess of it.

    Raises
    ------
    ValueError : the residual is too large to prove a bound.

    References
    ----------
    Higham 2002, chapter 14.
    """
    guess = rationals(x)
    residual = rationals(np.eye(len(x), dtype=int)) - rationals(a) * guess
    return below_one("‖I - AX‖", column_sum_norm(guess * residual), column_sum_norm(residual), x.format.base)


def below_one(name: str, first: Fraction, ratio: Fraction, base: int) -> float:
    """Return first / (1 - ratio), rounded up; the ratio, which has a name, must be below 1."""
    if ratio >= 1:
        raise ValueError(
            f"{name} must be below 1 to prove a bound; got {above(ratio):.3g}. Use more {digit_unit(base)}."
        )
    return above(first / (1 - ratio))


def true_error(x: Any, inverse: Any) -> Fraction:
    """Return the exact column-sum norm of X minus the true inverse."""
    return column_sum_norm(rationals(x) - inverse)


@dataclass(frozen=True, repr=False)
class ProvedInverse:
    r"""A computed inverse X with its error :math:`\|X - A^{-1}\|/\|A^{-1}\|`, exact but for rounding up to float64."""

    fmt: FloatFormat
    inverse: FloatArray
    error: float
    tolerance: float

    def __str__(self) -> str:
        digits = digits_text(self.fmt.precision, self.fmt.base)
        return f"{digits}: {self.error / self.tolerance:.2g} of the tolerance, by comparison with the exact inverse"

    __repr__ = __str__


def smallest_precision(
    a: Any,
    tolerance: float,
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    largest: int | None = None,
) -> ProvedInverse:
    r"""Find the fewest digits in which the computed inverse of a matrix is within a tolerance of the exact one.

    In each precision that :func:`gpbnb.arithmetic.search.smallest_precision` tries, the matrix is rounded and inverted
    with partial pivoting, and the result X is compared with the exact inverse of the matrix as given:

    .. math:: \|X - A^{-1}\| \le \text{tolerance}\,\|A^{-1}\|

    Parameters
    ----------
    a : (n, n), exact: strings, ints, Fractions; a float stands for its exact binary value.
    tolerance : relative error, above 0.
    base, rounding : base and rounding of the formats.
    largest : highest precision to try; by default :func:`gpbnb.arithmetic.search.largest_by_default`, 200 bits or 60
        decimal digits.

    Returns
    -------
    answer : the format, the inverse and its error. The next higher precision meets the tolerance as well, unless it
        is above `largest`.

    Raises
    ------
    ValueError : `tolerance` is not above 0, `a` is not square, or no precision up to `largest` is enough.
    numpy.linalg.LinAlgError : `a` is singular, so no precision helps.

    Examples
    --------
    >>> smallest_precision([[2, 1], [1, 3]], 1e-3)
    9 bits: 0.73 of the tolerance, by comparison with the exact inverse
    """
    check_relative(tolerance)
    if largest is None:
        largest = search.largest_by_default(base)
    if largest < 1:
        raise ValueError(f"largest must be a precision of at least 1; got {largest}")
    given = exact(a)
    if given.ndim != 2 or given.shape[0] != given.shape[1] or not given.size:
        raise ValueError(f"a must be a square matrix (n, n) with n at least 1; got shape {given.shape}")
    inverse = true_inverse(given)
    size = column_sum_norm(inverse)
    tried: dict[FloatFormat, ProvedInverse] = {}
    why: dict[int, str] = {}

    def meets(fmt: FloatFormat) -> bool:
        try:
            x = linalg.inv(fmt.array(given), pivot=True)
        except np.linalg.LinAlgError as error:  # it is singular in so few digits
            why[fmt.precision] = str(error)
            return False
        tried[fmt] = ProvedInverse(fmt, x, above(true_error(x, inverse) / size), float(tolerance))
        return tried[fmt].error <= tolerance

    found = search.smallest_precision(meets, base, rounding, largest=largest)
    if found is not None:
        return tried[found]
    if tried:
        reached = f"the least error is {min(each.error for each in tried.values()):.3g}"
    else:
        reached = f"in {digits_text(max(why), base)} {why[max(why)]}"
    raise ValueError(
        f"got no inverse in at most {digits_text(largest, base)} with a relative error of at most "
        f"{float(tolerance):.3g}; {reached}. Increase largest or the tolerance."
    )


def check_relative(tolerance: Any) -> None:
    """Reject a tolerance that is not a relative error, a finite number above 0."""
    number = isinstance(tolerance, Real) and not isinstance(tolerance, bool)
    if not number or not 0 < tolerance < math.inf:
        raise ValueError(f"got tolerance {tolerance!r}; needed a relative error above 0, such as 1e-6")
