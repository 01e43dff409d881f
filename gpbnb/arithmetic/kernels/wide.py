"""Significands of two words: base 2 up to 113 bits, 16 up to 28 digits and 10 up to 34 digits, with any range.

A number is ``(negative, m, e)``, ``m * base**e`` with m of 128 bits. Zero is ``(False, 0, 0)``; every other number has
t digits, the last of which are zeros where numbers are subnormal or the spacing is fixed. An array holds three int64
for each number: the upper bits of m with its sign, never zero unless the number is; the `split` lower bits; and e.

Each operation gives an integer below 2**127 that is exact, or has more digits than t, and says whether others follow;
:func:`rounded` rounds it once. One compiled function serves all formats, since asking for the base costs only a branch
that the processor predicts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import from_bits, high_product, leading_zeros, select, trailing_zeros
from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.decimal import increment
from gpbnb.arithmetic.kernels.integers import (
    divided,
    divided_by_word,
    high_word,
    joined,
    length,
    low_word,
    product,
    reciprocal,
    shifted_left,
    wide,
    words_product,
)
from gpbnb.arithmetic.kernels.tags import ABRUPT, FARTHEST, FIXED, GRADUAL

_WORD = 2**64 - 1
_POWERS = [10**k for k in range(39)]
_NORMAL = [p << (128 - p.bit_length()) for p in _POWERS]


def _table(numbers: list[int]) -> Any:
    """Upper and lower words."""
    return np.array([[n >> 64, n & _WORD] for n in numbers], np.uint64)


_POWER, _DIVISOR = _table(_POWERS), _table(_NORMAL)
_SHIFT = np.array([128 - p.bit_length() for p in _POWERS], np.int64)
_RECIPROCAL = np.array([(2**192 - 1) // d - 2**64 for d in _NORMAL], np.uint64)
_FIVE = _table([5**k for k in range(56)])
_SPARE = 3  # digits that a product and an addend keep below those of the larger one
_MOST_PLACES = 55  # 5**55 has 128 bits

_U0, _U1 = np.uint64(0), np.uint64(1)
_ROOT = math.sqrt(2.0**63)
_CUT, _BELOW_62 = 2.0**16, 2.0**62 * (1 - 2.0**-51)
_OFFSET = 2.0**16 - 2.0**-20  # makes numbers positive, which a conversion to integers chops
_LOW_60 = np.uint64(2**60 - 1)


@inner(forceinline=True)
def _entry(table: Any, k: Any) -> Any:
    """A number of two words; with an unsigned index, numba need not test whether it is negative."""
    return joined(table[np.uint64(k), 0], table[np.uint64(k), 1])


@inner(forceinline=True)
def zero() -> Any:
    return False, wide(_U0), np.int64(0)


@inner(forceinline=True)
def _digits(fmt: Any, n: Any) -> Any:
    """Number of digits of n; 0 for zero."""
    count = length(n)
    if fmt.bits == 1:
        return count
    if fmt.bits == 4:
        return (count + 3) >> 2
    # floor(count log10 2): the number of digits, or one less.
    count = (count * 1233) >> 12
    return count + np.int64(n >= _entry(_POWER, count))


@inner(forceinline=True)
def _raised(fmt: Any, n: Any, k: Any) -> Any:
    """``n * base**k``, which must fit into 128 bits."""
    return n << (k * fmt.bits) if fmt.bits > 0 else n * _entry(_POWER, k)


@inner
def _lowered(fmt: Any, n: Any, k: Any) -> Any:
    """Divide n by ``base**k``, k > 0: quotient, and how the rest compares with half a unit: 0 none, 1, 2 half, 3."""
    if fmt.bits > 0:
        last = k * fmt.bits - 1
        q = n >> last
        half = wide(_U1) << last
        rest = n - ((q >> 1) << last << 1)
        q = q >> 1
    else:
        unit = _entry(_POWER, k)
        s = _SHIFT[np.uint64(k)]
        q, rest = divided((n >> 1) >> (127 - s), n << s, _entry(_DIVISOR, k), _RECIPROCAL[np.uint64(k)])
        rest, half = rest >> s, unit >> 1
    return q, np.int64(rest != wide(_U0)) + np.int64(rest >= half) + np.int64(rest > half)


@inner(forceinline=True)
def _cut(fmt: Any, high: Any, low: Any, k: Any) -> Any:
    """Divide 256 bits by ``base**k``: quotient, which must fit into 128 bits, and whether there is a rest."""
    if k == 0:
        return low, False
    if fmt.bits > 0:
        s = k * fmt.bits
        return (high << (128 - s)) | (low >> s), (low << (128 - s)) != wide(_U0)
    high, low = shifted_left(high, low, _SHIFT[np.uint64(k)])
    q, rest = divided(high, low, _entry(_DIVISOR, k), _RECIPROCAL[np.uint64(k)])
    return q, rest != wide(_U0)


@inner
def _enlarged(fmt: Any, n: Any, k: Any) -> Any:
    """``n * base**k`` in 256 bits, for a power below 2**128."""
    if fmt.bits > 0:
        return shifted_left(wide(_U0), n, k * fmt.bits)
    return product(n, _entry(_POWER, k))


@inner(forceinline=True)
def _longer(fmt: Any, high: Any, low: Any, k: Any) -> Any:
    """Multiply 256 bits by ``base**k``, for a power below 2**64 and a result below 2**256."""
    if fmt.bits > 0:
        return shifted_left(high, low, k * fmt.bits)
    carry, low = product(low, _entry(_POWER, k))
    return high * _entry(_POWER, k) + carry, low


@inner
def _without(fmt: Any, n: Any, k: Any) -> Any:
    """Divide n, of at most t digits, by ``base**k``, k >= 0: quotient, and whether there is a rest unless n is zero."""
    if k <= 0:
        return n, False
    if k > fmt.precision:
        return wide(_U0), True
    q, rest = _lowered(fmt, n, k)
    return q, rest != 0


@inner(forceinline=True)
def _beyond_room(fmt: Any, high: Any, low: Any) -> Any:
    """How many digits 256 bits have beyond `room`, or one more."""
    size = 128 + length(high) if high != wide(_U0) else length(low)
    if fmt.bits > 0:
        return max((size - 127) // fmt.bits + 1, 0)
    return max(((size * 1233) >> 12) + 1 - fmt.room, 0)


@inner(forceinline=True)
def number(fmt: Any, high: Any, low: Any, e: Any) -> Any:
    """The number of three int64."""
    # The lower part has less than 64 bits, and a shift by a number below 64 takes half as many instructions.
    return high < 0, (wide(np.uint64(abs(high))) << (fmt.split & 63)) | wide(np.uint64(low)), e


@inner(forceinline=True)
def parts(fmt: Any, x: Any) -> Any:
    """The three int64 of a number."""
    negative, m, e = x
    high = np.int64(low_word(m >> (fmt.split & 63)))
    return -high if negative else high, np.int64(low_word(m) & ((_U1 << np.uint64(fmt.split)) - _U1)), e


@inner
def _beyond(fmt: Any, negative: Any) -> Any:
    """The limit that replaces a result beyond the range; raises OverflowError where there is none."""
    if not fmt.saturates:
        raise OverflowError("got a result beyond the range of the format; needed one within; scale the numbers")
    limit = fmt.lowest if negative else fmt.largest
    return number(fmt, limit[0], limit[1], limit[2])


@inner(forceinline=True)
def _exceeds(fmt: Any, m: Any, e: Any, limit: Any) -> Any:
    if e != limit[2]:
        return e > limit[2]
    return m > number(fmt, limit[0], limit[1], limit[2])[1]


@inner(forceinline=True)
def _in_range(fmt: Any, negative: Any, n: Any, e: Any) -> Any:
    """The number of these t digits if the format has it, or what replaces it."""
    if fmt.small == ABRUPT and e < fmt.quantum:
        return zero()
    # The first comparison is predicted, the sign is not.
    if e >= min(fmt.lowest[2], fmt.largest[2]) and _exceeds(fmt, n, e, fmt.lowest if negative else fmt.largest):
        return _beyond(fmt, negative)
    if e < -FARTHEST:
        raise OverflowError("got a result with an exponent below -2**60; needed one above; scale the numbers")
    return negative, n, e


@inner
def rounded(fmt: Any, negative: Any, n: Any, more: Any, e: Any) -> Any:
    """Round ``(n + f) * base**e``, where f is 0, or between 0 and 1 if there are more digits."""
    if n == wide(_U0):
        return zero()
    t = fmt.precision
    count = _digits(fmt, n)
    drop = count - t
    if fmt.small == FIXED:
        drop = fmt.quantum - e
    elif fmt.small == GRADUAL:
        drop = max(drop, fmt.quantum - e)
    if drop > 0:
        if drop > count:
            q, rest = wide(_U0), 1
        else:
            q, rest = _lowered(fmt, n, drop)
        n = q
        up = increment(fmt, low_word(q), rest >= 2, (rest == 2) & (not more), (rest != 0) | more, negative)
        if up != _U0:
            n = n + wide(_U1)
        if n == wide(_U0):
            return zero()
        e += drop
        count = _digits(fmt, n)
    if count > t:  # n is a power of the base after a carry, or too large for fixed point
        n, rest = _lowered(fmt, n, count - t)
        if rest != 0:
            return _beyond(fmt, negative)
        e += count - t
    elif count < t:
        n = _raised(fmt, n, t - count)
        e -= t - count
    return _in_range(fmt, negative, n, e)


@inner(forceinline=True)
def _one_word(fmt: Any) -> Any:
    """Whether words serve, also for a sum with another digit and bit: base 2 up to 61 bits, 16 up to 14 digits."""
    return (fmt.bits > 0) & (fmt.bits * (fmt.precision + 1) <= 62)


@inner(forceinline=True)
def _rounded_word(fmt: Any, negative: Any, n: Any, more: Any, e: Any) -> Any:
    """:func:`rounded` for a word n, if the format's numbers are words, too."""
    if n == _U0:
        return zero()
    t, digit = np.int64(fmt.precision), fmt.bits >> 1
    drop = ((63 - leading_zeros(n)) >> digit) + 1 - t
    if fmt.small == FIXED:
        drop = fmt.quantum - e
    elif fmt.small == GRADUAL:
        drop = max(drop, fmt.quantum - e)
    if drop > 0:
        e += drop
        if drop > 64 >> digit:
            n, more, drop = _U0, True, np.int64(64 >> digit)
        last = np.uint64((drop << digit) - 1)
        q = n >> last
        rest = np.uint64(more | ((q << last) != n))
        n, half = q >> _U1, q & _U1
        n += increment(fmt, n, half, half & ~rest, half | rest, negative)
        if n == _U0:
            return zero()
    if (n >> np.uint64(t << digit)) != _U0:  # a power of the base after a carry, or too large for fixed point
        return rounded(fmt, negative, wide(n), False, e)
    up = t - 1 - ((63 - leading_zeros(n)) >> digit)
    return _in_range(fmt, negative, wide(n << np.uint64(up << digit)), e - up)


@inner(forceinline=True)
def _rounded_bits(fmt: Any, negative: Any, n: Any, more: Any, e: Any, k: Any) -> Any:
    """:func:`_rounded_word` of ``(n + f) * base**e * 2**k``, where n has 62 bits."""
    if fmt.bits == 1:
        return _rounded_word(fmt, negative, n, more, e + k)
    s = np.uint64(-k & 3)
    cut = n >> s
    return _rounded_word(fmt, negative, cut, more | ((cut << s) != n), e + ((k + 3) >> 2))


@inner(forceinline=True)
def _up(fmt: Any, n: Any) -> Any:
    """By how many bits to shift a significand to the left, so that it has 61."""
    return leading_zeros(n) - 3 if fmt.bits == 4 else np.int64(61 - fmt.precision)


@inner(forceinline=True)
def _add_words(fmt: Any, a: Any, b: Any) -> Any:
    # Which number is the larger, and which of the signs, no processor predicts, so that branches would cost more.
    spare, digit, swapped = np.int64(2 if fmt.bits == 1 else 1), fmt.bits >> 1, a[2] < b[2]
    up = np.uint64(spare << digit)
    m, k = low_word(a[1]) << up, low_word(b[1]) << up
    negative, other = select(swapped, b[0], a[0]), select(swapped, a[0], b[0])
    x, y, e = select(swapped, k, m), select(swapped, m, k), max(a[2], b[2])
    # The smaller number is cut off two digits below the last of the larger one in base 2, one in base 16.
    s = np.uint64(min(abs(a[2] - b[2]), 63 >> digit) << digit)
    lower = y >> s
    more, opposed, less = (lower << s) != y, negative != other, x < lower
    n = select(less, lower - x, x - lower - np.uint64(more))  # nothing is cut off if x is less
    n = select(opposed, n, x + lower)
    if more & (fmt.bits == 4) and (n >> np.uint64(fmt.precision << digit)) == _U0:
        return _add_long(fmt, a, b)  # a digit less is left, so that digits which were cut off decide
    return _rounded_word(fmt, select(opposed & less, other, negative), n, more, e - spare)


@inner(forceinline=True)
def add(fmt: Any, a: Any, b: Any) -> Any:
    if a[1] == wide(_U0):
        return round_(fmt, b)  # the opposite of a lowest number, if it was subtracted
    if b[1] == wide(_U0):
        return a
    return _add_words(fmt, a, b) if _one_word(fmt) else _add_long(fmt, a, b)


@inner(forceinline=True)
def _add_long(fmt: Any, a: Any, b: Any) -> Any:
    negative, x, e = a
    other, y, f = b
    if e < f:
        negative, x, e, other, y, f = other, y, f, negative, x, e
    # The larger number gets more digits at its end, and the smaller one is cut off at the last of them.
    d = e - f
    k = min(d, fmt.room - fmt.precision)
    x, e = _raised(fmt, x, k), e - k
    y, more = _without(fmt, y, d - k)
    if negative == other:
        n = x + y
    elif x >= y:
        n = x - y
        if more:  # then x has digits to spare
            n = n - wide(_U1)
    else:
        n, negative = y - x, other
    return rounded(fmt, negative, n, more, e)


@inner(forceinline=True)
def opposite(fmt: Any, a: Any) -> Any:
    return (not a[0]) & (a[1] != wide(_U0)), a[1], a[2]


@inner(forceinline=True)
def negative(fmt: Any, a: Any) -> Any:
    return round_(fmt, opposite(fmt, a))


@inner(forceinline=True)
def load(fmt: Any, words: Any, k: Any) -> Any:
    """The number k."""
    return number(fmt, words[3 * k], words[3 * k + 1], words[3 * k + 2])


@inner(forceinline=True)
def put(fmt: Any, words: Any, k: Any, x: Any) -> None:
    words[3 * k], words[3 * k + 1], words[3 * k + 2] = parts(fmt, x)


@inner(forceinline=True)
def multiply(fmt: Any, a: Any, b: Any) -> Any:
    if a[1] == wide(_U0) or b[1] == wide(_U0):
        return zero()
    if _one_word(fmt):
        k = np.int64(64 - fmt.bits * fmt.precision)
        x, y = low_word(a[1]) << np.uint64(k), low_word(b[1]) << np.uint64(k)
        e = a[2] + b[2] + ((64 - 2 * k) >> (fmt.bits >> 1))
        return _rounded_word(fmt, a[0] != b[0], high_product(x, y), x * y != _U0, e)
    return _multiply_long(fmt, a, b)


@inner
def _multiply_long(fmt: Any, a: Any, b: Any) -> Any:
    k = max(2 * fmt.precision - fmt.room, 0)
    high, low = product(a[1], b[1])
    n, more = _cut(fmt, high, low, k)
    return rounded(fmt, a[0] != b[0], n, more, a[2] + b[2] + k)


@inner
def fused(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    """``a * b + c``, rounded once."""
    if a[1] == wide(_U0) or b[1] == wide(_U0):
        return round_(fmt, c)
    if c[1] == wide(_U0):
        return multiply(fmt, a, b)
    negative, t, more = a[0] != b[0], fmt.precision, False
    high, low = product(a[1], b[1])
    upper, lower, e = wide(_U0), c[1], a[2] + b[2]
    # The number that ends higher gets more digits at its end, so that the other one is only cut off where both cannot
    # cancel: the sum then keeps more digits than t.
    d = e - c[2]
    if d >= 0:
        k = min(d, _SPARE)
        high, low = _longer(fmt, high, low, k)
        e -= k
        lower, more = _without(fmt, lower, d - k)
    elif -d <= t + _SPARE:
        upper, lower = _enlarged(fmt, lower, -d)
    else:
        low, more = _cut(fmt, high, low, t)
        high, lower, e = wide(_U0), _raised(fmt, lower, np.int64(_SPARE)), c[2] - _SPARE
        low, further = _without(fmt, low, -d - t - _SPARE)
        more |= further
    if negative == c[0]:
        low = low + lower
        high = high + upper + wide(np.uint64(low < lower))
    else:
        if high < upper or (high == upper and low < lower):
            negative, high, low, upper, lower = c[0], upper, lower, high, low
        high = high - upper - wide(np.uint64(low < lower))
        low = low - lower
        if more:  # then the number that was not cut off is larger
            high = high - wide(np.uint64(low == wide(_U0)))
            low = low - wide(_U1)
    k = _beyond_room(fmt, high, low)
    n, further = _cut(fmt, high, low, k)
    return rounded(fmt, negative, n, more | further, e + k)


@inner(error_model="numpy", forceinline=True)
def _quotient_of_words(x: Any, y: Any) -> Any:
    """floor(2**62 x / y) for 2**60 <= x, y < 2**61, a word below 2**63, and whether there is a rest."""
    # float64 gives 50 bits. Its quotient of what is left gives the others, with a margin for errors, so that at most 1
    # is missing. The factor keeps the first below 2**63 where x is rounded to 2**61.
    reciprocal = 1.0 / np.float64(np.int64(y))
    q = np.uint64(np.int64(np.float64(np.int64(x)) * reciprocal * _BELOW_62))
    rest = np.float64(np.int64(low_word(((wide(x) << 62) - words_product(q, y)) >> 16))) * _CUT
    q += np.uint64(np.int64(rest * reciprocal + _OFFSET) - np.int64(_OFFSET + 1.0))
    r = (x << np.uint64(62)) - q * y  # below 2 y
    one = r >= y
    return q + np.uint64(one), (r != _U0) & (r != y)


@inner(forceinline=True)
def divide(fmt: Any, a: Any, b: Any) -> Any:
    if b[1] == wide(_U0):
        raise ZeroDivisionError("got a division by zero; needed a divisor other than zero")
    if a[1] == wide(_U0):
        return zero()
    if _one_word(fmt):
        x, y = low_word(a[1]), low_word(b[1])
        k, s = _up(fmt, x), _up(fmt, y)
        q, more = _quotient_of_words(x << np.uint64(k), y << np.uint64(s))
        return _rounded_bits(fmt, a[0] != b[0], q, more, a[2] - b[2], s - k - 62)
    return _divide_long(fmt, a, b)


@inner
def _divide_long(fmt: Any, a: Any, b: Any) -> Any:
    k = fmt.room - 1
    high, low = _enlarged(fmt, a[1], k)
    s = 128 - length(b[1])
    d = b[1] << s
    high, low = shifted_left(high, low, s)
    n, rest = divided(high, low, d, reciprocal(d))
    return rounded(fmt, a[0] != b[0], n, rest != wide(_U0), a[2] - b[2] - k)


@inner(error_model="numpy", forceinline=True)
def _root_of_126_bits(n: Any) -> Any:
    """floor(sqrt(n)) for 2**124 <= n < 2**126, a word."""
    # float64 gives 50 bits. Newton's step gives the others, with a margin for its errors, so that at most 1 is missing.
    near = math.sqrt(np.float64(np.int64(low_word(n >> 63)))) * _ROOT
    s = np.uint64(np.int64(near))
    # Of the rest, a number of either sign below 2**78 in two's complement, 63 bits suffice.
    rest = np.float64(np.int64(low_word((n - words_product(s, s)) >> 16))) * 2.0**15
    s += np.uint64(np.int64(rest / near + _OFFSET) - np.int64(_OFFSET + 1.0))
    return s + np.uint64(n - words_product(s, s) > wide(s) << 1)


@inner(error_model="numpy", forceinline=True)
def _root_of_word(x: Any) -> Any:
    """floor(sqrt(2**62 x)) for 2**60 <= x < 2**62, a word below 2**62, and whether there is a rest."""
    near = math.sqrt(np.float64(np.int64(x))) * 2.0**31
    s = np.uint64(np.int64(near))
    rest = np.float64(np.int64(low_word(((wide(x) << 62) - words_product(s, s)) >> 16))) * 2.0**15
    s += np.uint64(np.int64(rest / near + _OFFSET) - np.int64(_OFFSET + 1.0))
    r = (x << np.uint64(62)) - s * s  # below 2**64
    twice = s + s
    return s + np.uint64(r > twice), (r != _U0) & (r != twice + _U1)


@inner(forceinline=True)
def sqrt(fmt: Any, a: Any) -> Any:
    if a[0]:
        raise ValueError("got the square root of a negative number; needed x >= 0")
    if a[1] == wide(_U0):
        return zero()
    if _one_word(fmt):
        half = a[2] >> 1
        odd = (a[2] & 1) * fmt.bits  # the number is base**(2 half) * 2**odd times the significand
        k = _up(fmt, low_word(a[1]))
        k += (odd - k) & 1
        root, more = _root_of_word(low_word(a[1]) << np.uint64(k))
        return _rounded_bits(fmt, False, root, more, half, (odd - k - 62) >> 1)
    return _root_long(fmt, a)


@inner
def _root_long(fmt: Any, a: Any) -> Any:
    # The root of a number with 2t + 1 or 2t + 2 digits and an even exponent has t + 1.
    k = fmt.precision + 2 - ((a[2] - fmt.precision) & 1)
    high, low = _enlarged(fmt, a[1], k)
    # Shifted by an even number of bits, it has 245 or 246. The root of the first 126 comes first, then 60 bits more:
    # Zimmermann, Karatsuba square root (1999).
    size = 128 + length(high) if high != wide(_U0) else length(low)
    s = (246 - size) >> 1
    if 2 * s >= 128:
        high, low = low << (2 * s - 128), wide(_U0)
    else:
        high, low = shifted_left(high, low, 2 * s)
    first = (high << 8) | (low >> 120)
    root = _root_of_126_bits(first)
    if s >= 60:  # the other bits are zeros
        return rounded(fmt, False, wide(root) >> (s - 60), wide(root) * wide(root) != first, (a[2] - k) >> 1)
    rest = (first - wide(root) * wide(root)) << 60 | ((low >> 60) & wide(_LOW_60))
    digit, rest_word = divided_by_word(high_word(rest), low_word(rest), root + root)
    rest = (wide(rest_word) << 60) | (low & wide(_LOW_60))
    whole = (wide(root) << 60) + wide(digit)
    square = wide(digit) * wide(digit)
    # The rest is negative if the second digit is too large.
    while rest < square:
        rest = rest + whole + whole - wide(_U1)
        whole = whole - wide(_U1)
    return rounded(fmt, False, whole >> s, rest != square, (a[2] - k) >> 1)


@inner(forceinline=True)
def round_(fmt: Any, x: Any) -> Any:
    """Round ``m * base**e`` for any m of at most `room` digits."""
    return rounded(fmt, x[0], x[1], False, x[2])


@inner
def compare(fmt: Any, a: Any, b: Any) -> Any:
    if a[0] != b[0]:
        return -1 if a[0] else 1
    larger: Any = 0
    if a[1] == wide(_U0) or b[1] == wide(_U0) or a[2] == b[2]:
        larger = np.int64(a[1] > b[1]) - np.int64(a[1] < b[1])
    else:
        larger = 1 if a[2] > b[2] else -1
    return -larger if a[0] else larger


# -- conversion ----------------------------------------------------------------------------------------


@inner
def _exactly(fmt: Any, n: Any, e: Any, m: Any, f: Any) -> Any:
    """Whether ``n * base**e`` equals ``m * base**f``."""
    if n == wide(_U0) or m == wide(_U0):
        return n == m
    d = f - e
    if _digits(fmt, n) != _digits(fmt, m) + d:
        return False
    return _raised(fmt, m, d) == n if d >= 0 else _raised(fmt, n, -d) == m


@inner
def _from_binary(fmt: Any, n: Any, more: Any, k: Any) -> Any:
    """Return ``(n + f) * 2**k``, f as in :func:`rounded`, as n, `more` and e in the base, and whether that succeeded.

    If there are more digits, n has at least 127 bits, and the base is a power of two.
    """
    if n == wide(_U0):
        return n, False, np.int64(0), True
    if fmt.bits > 0:
        spare = max(length(n) - 122, 0)
        more |= (n & ((wide(_U1) << spare) - wide(_U1))) != wide(_U0)
        e = (k + spare) // fmt.bits
        return (n >> spare) << (k + spare - e * fmt.bits), more, e, True
    word = low_word(n)
    zeros = trailing_zeros(word) if word != _U0 else 64 + trailing_zeros(high_word(n))
    n, places = n >> zeros, -(k + zeros)
    if places <= 0:
        possible = length(n) - places <= 120
        return n << (-places if possible else 0), False, np.int64(0), possible
    # With 5**p of p log2 5 bits, the product n * 5**places takes at most 246 bits.
    if places > 2 * _MOST_PLACES or length(n) + ((places * 1189) >> 9) + 1 > 246:
        return n, False, np.int64(0), False
    first = min(places, _MOST_PLACES)
    high, low = product(n, _entry(_FIVE, first))
    if places > first:
        rest = _entry(_FIVE, places - first)
        carried, low = product(low, rest)
        high = high * rest + carried
    excess = _beyond_room(fmt, high, low)
    n, more = _cut(fmt, high, low, excess)
    return n, more, excess - places, True


@inner
def _in_binary(fmt: Any, m: Any, e: Any) -> Any:
    """Return ``m * base**e`` as ``(n + f) * 2**k``: n, whether f > 0, k, and whether that succeeded.

    If f > 0, n has at least 127 bits.
    """
    if fmt.bits > 0:
        return m, False, e * fmt.bits, True
    if e > 38 or e < -38:
        return m, False, np.int64(0), False
    if e >= 0:
        high, low = product(m, _entry(_POWER, e))
        if high == wide(_U0):
            return low, False, np.int64(0), True
        s = 128 - length(high)
        high, low = shifted_left(high, low, s)
        return high, low != wide(_U0), 128 - s, True
    k = np.uint64(-e)
    s = 128 - length(m)
    q, rest = divided((m << s) >> 1, wide(_U0), _entry(_DIVISOR, k), _RECIPROCAL[k])
    return q, rest != wide(_U0), _SHIFT[k] - s - 127, True


@compiled
def converted(source: Any, fmt: Any, exactly: bool, n: int, a: Any, out: Any, states: Any) -> None:
    """Round numbers of one format to another, in any base.

    states[i] is 2 if the entry needs exact arithmetic, 1 if it is rounded although it must not be, `exactly`, else 0.
    Raises OverflowError.
    """
    for i in range(n):
        negative, m, e = number(source, a[0][i], a[1][i], a[2][i])
        more, possible = False, True
        if source.bits != fmt.bits and m != wide(_U0):
            m, more, e, possible = _in_binary(source, m, e)
            if possible:
                m, more, e, possible = _from_binary(fmt, m, more, e)
        x = zero()
        states[i] = 2
        if possible:
            x = rounded(fmt, negative, m, more, e)
            states[i] = exactly and (more or not _exactly(fmt, m, e, x[1], x[2]))
        out[0][i], out[1][i], out[2][i] = parts(fmt, x)


@compiled
def to_floats(fmt: Any, n: int, a: Any, out: Any, states: Any) -> None:
    """Round numbers to the nearest float64, ties to even; states[i] is 2 if the entry needs exact arithmetic."""
    for i in range(n):
        negative, m, e = number(fmt, a[0][i], a[1][i], a[2][i])
        out[i], states[i] = 0.0, 0
        if m == wide(_U0):
            continue
        m, more, k, possible = _in_binary(fmt, m, e)
        size = length(m)
        exponent = size - 1 + k  # of the highest bit
        if not possible or exponent < -1021 or exponent > 1022:
            states[i] = 2
            continue
        m = m << (128 - size)
        whole = np.int64(low_word(m >> 75))
        rest = m & ((wide(_U1) << 75) - wide(_U1))
        half = wide(_U1) << 74
        up = rest > half or (rest == half and (more or (whole & 1) == 1))
        x = from_bits(((exponent + 1022) << 52) + whole + np.int64(up))  # a carry leads to the next exponent
        out[i] = -x if negative else x
