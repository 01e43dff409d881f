"""What tells a compiled kernel in which arithmetic to work: a tag, on whose type numba specialises.

No kernel is needed to make one, and importing this is light.
"""

from __future__ import annotations

from typing import Any, NamedTuple

LARGEST_SHORT = 8  # precision of ShortDecimal


class Binary(NamedTuple):
    """Base 2, precision 1 to 53; a number is a float64, an array float64 (...)."""

    precision: int
    nearest: bool


class Hexadecimal(NamedTuple):
    """Base 16, precision 1 to 13; a number is a float64, an array float64 (...)."""

    precision: int
    nearest: bool


class Decimal(NamedTuple):
    """Base 10, precision 1 to 18; a number is ``(significand, exponent)``, an array int64 (..., 2)."""

    precision: int
    nearest: bool


class ShortDecimal(NamedTuple):
    """Base 10, precision 1 to 8; the same numbers as those of ``Decimal``, computed faster."""

    precision: int
    nearest: bool


class Double(NamedTuple):
    """Plain float64, as the machine rounds it; an array is float64 (...)."""


class DoubleDouble(NamedTuple):
    """The reference: ``(high, low)`` of float64, relative error of one operation below 2**-102; float64 (..., 2)."""


class Two(NamedTuple):
    """Digits of one bit."""


class Sixteen(NamedTuple):
    """Digits of four bits."""


class Away(NamedTuple):
    """To nearest, half away from zero."""


class Even(NamedTuple):
    """To nearest, half to the even last digit."""


class Zero(NamedTuple):
    """Toward zero."""


class Up(NamedTuple):
    """Toward plus infinity."""


class Down(NamedTuple):
    """Toward minus infinity."""


class Odd(NamedTuple):
    """Inexact results to the odd last digit."""


class Random(NamedTuple):
    """Stochastic rounding; the array holds the seed and how many numbers have been drawn."""

    state: Any  # (2,) uint64


class Separate(NamedTuple):
    """Products in sums are rounded before they are added."""


class Fused(NamedTuple):
    """Products in sums are added by fused multiply-add."""


class Pairwise(NamedTuple):
    """The sum of the first half of the products, rounded down, is added to that of the second, and so on in each."""


class Blocked(NamedTuple):
    """Products are summed from left to right in blocks, and so are the sums of the blocks."""

    block: int
    products: Any  # Separate or Fused


class Limited(NamedTuple):
    """Bases 2 and 16 with any rounding mode, and with a range; a number is a float64, an array float64 (...)."""

    digits: Any  # Two or Sixteen
    mode: Any
    sums: Any  # Separate, Fused, Pairwise or Blocked
    precision: int
    gradual: float  # numbers below it have the spacing of those just above; 0 without subnormal numbers
    least: float  # results below it, but an exact zero, become `below`
    below: float
    lowest: float  # results below it become `under`, those above the largest `over`; NaN is overflow
    largest: float
    under: float
    over: float


class Hardware32(NamedTuple):
    """IEEE binary32, ties to even, with its range, computed by the machine; numbers as float64."""


class Hardware64(NamedTuple):
    """IEEE binary64, ties to even, with its range, computed by the machine."""


class Mixed(NamedTuple):
    """Numbers of one arithmetic, whose sums of products are kept in another until they are stored; single float64."""

    stored: Any
    sums: Any


class LimitedDecimal(NamedTuple):
    """Base 10, precision 1 to 18, with any rounding mode but the random one, and a range; numbers as of ``Decimal``."""

    mode: Any
    precision: int
    least: int  # exponent of the last digit of the least normal number
    largest: int  # and of the largest
    flush: bool  # whether numbers below become zero; else they are beyond the backend


FLOATS = (Binary, Hexadecimal, Double, Limited, Hardware32, Hardware64, Mixed)  # whose numbers are single float64
PAIRS = (Decimal, ShortDecimal, LimitedDecimal)

Tag = (
    Binary
    | Hexadecimal
    | Decimal
    | ShortDecimal
    | Double
    | DoubleDouble
    | Limited
    | Hardware32
    | Hardware64
    | LimitedDecimal
    | Mixed
)
