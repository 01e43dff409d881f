"""Decimal numbers, pairs of int64, in float64 and in double-double."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_POWERS = np.array([10.0**k for k in range(23)])  # exact
_SPLITTER = 2.0**27 + 1


def nearest_floats(pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """Convert decimal numbers, (..., 2), to the nearest float64; NaN where that takes more digits."""
    return _converted(pairs)[0]


def nearest_double_doubles(pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """Convert decimal numbers, (..., 2), to the nearest double-doubles; NaN where that takes more digits."""
    high, x, power, divided = _converted(pairs)
    factor = np.where(divided, high, x)
    p = factor * power
    (a, b), (c, d) = _halves(factor), _halves(power)
    rest = ((a * c - p) + a * d + b * c) + b * d  # factor * power - p, exactly
    return np.stack([high, np.where(divided, ((x - p) - rest) / power, rest)], axis=-1)


def _converted(pairs: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
    """Return nearest float64, significands, the power by which each is multiplied or divided, and which are divided."""
    m, e = pairs[..., 0], pairs[..., 1]
    x = np.where((np.abs(m) < 2**53) & (np.abs(e) <= 22), m, np.nan)
    power, divided = _POWERS[np.minimum(np.abs(e), 22)], e < 0
    return np.where(divided, x / power, x * power), x, power, divided


def _halves(a: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two numbers of at most 26 bits whose sum is a."""
    high = _SPLITTER * a
    high = high - (high - a)
    return high, a - high
