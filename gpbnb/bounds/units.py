"""The largest rounding error of a result, and what happens to numbers when a format stores them."""

from __future__ import annotations

import contextlib
from bisect import bisect_left
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding


class Units(NamedTuple):
    r"""The largest rounding error of a result of at most a given size, :math:`\tfrac12 b^{e-t}` or :math:`b^{e-t}`.

    The size is below :math:`b^e`. The table covers sizes from 2**-900 to 2**900, or the range of the format. Below the
    least number, the error stays that of the least number; beyond the largest, the table has no error.
    """

    #: powers of the base, rounded down.
    powers: NDArray[np.float64]
    #: error of a result up to this power, rounded up.
    errors: NDArray[np.float64]
    #: float64 powers of the base, by which a product is exact; with a limited range, only one.
    exact: NDArray[np.float64]
    #: the size up to which sums are exact, because their last place is that of the smallest numbers.
    aligned: float


@lru_cache(maxsize=2**14)
def _power(base: int, exponent: int, share: int = 1) -> tuple[float, float, float]:
    """Round base**exponent / share down, to nearest and up."""
    exact = Fraction(base) ** exponent / share
    return -above(-exact), float(exact), above(exact)


@lru_cache(maxsize=64)
def units(fmt: FloatFormat | FixedFormat) -> Units:
    """Tables of :class:`Units` for a format."""
    limits, base, most, aligned = fmt.limits, fmt.base, int(850 / np.log2(fmt.base)), 0.0
    exponents, share = range(-most, most + 1), 2 if fmt.rounding.to_nearest else 1
    powers, exact, _ = map(list, zip(*(_power(base, k) for k in exponents), strict=True))
    errors = [_power(base, k - fmt.precision, share)[2] for k in exponents]
    if limits is not None:
        exact, largest = [1.0], -above(-limits.largest)
        if limits.fixed:
            powers, errors, aligned = [largest], [_power(2, limits.emin - fmt.precision + 1, share)[2]], np.inf
        else:
            least = (limits.emin - fmt.precision + 1, share) if limits.subnormal else (limits.emin, 1)
            errors = [max(each, _power(base, *least)[2]) for each in errors]
            aligned = _power(base, limits.emin + 1)[1] if limits.subnormal else 0.0
            last = bisect_left(exponents, limits.largest, key=lambda k: Fraction(base) ** k)
            if last < len(exponents):
                powers, errors = [*powers[:last], largest], errors[: last + 1]
    return Units(np.array(powers), np.array(errors), np.array(exact), aligned)


def largest_errors(fmt: FloatFormat | FixedFormat, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest error of rounding or storing a number of at most each size; infinite beyond the range."""
    table = units(fmt)
    at = np.searchsorted(table.powers, sizes)  # the first power not below
    return np.where(np.equal(sizes, 0), 0.0, np.append(table.errors, np.inf)[at])


def stored_sizes(fmt: FloatFormat | FixedFormat, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest size of a number that was within each size before a format stored it.

    Rounding keeps the order of numbers, so this size is the stored limit, if it is larger. With stochastic rounding, it
    is the next number of the format. A limit beyond the range stays as it is.
    """
    upwards = replace(fmt, rounding=Rounding.UP) if fmt.rounding is Rounding.STOCHASTIC else fmt
    found = []
    different, places = np.unique(sizes, return_inverse=True)
    for size in different:
        largest = float(size)
        if np.isfinite(size):
            with contextlib.suppress(OverflowError):
                largest = max(largest, *(above(abs(upwards.round(sign * float(size)))) for sign in (1, -1)))
        found.append(largest)
    return np.array(found)[places].reshape(np.shape(sizes))
