"""Formats of t-digit numbers: base, precision, and the rounding of further digits.

Source: hung1984, ch. II, sections 2-4; the same in hung1982, ch. III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import exact_fraction, exact_ratio
from gpbnb.arithmetic.kernels.exact import LARGEST_BITS, kernel
from gpbnb.arithmetic.number_format import NumberFormat, checked_rounding
from gpbnb.arithmetic.rounding import FLOAT_OVERFLOWS, Limits, Rounding, Rules, digits_text
from gpbnb.arithmetic.words import FloatLayout

__all__ = ["FloatFormat", "prints_as"]

_WORDS = ((2, True), (2, False), (16, False))  # base, and whether there are subnormal numbers, of layouts

LARGEST_EXPONENT = 2**20
"""Largest size of an exponent of a range, in base 2; that of binary128 is 16383."""


@dataclass(frozen=True, init=False, repr=False)
class FloatFormat(NumberFormat[FloatArray]):
    r"""Floating-point numbers :math:`\pm.d_1 d_2 \dots d_t \times b^e`, with any exponent unless a range is given.

    Zero is a number of every format; infinity, NaN and negative zero are numbers of none.

    Parameters
    ----------
    base : b, an int of at least 2.
    precision : t, the number of digits of the significand, an int of at least 1.
    rounding : how every stored number and every result is rounded; a :class:`~gpbnb.arithmetic.rounding.Rounding`, or
        its name, such as "chop".
    emin, emax : exponents of the least normal and of the largest number, as IEEE 754 counts them:
        :math:`b^{\text{emin}}` and :math:`d.dd\dots\times b^{\text{emax}}`. Give both or neither.
    subnormal : whether numbers below the least normal number have the same spacing as those just above it (gradual
        underflow). If not, results that are below the least normal number after rounding become zero. It matters only
        for a format with a range.
    largest : the largest number. By default, all its t digits are b - 1.
    seed : seed of the random numbers for stochastic rounding. Each run of a filter restarts the random numbers from the
        seed. Operations on arrays draw from one sequence, until
        :meth:`~gpbnb.arithmetic.number_format.NumberFormat.restart` or a run of a filter restarts it.
    overflow : what happens to a result that is beyond the largest number after rounding. "raise" raises an
        OverflowError that names the operation and the entry. "saturate" takes the largest number, with the sign of the
        result.

    Raises
    ------
    TypeError : a parameter has the wrong type.
    ValueError : ``base < 2`` or ``precision < 1``, or so many digits that numbers do not fit in memory; an unknown
        rounding; `emin` or `emax` without the other, ``emin > emax``, or exponents too large to compute with; a
        largest number that is not in the format; an unknown `overflow`, or an `overflow` without a range.

    Notes
    -----
    A range is applied after rounding, as in IEEE 754. A division by zero and the root of a negative number raise an
    error. Filters have compiled loops for "saturate" in base 2 up to 53 bits, or 52 if ties go away from zero, and in
    base 16.

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
    rounding: Rounding
    emin: int | None
    emax: int | None
    subnormal: bool
    #: The largest number, if it was given.
    given_largest: Fraction | None
    seed: int
    overflow: str

    algebra = linalg.NUMPY

    def __init__(
        self,
        base: int,
        precision: int,
        rounding: Rounding | str = Rounding.NEAREST,
        emin: int | None = None,
        emax: int | None = None,
        subnormal: bool = True,
        largest: Any = None,
        seed: int = 0,
        given_largest: Any = None,
        overflow: str = "raise",
    ) -> None:
        stated = given_largest if largest is None else largest
        given = (base, precision, rounding, emin, emax, subnormal, stated, seed, overflow)
        for field, value in zip(fields(self), given, strict=True):
            object.__setattr__(self, field.name, value)
        self._check()

    def _check(self) -> None:
        for name, least in (("base", 2), ("precision", 1)):
            value = getattr(self, name)
            if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
                raise TypeError(
                    f"{name}: got {value!r} of type {type(value).__name__}; needed an int of at least {least}"
                )
            if value < least:
                raise ValueError(f"{name}: got {value}; needed an int of at least {least}")
            object.__setattr__(self, name, int(value))
        object.__setattr__(self, "rounding", checked_rounding(self.rounding))
        if self.precision > LARGEST_BITS / math.log2(self.base):
            raise ValueError(
                f"precision: got {digits_text(self.precision, self.base)}; needed at most "
                f"{int(LARGEST_BITS / math.log2(self.base))}, or numbers do not fit in memory; use fewer"
            )

        self._check_range()

    def _check_range(self) -> None:
        if not isinstance(self.subnormal, (bool, np.bool_)):
            raise TypeError(f"subnormal: got {self.subnormal!r}; needed True or False")
        for name in ("emin", "emax", "seed"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, (int, np.integer))):
                raise TypeError(f"{name}: got {value!r} of type {type(value).__name__}; needed an int")
        if self.overflow not in FLOAT_OVERFLOWS:
            raise ValueError(f"overflow: got {self.overflow!r}; needed one of {', '.join(map(repr, FLOAT_OVERFLOWS))}")
        if (self.emin is None) != (self.emax is None):
            raise ValueError(f"got emin={self.emin}, emax={self.emax}; needed both, or neither for an unlimited range")
        if self.emin is None or self.emax is None:
            if self.given_largest is not None or not self.subnormal or self.overflow != "raise":
                raise ValueError(
                    "got a largest number, subnormal=False or overflow without a range; needed emin and emax as well"
                )
            return
        object.__setattr__(self, "emin", int(self.emin))
        object.__setattr__(self, "emax", int(self.emax))
        if self.emin > self.emax:
            raise ValueError(f"got emin={self.emin} above emax={self.emax}; needed emin <= emax")
        if max(-self.emin, self.emax) > LARGEST_EXPONENT / math.log2(self.base):
            raise ValueError(
                f"got emin={self.emin}, emax={self.emax}; needed exponents of at most "
                f"{int(LARGEST_EXPONENT / math.log2(self.base))} in size, or the limits are too long to compute with"
            )
        if self.given_largest is not None:
            object.__setattr__(self, "given_largest", exact_fraction(self.given_largest))
            last = Fraction(self.base) ** (self.emax - self.precision + 1)
            if (
                not self.base ** (self.precision - 1) * last <= self.given_largest <= self._nines
                or (self.given_largest / last).denominator != 1
            ):
                raise ValueError(
                    f"largest: got {self.given_largest}; needed a number of the format with the exponent emax"
                )

    def __repr__(self) -> str:
        text = f"base={self.base}, precision={self.precision}, rounding={self.rounding}"
        if self.emin is not None:
            text += f", emin={self.emin}, emax={self.emax}"
        if not self.subnormal:
            text += ", subnormal=False"
        if self.given_largest is not None:
            whole = self.given_largest.denominator == 1
            text += f", largest={self.given_largest}" if whole else f", largest='{self.given_largest}'"
        if self.seed:
            text += f", seed={self.seed}"
        if self.overflow != "raise":
            text += f", overflow={self.overflow!r}"
        return f"FloatFormat({text})"

    @property
    def limits(self) -> Limits | None:
        """The limits of the range; None if exponents are unlimited."""
        if self.emin is None or self.emax is None:
            return None
        return Limits(self.emin, self.subnormal, self.largest, -self.largest, self.overflow)

    @property
    def _nines(self) -> Fraction:
        """The number with the exponent emax whose digits are all b - 1."""
        return (self.base**self.precision - 1) * Fraction(self.base) ** (self._range[1] - self.precision + 1)

    @cached_property
    def largest(self) -> Fraction:
        """The largest number, exact.

        Raises
        ------
        ValueError : exponents are unlimited.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> float(BINARY32.largest), float(BINARY32.smallest_normal), float(BINARY32.smallest)
        (3.4028234663852886e+38, 1.1754943508222875e-38, 1.401298464324817e-45)
        """
        if self.given_largest is not None:
            return self.given_largest
        return self._nines

    @property
    def smallest_normal(self) -> Fraction:
        """The smallest positive number that keeps all t digits, as an exact Fraction.

        Raises
        ------
        ValueError : exponents are unlimited.
        """
        return Fraction(self.base) ** self._range[0]

    @property
    def smallest(self) -> Fraction:
        """The smallest positive number, as an exact Fraction; it is subnormal if the format has subnormal numbers.

        Raises
        ------
        ValueError : exponents are unlimited.
        """
        return self.smallest_normal / (self.base ** (self.precision - 1) if self.subnormal else 1)

    @property
    def _range(self) -> tuple[int, int]:
        if self.emin is None or self.emax is None:
            raise ValueError(
                f"got {self}, whose exponents are unlimited, so that it has no largest or smallest number; needed a "
                "format with emin and emax, such as BINARY32"
            )
        return self.emin, self.emax

    @property
    def layout(self) -> FloatLayout:
        """How a word stores a number of this format.

        Raises
        ------
        ValueError : the format has base 10 or an unlimited range, so no layout is defined.
        """
        if self.emin is None or self.emax is None or (self.base, self.subnormal) not in _WORDS:
            raise ValueError(
                f"got {self}, which has no bits; needed a range emin, emax, and base 2, or base 16 with subnormal=False"
            )
        return FloatLayout.of(self.base, self.precision, self.emin, self.emax, self.subnormal)

    @cached_property
    def rules(self) -> Rules:
        """All settings that determine the digits of a result."""
        return Rules(self.base, self.precision, self.rounding, self.limits, self.seed)

    @property
    def unit_roundoff(self) -> Fraction:
        r"""Bound on the relative error of one rounding, as an exact Fraction.

        .. math:: \beta = \tfrac12 b^{1-t} \text{ (to nearest)}, \qquad \beta_c = b^{1-t} \text{ (otherwise)}

        If the range is limited, the bound holds for results that are not below the smallest normal number.

        References
        ----------
        hung1984, ch. II, (8) and (13).
        """
        step = Fraction(1, self.base ** (self.precision - 1))
        return step / 2 if self.rounding.to_nearest else step

    def split(self, value: Any) -> tuple[Fraction, Fraction, int]:
        r"""Split a number at its t-th digit, :math:`x = u\,b^e + v\,b^{e-t}`.

        Returns
        -------
        u, v, e : :math:`1/b \le |u| < 1` with t digits, :math:`0 \le |v| < 1` of the same sign,
            and the integer exponent; ``(0, 0, 0)`` for zero.

        Raises
        ------
        TypeError, ValueError, OverflowError : as for :meth:`~gpbnb.arithmetic.number_format.NumberFormat.round`.

        References
        ----------
        hung1984, ch. II, (2).
        """
        chop = kernel(Rules(self.base, self.precision, Rounding.CHOP))
        p, q, k = exact_ratio(value)
        m, exponent = chop.from_decimal(p, q, k)
        if m == 0:
            return Fraction(0), Fraction(0), 0
        chopped = chop.to_fraction(m, exponent)  # comes first, because it rejects exponents too long to write out
        u = Fraction(m, self.base**self.precision)
        rest = Fraction(p, q) * Fraction(10) ** k - chopped
        return u, rest / Fraction(self.base) ** exponent, exponent + self.precision

    def array(self, values: Any) -> FloatArray:
        """Round numbers into a :class:`~gpbnb.arithmetic.array.FloatArray`.

        Parameters
        ----------
        values : a number as in :meth:`~gpbnb.arithmetic.number_format.NumberFormat.round`, nested lists or tuples of
            them, a NumPy array, or a FloatArray of any format (each entry is then rounded into this one).

        Raises
        ------
        TypeError, ValueError, OverflowError : as for :meth:`~gpbnb.arithmetic.number_format.NumberFormat.round`, with
            the entry in the message; or nested lists of unequal lengths.
        """
        return FloatArray.from_values(values, self)


def prints_as(value: Any, printed: str, *roundings: Rounding) -> bool:
    """Whether a number, rounded to as many decimal digits as `printed` has, equals `printed`.

    Parameters
    ----------
    roundings : the ways in which it may have been rounded; by default only to nearest.
    """
    figures = max(len(printed.lower().partition("e")[0].replace(".", "").lstrip("+-0")), 1)
    formats = (FloatFormat(10, figures, rounding) for rounding in roundings or (Rounding.NEAREST,))
    return any(fmt.round(value) == Fraction(printed) for fmt in formats)
