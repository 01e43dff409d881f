"""What a run has computed after some of its steps, and how it differs from a reference.

A run keeps numbers as its loops compute them. They become Fractions when these are asked for; the differences of two
runs, correctly rounded to float64, do not need them.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.pairs import nearest_double_doubles

_LARGEST = 2.0**1000  # sums of a few smaller numbers stay in the range of float64
_SHARE = 2.0**-105  # relative error of the nearest double-double, at most


class Packed(NamedTuple):
    """Numbers as compiled loops compute them.

    Parameters
    ----------
    numbers : float64 in bases 2 and 16, pairs (..., 2) of int64 in base 10, pairs of float64 in double-double.
    fmt : their format; None for double-double.
    """

    numbers: NDArray[Any]
    fmt: FloatFormat | FixedFormat | None

    def exactly(self) -> NDArray[Any]:
        """Return the numbers as Fractions."""
        if self.fmt is None:
            high, low = (part.astype(object) for part in (self.numbers[..., 0], self.numbers[..., 1]))
            return np.asarray(np.frompyfunc(_exact_sum, 2, 1)(high, low), dtype=object)
        return np.asarray(FloatArray.from_packed(self.numbers, self.fmt).to_fractions(), dtype=object)

    def first(self, count: int) -> Packed:
        """Return the numbers of the first checkpoints."""
        return Packed(self.numbers[:count], self.fmt)


class Checkpoints:
    """Exact values after some steps, object arrays of Fractions: x (c, n), K (c, n, m), P (c, n, n).

    Parameters
    ----------
    steps : after which steps.
    x, K, P : the values, as Fractions or as a run keeps them.
    """

    def __init__(
        self, steps: Sequence[int], x: NDArray[Any] | Packed, K: NDArray[Any] | Packed, P: NDArray[Any] | Packed
    ) -> None:
        self.steps = tuple(steps)
        self._kept = x, K, P

    @cached_property
    def x(self) -> NDArray[Any]:
        """Estimates, (c, n)."""
        return _exactly(self._kept[0])

    @cached_property
    def K(self) -> NDArray[Any]:
        """Gains, (c, n, m)."""
        return _exactly(self._kept[1])

    @cached_property
    def P(self) -> NDArray[Any]:
        """Covariances, (c, n, n)."""
        return _exactly(self._kept[2])

    def to_float(self, letter: str) -> NDArray[np.float64]:
        """Return the nearest float64 of "x", "K" or "P"."""
        return _nearest(self._kept["xKP".index(letter)])

    def minus(self, true: Checkpoints) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return x, K and P minus those of a reference with at least as many checkpoints, correctly rounded."""
        count = len(self.steps)
        if self.steps != true.steps[:count]:
            raise ValueError(
                f"got checkpoint steps {self.steps} for the runs and {true.steps} for the reference; needed equal steps"
            )
        others = [each.first(count) if isinstance(each, Packed) else each[:count] for each in true._kept]
        x, K, P = (_difference(a, b) for a, b in zip(self._kept, others, strict=True))
        return x, K, P


def _exactly(values: NDArray[Any] | Packed) -> NDArray[Any]:
    return values.exactly() if isinstance(values, Packed) else values


def _exact_sum(high: float, low: float) -> Fraction:
    # Both denominators are powers of two: faster than the sum of two Fractions.
    (n, d), (p, q) = high.as_integer_ratio(), low.as_integer_ratio()
    return Fraction(n * (q // d) + p, q) if q > d else Fraction(n + p * (d // q), d)


def _nearest(values: NDArray[Any] | Packed) -> NDArray[np.float64]:
    if isinstance(values, Packed):
        if values.fmt is None:
            return np.array(values.numbers[..., 0])  # the nearest by definition of a double-double
        return np.asarray(FloatArray.from_packed(values.numbers, values.fmt).to_float(), dtype=np.float64)
    return values.astype(np.float64)


def _difference(values: NDArray[Any] | Packed, true: NDArray[Any] | Packed) -> NDArray[np.float64]:
    """Return values minus true ones, correctly rounded."""
    if not isinstance(values, Packed) or not isinstance(true, Packed) or true.fmt is not None:
        return np.asarray((_exactly(values) - _exactly(true)).astype(np.float64))
    found, certain = _rounded_difference(*_in_two(values), true.numbers[..., 0], true.numbers[..., 1])
    if not certain.all():
        hard = ~certain
        exact = Packed(values.numbers[hard], values.fmt).exactly() - Packed(true.numbers[hard], None).exactly()
        found[hard] = exact.astype(np.float64)
    return found


def _in_two(values: Packed) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return numbers as sums of two float64, and bounds of the errors; NaN instead of decimal numbers with more."""
    numbers = values.numbers
    if values.fmt is None:
        high, low = numbers[..., 0], numbers[..., 1]
        return high, low, np.zeros_like(high)
    if numbers.dtype == np.float64:
        return numbers, np.zeros_like(numbers), np.zeros_like(numbers)
    high, low = np.moveaxis(nearest_double_doubles(numbers), -1, 0)
    return high, low, np.abs(high) * _SHARE


def _rounded_difference(
    high: NDArray[np.float64],
    low: NDArray[np.float64],
    error: NDArray[np.float64],
    true_high: NDArray[np.float64],
    true_low: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return high + low - (true_high + true_low), and where it is certainly the nearest float64."""
    with np.errstate(all="ignore"):
        s, e = _two_sum(high, -true_high)
        t, f = _two_sum(low, -true_low)
        t, e = _two_sum(e, t)
        s, t = _two_sum(s, t)
        e, first = _two_sum(e, f)
        t, second = _two_sum(t, e)
        found, rest = _two_sum(s, t)
        # The exact difference is found + rest, but for what is left of the two sums, and for the given error.
        off = np.abs(first) + np.abs(second) + error
        margin = 2 * off + 2.0**-52 * np.abs(rest)
        certain = (off == 0) | ((found + (rest + margin) == found) & (found + (rest - margin) == found))
        certain &= (np.abs(high) < _LARGEST) & (np.abs(true_high) < _LARGEST)
    return found + 0.0, certain


def _two_sum(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return fl(a + b) and its error, which is a float64."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)
