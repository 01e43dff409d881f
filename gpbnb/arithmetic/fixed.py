"""Fixed-point arithmetic as in digital signal processors, on multiples of one unit between two limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import exact_ratio
from gpbnb.arithmetic.kernels.backends import Backend
from gpbnb.arithmetic.kernels.exact import LARGEST_BITS, ExactKernel
from gpbnb.arithmetic.kernels.limited import limited_kernel
from gpbnb.arithmetic.kernels.limited_backends import (
    Accumulator,
    LimitedExact,
    check_compiled,
    limited_backend,
    limited_exact,
    mixed_tag,
    restart,
    run_tag,
)
from gpbnb.arithmetic.kernels.tags import Tag
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Limits, Order, Rounding, Rules, rounding_named

_POLICIES = ("raise", "saturate", "wrap")


class FixedArray(FloatArray):
    """An immutable n-dimensional array of fixed-point numbers; make one with ``fmt.array``.

    Its operations are those of :class:`gpbnb.arithmetic.array.FloatArray`: each rounds its exact result once, to a
    multiple of the unit. The format determines what happens to a result beyond the limits.
    """

    __slots__ = ()


@dataclass(frozen=True)
class FixedFormat:
    r"""Two's complement fixed point: multiples of :math:`2^{-f}` from :math:`-2^i` to :math:`2^i - 2^{-f}`.

    Parameters
    ----------
    integer_bits : i, bits before the binary point, without the sign.
    fraction_bits : f, bits after it; the word has 1 + i + f bits.
    rounding : applied to every stored number and every result; a ``Rounding``, or its name, such as "chop".
    overflow : "raise" an OverflowError that names the operation and the entry, "saturate" at the nearest limit, or
        "wrap" around as two's complement does.
    seed : seed for stochastic rounding.

    Raises
    ------
    TypeError : a parameter is not of its type.
    ValueError : no bits at all, or an unknown rounding or overflow.

    Examples
    --------
    >>> q15 = FixedFormat(integer_bits=0, fraction_bits=15)
    >>> (q15.array("0.1") * q15.array("0.5")).to_fractions()
    Fraction(1639, 32768)
    """

    integer_bits: int
    fraction_bits: int
    rounding: Rounding = Rounding.NEAREST
    overflow: str = "raise"
    seed: int = 0

    def __post_init__(self) -> None:
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
        """Bits of the word without its sign."""
        return self.integer_bits + self.fraction_bits

    @property
    def unit(self) -> Fraction:
        """The exact distance between neighbouring numbers. Rounding to nearest has an error of at most half of it."""
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
    def limits(self) -> Limits:
        """The limits of the range."""
        return Limits(self.integer_bits - 1, True, self.largest, self.lowest, self.overflow, fixed=True)

    @cached_property
    def _rules(self) -> Rules:
        return Rules(2, self.precision, self.rounding, self.limits, self.seed)

    @property
    def kernel(self) -> ExactKernel:
        """The scalar operations of this format."""
        return limited_kernel(self._rules)

    @property
    def backend(self) -> Backend:
        """The backend that stores the numbers of an array of this format."""
        return limited_backend(self._rules)

    @property
    def exact_backend(self) -> LimitedExact:
        """The slow backend that can store every number of this format."""
        return limited_exact(self._rules)

    def run_tag(
        self, fused: bool = False, sums: Accumulator | None = None, order: Order = "left", block: int = 32
    ) -> Tag:
        """Return the arithmetic for one compiled loop; see :meth:`gpbnb.arithmetic.formats.FloatFormat.run_tag`."""
        if sums is not None:
            return mixed_tag(self.run_tag(), sums.run_tag(fused, order=order, block=block))
        return run_tag(self.backend, self._rules, fused, order, block)

    def check_compiled(self) -> None:
        """Reject a format without compiled loops; see :meth:`gpbnb.arithmetic.formats.FloatFormat.check_compiled`."""
        check_compiled(self.backend, self._rules)

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        restart(self.kernel, self.backend)

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
    largest = max(abs(exact(values)).ravel(), default=Fraction(0))
    if not largest:
        raise ValueError("got values that are all zero; needed at least one nonzero value; omit the variable")
    integer_bits = math.frexp(float(largest))[1]  # largest < 2**integer_bits, apart from the last rounding
    while True:
        fmt = FixedFormat(integer_bits, bits - 1 - integer_bits, rounding, overflow)
        if largest <= fmt.largest:
            smaller = FixedFormat(integer_bits - 1, bits - integer_bits, rounding, overflow)
            if largest > smaller.largest:
                return fmt
            integer_bits -= 1
        else:
            integer_bits += 1
