"""Conversion between float64 and base 10, correctly rounded.

A power of ten is stored to 128 bits, cut off. Its product with a significand of 64 bits has 192, of which the last 64
are uncertain. The next 64 bits below the wanted ones decide a rounding, unless they are within one unit of a tie or of
an exact number; then the entry is left to exact arithmetic. Numbers with few binary places have exact decimal digits in
64 bits, which are rounded as they are. Lemire, Number parsing at a gigabyte per second (2021), uses the same products.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels import decimal
from gpbnb.arithmetic.kernels.bits import bits, from_bits, high_product, leading_zeros, trailing_zeros
from gpbnb.arithmetic.kernels.compiling import compiled, inner

_LEAST, _MOST = -345, 345  # decimal exponents of the table
_U1 = np.uint64(1)
_EXPONENT, _FRACTION = np.int64(0x7FF), np.int64((1 << 52) - 1)
_HALF_RANGE = np.uint64(2**63 - 1)
_LONGEST = 27  # binary places p for which 5**p fits into 63 bits


def _powers() -> tuple[Any, ...]:
    """Upper and lower halves of 10**q to 128 bits, and exponents: 10**q is about (upper * 2**64 + lower) * 2**e."""
    whole, exponents = [], []
    for q in range(_LEAST, _MOST + 1):
        n, d = (10**q, 1) if q >= 0 else (1, 10**-q)
        e = n.bit_length() - d.bit_length() - 128
        cut = (n << -e) // d if e < 0 else n // (d << e)
        while cut >= 1 << 128:
            cut, e = cut >> 1, e + 1
        while cut < 1 << 127:
            e -= 1
            cut = (n << -e) // d if e < 0 else n // (d << e)
        whole.append(cut)
        exponents.append(e)
    halves = [np.array([(cut >> shift) & (2**64 - 1) for cut in whole], np.uint64) for shift in (64, 0)]
    return (*halves, np.array(exponents, np.int64))


_UPPER, _LOWER, _POWER = _powers()
_FIVE = np.array([5**p for p in range(_LONGEST + 1)], np.uint64)


@inner(forceinline=True)
def _scaled(m: Any, q: Any) -> Any:
    """The upper two of the three words of m * 10**q, cut off, and the exponent of the highest word."""
    k = np.uint64(q - _LEAST)
    upper, lower = _UPPER[k], _LOWER[k]
    middle, top = m * upper, high_product(m, upper)
    carry = high_product(m, lower)
    low = middle + carry
    return top + (_U1 if low < carry else np.uint64(0)), low, _POWER[k] + 128


@inner(forceinline=True)
def _uncertain(fraction: Any) -> Any:
    """Whether 64 bits of a fraction are next to 0, 1/2 or 1."""
    return ((fraction + np.uint64(2)) & _HALF_RANGE) <= np.uint64(3)


@compiled
def from_floats(fmt: Any, n: int, x: Any, out: Any, states: Any) -> None:
    """Round float64 numbers to pairs; states[i] is 0 if that is exact, 1 if not, 2 if the entry needs exact arithmetic.

    Raises OverflowError like the operations of base 10.
    """
    t = fmt.precision
    for i in range(n):
        u = bits(x[i])
        exponent, fraction = (u >> 52) & _EXPONENT, u & _FRACTION
        if exponent == 0 or exponent == _EXPONENT:
            out[0][i], out[1][i], states[i] = 0, 0, (0 if u << 1 == 0 else 2)
            continue
        m, k = np.uint64(fraction | (np.int64(1) << 52)), exponent - 1075
        zeros = trailing_zeros(m)
        short, places = m >> np.uint64(zeros), -(k + zeros)
        if places <= 0 and k + zeros <= 10:
            short, places = short << np.uint64(-places), 0
        if 0 <= places <= _LONGEST and high_product(short, _FIVE[places]) == 0 and short * _FIVE[places] < _HALF_RANGE:
            digits = np.int64(short * _FIVE[places])
            pair = decimal.round_(fmt, ((-digits if u < 0 else digits), -places))
            drop = pair[1] + places
            power = np.int64(decimal.POWER[abs(drop)]) if abs(drop) < 19 else np.int64(0)
            kept = digits * power == abs(pair[0]) if drop < 0 else abs(pair[0]) * power == digits
            out[0][i], out[1][i], states[i] = pair[0], pair[1], (0 if kept else 1)
            continue
        # floor((k + 52) log10 2): the decimal exponent, or one less
        q = t - 1 - (((k + 52) * 78913) >> 18)
        for _ in range(2):
            top, low, power = _scaled(m << np.uint64(11), q)
            # The number is about (top + low / 2**64) * 2**down.
            down = power + k - 11
            whole = top >> np.uint64(-down)
            if whole < decimal.POWER[t]:
                break
            q -= 1
        rest = (top << np.uint64(64 + down)) | (low >> np.uint64(-down))
        if _uncertain(rest):
            out[0][i], out[1][i], states[i] = 0, 0, 2
        else:
            pair = decimal.number(fmt, whole, -q, rest > _HALF_RANGE, False, True, u < 0)
            out[0][i], out[1][i], states[i] = pair[0], pair[1], 1


@compiled
def to_floats(n: int, m: Any, e: Any, out: Any, states: Any) -> None:
    """Round pairs to the nearest float64, ties to even; states[i] is 2 if the entry needs exact arithmetic."""
    for i in range(n):
        states[i] = 0
        if m[i] == 0:
            out[i] = 0.0
            continue
        if e[i] < _LEAST or e[i] > _MOST:
            states[i] = 2
            continue
        size = np.uint64(abs(m[i]))
        shift = leading_zeros(size)
        top, low, power = _scaled(size << np.uint64(shift), e[i])
        spare = leading_zeros(top)  # 0 or 1
        if spare > 0:
            top = (top << _U1) | (low >> np.uint64(63))
            low <<= _U1
        exponent = power - shift - spare + 63  # of the highest bit
        rest = (top << np.uint64(53)) | (low >> np.uint64(11))
        if _uncertain(rest) or exponent < -1021 or exponent > 1022:
            states[i] = 2
            continue
        whole = np.int64((top >> np.uint64(11)) + np.uint64(rest > _HALF_RANGE))  # a carry leads to the next exponent
        number = from_bits(((exponent + 1022) << 52) + whole)
        out[i] = -number if m[i] < 0 else number
