"""What formats share: how they compute, and what they make besides ``fmt.array``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from typing import Any, Generic, Self, TypeVar, cast

import numpy as np

from gpbnb.arithmetic.conversion import exact_ratio
from gpbnb.arithmetic.kernels.backends import Backend, Exact, backend, exact
from gpbnb.arithmetic.kernels.exact import ExactKernel, kernel
from gpbnb.arithmetic.kernels.selection import compiled_tag, run_tag
from gpbnb.arithmetic.kernels.tags import Float, Tag, random_state
from gpbnb.arithmetic.rounding import Order, Rounding, Rules, rounding_named
from gpbnb.arithmetic.text import at_entry
from gpbnb.arithmetic.words import Layout, words

Made = TypeVar("Made")


def checked_rounding(rounding: Any) -> Rounding:
    """Return a rounding, or the one with this name; :class:`TypeError` for anything else."""
    if not isinstance(rounding, (Rounding, str)):
        raise TypeError(
            f"rounding: got {rounding!r} of type {type(rounding).__name__}; "
            f"needed one of {', '.join(map(str, Rounding))}, or its name"
        )
    return rounding_named(rounding)


class NumberFormat(ABC, Generic[Made]):
    """A number format, floating or fixed point, that makes arrays of one class."""

    #: The number base.
    base: int
    #: Digits of the significand, or bits of the word without its sign.
    precision: int
    #: Applied to every result.
    rounding: Rounding
    #: What happens to a result beyond the range.
    overflow: str

    @property
    @abstractmethod
    def rules(self) -> Rules:
        """All settings that determine the digits of a result."""

    @property
    @abstractmethod
    def layout(self) -> Layout:
        """How a word stores a number of this format."""

    @property
    @abstractmethod
    def algebra(self) -> Mapping[str, Callable[..., Any]]:
        """What functions of ``np.linalg`` do for arrays of the format; elimination pivots, as LAPACK does."""

    @property
    def unit_roundoff(self) -> Fraction:
        """Bound of the relative error of one rounding.

        Raises
        ------
        AttributeError : fixed point, whose relative errors have no bound.
        """
        raise AttributeError(f"got {self}, whose relative errors have no bound; needed floating point")

    @abstractmethod
    def array(self, values: Any) -> Made:
        """Round numbers into an array."""

    @cached_property
    def kernel(self) -> ExactKernel:
        """The scalar operations of this format."""
        return kernel(self.rules)

    def run_tag(
        self, fused: bool = False, sums: NumberFormat[Any] | None = None, order: Order = "left", block: int = 32
    ) -> Tag:
        """Return the tag of the arithmetic from which a run draws random numbers, if it has any.

        Sums of products use fused multiply-add and an order as :func:`gpbnb.arithmetic.linalg.matmul` does, in the
        format `sums` before they are stored, by default this one; ValueError says what has no compiled loops.
        Stochastic rounding restarts its random numbers from the seed.
        """
        if sums is None:
            return run_tag(self.rules, fused, order, block)
        own, other = compiled_tag(self.rules), run_tag(sums.rules, fused, order, block)
        if not (isinstance(own, Float) and isinstance(other, Float)):
            raise ValueError(f"got sums kept in {sums} with numbers in {self}; needed base 2 or 16 for both")
        if other.precision < own.precision:
            raise ValueError(
                f"got sums of precision {other.precision} with numbers of precision {own.precision}; needed at least "
                "as many digits for sums as for numbers"
            )
        return other if random_state(own) is None else own

    def check_compiled(self) -> None:
        """Reject a format without compiled loops.

        The message names the setting that prevents them, and what to set instead.
        """
        compiled_tag(self.rules)

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        self.backend.restart()

    @cached_property
    def backend(self) -> Backend:
        """The backend that stores the numbers of an array of this format, compiled if the format allows it."""
        return backend(self.rules)

    @cached_property
    def exact_backend(self) -> Exact:
        """The slow backend that can store every number of this format."""
        return exact(self.rules)

    def round(self, value: Any) -> Fraction:
        """Round one number into the format.

        Parameters
        ----------
        value : str ("765.4567", "1e-3", "1/3"), int, float (its exact binary value), Decimal,
            Fraction, or a NumPy integer or float.

        Returns
        -------
        The rounded value, as an exact Fraction.

        Raises
        ------
        TypeError : `value` is of another type.
        ValueError : a string that is not a number; NaN or infinity.
        OverflowError : the result is too long to write out as a Fraction.
        """
        return self.kernel.to_fraction(*self.kernel.from_decimal(*exact_ratio(value)))

    @cached_property
    def strict(self) -> Self:
        """The same format, whose overflow is an error; stochastic rounding becomes chopping."""
        random = self.rounding is Rounding.STOCHASTIC
        return replace(cast(Any, self), overflow="raise", rounding=Rounding.CHOP if random else self.rounding)

    def store(self, values: Any) -> Made:
        """Round numbers that are given, not computed, such as coefficients, into an array.

        Raises
        ------
        OverflowError : a number is beyond the range, whatever the format does with a result there.
        """
        if self.overflow != "raise":
            self.strict.array(values)
        return self.array(values)

    def zeros(self, shape: int | tuple[int, ...]) -> Made:
        """Return an array of zeros.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> BINARY32.zeros(3).to_float()
        array([0., 0., 0.])
        """
        return self.array(np.zeros(shape, dtype=int))

    def eye(self, n: int, m: int | None = None) -> Made:
        """Return the identity matrix (n, n), or (n, m) with ones on the diagonal.

        Raises
        ------
        OverflowError : the format cannot represent 1; Q15, for example, cannot.
        """
        return self.array(np.eye(n, m, dtype=int))

    def from_bits(self, bits: Any) -> Made:
        """Return the numbers that words store; the inverse of :meth:`gpbnb.arithmetic.array.FloatArray.to_bits`.

        A negative zero becomes zero.

        Parameters
        ----------
        bits : whole numbers, of any shape, such as ``np.float32(x).view(np.uint32)``.

        Raises
        ------
        ValueError : the format has no range, or has base 10; a word is too long, or its value is not a number of the
            format, for example infinity or NaN.
        TypeError : an entry is not a whole number.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> BINARY32.from_bits(0x3F800000).to_float()
        1.0
        """
        layout = self.layout
        given = words(bits, layout.width)
        values = np.empty(given.shape, dtype=object)
        for index, word in np.ndenumerate(given):
            m, e = layout.pair(word)
            values[index] = value = self.kernel.to_fraction(m, e)
            try:
                stored = self.round(value) == value
            except OverflowError:
                stored = False
            if not stored:
                where = at_entry(tuple(map(str, index)))
                raise ValueError(
                    f"{where}got bits {word:#x}, which are infinity, NaN or beyond the range; needed those of a number "
                    f"of {self}"
                )
        return self.array(values)
