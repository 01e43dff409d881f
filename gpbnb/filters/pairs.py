"""Packed numbers of any format in double-double, and decimal ones, pairs of int64, in float64."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.kernels.doubledouble import LEAST, LIMIT

_LAST = 22
_POWERS = np.array([10.0**k for k in range(_LAST + 1)])  # exact
_SPLITTER = 2.0**27 + 1


def nearest_floats(pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """Convert decimal numbers, (..., 2), to the nearest float64, infinite beyond its range."""
    m, e = pairs[..., 0], pairs[..., 1]
    x, power = m.astype(np.float64), _POWERS[np.minimum(np.abs(e), _LAST)]
    found = np.where(e < 0, x / power, x * power)
    for at in _taking_more_operations(pairs):
        m, e = pairs[at].tolist()
        power = 10 ** min(abs(e), 400)  # which is beyond the range for every m
        try:
            found[at] = m / power if e < 0 else float(m * power)
        except OverflowError:
            found[at] = math.copysign(math.inf, m)
    return found


def nearest_double_doubles(packed: NDArray[Any]) -> NDArray[np.float64]:
    """Convert packed numbers of any format, exactly in bases 2 and 16, to the nearest in base 10."""
    found = double_doubles_near(packed)
    if packed.dtype != np.float64:
        for at in _taking_more_operations(packed):
            m, e = packed[at].tolist()
            found[at] = double_doubles(np.array([Fraction(m) * Fraction(10) ** e]))[0]
    return found


def _taking_more_operations(pairs: NDArray[np.int64]) -> Iterator[tuple[int, ...]]:
    """Give the places of numbers that are not the result of one operation on a float64 and a power of ten."""
    return map(tuple, np.argwhere((np.abs(pairs[..., 0]) >= 2**53) | (np.abs(pairs[..., 1]) > _LAST)))


@np.errstate(all="ignore")
def double_doubles_near(packed: NDArray[Any]) -> NDArray[np.float64]:
    """Convert packed numbers like :func:`nearest_double_doubles`, faster but rounded once for each 22 powers of ten.

    Decimal numbers of at least 2**996 or, except for zero, below 2**-850 become NaN.
    The operations are those of :mod:`gpbnb.arithmetic.kernels.doubledouble` for a second number of one float64.
    """
    if packed.dtype == np.float64:
        return np.stack([packed, np.zeros_like(packed)], axis=-1)
    m, e = packed[..., 0], packed[..., 1]
    high = m.astype(np.float64)
    low = (m - high.astype(np.int64)).astype(np.float64)
    while (left := (e != 0) & (high != 0) & ~np.isnan(high)).any():
        e = np.where(left, e, 0)
        power = _POWERS[np.minimum(np.abs(e), _LAST)]
        result = np.where(e < 0, high / power, high * power)
        factor = np.where(e < 0, result, high)
        product = factor * power
        rest = _rest(factor, power, product)
        low = np.where(e < 0, ((high - product) + (low - rest)) / power, rest + low * power)
        high = result + low
        low -= high - result
        within = ((np.abs(high) >= LEAST) & (np.abs(high) < LIMIT)) | (m == 0)
        high, low = np.where(within, high, np.nan), np.where(within, low, np.nan)
        e = e - np.clip(e, -_LAST, _LAST)
    return np.stack([high, low], axis=-1)


def widened(packed: NDArray[Any]) -> NDArray[np.float64]:
    """Convert results of a run, (k, n, m) or (k, n, m, 2), unless they are in it, to double-doubles near them."""
    if packed.dtype == np.float64 and packed.ndim == 4:
        return np.ascontiguousarray(packed)
    return double_doubles_near(packed)


def widened_estimates(packed: NDArray[Any]) -> NDArray[np.float64]:
    """Convert as :func:`widened` does; decimal numbers that are too small for double-double become zero."""
    wide = widened(packed)
    if packed.dtype != np.float64:
        wide[np.isnan(wide[..., 0]) & (packed[..., 1] < 0)] = 0.0
    return wide


def _rest(a: NDArray[np.float64], b: NDArray[np.float64], product: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ab minus the product, exactly."""
    (c, d), (f, g) = _halves(a), _halves(b)
    return ((c * f - product) + c * g + d * f) + d * g


def _halves(a: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two numbers of at most 26 bits whose sum is a."""
    high = _SPLITTER * a
    high = high - (high - a)
    return high, a - high
