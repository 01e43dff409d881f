"""One operation on float64 in any format of bases 2 and 16, whose precision, rounding and range are data."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import bits, fma, from_bits
from gpbnb.arithmetic.kernels.compiling import borrowing, inner
from gpbnb.arithmetic.kernels.doubledouble import two_sum
from gpbnb.arithmetic.kernels.tags import (
    ABSOLUTE,
    ADD,
    AWAY,
    DIVIDE,
    DOWN,
    EVEN,
    HALF_UP,
    LEAST,
    MULTIPLY,
    NEGATIVE,
    ODD,
    RANDOM,
    ROOT,
    ROUND,
    SUBTRACT,
    UP,
    Float,
)
from gpbnb.arithmetic.rounding import DRAW_BITS

_ONE = np.int64(1)
_EXPONENT, _HALF_ULP = np.int64(0x7FF << 52), np.int64(53 << 52)
_GOLDEN, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_DRAWN, _NEXT = np.uint64(64 - DRAW_BITS), np.uint64(1)


@borrowing
def masked(whole: Any, numbers: Any) -> Any:
    """The format of these columns, of which digits and rounding come first; random numbers are drawn elsewhere."""
    bits, precision, mode = whole[0], whole[1], whole[2]
    gradual, least, below, lowest, largest = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    return Float(bits, precision, mode, gradual, least, below, lowest, largest, numbers[5], numbers[6], 0)


@inner(forceinline=True)
def drawn(seed: Any, count: Any) -> Any:
    """Random bits for a rounding, the same as those of :func:`gpbnb.arithmetic.kernels.exact.draw`."""
    z = seed + count * _GOLDEN
    z = (z ^ (z >> np.uint64(30))) * _FIRST
    z = (z ^ (z >> np.uint64(27))) * _SECOND
    return np.int64((z ^ (z >> np.uint64(31))) >> _DRAWN)


@borrowing
def _rounded_magnitude(fmt: Any, random: Any, u: Any, k: Any, sticky: Any, negative: Any) -> Any:
    """Round a magnitude that is chopped to 53 bits and read as an integer, of which k bits are dropped."""
    unit, mode = _ONE << k, fmt.mode
    rest = u & (unit - 1)
    if mode == EVEN:
        return (u + ((unit >> 1) - 1) + np.int64(((u & unit) != 0) | sticky)) & -unit
    if mode == HALF_UP:
        return (u + (unit >> 1) - np.int64(negative & (not sticky))) & -unit
    if mode == RANDOM:
        random[1] += _NEXT
        scaled = drawn(random[0], random[1]) << (k - DRAW_BITS)
        up = (scaled < rest) | ((scaled == rest) & sticky)
        return (u & -unit) + (np.int64(up) << k)
    outward = ((mode == UP) & (not negative)) | ((mode == DOWN) & negative)
    added = (unit - 1) + np.int64(sticky) if outward else unit >> 1 if mode == AWAY else np.int64(0)
    inexact = (rest != 0) | sticky
    return ((u + added) & -unit) | (np.int64(inexact & (mode == ODD)) << k)


@inner
def within(fmt: Any, y: Any, exact_zero: Any) -> Any:
    """Apply the limits to a rounded number."""
    y = fmt.below if (abs(y) < fmt.least) & ((y != 0.0) | (not exact_zero)) else y
    y = fmt.over if y > fmt.largest else y
    return fmt.under if y < fmt.lowest else y


@inner
def _fit_53(fmt: Any, p: Any, r: Any, exact_zero: Any) -> Any:
    """Round p + r to 53 bits, ties to even; p is its nearest float64 and thus the result, except below `gradual`.

    There, adding `gradual` rounds p a second time. That is wrong if p, but not p + r, is a tie, and goes away from
    p + r.
    """
    a, rest = abs(p), (-r if p < 0.0 else r)
    base = fmt.gradual if a < fmt.gradual else 0.0
    s = a + base
    unit = base * 2.0**-52
    twice = 2.0 * (a - (s - base))
    s = s + unit if (twice == unit) & (rest > 0.0) else s
    s = s - unit if (twice == -unit) & (rest < 0.0) else s
    y = s - base
    return within(fmt, 0.0 - y if p < 0.0 else y, exact_zero)


@borrowing
def _fit(fmt: Any, random: Any, p: Any, r: Any, exact_zero: Any) -> Any:
    """Round the exact p + r, where p is its nearest float64; NaN if the format has no such number."""
    if not abs(p) < np.inf:
        return np.nan
    if fmt.precision == 53 and fmt.bits == 1:
        if fmt.mode == EVEN:
            return _fit_53(fmt, p, r, exact_zero)
        if fmt.mode == AWAY:  # only the residual tells a tie, which the processor has rounded to even
            half = from_bits((bits(p) & _EXPONENT) - _HALF_ULP)
            tie = r == (half if p > 0.0 else -half)
            return within(fmt, from_bits(bits(p) + np.int64(tie)) + 0.0, exact_zero)
    negative = p < 0.0
    a = abs(p)
    base = fmt.gradual if a < fmt.gradual else 0.0
    s = a + base
    e = a - (s - base)
    rest = e if e != 0.0 else (-r if negative else r)
    u = bits(s) - np.int64(rest < 0.0)
    k = np.int64(53) - fmt.precision
    if fmt.bits == 4:  # the first hexadecimal digit of 2**e * 1.f has 1 + e mod 4 bits
        k = np.int64(56) - np.int64(4) * fmt.precision - (((u >> 52) + 1) & 3)
    y = from_bits(_rounded_magnitude(fmt, random, u, k, rest != 0.0, negative)) - base
    return within(fmt, 0.0 - y if negative else y, exact_zero)


@inner(forceinline=True)
def fused_sum(a: Any, b: Any, c: Any) -> Any:
    """The float64 w nearest to a * b + c, a residual with the correct sign, and whether the sum is exactly zero.

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


@borrowing(error_model="numpy")
def carefully(fmt: Any, random: Any, code: Any, x: Any, y: Any, z: Any) -> Any:
    """The result of an operation on numbers; NaN if the format has none."""
    if code in (ADD, SUBTRACT):
        y = 0.0 - y if code == SUBTRACT else y
        s = x + y
        c = s - x
        return _fit(fmt, random, s, (x - (s - c)) + (y - c), s == 0.0)
    if code == MULTIPLY:
        p = x * y
        return _fit(fmt, random, p, fma(x, y, -p), (x == 0.0) | (y == 0.0))
    tied = fmt.precision == 53 and fmt.mode == AWAY  # no quotient or root is a tie, and residuals are not to scale
    if code == DIVIDE:
        if y == 0.0:
            return np.nan
        q = x / y
        r = fma(-q, y, x)
        return _fit(fmt, random, q, 0.0 if tied else -r if y < 0.0 else r, x == 0.0)
    if code == ROOT:
        if not x >= 0.0:
            return np.nan
        s = math.sqrt(x)
        return _fit(fmt, random, s, 0.0 if tied else fma(-s, s, x), x == 0.0)
    if code in (NEGATIVE, ABSOLUTE):  # fixed point has one more negative number than positive ones
        y = 0.0 - x if code == NEGATIVE or x < 0.0 else x
        return fmt.over if y > fmt.largest else y
    if code == ROUND:
        return _fit(fmt, random, x, 0.0, x == 0.0)
    w, rest, zero = fused_sum(x, y, z)
    if fmt.precision == 53 and fmt.mode == EVEN:
        near = fma(x, y, z)
        rest = rest if near == w else w - near
        w = near if w == w else w
    return _fit(fmt, random, w, rest, zero)
