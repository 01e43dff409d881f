"""Base 10 with 1 to 18 digits, on pairs of int64.

A pair ``(m, e)`` represents ``m * 10**e``. Zero is ``(0, 0)``; every other number has ``10**(t-1) <= abs(m) < 10**t``.
Magnitudes are uint64, which holds 10**19; only products, and dividends with 10 to 18 digits, need 128 bits. For up to 8
digits, :mod:`gpbnb.arithmetic.kernels.shortdecimal` computes the same faster.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels.bits import high_product, leading_zeros
from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.integers import divided_by_word
from gpbnb.arithmetic.kernels.tags import (
    ABRUPT,
    AWAY,
    DOWN,
    EVEN,
    GRADUAL,
    HALF_UP,
    ODD,
    UP,
    Decimal,
    Wide,
)

NARROW = 9  # precision up to which the dividend fits into 64 bits
LARGEST_EXPONENT = 2**60

_U0, _U1 = np.uint64(0), np.uint64(1)
_U5, _U10, _U50, _U100 = np.uint64(5), np.uint64(10), np.uint64(50), np.uint64(100)
_TWO_64 = 2.0**64

POWER = np.array([10**k for k in range(20)], np.uint64)
HALF = POWER // np.uint64(2)

# For n < 2**61 and d = 10**k, k > 0, n // d is the high half of n * INVERSE[k], shifted right by LENGTH[k]. Proof: let
# l = floor(log2 d) and c = ceil(2**(63 + l) / d). Then c * d exceeds 2**(63 + l) by less than d < 2**(l + 1), and n
# times this excess is below 2**(63 + l). INVERSE[k] = 2c is below 2**64.
_LENGTHS = [(10**k).bit_length() - 1 for k in range(19)]
LENGTH = np.array(_LENGTHS, np.uint64)
INVERSE = np.array([0] + [-2 * ((-1 << (63 + n)) // 10**k) for k, n in enumerate(_LENGTHS) if k > 0], np.uint64)

# Divisors shifted until their highest bit is set, and their reciprocals, for dividing 128 by 64 bits.
_SHIFT = np.array([63 - n for n in _LENGTHS], np.int64)
_NORMAL = np.array([10**k << (63 - n) for k, n in enumerate(_LENGTHS)], np.uint64)
_RECIPROCAL = np.array([(2**128 - 1) // (10**k << (63 - n)) - 2**64 for k, n in enumerate(_LENGTHS)], np.uint64)


def _rounds_up(mode: int, odd: int, up: int, tie: int, inexact: int, negative: int) -> bool:
    """Whether a magnitude rounds up in a mode, by its last digit and what is cut off; see :func:`increment`."""
    if mode in (AWAY, EVEN, HALF_UP):
        return bool(up and not (tie and ((mode == EVEN and not odd) or (mode == HALF_UP and negative))))
    outward = (mode == UP and not negative) or (mode == DOWN and negative) or (mode == ODD and not odd)
    return bool(inexact and outward)


# For each mode, 32 bits with the answer of `_rounds_up` to each combination of odd, up, tie, inexact and negative. A
# processor cannot predict which combination comes next, so looking it up costs less than branches.
_BITS = [[at >> k & 1 for k in range(5)] for at in range(32)]
_INCREMENTS = np.array(
    [sum(_rounds_up(mode, *bits) << at for at, bits in enumerate(_BITS)) for mode in range(7)], np.uint64
)


@inner(forceinline=True)
def _power(k: Any) -> Any:
    """10**k; with an unsigned index, numba need not test whether it is negative."""
    return POWER[np.uint64(k)]


@inner(forceinline=True)
def _quotient(n: Any, k: Any) -> Any:
    """``n // 10**k`` for n < 2**61, k > 0."""
    return high_product(n, INVERSE[np.uint64(k)]) >> LENGTH[np.uint64(k)]


@inner(forceinline=True)
def _wide_by_power(high: Any, low: Any, k: Any) -> Any:
    """Divide a 128-bit number by 10**k: quotient, which must fit into 64 bits, and remainder.

    Moeller and Granlund, Improved division by invariant integers (2011), algorithm 4.
    """
    index = np.uint64(k)
    s = _SHIFT[index]
    d = _NORMAL[index]
    u1 = (high << s) | (low >> (64 - s))
    u0 = low << s
    v = _RECIPROCAL[index]
    q1, q0 = high_product(v, u1), v * u1
    q0 += u0
    q1 += u1 + _U1 + (_U1 if q0 < u0 else _U0)
    r = u0 - q1 * d
    if r > q0:
        q1 -= _U1
        r += d
    if r >= d:
        q1 += _U1
        r -= d
    return q1, r >> s


@inner(forceinline=True)
def _digits(n: Any) -> Any:
    """Number of decimal digits of n; 1 for zero."""
    count = ((64 - leading_zeros(n | _U1)) * 1233) >> 12  # the number of digits or one less
    return count + np.int64(n >= _power(count))


@inner(forceinline=True)
def check(e: Any) -> None:
    """Raise OverflowError for an exponent that is too large for further operations."""
    if e > LARGEST_EXPONENT or e < -LARGEST_EXPONENT:
        raise OverflowError(
            "got a result with an exponent beyond 2**60; needed one that int64 holds; scale the numbers"
        )


def increment(fmt: Any, m: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
    """1 if a magnitude rounds up to m + 1, else 0; `up`: at least halfway, `tie`: halfway, `inexact`: above m."""
    raise TypeError("got a call of increment from Python; needed one from a function compiled by numba")


@overload(increment, strict=False, jit_options={"forceinline": True, "no_cfunc_wrapper": True})
def _overloaded_increment(fmt: Any, m: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
    def to_nearest_or_chopped(fmt: Any, m: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
        return np.uint64(up & fmt.nearest)

    def by_mode(fmt: Any, m: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
        if fmt.mode == AWAY:  # a branch that processors predict
            return np.uint64(up)
        at = (m & _U1) | (np.uint64(up) << 1) | (np.uint64(tie) << 2)
        at |= (np.uint64(inexact) << 3) | (np.uint64(negative) << 4)
        return (_INCREMENTS[np.uint64(fmt.mode)] >> at) & _U1

    return by_mode if getattr(fmt, "instance_class", None) in (Decimal, Wide) else to_nearest_or_chopped


@inner(forceinline=True)
def _shortened(fmt: Any, m: Any, e: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
    """Round a number with t digits, below the normal numbers of a format, to the spacing of its subnormal numbers."""
    k = fmt.least - e
    if k > fmt.precision:
        m, up, tie, inexact = _U0, False, False, True
    else:
        unit = _power(k)
        whole = m // unit
        rest = m - whole * unit
        up, tie, inexact = rest + rest >= unit, (rest + rest == unit) & (not inexact), inexact | (rest != _U0)
        m = whole
    m += increment(fmt, m, up, tie, inexact, negative)
    if m == _U0:
        return np.int64(0), np.int64(0)
    k = fmt.precision - _digits(m)
    m = np.int64(m * _power(k))
    return -m if negative else m, fmt.least - k


def number(fmt: Any, m: Any, e: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
    """Make the pair of a magnitude with t digits, and what is cut off below them; see :func:`increment`.

    Raises OverflowError if the backend or the format cannot hold its exponent.
    """
    raise TypeError("got a call of number from Python; needed one from a function compiled by numba")


@overload(number, strict=False, jit_options={"forceinline": True, "no_cfunc_wrapper": True})
def _overloaded_number(fmt: Any, m: Any, e: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
    def anywhere(fmt: Any, m: Any, e: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
        m += increment(fmt, m, up, tie, inexact, negative)
        carried = m == _power(fmt.precision)
        m = np.int64(_power(fmt.precision - 1) if carried else m)
        e += np.int64(carried)
        check(e)
        return -m if negative else m, e

    def within(fmt: Any, m: Any, e: Any, up: Any, tie: Any, inexact: Any, negative: Any) -> Any:
        normal = e >= fmt.least
        if not normal and fmt.small == GRADUAL:
            return _shortened(fmt, m, e, up, tie, inexact, negative)
        m += increment(fmt, m, up, tie, inexact, negative)
        carried = m == _power(fmt.precision)
        m = np.int64(_power(fmt.precision - 1) if carried else m)
        e += np.int64(carried)
        if normal and e <= fmt.largest:  # as for most numbers
            return -m if negative else m, e
        if e > fmt.largest or (e < fmt.least and fmt.small != ABRUPT):
            raise OverflowError("got a result beyond the largest number of the format; needed one within")
        return (-m if negative else m, e) if e >= fmt.least else (np.int64(0), np.int64(0))

    return within if getattr(fmt, "instance_class", None) is Decimal else anywhere


@inner(forceinline=True)
def _filled(fmt: Any, n: Any, e: Any, negative: Any) -> Any:
    """Round an n with at most t digits, which only a limited range makes inexact."""
    if n == _U0:
        return np.int64(0), np.int64(0)
    k = fmt.precision - _digits(n)
    return number(fmt, n * _power(k), e - k, False, False, False, negative)


@inner(forceinline=True)
def add(fmt: Any, a: Any, b: Any) -> Any:
    m1, e1 = a
    m2, e2 = b
    if m1 == 0:
        return b
    if m2 == 0:
        return a
    if e1 < e2:
        m1, e1, m2, e2 = m2, e2, m1, e1
    t = fmt.precision
    d = e1 - e2
    x, y = np.uint64(abs(m1)), np.uint64(abs(m2))
    negative = m1 < 0
    same = negative == (m2 < 0)
    beyond_half: Any = False  # all three describe what lies below the last digit of n
    halfway: Any = False
    more: Any = False
    if d <= 1:
        x *= _power(d)
        e = e2
        if same:
            n = x + y
        elif x >= y:
            n = x - y
        else:
            n = y - x
            negative = not negative
        if n < _power(t - 1):
            return _filled(fmt, n, e, negative)
    else:
        # The larger number gets one more digit, and the smaller one is cut off at that digit. What is cut off only
        # decides the direction, and the sum has at least t digits.
        k = d - 1
        e = e1 - 1
        if k > t:
            whole, rest, unit = _U0, _U1, _U10
        else:
            whole, unit = _quotient(y, k), _power(k)
            rest = y - whole * unit
        more = rest != _U0
        halfway = rest + rest == unit
        if same:
            n = x * _U10 + whole
            beyond_half = rest + rest >= unit
        else:
            n = x * _U10 - whole
            if rest != _U0:
                n -= _U1
                beyond_half = rest + rest <= unit
    if n >= _power(t + 1):
        m = n // _U100
        last = n - m * _U100
        up: Any = last >= _U50
        halfway = (last == _U50) & (not more)
        more = more | (last != _U0)
        e += 2
    elif n >= _power(t):
        m = n // _U10
        last = n - m * _U10
        up = last >= _U5
        halfway = (last == _U5) & (not more)
        more = more | (last != _U0)
        e += 1
    else:
        m = n
        up = beyond_half
    return number(fmt, m, e, up, halfway, more, negative)


@inner(forceinline=True)
def opposite(fmt: Any, a: Any) -> Any:
    return -a[0], a[1]


negative = opposite


@inner(forceinline=True)
def multiply(fmt: Any, a: Any, b: Any) -> Any:
    m1, e1 = a
    m2, e2 = b
    if m1 == 0 or m2 == 0:
        return np.int64(0), np.int64(0)
    t = fmt.precision
    k = t - 1
    x, y = np.uint64(abs(m1)), np.uint64(abs(m2))
    m, rest = _wide_by_power(high_product(x, y), x * y, k)
    up, tie, inexact = rest + rest >= _power(k), rest + rest == _power(k), rest != _U0
    if m >= _power(t):
        n = m
        m = n // _U10
        last = n - m * _U10
        up, tie, inexact = last >= _U5, (last == _U5) & (not inexact), inexact | (last != _U0)
        k = t
    negative = (m1 < 0) != (m2 < 0)
    return number(fmt, m, e1 + e2 + k, up, tie, inexact, negative)


@inner(forceinline=True)
def divide(fmt: Any, a: Any, b: Any) -> Any:
    m1, e1 = a
    m2, e2 = b
    if m2 == 0:
        raise ZeroDivisionError("got a division by zero; needed a divisor other than zero")
    if m1 == 0:
        return np.int64(0), np.int64(0)
    t = fmt.precision
    x, y = np.uint64(abs(m1)), np.uint64(abs(m2))
    k = t - 1 if x >= y else t
    if t <= NARROW:
        n = x * _power(k)
        m = n // y
        rest = n - m * y
    else:
        m, rest = divided_by_word(high_product(x, _power(k)), x * _power(k), y)
    negative = (m1 < 0) != (m2 < 0)
    return number(fmt, m, e1 - e2 - k, rest + rest >= y, rest + rest == y, rest != _U0, negative)


@inner
def sqrt(fmt: Any, a: Any) -> Any:
    m, e = a
    if m < 0:
        raise ValueError("got the square root of a negative number; needed x >= 0")
    if m == 0:
        return np.int64(0), np.int64(0)
    # The root of a number with 2t - 1 or 2t digits and an even exponent has exactly t digits.
    k = fmt.precision - ((e - fmt.precision) & 1)
    x = np.uint64(m)
    high, low = high_product(x, _power(k)), x * _power(k)
    s = np.uint64(math.sqrt(np.float64(high) * _TWO_64 + np.float64(low)))
    # After one Newton step the remainder fits into 63 bits, and the root is off by at most two.
    square = s * s
    upper = np.int64(high - high_product(s, s) - (_U1 if low < square else _U0))
    remainder = np.float64(upper) * _TWO_64 + np.float64(low - square)
    root = np.int64(s) + np.int64(remainder / (2.0 * np.float64(s)))
    rest = np.int64(low - np.uint64(root) * np.uint64(root))
    while rest < 0:
        root -= 1
        rest += 2 * root + 1
    while rest > 2 * root:
        rest -= 2 * root + 1
        root += 1
    # Neither a tie nor a carry can occur: the root is below 10**t - 1/2.
    whole = np.uint64(root)
    return number(fmt, whole, (e - k) // 2, rest > root, False, rest > 0, False)


@inner
def round_(fmt: Any, x: Any) -> Any:
    """Round ``m * 10**e`` for any int64 m except the smallest."""
    m, e = x
    if m == 0:
        return np.int64(0), np.int64(0)
    n = np.uint64(abs(m))
    drop = _digits(n) - fmt.precision
    if drop <= 0:
        return _filled(fmt, n, e, m < 0)
    unit = _power(drop)
    q = n // unit
    rest = n - q * unit
    return number(fmt, q, e + drop, rest + rest >= unit, rest + rest == unit, rest != _U0, m < 0)


@inner
def compare(fmt: Any, a: Any, b: Any) -> Any:
    m1, e1 = a
    m2, e2 = b
    if e1 == e2 or m1 == 0 or m2 == 0 or (m1 < 0) != (m2 < 0):
        return (m1 > m2) - (m1 < m2)
    # Both have the same sign, so the larger exponent means the larger magnitude.
    return 1 if (e1 > e2) == (m1 > 0) else -1


@inner(forceinline=True)
def load(fmt: Any, words: Any, k: Any) -> Any:
    """The pair k."""
    return words[2 * k], words[2 * k + 1]


@inner(forceinline=True)
def put(fmt: Any, words: Any, k: Any, x: Any) -> None:
    words[2 * k], words[2 * k + 1] = x
