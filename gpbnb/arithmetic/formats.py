"""Formats of t-digit numbers: base, precision, and the rounding of further digits.

Source: hung1984, ch. II, sections 2-4; the same in hung1982, ch. III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import exact_fraction, exact_ratio
from gpbnb.arithmetic.kernels.backends import Backend, Exact, backend, exact
from gpbnb.arithmetic.kernels.exact import LARGEST_BITS, ExactKernel, kernel
from gpbnb.arithmetic.kernels.limited import limited_kernel
from gpbnb.arithmetic.kernels.limited_backends import (
    Accumulator,
    check_compiled,
    limited_backend,
    limited_exact,
    mixed_tag,
    restart,
    run_tag,
)
from gpbnb.arithmetic.kernels.tags import Tag
from gpbnb.arithmetic.rounding import Limits, Order, Rounding, Rules, rounding_named

__all__ = ["FloatFormat", "prints_as"]

LARGEST_EXPONENT = 2**20
"""Largest size of an exponent of a range, in base 2; that of binary128 is 16383."""


@dataclass(frozen=True)
class FloatFormat:
    r"""Floating-point numbers :math:`\pm.d_1 d_2 \dots d_t \times b^e`, of any exponent unless a range is given.

    Zero is a number of every format; there is no negative zero, infinity or NaN.

    Parameters
    ----------
    base : b, an int of at least 2.
    precision : t, digits of the significand, an int of at least 1.
    rounding : applied to every stored number and every result; a :class:`~gpbnb.arithmetic.rounding.Rounding`, or its
        name, such as "chop".
    emin, emax : exponents of the least normal and of the largest number, as IEEE 754 counts them:
        :math:`b^{\text{emin}}` and :math:`d.dd\dots\times b^{\text{emax}}`. Give both or neither.
    subnormal : with a range, whether numbers below the least normal one keep its spacing (gradual underflow). Otherwise
        results that are below it after rounding become zero.
    largest : the largest number, if it is not the one whose t digits are all b - 1.
    seed : seed for stochastic rounding. Each run of a filter restarts the random numbers from the seed, those of arrays
        included; operations on arrays continue one sequence, which :meth:`restart` restarts.

    Raises
    ------
    TypeError : a parameter is not of its type.
    ValueError : ``base < 2`` or ``precision < 1``, or numbers too long for memory; no rounding of this name; one of
        `emin` and `emax` without the other, ``emin > emax``, or exponents too large to compute with; a largest number
        that is not in the format.

    Notes
    -----
    A result beyond the largest number is an OverflowError that names the operation and the entry. A range is applied
    after rounding, as in IEEE 754.

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
    emin: int | None = None
    emax: int | None = None
    subnormal: bool = True
    largest: Fraction | None = None
    seed: int = 0

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
        if not isinstance(self.rounding, (Rounding, str)):
            raise TypeError(
                f"rounding: got {self.rounding!r} of type {type(self.rounding).__name__}; "
                f"needed one of {', '.join(map(str, Rounding))}, or its name"
            )
        object.__setattr__(self, "rounding", rounding_named(self.rounding))
        if self.precision > LARGEST_BITS / math.log2(self.base):
            raise ValueError(
                f"precision: got {self.precision} digits; needed at most "
                f"{int(LARGEST_BITS / math.log2(self.base))}, or numbers do not fit in memory; use fewer"
            )

        self._check_range()

    def _check_range(self) -> None:
        for name in ("emin", "emax", "seed"):
            value = getattr(self, name)
            if value is not None and (isinstance(value, bool) or not isinstance(value, (int, np.integer))):
                raise TypeError(f"{name}: got {value!r} of type {type(value).__name__}; needed an int")
        if (self.emin is None) != (self.emax is None):
            raise ValueError(f"got emin={self.emin}, emax={self.emax}; needed both, or neither for an unlimited range")
        if self.emin is None or self.emax is None:
            if self.largest is not None or not self.subnormal:
                raise ValueError(
                    "got a largest number or subnormal=False without a range; needed emin and emax as well"
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
        last = Fraction(self.base) ** (self.emax - self.precision + 1)
        nines = (self.base**self.precision - 1) * last
        if self.largest is None:
            return
        object.__setattr__(self, "largest", exact_fraction(self.largest))
        if (
            not self.base ** (self.precision - 1) * last <= self.largest <= nines
            or (self.largest / last).denominator != 1
        ):
            raise ValueError(f"largest: got {self.largest}; needed a number of the format with the exponent emax")

    def __repr__(self) -> str:
        text = f"base={self.base}, precision={self.precision}, rounding={self.rounding}"
        if self.emin is not None:
            text += f", emin={self.emin}, emax={self.emax}"
        if not self.subnormal:
            text += ", subnormal=False"
        if self.largest is not None:
            text += f", largest={self.largest}"
        if self.seed:
            text += f", seed={self.seed}"
        return f"FloatFormat({text})"

    @property
    def limits(self) -> Limits | None:
        """The limits of the range; None if exponents are unlimited."""
        if self.emin is None or self.emax is None:
            return None
        nines = (self.base**self.precision - 1) * Fraction(self.base) ** (self.emax - self.precision + 1)
        largest = nines if self.largest is None else self.largest
        return Limits(self.emin, self.subnormal, largest, -largest)

    @cached_property
    def _rules(self) -> Rules | None:
        """The rules of the format; None for the reports' two roundings with unlimited range."""
        if self.emin is None and self.rounding in Rounding.documented():
            return None
        return Rules(self.base, self.precision, self.rounding, self.limits, self.seed)

    @property
    def kernel(self) -> ExactKernel:
        """The scalar operations of this format."""
        if self._rules is not None:
            return limited_kernel(self._rules)
        return kernel(self.base, self.precision, self.rounding is Rounding.NEAREST)

    def run_tag(
        self, fused: bool = False, sums: Accumulator | None = None, order: Order = "left", block: int = 32
    ) -> Tag:
        """Return the arithmetic for one compiled loop; random roundings start with the first number of the seed.

        Parameters
        ----------
        fused : whether sums of products use fused multiply-add.
        sums : the format that keeps sums of products until they are stored; by default this one.
        order, block : of the additions in sums of products, as of :func:`gpbnb.arithmetic.linalg.matmul`.

        Raises
        ------
        ValueError : the format has no compiled loops, or none with fused multiply-add, with sums in `sums`, or in this
            order; an unknown order.
        """
        if sums is not None:
            return mixed_tag(self.run_tag(), sums.run_tag(fused, order=order, block=block))
        return run_tag(
            self.backend, self._rules or Rules(self.base, self.precision, self.rounding), fused, order, block
        )

    def check_compiled(self) -> None:
        """Reject a format without compiled loops.

        Raises
        ------
        ValueError : it has none; the message names the setting that prevents them, and what to set instead.
        """
        check_compiled(self.backend, self._rules or Rules(self.base, self.precision, self.rounding))

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        restart(self.kernel, self.backend)

    @property
    def backend(self) -> Backend:
        """The backend that stores the numbers of an array of this format, compiled if the format allows it."""
        if self._rules is not None:
            return limited_backend(self._rules)
        return backend(self.base, self.precision, self.rounding is Rounding.NEAREST)

    @property
    def exact_backend(self) -> Exact:
        """The slow backend that can store every number of this format."""
        if self._rules is not None:
            return limited_exact(self._rules)
        return exact(self.base, self.precision, self.rounding is Rounding.NEAREST)

    @property
    def unit_roundoff(self) -> Fraction:
        r"""Bound of the relative error of one rounding, exact.

        .. math:: \beta = \tfrac12 b^{1-t} \text{ (to nearest)}, \qquad \beta_c = b^{1-t} \text{ (otherwise)}

        If the range is limited, it holds for results that are not below the smallest normal number.

        References
        ----------
        hung1984, ch. II, (8) and (13).
        """
        step = Fraction(1, self.base ** (self.precision - 1))
        return step / 2 if self.rounding in (Rounding.NEAREST, Rounding.EVEN) else step

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
        chopped = chop.to_fraction(m, exponent)  # comes first, because it rejects exponents too long to write out
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
    """Whether a number, rounded to as many decimal digits as `printed` has, equals `printed`.

    Parameters
    ----------
    roundings : the ways in which it may have been rounded; by default only to nearest.
    """
    figures = len(printed.lower().partition("e")[0].replace(".", "").lstrip("+-0"))
    formats = (FloatFormat(10, figures, rounding) for rounding in roundings or (Rounding.NEAREST,))
    return any(fmt.round(value) == Fraction(printed) for fmt in formats)
