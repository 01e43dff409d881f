"""The bits with which processors store numbers: IEEE 754, IBM's words, and two's complement.

A format of base 2 with gradual underflow has the layout of IEEE 754: a sign, an exponent, and a significand without its
leading one. A format without subnormal numbers stores every digit of the significand, as IBM's machines do. The width
of the exponent follows from the range.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.exact import ZERO, Pair


class Layout(Protocol):
    """How the numbers ``m * base**e`` of a format are stored in a word of `width` bits."""

    @property
    def width(self) -> int:
        """Number of bits."""

    def bits(self, m: int, e: int) -> int:
        """Return the word of a number whose m has as many digits as the format."""

    def pair(self, word: int) -> Pair:
        """Return m and e of the number that a word stores; infinity and NaN give one beyond the range."""


class FloatLayout(NamedTuple):
    """A sign, an exponent, and a significand with or without its leading one."""

    base: int
    precision: int
    emin: int
    exponent_bits: int
    stored_bits: int
    leading_one: bool

    @classmethod
    def of(cls, base: int, precision: int, emin: int, emax: int, subnormal: bool) -> FloatLayout:
        """Return the layout of a format of base 2, or of base 16 without subnormal numbers."""
        if subnormal:
            return cls(base, precision, emin, (emax + 1 - emin).bit_length(), precision - 1, True)
        digit = base.bit_length() - 1
        return cls(base, precision, emin, (emax - emin).bit_length(), precision * digit, False)

    @property
    def width(self) -> int:
        """Number of bits."""
        return 1 + self.exponent_bits + self.stored_bits

    def bits(self, m: int, e: int) -> int:
        """Return the word of a number whose m has `precision` digits."""
        if m == 0:
            return 0
        sign, field = int(m < 0) << (self.width - 1), e + self.precision - 1 - self.emin
        if not self.leading_one:
            return sign | field << self.stored_bits | abs(m)
        # The leading one of a normal number raises the exponent by one; a subnormal number has none.
        return sign | ((field << self.stored_bits) + abs(m) if field >= 0 else abs(m) >> -field)

    def pair(self, word: int) -> Pair:
        """Return m and e of the number that a word stores; infinity and NaN give one beyond the range."""
        sign, rest = divmod(word, 1 << (self.width - 1))
        field, m = divmod(rest, 1 << self.stored_bits)
        if self.leading_one and field:
            field, m = field - 1, m + (1 << self.stored_bits)
        return (-m if sign else m, field + self.emin - self.precision + 1) if m else ZERO


class FixedLayout(NamedTuple):
    """Two's complement; numbers are multiples of 2**quantum."""

    width: int
    quantum: int

    def bits(self, m: int, e: int) -> int:
        """Return the word of a number."""
        shift = e - self.quantum
        return (m << shift if shift >= 0 else m >> -shift) % (1 << self.width)

    def pair(self, word: int) -> Pair:
        """Return m and e of the number that a word stores."""
        return (word - (1 << self.width) if word >> (self.width - 1) else word), self.quantum


def words(values: Any, width: int) -> NDArray[Any]:
    """Return words of `width` bits as an object array of ints."""
    given = np.asarray(values)
    entries = given.ravel().tolist()
    if not all(type(each) is int for each in entries):
        raise TypeError(f"got bits {values!r}; needed whole numbers such as 0x3f800000")
    for each in entries:
        if each < 0 or each >> width:
            raise ValueError(f"got bits {each:#x}; needed a word of {width} bits, from 0 to {(1 << width) - 1:#x}")
    return given.astype(object)


def in_words(bits: Any, width: int) -> Any:
    """Return words as an array of the smallest unsigned type that holds `width` bits, or as an int."""
    found = np.asarray(bits, dtype=object)
    if not found.ndim:
        return int(found[()])
    smallest = next((size for size in (8, 16, 32, 64) if width <= size), None)
    return found if smallest is None else found.astype(f"uint{smallest}")
