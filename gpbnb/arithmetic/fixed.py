"""Fixed-point arithmetic as in digital signal processors, on multiples of one unit between two limits."""

from __future__ import annotations

from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gpbnb.arithmetic import rational
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import exact_ratio
from gpbnb.arithmetic.kernels.exact import LARGEST_BITS
from gpbnb.arithmetic.making import Makes
from gpbnb.arithmetic.rounding import Limits, Rounding, Rules, rounding_named
from gpbnb.arithmetic.words import FixedLayout

_POLICIES = ("raise", "saturate", "wrap")


class FixedArray(FloatArray):
    """An immutable n-dimensional array of fixed-point numbers; make one with ``fmt.array``.

    Its operations are those of :class:`gpbnb.arithmetic.array.FloatArray`: each rounds its exact result once, to a
    multiple of the unit. The format determines what happens to a result beyond the limits.
    """

    __slots__ = ()


@dataclass(frozen=True, init=False)
class FixedFormat(Makes[FixedArray]):
    r"""Two's complement fixed point: multiples of :math:`2^{-f}` from :math:`-2^i` to :math:`2^i - 2^{-f}`.

    Parameters
    ----------
    integer_bits : i, the number of bits before the binary point, without the sign bit.
    fraction_bits : f, the number of bits after the binary point. The word has 1 + i + f bits.
    rounding : how every stored number and every result is rounded; a ``Rounding``, or its name, such as "chop".
    overflow : what happens to a result beyond the limits. "raise" raises an OverflowError that names the operation and
        the entry, "saturate" takes the nearest limit, and "wrap" wraps around as two's complement does.
    seed : seed of the random numbers for stochastic rounding.

    Raises
    ------
    TypeError : a parameter has the wrong type.
    ValueError : the word has no bits at all, or the rounding or the overflow is unknown.

    Examples
    --------
    >>> q15 = FixedFormat(integer_bits=0, fraction_bits=15)
    >>> (q15.array("0.1") * q15.array("0.5")).to_fractions()
    Fraction(1639, 32768)
    """

    integer_bits: int
    fraction_bits: int
    rounding: Rounding
    overflow: str
    seed: int

    def __init__(
        self,
        integer_bits: int,
        fraction_bits: int,
        rounding: Rounding | str = Rounding.NEAREST,
        overflow: str = "raise",
        seed: int = 0,
    ) -> None:
        given = (integer_bits, fraction_bits, rounding, overflow, seed)
        for field, value in zip(fields(self), given, strict=True):
            object.__setattr__(self, field.name, value)
        self._check()

    def _check(self) -> None:
        for name in ("integer_bits", "fraction_bits", "seed"):
            value = getattr(self, name)
            if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
                raise TypeError(f"{name}: got {value!r} of type {type(value).__name__}; needed an int")
            object.__setattr__(self, name, int(value))
        if not isinstance(self.rounding, (Rounding, str)):
            raise TypeError(
                f"rounding: got {self.rounding!r} of type {type(self.rounding).__name__}; "
                f"needed one of {', '.join(map(str, Rounding))}, or its name"
            )
        object.__setattr__(self, "rounding", rounding_named(self.rounding))
        if not 1 <= self.precision <= LARGEST_BITS:
            raise ValueError(
                f"got {self.integer_bits} integer bits and {self.fraction_bits} fraction bits; needed 1 to "
                f"{LARGEST_BITS} together"
            )
        if self.overflow not in _POLICIES:
            raise ValueError(f"overflow: got {self.overflow!r}; needed one of {', '.join(map(repr, _POLICIES))}")

    @property
    def base(self) -> int:
        """The number base, 2."""
        return 2

    @property
    def precision(self) -> int:
        """Number of bits in the word, without the sign bit."""
        return self.integer_bits + self.fraction_bits

    @property
    def unit(self) -> Fraction:
        """The exact distance between neighbouring numbers. Rounding to nearest errs by at most half this distance."""
        return Fraction(1, 2) ** self.fraction_bits

    @property
    def largest(self) -> Fraction:
        """The largest number."""
        return Fraction(2) ** self.integer_bits - self.unit

    @property
    def lowest(self) -> Fraction:
        """The lowest number."""
        return -(Fraction(2) ** self.integer_bits)

    @property
    def smallest(self) -> Fraction:
        """The smallest positive number, the unit."""
        return self.unit

    @property
    def layout(self) -> FixedLayout:
        """How a word stores a number of this format, in two's complement."""
        return FixedLayout(1 + self.precision, -self.fraction_bits)

    @property
    def limits(self) -> Limits:
        """The limits of the range."""
        return Limits(self.integer_bits - 1, True, self.largest, self.lowest, self.overflow, fixed=True)

    @cached_property
    def rules(self) -> Rules:
        """All settings that determine the digits of a result."""
        return Rules(2, self.precision, self.rounding, self.limits, self.seed)

    def round(self, value: Any) -> Fraction:
        """Round one number into the format; see :meth:`gpbnb.arithmetic.formats.FloatFormat.round`."""
        return self.kernel.to_fraction(*self.kernel.from_decimal(*exact_ratio(value)))

    def array(self, values: Any) -> FixedArray:
        """Round numbers into a :class:`FixedArray`; see :meth:`gpbnb.arithmetic.formats.FloatFormat.array`."""
        return FixedArray.from_values(values, self)


def scaling(values: Any, bits: int, rounding: Rounding = Rounding.NEAREST, overflow: str = "raise") -> FixedFormat:
    """Choose the binary point of a word so that no value overflows and no bit is wasted.

    Parameters
    ----------
    values : numbers that occur, of any shape, such as the range of a variable in a reference run, with a margin.
    bits : bits of the word, including its sign.
    rounding, overflow : as for :class:`FixedFormat`.

    Raises
    ------
    ValueError : fewer than two bits, or all values zero.
    """
    if bits < 2:
        raise ValueError(f"bits: got {bits}; needed at least 2, one of them the sign")
    largest = max(map(abs, rational.exact(values).ravel().tolist()), default=Fraction(0))
    if not largest:
        raise ValueError("got values that are all zero; needed at least one nonzero value; omit the variable")
    integer_bits = largest.numerator.bit_length() - largest.denominator.bit_length()  # or one or two more
    while True:
        fmt = FixedFormat(integer_bits, bits - 1 - integer_bits, rounding, overflow)
        if largest <= fmt.largest:
            smaller = FixedFormat(integer_bits - 1, bits - integer_bits, rounding, overflow)
            if largest > smaller.largest:
                return fmt
            integer_bits -= 1
        else:
            integer_bits += 1
