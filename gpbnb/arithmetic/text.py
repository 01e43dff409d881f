"""Decimal text of numbers, which their format converts back to the same numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.exact import ExactKernel, integer_text, kernel, size_text
from gpbnb.arithmetic.rounding import Rounding, Rules


def number_text(value: Any) -> str:
    """Return the text of a given number for a message, which is short if the number is a long integer."""
    long = isinstance(value, int) and value.bit_length() > 128
    return f"about {size_text(Fraction(value))}" if long else repr(value)


def in_columns(texts: Callable[[int], str], shape: tuple[int, ...], separator: str, prefix: str) -> str:
    """Lay out an array of texts, counted row after row, as NumPy lays out numbers, with the same omissions."""
    shown: dict[int, str] = {}

    def entry(place: Any) -> str:
        i = int(place)
        if i not in shown:
            shown[i] = texts(i)
        return shown[i].rjust(width)

    width = 0
    if not shape:
        return entry(0)
    places = np.arange(math.prod(shape)).reshape(shape)
    np.array2string(places, formatter={"int": entry})  # to find which entries are shown and how wide they are
    width = max(map(len, shown.values()), default=0)
    return np.array2string(
        places, separator=separator, prefix=prefix, suffix=")", formatter={"int": entry}, max_line_width=120
    )


def decimal_text(m: int, e: int, form: ExactKernel) -> str:
    """Return decimal digits that round to ``m * base**e`` in the format of a kernel, exact in base 10."""
    if m == 0:
        return "0"
    if form.base == 10:
        digits, exponent = integer_text(abs(m)), e
    else:
        try:
            found = _shortened(m, e, form)
        except OverflowError:  # otherwise the decimal exponent would have millions of digits
            return f"{integer_text(m)}*{integer_text(form.base)}**{integer_text(e)}"
        if found is None:
            p, q = form.to_fraction(m, e).as_integer_ratio()
            return f"{integer_text(p)}/{integer_text(q)}"
        digits, exponent = found
    digits, exponent = digits.rstrip("0"), exponent + len(digits) - len(digits.rstrip("0"))
    sign = "-" if m < 0 else ""
    point = len(digits) + exponent
    if -4 <= point - 1 < 16:
        if exponent >= 0:
            return sign + digits + "0" * exponent
        if point > 0:
            return f"{sign}{digits[:point]}.{digits[point:]}"
        return f"{sign}0.{'0' * -point}{digits}"
    tail = f".{digits[1:]}" if len(digits) > 1 else ""
    return f"{sign}{digits[0]}{tail}e{'+' if point > 0 else ''}{integer_text(point - 1)}"


def _shortened(m: int, e: int, form: ExactKernel) -> tuple[str, int] | None:
    """Return enough decimal digits of ``abs(m) * base**e`` to distinguish it from its neighbours in the format.

    Where the format rounds in one direction, the digits err in the other, so that rounding gives this number and not
    its neighbour. Roundings without a direction get all digits, or None if there is no end of them.
    """
    value = form.to_fraction(abs(m), e)
    if form.rounding not in (*Rounding.documented(), Rounding.EVEN):
        places = max(value.denominator.bit_length() - 1, 0)
        if 10**places % value.denominator == 0:
            return integer_text(int(value * 10**places)), -places
        if form.rounding not in (Rounding.UP, Rounding.DOWN):
            return None
    count = math.ceil(form.precision * math.log10(form.base)) + 2
    decimal = kernel(Rules(10, count, Rounding.NEAREST))
    digits, exponent = decimal.from_ratio(value.numerator, value.denominator)
    outward = form.rounding is Rounding.CHOP or (form.rounding is Rounding.DOWN) == (m > 0)
    error = decimal.to_fraction(digits, exponent) - value
    if not form.nearest and error and (error < 0) == outward:
        digits += 1 if outward else -1
    return integer_text(digits), exponent


def place(index: tuple[Any, ...]) -> str:
    """Write the index of an entry, as ``[0, 1]``."""
    return f"[{', '.join(map(str, index))}]"


def at_entry(index: tuple[Any, ...]) -> str:
    """Begin a message about an entry with its index; empty for a single number."""
    return f"entry {place(index)}: " if index else ""
