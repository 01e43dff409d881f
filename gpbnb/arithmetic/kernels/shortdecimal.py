"""Base 10 with 1 to 8 digits: like :mod:`gpbnb.arithmetic.kernels.decimal`, in 64 bits and almost without branches.

A processor cannot predict how many digits a sum or product has, or which operand is larger, and each wrong guess costs
as much as the operation itself. So the code branches on neither: it shifts a result until it has a known number of
digits or one less, and handles the rest with a table and selections.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import high_product, leading_zeros, select
from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.decimal import (
    HALF,
    INVERSE,
    LENGTH,
    POWER,
    check,
    compare,
    divide,
    load,
    negative,
    opposite,
    put,
    round_,
    sqrt,
)

__all__ = [
    "add", "compare", "divide", "load", "multiply", "negative", "opposite", "put", "round_", "sqrt",
]  # fmt: skip

_DIGITS = 18  # of a sum at most: t of the larger number, and t + 2 below them
_ZERO = np.int64(0), np.int64(0)

# For each number of leading zeros of n < 10**18: the largest decimal shift that never gives more than 18 digits.
# Numbers that rounding carries to 10**j are above 0.95 * 10**j. For j < 18 no power of two lies between the two, so
# these numbers have as many leading zeros as 10**j itself and get one digit less. A sum of 18 digits (t = 8) is never
# carried: the part below its t digits is less than 0.01 units.
_SPARE = np.array([max(_DIGITS - len(str(2 ** (64 - zeros) - 1)), 0) for zeros in range(65)], np.int64)
_SHIFT = np.array([10**k for k in _SPARE.tolist()], np.uint64)


@inner(forceinline=True)
def _rule(fmt: Any, digits: Any) -> Any:
    """Constants to round this many digits, or one less, to t; found before any branch, so only once per loop."""
    cut, nearest = np.uint64(digits - fmt.precision), np.uint64(fmt.nearest)
    # A number with one digit less that rounding would carry is treated as having all: the result is the same.
    limit = POWER[np.uint64(digits - 1)] - HALF[(cut - np.uint64(1)) * nearest]
    return limit, HALF[cut * nearest], INVERSE[cut], LENGTH[cut]


@inner(forceinline=True)
def _rounded(rule: Any, n: Any, e: Any, negative: Any) -> Any:
    """Round n by its rule, unchecked; e is its exponent if it has all digits. For n = 0, ignore the exponent."""
    limit, half, inverse, length = rule
    short = n < limit
    n = select(short, n * np.uint64(10), n)
    m = np.int64(high_product(n + half, inverse) >> length)
    return select(negative, -m, m), e - np.int64(short)


@inner(forceinline=True)
def _product(fmt: Any, rule: Any, a: Any, b: Any) -> Any:
    """The product, unchecked: it has 2t or 2t - 1 digits and is at most (10**t - 1)**2, which is not carried."""
    p = a[0] * b[0]
    return _rounded(rule, np.uint64(abs(p)), a[1] + fmt.precision + b[1], p < 0)


@inner(forceinline=True)
def _sum(fmt: Any, rule: Any, a: Any, b: Any) -> Any:
    """Add two numbers; a zero may have any exponent."""
    t = fmt.precision
    m1, e1 = a
    m2, e2 = b
    swap = e1 < e2
    m1, m2 = select(swap, m2, m1), select(swap, m1, m2)
    e1, e2 = select(swap, e2, e1), select(swap, e1, e2)
    # The processor predicts this branch well; a selection would make d wait for the significands.
    if m1 == 0:
        return _checked(m2, e2)
    # If the exponents differ by more than t + 2, only the sign of the smaller number matters: it is below 1/100 of a
    # unit of the larger, and the nearest number or midpoint is at least 1/20 away, even just below a power of ten.
    d = min(e1 - e2, t + 2)
    s = m1 * np.int64(POWER[np.uint64(d)]) + m2
    if s == 0:
        return _ZERO
    n = np.uint64(abs(s))
    zeros = np.uint64(leading_zeros(n))
    m, e = _rounded(rule, n * _SHIFT[zeros], e1 + (_DIGITS - t) - d - _SPARE[zeros], s < 0)
    check(e)
    return m, e


@inner(forceinline=True)
def _checked(m: Any, e: Any) -> Any:
    if m == 0:
        return _ZERO
    check(e)
    return m, e


@inner(forceinline=True)
def add(fmt: Any, a: Any, b: Any) -> Any:
    return _sum(fmt, _rule(fmt, _DIGITS), a, b)


@inner(forceinline=True)
def multiply(fmt: Any, a: Any, b: Any) -> Any:
    m, e = _product(fmt, _rule(fmt, 2 * fmt.precision), a, b)
    return _checked(m, e)
