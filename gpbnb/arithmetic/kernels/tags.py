"""Tags that tell a compiled loop which arithmetic to use; numba compiles the loop for the type of its tag.

Importing this module is fast, because it needs no compiled code.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

LARGEST_SHORT = 8  # precision of ShortDecimal
SAFE_TWICE = 25  # bits; results rounded to float64 first and then to nearest with this precision are correct
LEAST, LIMIT = 2.0**-960, 2.0**1023  # magnitudes of Float without a range, from LEAST to below LIMIT
# Codes of rounding modes. AWAY, EVEN and HALF_UP round to nearest, with ties away from zero, to the even last digit or
# toward plus infinity. ZERO, UP and DOWN round toward zero, plus or minus infinity. ODD rounds inexact results to
# neighbours with an odd last digit. RANDOM rounds stochastically.
AWAY, EVEN, ZERO, UP, DOWN, ODD, HALF_UP, RANDOM = range(8)
# What happens below the smallest normal number of a Wide or Decimal format: there is none; its spacing is kept;
# numbers become zero; or all numbers have one spacing.
UNLIMITED, GRADUAL, ABRUPT, FIXED = range(4)
FARTHEST = 2**60  # exponent of a Wide number


# fmt: off
(
    ADD, SUBTRACT, MULTIPLY, DIVIDE, ROOT, NEGATIVE, ABSOLUTE, CHOOSE, COMPARE, COMBINE, ROUND, FUSED, NONZERO,
    SKIP,
) = range(14)
# fmt: on
"""Codes of operations. CHOOSE takes its second or third operand, as the truth value that is its first operand is true
or false. COMPARE compares two numbers; its third operand has bit 0, 1 or 2 set if it holds for the order less, equal or
greater. COMBINE combines two truth values by a table, the bits of its third operand. ROUND brings a number of another
format into that of the segment, FUSED adds its third operand to a product, NONZERO stops where a number is zero,
and SKIP leaves out as many rows as its second operand says if its truth value is false."""

AT_LEAST, AT_MOST = range(SKIP + 1, SKIP + 3)
"""Codes of the limits of a linear program, which the machine has as a comparison and a choice."""


class Float(NamedTuple):
    """Bases 2 and 16 on float64: precision 1 to 53 or 13, any rounding mode and range; an array is float64 (...)."""

    bits: int  # of a digit
    precision: int
    mode: int
    gradual: float  # smaller numbers keep the spacing just above it; 0 without subnormal numbers
    least: float  # smaller magnitudes, except an exact zero, become `below`
    below: float
    lowest: float  # results below it become `under`, results above `largest` become `over`; NaN marks overflow
    largest: float
    under: float
    over: float
    random: Any  # (2,) uint64: seed and count of random numbers drawn, which RANDOM updates


class Decimal(NamedTuple):
    """Base 10, precision 1 to 18, any rounding mode except random, and any range.

    A number is ``(significand, exponent)``, an array is int64 (..., 2).
    """

    mode: int  # its code
    precision: int
    least: int  # exponent of the last digit of the smallest normal number
    largest: int  # exponent of the last digit of the largest number
    small: int  # UNLIMITED, GRADUAL or ABRUPT


class ShortDecimal(NamedTuple):
    """Base 10, precision 1 to 8: the same numbers as ``Decimal``, computed two to four times as fast."""

    precision: int
    nearest: bool


class DoubleDouble(NamedTuple):
    """The reference: pairs ``(high, low)`` of float64, relative errors below 2**-102; an array is float64 (..., 2)."""


class Wide(NamedTuple):
    """Significands of up to 113 bits in bases 2, 10 and 16, any rounding mode except random, and any range.

    A number is ``(negative, significand, exponent)``, an array is int64 (..., 3); see
    :mod:`gpbnb.arithmetic.kernels.wide`.
    """

    bits: int  # of a digit; 0 in base 10
    mode: int  # AWAY to HALF_UP
    precision: int
    room: int  # digits of the integers that are rounded
    split: int  # bits of the lower part of a stored significand
    small: int  # UNLIMITED to FIXED
    quantum: int  # exponent of the last digit of the smallest normal number, or of all numbers
    lowest: tuple[int, int, int]  # as stored
    largest: tuple[int, int, int]
    saturates: bool  # results beyond them become these; otherwise they are out of range


def extents_of_sums(n: int, base: int, precision: int, gradual: float, low: float, high: float) -> tuple[float, float]:
    """Smallest and largest size of sums of n products other than zero, if those of the products are `low` and `high`.

    A sum grows at most by this factor when it is rounded, and no longer when a product is less than half a unit of its
    last digit. Nonzero sums are multiples of the last digit of the smallest product.
    """
    unit = float(base) ** (1 - precision)
    growth = min(n * math.exp(min((n + 1) * unit, 700.0)), base**2 * (base / unit))
    return low * unit / (4 * base), high * growth + n * gradual


# -- kinds of numbers, each with compiled loops that take formats as data -------------------------------------------


class Quick(NamedTuple):
    """Bases 2 and 16 on float64, where no number is near the ends of its range."""


class Careful(NamedTuple):
    """Bases 2 and 16 on float64."""


class InPairs(NamedTuple):
    """Base 10 on pairs of int64."""


class InShortPairs(NamedTuple):
    """Base 10 on pairs of int64, with at most 8 digits and no range."""


class InTwoWords(NamedTuple):
    """Up to 113 bits or 34 digits, on three int64."""


class Single(NamedTuple):
    """float32, as the processor computes."""


class Double(NamedTuple):
    """float64, as the processor computes."""


class Proved(NamedTuple):
    """:class:`Quick`, where the sizes of the given numbers prove that no result leaves the quick range."""


QUICK_LEAST = 2.0**-480
"""Least size of numbers of :class:`Quick`, and the inverse of the largest: no product and no quotient of two of them
leaves float64."""


def random_state(tag: Any) -> Any:
    """Return the seed and the count of random numbers of an arithmetic, which its operations update; None if none."""
    return tag.random if isinstance(tag, Float) and tag.mode == RANDOM else None


Tag = Float | Decimal | DoubleDouble | Wide
