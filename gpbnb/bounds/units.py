"""The largest rounding error of a result, and what happens to numbers when a format stores them."""

from __future__ import annotations

import contextlib
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


@lru_cache(maxsize=64)
def units(fmt: FloatFormat | FixedFormat) -> Units:
    """Tables of :class:`Units` for a format."""
    limits, most = fmt.limits, int(850 / np.log2(fmt.base))
    sizes, aligned = [Fraction(fmt.base) ** k for k in range(-most, most + 1)], 0.0
    exact = [float(power) for power in sizes]
    share = 2 if fmt.rounding.to_nearest else 1
    errors = [power / fmt.base**fmt.precision / share for power in sizes]
    if limits is not None and limits.fixed:
        sizes, exact, aligned = [limits.largest], [1.0], np.inf
        errors = [Fraction(1, 2) ** (fmt.precision - 1 - limits.emin) / share]
    elif limits is not None:
        normal, exact = Fraction(fmt.base) ** limits.emin, [1.0]
        least = normal / fmt.base ** (fmt.precision - 1) / share if limits.subnormal else normal
        aligned = float(normal * fmt.base) if limits.subnormal else 0.0
        errors = [max(each, least) for each in errors]
        last = next((i for i, power in enumerate(sizes) if power >= limits.largest), None)
        if last is not None:
            sizes, errors = [*sizes[:last], limits.largest], errors[: last + 1]
    powers = [near if Fraction(near := float(power)) <= power else np.nextafter(near, 0) for power in sizes]
    return Units(np.array(powers), np.array([above(error) for error in errors]), np.array(exact), aligned)


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
