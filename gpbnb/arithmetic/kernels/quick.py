"""One operation on float64 in base 2 or 16, rounded quickly: where no result is near the ends of the format's range."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import at, bits, entries, fma, from_bits, select
from gpbnb.arithmetic.kernels.compiling import borrowing, inner
from gpbnb.arithmetic.kernels.doubledouble import two_sum
from gpbnb.arithmetic.kernels.tags import ABSOLUTE, DIVIDE, FUSED, MULTIPLY, NEGATIVE, ROOT, SUBTRACT

WHOLE, NUMBER, RANDOM = range(3)
"""Entries of a table of formats, which hold addresses of arrays: the columns of formats, int64 and float64, whose
meaning depends on the kind of number; seed and count of random numbers."""
COLUMNS, NUMBERS = 16, 7  # of each format
# Columns of formats of float64, int64; the first three are those of :class:`gpbnb.arithmetic.kernels.tags.Float`.
# fmt: off
(
    BITS, PRECISION, MODE, HOW, CLEAR, SHIFT, HALF, EVEN, LOW, SPAN, BELOW_ZERO, ABOVE_ZERO, STICKY_BELOW, STICKY_ABOVE,
    EVENLY,
) = range(15)
# fmt: on
SHORT, LONG, TIED, DIRECTED, HEXADECIMAL, NONE, GRADUAL = range(7)
"""How quick results are rounded: to nearest without a look at what is left, since rounding twice is correct; to nearest
or toward zero; to nearest by the size of what is left, which tells ties away from zero in 53 bits; in another mode; in
base 16; not at all; or, where the column EVENLY is set, like the first, also below the smallest normal number, whose
spacing continues there."""
_SIGN, _MAGNITUDE = np.int64(-(2**63)), np.int64(2**63 - 1)
_EXPONENT, _HALF, _HALF_ULP = np.int64(0x7FF << 52), np.int64(1 << 51), np.int64(53 << 52)
_SHIFT_OF_EXACT_PRODUCTS = 27  # products of numbers of at most 26 bits are exact
_LONG = np.int64(LONG)


@borrowing
def rule_of(formats: Any, f: Any) -> Any:
    """How results of a format are rounded, and the data for :func:`rounded`."""
    whole = at(entries(formats, WHOLE, np.int64), COLUMNS * f)
    nearest = whole[CLEAR], whole[SHIFT], whole[HALF], whole[EVEN], whole[LOW], whole[SPAN]
    return whole[HOW], (*nearest, whole[BELOW_ZERO], whole[ABOVE_ZERO], whole[STICKY_BELOW], whole[STICKY_ABOVE])


@inner(forceinline=True)
def rounded(how: Any, p: Any, r: Any, rule: Any) -> Any:
    """Round p + r, where p is p + r to nearest with ties to even; also return whether it is out of the quick range.

    The bits of numbers of one sign are evenly spaced integers, also across powers of two. Those of the exact p + r, cut
    off to 53 bits, are those of p or, where r leads back toward zero, one less.
    """
    clear, shift, half, even, low, span, below, above, sticky_below, sticky_above = rule
    u = bits(p)
    if how == SHORT:
        u = (u + half + ((u >> shift) & even)) & clear
    elif how == GRADUAL:
        # The float64 from 1.5 times a power of two on are as far apart as the numbers of the format around p, and the
        # processor rounds ties to even: so adding that number and subtracting it again rounds p, of either sign.
        spacing = from_bits(max(u & _EXPONENT, low) + (shift << 52) + _HALF)
        u = bits((p + spacing) - spacing)
    elif how == TIED:
        tie = from_bits((u & _EXPONENT) - _HALF_ULP)
        u += np.int64(r == (tie if p > 0.0 else -tie))
    else:
        left = np.int64(r != 0.0)
        u += ((bits(r) ^ u) >> 63) & -left
        if how == LONG:
            u = (u + half + (((u >> shift) | left) & even)) & clear
        elif how == HEXADECIMAL:  # the first hexadecimal digit of 2**e * 1.f has 1 + e mod 4 bits
            shift -= ((u >> 52) + 1) & 3
            u = (u + ((half << shift) >> 1)) & -(np.int64(1) << shift)
        else:
            u = (u + select(u < 0, below, above) + (select(u < 0, sticky_below, sticky_above) & left)) & clear
    size = u & _MAGNITUDE
    # Rounded, a number below the range may be zero, but p is not.
    gone = (np.uint64(size - low) > np.uint64(span)) & (p != 0.0) if how != GRADUAL else size > low + span
    return from_bits(u) + 0.0, gone


@borrowing(error_model="numpy", forceinline=True)
def basic(operation: Any, how: Any, rule: Any, x: Any, y: Any) -> Any:
    """A product, quotient or sum, and whether it is out of the quick range."""
    if operation == MULTIPLY:
        p = x * y
        r = fma(x, y, -p)
    elif operation == DIVIDE:
        p = x / y
        r = fma(-p, y, x)
        r = 0.0 if how == TIED else -r if y < 0.0 else r  # no quotient is a tie
    else:
        y = -y if operation == SUBTRACT else y
        p = x + y
        c = p - x
        r = (x - (p - c)) + (y - c)
    found, gone = rounded(how, p, r, rule)
    return found, gone | ((operation == DIVIDE) & (y == 0.0))


@borrowing(error_model="numpy", forceinline=True)
def other(operation: Any, how: Any, rule: Any, x: Any, y: Any, z: Any) -> Any:
    """The result of another operation on numbers, as :func:`basic`."""
    if operation in (NEGATIVE, ABSOLUTE):
        return (0.0 - x if operation == NEGATIVE else abs(x)), False
    p, r = x, 0.0
    if operation == ROOT:
        p = math.sqrt(x)
        r = 0.0 if how == TIED else fma(-p, p, x)  # nor is a root
    elif operation == FUSED:
        if how == SHORT and rule[1] == 0:  # 53 bits, ties to even
            p = fma(x, y, z)
        elif rule[1] - 3 * np.int64(how == HEXADECIMAL) >= _SHIFT_OF_EXACT_PRODUCTS:
            p, r = two_sum(x * y, z)
            how = _LONG if how == SHORT else how
        else:
            return x, True
    found, gone = rounded(how, p, r, rule)
    return found, gone | (p != p)
