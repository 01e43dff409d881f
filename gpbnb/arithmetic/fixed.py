"""Fixed-point arithmetic as in digital signal processors, on multiples of one unit between two limits."""

from __future__ import annotations

from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.kernels.exact import LARGEST_BITS
from gpbnb.arithmetic.number_format import NumberFormat, checked_rounding
from gpbnb.arithmetic.rounding import Limits, Rounding, Rules
from gpbnb.arithmetic.words import FixedLayout

_POLICIES = ("raise", "saturate", "wrap")


class FixedArray(FloatArray):
    """An immutable n-dimensional array of fixed-point numbers; make one with ``fmt.array``.

    Its operations are those of :class:`gpbnb.arithmetic.array.FloatArray`: each rounds its exact result once, to a
    multiple of the unit. The format determines what happens to a result beyond the limits.
    """

    __slots__ = ()


@dataclass(frozen=True, init=False, repr=False)
class FixedFormat(NumberFormat[FixedArray]):
    r"""Two's complement fixed point: multiples of :math:`2^{-f}` from :math:`-2^i` to :math:`2^i - 2^{-f}`.

    Decimal fixed point, as for money, is a :class:`FloatFormat` with one exponent: ``FloatFormat(10, 8, emin=5,
    emax=5)`` holds the multiples of 0.01 of up to eight digits.

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

    base = 2
    algebra = linalg.NUMPY

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
        object.__setattr__(self, "precision", self.integer_bits + self.fraction_bits)
        object.__setattr__(self, "rounding", checked_rounding(self.rounding))
        if not 1 <= self.precision <= LARGEST_BITS:
            raise ValueError(
                f"got {self.integer_bits} integer bits and {self.fraction_bits} fraction bits; needed 1 to "
                f"{LARGEST_BITS} together"
            )
        if self.overflow not in _POLICIES:
            raise ValueError(f"overflow: got {self.overflow!r}; needed one of {', '.join(map(repr, _POLICIES))}")

    def __repr__(self) -> str:
        text = f"integer_bits={self.integer_bits}, fraction_bits={self.fraction_bits}, rounding={self.rounding}"
        if self.overflow != "raise":
            text += f", overflow={self.overflow!r}"
        if self.seed:
            text += f", seed={self.seed}"
        return f"FixedFormat({text})"

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

    def array(self, values: Any) -> FixedArray:
        """Round numbers into an array of this format; see :meth:`gpbnb.arithmetic.formats.FloatFormat.array`."""
        return FixedArray.from_values(values, self)
