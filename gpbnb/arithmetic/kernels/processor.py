"""Bases 2 and 16 as processors compute, on float64: every rounding mode, a limited range.

As in :mod:`gpbnb.arithmetic.kernels.binary`, an operation yields the nearest float64 p and the sign of the exact
result minus p. Below the smallest normal number B of a format, all numbers have the same spacing as those from B to 2B.
So B is added to the magnitude, the sum is rounded like any other number, and B is subtracted again without error.

Results beyond the range become NaN, and later results stay NaN.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import bits, fma, from_bits
from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.doubledouble import two_sum
from gpbnb.arithmetic.kernels.tags import (
    AWAY,
    DOWN,
    HALF_UP,
    LEAST,
    ODD,
    UP,
    Even,
    Hardware32,
    Hardware64,
    LongEven,
    Mode,
    Random,
    ShortEven,
    Sixteen,
    Two,
)
from gpbnb.arithmetic.rounding import DRAW_BITS

EXACT_PRODUCT = 26  # bits; products of numbers this short are exact in float64
_ONE = np.int64(1)
_SIGN, _MAGNITUDE = np.int64(-(2**63)), np.int64(2**63 - 1)
_EXPONENT, _HALF = np.int64(0x7FF << 52), np.int64(1 << 51)
_LARGEST_32 = float(np.finfo(np.float32).max)
_GOLDEN, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_DRAWN = np.uint64(64 - DRAW_BITS)


# -- rounding a magnitude that is chopped to 53 bits and read as an integer ---------------------------


def _dropped_binary(fmt: Any, u: Any) -> Any:
    return np.int64(53) - fmt.precision


def _dropped_hexadecimal(fmt: Any, u: Any) -> Any:
    # The first hexadecimal digit of 2**e * 1.f has 1 + e mod 4 bits.
    return np.int64(56) - np.int64(4) * fmt.precision - (((u >> 52) + 1) & 3)


def _even(fmt: Any, u: Any, k: Any, sticky: Any, negative: Any) -> Any:
    unit = _ONE << k
    # A mask finds the last digit, because no vector instruction shifts signed numbers.
    return (u + ((unit >> 1) - 1) + np.int64(((u & unit) != 0) | sticky)) & -unit


def _coded(fmt: Any, u: Any, k: Any, sticky: Any, negative: Any) -> Any:
    unit, code = _ONE << k, fmt.mode.code
    if code == HALF_UP:
        return (u + (unit >> 1) - np.int64(negative & (not sticky))) & -unit
    outward = ((code == UP) & (not negative)) | ((code == DOWN) & negative)
    added = (unit - 1) + np.int64(sticky) if outward else unit >> 1 if code == AWAY else 0
    inexact = ((u & (unit - 1)) != 0) | sticky
    return ((u + added) & -unit) | (np.int64(inexact & (code == ODD)) << k)


def _random(fmt: Any, u: Any, k: Any, sticky: Any, negative: Any) -> Any:
    # The same random numbers as gpbnb.arithmetic.kernels.exact.draw.
    state = fmt.mode.state
    state[1] += np.uint64(1)
    z = state[0] + state[1] * _GOLDEN
    z = (z ^ (z >> np.uint64(30))) * _FIRST
    z = (z ^ (z >> np.uint64(27))) * _SECOND
    drawn = np.int64((z ^ (z >> np.uint64(31))) >> _DRAWN)
    unit = _ONE << k
    rest = u & (unit - 1)
    # k >= DRAW_BITS, so the scaled draw is an integer; sticky tells whether digits follow the rest
    scaled = drawn << (k - DRAW_BITS)
    up = (scaled < rest) | ((scaled == rest) & sticky)
    return (u & -unit) + (np.int64(up) << k)


_MODES = {Even: _even, Mode: _coded, Random: _random}
_DROPPED = {Two: _dropped_binary, Sixteen: _dropped_hexadecimal}


@cache
def operations(digits: Any, mode: Any) -> dict[str, Any]:
    """Make the scalar operations for a class of digits and a class of rounding mode."""
    if mode is ShortEven:
        return _short(_within)
    if mode is LongEven:
        return _with_residuals(_fit_53, 0)
    dropped = inner(forceinline=True)(_DROPPED[digits])
    round_magnitude = inner(forceinline=True)(_MODES[mode])

    @inner(forceinline=True)
    def fit(fmt: Any, p: Any, r: Any, exact_zero: Any) -> Any:
        """Round the exact p + r, where p is its nearest float64; only the sign of r is used."""
        negative = p < 0.0
        a = abs(p)
        base = fmt.gradual if a < fmt.gradual else 0.0
        s = a + base
        e = a - (s - base)
        rest = e if e != 0.0 else (-r if negative else r)
        u = bits(s) - np.int64(rest < 0.0)
        v = round_magnitude(fmt, u, dropped(fmt, u), rest != 0.0, negative)
        y = from_bits(v) - base
        y = y if (y >= fmt.least) | (exact_zero & (y == 0.0)) else fmt.below
        y = 0.0 - y if negative else y
        y = fmt.over if y > fmt.largest else y
        y = fmt.under if y < fmt.lowest else y
        return y if a == a else np.nan

    made = _with_residuals(fit, EXACT_PRODUCT // (4 if digits is Sixteen else 1))
    return {**made, "round_": _round_even_of_52} if (digits, mode) == (Two, Even) else made


def _with_residuals(fit: Any, exact_product: int) -> dict[str, Any]:
    """Make the scalar operations of a format whose results ``fit`` rounds.

    ``fit`` takes the nearest float64 to the exact result, and the sign of what is left. Products of numbers of at most
    `exact_product` digits leave nothing.
    """

    @inner(forceinline=True)
    def add(fmt: Any, a: Any, b: Any) -> Any:
        s = a + b
        c = s - a
        return fit(fmt, s, (a - (s - c)) + (b - c), True)

    @inner(forceinline=True)
    def subtract(fmt: Any, a: Any, b: Any) -> Any:
        return add(fmt, a, 0.0 - b)

    @inner(forceinline=True)
    def multiply(fmt: Any, a: Any, b: Any) -> Any:
        p = a * b
        zero = (a == 0.0) | (b == 0.0)
        return fit(fmt, p, 0.0 if fmt.precision <= exact_product else fma(a, b, -p), zero)

    @inner(error_model="numpy", forceinline=True)
    def quotient(fmt: Any, a: Any, b: Any) -> Any:
        q = a / b
        r = fma(-q, b, a)
        return fit(fmt, q, -r if b < 0.0 else r, a == 0.0)

    @inner(forceinline=True)
    def round_(fmt: Any, x: Any) -> Any:
        y = fit(fmt, x, 0.0, x == 0.0)
        return y if abs(x) < np.inf else np.nan

    return {
        "add": add,
        "subtract": subtract,
        "multiply": multiply,
        "quotient": quotient,
        "round_": round_,
    }


@inner(forceinline=True)
def _power(fmt: Any, x: Any, fraction: Any) -> Any:
    """(1 + fraction / 2**52) * 2**(e + 53 - t), where x has the exponent e, or that of the smallest normal number.

    The float64 values from this power C to 2C have the spacing of the t-digit numbers from 2**e to 2**(e + 1), and the
    machine rounds ties to even. So adding C, with the sign of x, and subtracting it again rounds x. If x is beyond
    every range, C does not matter.
    """
    scale = from_bits(bits(x) & _EXPONENT)
    scale = scale if scale > fmt.gradual else fmt.gradual
    return scale * from_bits(((np.int64(1023 + 53) - fmt.precision) << 52) | fraction)


@inner(forceinline=True)
def _nearest_even(fmt: Any, x: Any) -> Any:
    """Round a float64 of any size to the spacing of a format of at most 51 bits: 1.5 C serves for either sign."""
    c = _power(fmt, x, _HALF)
    return (x + c) - c


@inner(forceinline=True)
def _nearest_even_of_52(fmt: Any, x: Any) -> Any:
    c = from_bits(bits(_power(fmt, x, np.int64(0))) | (bits(x) & _SIGN))
    return (x + c) - c


@inner(forceinline=True)
def _within(fmt: Any, y: Any, exact_zero: Any) -> Any:
    """Apply the limits to a rounded number."""
    if fmt.least > 0.0:
        y = fmt.below if (abs(y) < fmt.least) & ((y != 0.0) | (not exact_zero)) else y  # NaN stays
    y = fmt.over if y > fmt.largest else y
    return fmt.under if y < fmt.lowest else y


@inner(forceinline=True)
def _fit_53(fmt: Any, p: Any, r: Any, exact_zero: Any) -> Any:
    """Round the exact p + r to 53 bits, where p is its nearest float64 and thus the result, except below B.

    There, adding B rounds p a second time. That is wrong if p, but not p + r, is a tie, and goes away from p + r.
    """
    a, rest = abs(p), (-r if p < 0.0 else r)
    base = fmt.gradual if a < fmt.gradual else 0.0
    s = a + base
    unit = base * 2.0**-52  # the spacing of all numbers from B to 2B
    twice = 2.0 * (a - (s - base))
    s = s + unit if (twice == unit) & (rest > 0.0) else s
    s = s - unit if (twice == -unit) & (rest < 0.0) else s
    y = s - base
    return _within(fmt, 0.0 - y if p < 0.0 else y, exact_zero)


@inner(forceinline=True)
def _round_even(fmt: Any, x: Any) -> Any:
    return _within(fmt, _nearest_even(fmt, x), x == 0.0) + (x - x)  # NaN for infinities


@inner(forceinline=True)
def _round_even_of_52(fmt: Any, x: Any) -> Any:
    return _within(fmt, _nearest_even_of_52(fmt, x), x == 0.0) + (x - x)


# A result of two numbers of at most 25 bits may be rounded to 53 bits first. If it is not a tie of the format, also of
# one whose last digits gradual underflow takes, it differs from each by more than 2**-52 of its size.


@inner(forceinline=True)
def _free(fmt: Any, y: Any, exact_zero: Any) -> Any:
    return y


def _short(within: Any) -> dict[str, Any]:
    to_even, dropped = inner(forceinline=True)(_even), inner(forceinline=True)(_dropped_binary)

    @inner(forceinline=True)
    def round_alone(fmt: Any, x: Any, exact_zero: Any) -> Any:
        # Fewer operations wait for each other than in `_nearest_even`; the branch keeps loops from being vectorized.
        size = abs(x)
        if (size >= fmt.gradual) & (size >= fmt.least) & (size <= fmt.largest):
            u = bits(x)
            return from_bits(to_even(fmt, u, dropped(fmt, u), False, False))
        return within(fmt, _nearest_even(fmt, x), exact_zero)

    @inner(forceinline=True)
    def add_product(fmt: Any, a: Any, b: Any, c: Any) -> Any:
        return round_alone(fmt, c + round_alone(fmt, a * b, (a == 0.0) | (b == 0.0)), True)

    @inner(forceinline=True)
    def add(fmt: Any, a: Any, b: Any) -> Any:
        return within(fmt, _nearest_even(fmt, a + b), True)

    @inner(forceinline=True)
    def subtract(fmt: Any, a: Any, b: Any) -> Any:
        return within(fmt, _nearest_even(fmt, a - b), True)

    @inner(forceinline=True)
    def multiply(fmt: Any, a: Any, b: Any) -> Any:
        return within(fmt, _nearest_even(fmt, a * b), (a == 0.0) | (b == 0.0))

    @inner(error_model="numpy", forceinline=True)
    def quotient(fmt: Any, a: Any, b: Any) -> Any:
        return within(fmt, _nearest_even(fmt, a / b), a == 0.0)

    return {
        "add": add,
        "add_product": add_product,
        "subtract": subtract,
        "multiply": multiply,
        "quotient": quotient,
        "round_": _round_even,
    }


@inner(forceinline=True)
def fused_sum(a: Any, b: Any, c: Any) -> Any:
    """a * b + c as its nearest float64 w and a residual with the correct sign, and whether the sum is exactly zero.

    The exact product is p + e, and p + c = s + r. The residuals e and r add up to v + lowest, and s and v to w + low.
    If low is not zero, it is a multiple of the last bit of v and thus larger than lowest. If the residual of the
    product is too small for float64, w is NaN.
    """
    p = a * b
    e = fma(a, b, -p)
    s, r = two_sum(p, c)
    v, lowest = two_sum(r, e)
    w, low = two_sum(s, v)
    zero = (a == 0.0) | (b == 0.0)
    w = w if zero | (abs(p) >= LEAST) else np.nan
    return w, (low if low != 0.0 else lowest), (w == 0.0) & (zero | (c != 0.0))


# -- by the machine ----------------------------------------------------------------------------------


@inner(forceinline=True)
def _single(x: Any) -> Any:
    y = np.float64(np.float32(x)) + 0.0  # no negative zero
    return y if abs(y) <= _LARGEST_32 else np.nan


@inner(forceinline=True)
def _double(x: Any) -> Any:
    y = x + 0.0
    return y if abs(y) < np.inf else np.nan


def _machine(rounded: Any) -> dict[str, Any]:
    @inner(forceinline=True)
    def add(fmt: Any, a: Any, b: Any) -> Any:
        return rounded(a + b)

    @inner(forceinline=True)
    def subtract(fmt: Any, a: Any, b: Any) -> Any:
        return rounded(a - b)

    @inner(forceinline=True)
    def multiply(fmt: Any, a: Any, b: Any) -> Any:
        return rounded(a * b)

    @inner(error_model="numpy", forceinline=True)
    def quotient(fmt: Any, a: Any, b: Any) -> Any:
        return rounded(a / b)

    @inner(forceinline=True)
    def round_(fmt: Any, x: Any) -> Any:
        return rounded(x)

    return {
        "add": add,
        "subtract": subtract,
        "multiply": multiply,
        "quotient": quotient,
        "round_": round_,
    }


# Sums, products, quotients and roots of 24-bit numbers may be rounded to 53 bits first, which never creates a tie.
MACHINE = {
    Hardware32: _machine(_single),
    Hardware64: _machine(_double),
}


@inner(forceinline=True)
def _as_computed(x: Any) -> Any:
    return x + np.float32(0.0)  # no negative zero


@inner(forceinline=True)
def _to_single(fmt: Any, x: Any) -> Any:
    return np.float32(x) + np.float32(0.0)


# Results of which none leaves the range, or whose range is checked at the end: infinities and NaN stay what they are.
FREE = {
    ShortEven: _short(_free),
    Hardware32: {**_machine(_as_computed), "round_": _to_single},
    Hardware64: _machine(_as_computed),
}
