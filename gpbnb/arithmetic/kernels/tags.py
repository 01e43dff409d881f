"""What tells a compiled kernel in which arithmetic to work: a tag, on whose type numba specialises.

No kernel is needed to make one, and importing this is light.
"""

from __future__ import annotations

from typing import NamedTuple

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


Tag = Binary | Hexadecimal | Decimal | ShortDecimal | Double | DoubleDouble
