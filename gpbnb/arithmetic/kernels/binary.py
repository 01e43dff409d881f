"""Base 2 with 1 to 53 digits, and base 16 with 1 to 13, on float64.

Conditions are joined by & and |, which do not branch, because a processor cannot predict how a rounding goes.

Let p be the float64 result of an operation and r the exact result minus p. Then p and the sign of r determine between
which neighbouring float64 values the exact result lies. Read as integers, float64 values of one sign are evenly spaced,
even across powers of two: a step of one down from p whenever the exact result is smaller in magnitude gives the exact
result chopped to 53 bits. Midpoints between numbers with fewer bits are float64 values as well. So adding half a unit
and clearing the dropped bits rounds correctly to nearest, half away from zero.

A result below 2**-960, where r might underflow, or of at least 2**1023 becomes NaN, and later results stay NaN.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import bits, fma, from_bits
from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.tags import SAFE_TWICE, Binary, Hexadecimal

_SIGN = np.int64(-(2**63))
_MAGNITUDE = np.int64(2**63 - 1)
_EXPONENT = np.int64(0x7FF << 52)
_LEAST = np.int64((1023 - 960) << 52)
_LIMIT = np.int64((1023 + 1023) << 52)
_HALF_ULP = np.int64(53 << 52)
EXACT_PRODUCT = 26  # bits; products of numbers this short are exact in float64


def _clear_binary(fmt: Any, u: Any) -> Any:
    unit = np.int64(1) << (53 - fmt.precision)
    half = unit >> 1 if fmt.nearest else np.int64(0)
    return (u + half) & -unit


def _clear_hexadecimal(fmt: Any, u: Any) -> Any:
    # The first hexadecimal digit of 2**e * 1.f has 1 + e mod 4 bits.
    unit = np.int64(1) << (56 - 4 * fmt.precision - (((u >> 52) + 1) & 3))
    half = unit >> 1 if fmt.nearest else np.int64(0)
    return (u + half) & -unit


def operations(clear: Any, ties: bool, free: bool) -> dict[str, Any]:
    """Make the scalar operations on float64 for one way of clearing the dropped bits.

    Parameters
    ----------
    clear : rounds a magnitude, chopped to 53 bits and read as an integer, to the digits of a format.
    ties : whether the format may have 53 bits: then no bit is cleared, and the ties that float64 rounds to even are
        corrected.
    free : whether no result leaves the range, so that none is checked.
    """
    clear = inner(forceinline=True)(clear)

    @inner(forceinline=True)
    def fit(fmt: Any, p: Any, shift: Any, exact_zero: Any) -> Any:
        u = bits(p)
        v = clear(fmt, (u & _MAGNITUDE) + shift)
        if free:
            return from_bits(v | (u & _SIGN))
        in_range = ((v >= _LEAST) & (v < _LIMIT)) | (exact_zero & (v == 0))
        return from_bits(v | (u & _SIGN)) if in_range else np.nan

    @inner(forceinline=True)
    def direction(fmt: Any, p: Any, r: Any) -> Any:
        """Step from p, the float64 nearest to p + r, to p + r chopped to 53 bits; at 53 bits, to the tie away."""
        if ties and fmt.precision == 53 and fmt.nearest:
            half = from_bits((bits(p) & _EXPONENT) - _HALF_ULP)
            return np.int64(r == (half if p > 0 else -half))
        return -np.int64(((r < 0) & (p > 0)) | ((r > 0) & (p < 0)))

    def total(fmt: Any, a: Any, b: Any) -> Any:
        s = a + b
        if ties and fmt.nearest and fmt.precision <= SAFE_TWICE:
            return fit(fmt, s, np.int64(0), True)
        c = s - a
        r = (a - (s - c)) + (b - c)
        return fit(fmt, s, direction(fmt, s, r), True)

    add = inner(forceinline=True)(total)

    @inner(forceinline=True)
    def subtract(fmt: Any, a: Any, b: Any) -> Any:
        return add(fmt, a, 0.0 - b)

    @inner(forceinline=True)
    def multiply(fmt: Any, a: Any, b: Any) -> Any:
        p = a * b + 0.0  # no negative zero
        zero = (a == 0.0) | (b == 0.0)
        if ties and fmt.precision <= EXACT_PRODUCT:
            return fit(fmt, p, np.int64(0), zero)
        return fit(fmt, p, direction(fmt, p, fma(a, b, -p)), zero)

    @inner(error_model="numpy", forceinline=True)
    def quotient(fmt: Any, a: Any, b: Any) -> Any:
        q = a / b + 0.0
        if ties and fmt.precision <= SAFE_TWICE:
            return fit(fmt, q, np.int64(0), a == 0.0)
        r = fma(-q, b, a)
        if b < 0.0:
            r = 0.0 - r
        # A quotient of two 53-bit numbers never lies halfway between two others, so there is no tie to correct.
        down = np.int64(0) if ties and fmt.precision == 53 and fmt.nearest else direction(fmt, q, r)
        return fit(fmt, q, down, a == 0.0)

    @inner(forceinline=True)
    def round_(fmt: Any, x: Any) -> Any:
        return fit(fmt, x + 0.0, np.int64(0), x == 0.0)

    return {
        "add": add,
        "subtract": subtract,
        "multiply": multiply,
        "quotient": quotient,
        "round_": round_,
    }


OPERATIONS = {
    (tag, free): operations(clear, tag is Binary, free)
    for tag, clear in ((Binary, _clear_binary), (Hexadecimal, _clear_hexadecimal))
    for free in (False, True)
}
