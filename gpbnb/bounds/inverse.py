r"""Proved bounds on the error of a computed inverse, from a priori to a posteriori.

Each function bounds :math:`\|X - A^{-1}\|` in the column-sum norm (22), where X is the inverse of the t-digit matrix A
as :func:`gpbnb.arithmetic.linalg.inv` computes it. It returns a float64 above the value of its formula, and raises
ValueError if no bound can be proved. The bounds use:

============================  =========================================================================
bound                         uses
============================  =========================================================================
:func:`wilkinson`             the largest numbers that occur
:func:`higham`                the computed factors
:func:`ball`                  a second inversion of A, in ball arithmetic
:func:`a_posteriori`          the residual of X, in ball arithmetic of more bits
============================  =========================================================================
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from numbers import Real
from typing import Any

import flint
import numpy as np

from gpbnb.arithmetic import linalg, search
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounds import above, gamma
from gpbnb.arithmetic.conversion import exact_fraction
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.linalg import LU
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, rationals, true_inverse
from gpbnb.arithmetic.rounding import Rounding, digit_unit, digits_text

# -- a priori: from the count of roundings --------------------------------------------------------


def wilkinson(factors: LU, x: FloatArray) -> float:
    r"""Bound from the growth of the numbers, after Wilkinson.

    .. math:: \|X - A^{-1}\| \le \|X\|\,\frac{g}{1-g}, \qquad
        g = \gamma_{3n}\,n\,l\,n\,u\,\|X\| + (1+\gamma_{3n})\,\eta\,n\,((2n+u)\,(\|X\| + n\,l) + 2n)

    where l and u are the largest sizes of entries in the factors; l = 1 with partial pivoting. The product
    :math:`n l\,n u` bounds :math:`\||L||U|\|`. A result that underflows is wrong by at most η, the smallest positive
    number of the format; without limits of its exponents, η = 0.

    Parameters
    ----------
    factors : the factors of A from :func:`gpbnb.arithmetic.linalg.lu`.
    x : (n, n), the computed inverse.

    References
    ----------
    Wilkinson 1961; Higham 2002, Theorem 9.5.
    """
    n, norm = len(x), column_sum_norm(rationals(x))
    lower, upper = (abs(exact(each)).max() for each in (factors.lower, factors.upper))
    weight = gamma(3 * n, x.format.unit_roundoff)
    underflows = n * ((2 * n + upper) * (norm + n * lower) + 2 * n)
    g = weight * n * n * lower * upper * norm + (1 + weight) * _smallest(x) * underflows
    return _solved(norm * g, g, x.format.base)


def higham(factors: LU, x: FloatArray) -> float:
    r"""Bound from the computed factors, entry by entry.

    Each column of X solves :math:`(A + \Delta A_j)\hat x_j = u_j` with
    :math:`|\Delta A_j| \le \gamma_{3n} P^T|\hat L||\hat U|`, so that

    .. math:: \|X - A^{-1}\| \le \frac{\||X|G\|}{1 - \|G\|}, \qquad
        G = \gamma_{3n} P^T|\hat L||\hat U||X| + (1+\gamma_{3n})\,\eta\,(\mathbf 1 e^T|X| + P^T|\hat L|e\mathbf 1^T
        + 2n \mathbf 1\mathbf 1^T), \qquad e_i = 2n + |\hat u_{ii}|

    where a result that underflows is wrong by at most η: one of the 2n products and sums of an entry, or a quotient,
    whose error counts times its divisor.

    Parameters
    ----------
    factors, x : as in :func:`wilkinson`.

    References
    ----------
    Higham 2002, Theorem 9.4.
    """
    n, weight = len(x), gamma(3 * len(x), x.format.unit_roundoff)
    sizes, L, U = (abs(exact(each)) for each in (x, factors.lower, factors.upper))
    lower = np.empty_like(L)
    lower[factors.permutation] = L
    e = 2 * n + U.diagonal()
    underflows = (1 + weight) * _smallest(x) * (e @ sizes + (lower @ e)[:, np.newaxis] + 2 * n)
    G = rationals(lower) * rationals(U) * rationals(sizes) * flint.fmpq(*weight.as_integer_ratio())
    G += rationals(underflows)
    return _solved(column_sum_norm(rationals(sizes) * G), column_sum_norm(G), x.format.base)


def _smallest(x: FloatArray) -> Fraction:
    """Return the largest error of a result that underflows; refuse formats with another overflow than an error."""
    fmt: Any = x.format
    if fmt.limits is not None and fmt.overflow != "raise":
        raise ValueError(
            f"got {fmt}; this bound needs overflow 'raise', because a result beyond the range is wrong by more than "
            "rounding. Use a_posteriori, which holds however the inverse was computed."
        )
    return Fraction(0) if fmt.limits is None else fmt.smallest


def _solved(first: Fraction, ratio: Fraction, base: int) -> float:
    """Return first / (1 - ratio), rounded up."""
    if ratio >= 1:
        raise ValueError(f"‖G‖ must be below 1 to prove a bound; got {float(ratio):.3g}. Use more {digit_unit(base)}.")
    return above(first / (1 - ratio))


# -- ball arithmetic ------------------------------------------------------------------------------


def ball(a: Any, x: FloatArray) -> float:
    r"""Bound from inverting A in ball arithmetic, :math:`\||X - \mathrm{mid}| + \mathrm{rad}\|`, by partial pivoting.

    The midpoints of the balls have as many bits as the format.

    Parameters
    ----------
    a : (n, n), a FloatArray, or exact numbers.
    x : (n, n), its computed inverse, or any other guess of it.

    References
    ----------
    Johansson 2017; A is inverted by python-flint.
    """
    precision = _bits(x.format)
    with _working(precision):
        try:
            inverse = _balls(a).solve(_identity(len(x)), algorithm="lu")
        except ZeroDivisionError:
            raise ValueError(
                f"got a matrix that {precision} bits cannot distinguish from a singular one; use more bits"
            ) from None
    with _working(precision + 64):
        return _upper(_column_sum(_balls(x) - inverse))


def a_posteriori(a: Any, x: FloatArray) -> float:
    r"""Bound from the residual, computed with more digits than X has.

    .. math:: R = I - AX, \qquad A^{-1} - X = XR\,(I - R)^{-1}, \qquad
        \|X - A^{-1}\| \le \frac{\|XR\|}{1 - \|R\|}

    Every number is a ball, and the bound includes the radii, so it holds for any X, however X was computed. Midpoints
    have four times the bits of the format plus 64, so that A X fits.

    Parameters
    ----------
    a : (n, n), a FloatArray, or exact numbers.
    x : (n, n), its computed inverse, or any other guess of it.

    References
    ----------
    Higham 2002, chapter 14; Rump 2010.
    """
    with _working(4 * _bits(x.format) + 64):
        guess = _balls(x)
        residual = _identity(len(x)) - _balls(a) * guess
        size = _upper(_column_sum(residual))
        if not size < 1:
            raise ValueError(
                f"‖I - AX‖ must be below 1 to prove a bound; it may be as large as {size:.3g}. Use more "
                f"{digit_unit(x.format.base)}."
            )
        return _upper(_column_sum(guess * residual) / (1 - flint.arb(size)))


@contextmanager
def _working(bits: int) -> Iterator[None]:
    before = flint.ctx.prec
    flint.ctx.prec = bits
    try:
        yield
    finally:
        flint.ctx.prec = before


def _bits(fmt: NumberFormat) -> int:
    return max(2, math.ceil(fmt.precision * math.log2(fmt.base)))


def _balls(a: Any) -> Any:
    return flint.arb_mat(rationals(a))


def _identity(n: int) -> Any:
    return flint.arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def _column_sum(a: Any) -> Any:
    """Return an upper bound of the column-sum norm of a matrix of balls, as an arb without radius."""
    sums = [sum((entry.abs_upper() for entry in column), flint.arb(0)).upper() for column in a.transpose().tolist()]
    largest = sums[0]
    for one in sums[1:]:
        largest = one if one > largest else largest
    return largest


def _upper(x: Any) -> float:
    """Return a float64 that is not below any number in the ball."""
    return above(exact_fraction(x.upper()))


# -- the true error -------------------------------------------------------------------------------


def true_error(x: Any, inverse: Any) -> Fraction:
    """Return the exact column-sum norm of X minus the true inverse."""
    return column_sum_norm(rationals(x) - inverse)


# -- how many digits are enough? ------------------------------------------------------------------


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
