"""What a t-digit number is: base, precision, and how the digits beyond are dropped.

Source: hung1984, ch. II, sections 2-4; the same in hung1982, ch. III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import Any

import numpy as np

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import exact_ratio
from gpbnb.arithmetic.kernels.backends import Backend, Exact, backend, exact
from gpbnb.arithmetic.kernels.exact import LARGEST_BITS, ExactKernel, kernel


class Rounding(Enum):
    """How a number with more digits than the format holds is fitted into it."""

    #: To the nearest, half away from zero; hung1984, ch. II, (3).
    NEAREST = "nearest"
    #: Towards zero, the further digits dropped; hung1984, ch. II, (9).
    CHOP = "chop"


@dataclass(frozen=True)
class FloatFormat:
    r"""Floating-point numbers :math:`\pm.d_1 d_2 \dots d_t \times b^e` with unbounded exponent.

    Zero is a number of every format; there is no negative zero, infinity or NaN.

    Parameters
    ----------
    base : b, an int of at least 2.
    precision : t, digits of the significand, an int of at least 1.
    rounding : applied to every stored number and every result.

    Raises
    ------
    TypeError : a parameter is not of its type.
    ValueError : ``base < 2`` or ``precision < 1``, or numbers too long for memory.

    References
    ----------
    hung1984, ch. II, (1)-(3), (8), (9), (13).

    Examples
    --------
    >>> FloatFormat(base=10, precision=4).round("765.4567")
    Fraction(1531, 2)
    """

    base: int
    precision: int
    rounding: Rounding = Rounding.NEAREST

    def __post_init__(self) -> None:
        for name, least in (("base", 2), ("precision", 1)):
            value = getattr(self, name)
            if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
                raise TypeError(
                    f"{name}: got {value!r} of type {type(value).__name__}; needed an int of at least {least}"
                )
            if value < least:
                raise ValueError(f"{name}: got {value}; needed an int of at least {least}")
            object.__setattr__(self, name, int(value))
        if not isinstance(self.rounding, Rounding):
            raise TypeError(
                f"rounding: got {self.rounding!r} of type {type(self.rounding).__name__}; "
                "needed Rounding.NEAREST or Rounding.CHOP"
            )
        if self.precision > LARGEST_BITS / math.log2(self.base):
            raise ValueError(
                f"precision: got {self.precision} digits; needed at most "
                f"{int(LARGEST_BITS / math.log2(self.base))}, or numbers do not fit in memory; use fewer"
            )

    def __repr__(self) -> str:
        return f"FloatFormat(base={self.base}, precision={self.precision}, rounding={self.rounding})"

    @property
    def kernel(self) -> ExactKernel:
        """The scalar operations of this format."""
        return kernel(self.base, self.precision, self.rounding is Rounding.NEAREST)

    @property
    def backend(self) -> Backend:
        """What holds the numbers of an array of this format, compiled where the format allows."""
        return backend(self.base, self.precision, self.rounding is Rounding.NEAREST)

    @property
    def exact_backend(self) -> Exact:
        """What holds every number of this format, slowly."""
        return exact(self.base, self.precision, self.rounding is Rounding.NEAREST)

    @property
    def unit_roundoff(self) -> Fraction:
        r"""Bound of the relative error of one rounding, exact.

        .. math:: \beta = \tfrac12 b^{1-t} \text{ (nearest)}, \qquad \beta_c = b^{1-t} \text{ (chop)}

        References
        ----------
        hung1984, ch. II, (8) and (13).
        """
        step = Fraction(1, self.base ** (self.precision - 1))
        return step / 2 if self.rounding is Rounding.NEAREST else step

    def round(self, value: Any) -> Fraction:
        """Round one number into the format.

        Parameters
        ----------
        value : str ("765.4567", "1e-3", "1/3"), int, float (its exact binary value), Decimal,
            Fraction, or a NumPy integer or float.

        Returns
        -------
        The rounded value, exact.

        Raises
        ------
        TypeError : `value` is of another type.
        ValueError : a string that is not a number; NaN or infinity.
        OverflowError : the result is too long to write out as a Fraction.
        """
        return self.kernel.to_fraction(*self.kernel.from_decimal(*exact_ratio(value)))

    def split(self, value: Any) -> tuple[Fraction, Fraction, int]:
        r"""Split a number at its t-th digit, :math:`x = u\,b^e + v\,b^{e-t}`.

        Returns
        -------
        u, v, e : :math:`1/b \le |u| < 1` with t digits, :math:`0 \le |v| < 1` of the same sign,
            and the integer exponent; ``(0, 0, 0)`` for zero.

        Raises
        ------
        TypeError, ValueError, OverflowError : as :meth:`round`.

        References
        ----------
        hung1984, ch. II, (2).
        """
        chop = kernel(self.base, self.precision, False)
        p, q, k = exact_ratio(value)
        m, exponent = chop.from_decimal(p, q, k)
        if m == 0:
            return Fraction(0), Fraction(0), 0
        chopped = chop.to_fraction(m, exponent)  # first: it refuses exponents too long to write out
        u = Fraction(m, self.base**self.precision)
        rest = Fraction(p, q) * Fraction(10) ** k - chopped
        return u, rest / Fraction(self.base) ** exponent, exponent + self.precision

    def array(self, values: Any) -> FloatArray:
        """Round numbers into a :class:`~gpbnb.arithmetic.array.FloatArray`.

        Parameters
        ----------
        values : a number as in :meth:`round`, nested lists or tuples of them, a NumPy array, or a
            FloatArray of any format (each entry is then rounded into this one).

        Raises
        ------
        TypeError, ValueError, OverflowError : as :meth:`round`, naming the entry; nested lists
            of unequal lengths.
        """
        return FloatArray.from_values(values, self)


def prints_as(value: Any, printed: str, *roundings: Rounding) -> bool:
    """Whether a number, fitted into as many decimal digits as `printed` has, is `printed`.

    Parameters
    ----------
    roundings : the ways in which it may have been fitted; to nearest alone by default.
    """
    figures = len(printed.lower().partition("e")[0].replace(".", "").lstrip("+-0"))
    formats = (FloatFormat(10, figures, rounding) for rounding in roundings or (Rounding.NEAREST,))
    return any(fmt.round(value) == Fraction(printed) for fmt in formats)
