"""Compiled products for the filter's step, which skip factors of zero and leading factors of one.

Products with zero or one and sums with zero are exact, so no digit changes. The inner loops run along rows, whose
numbers are adjacent in memory, so that the processor handles several at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels.bits import ADDING_MULTIPLES, bits
from gpbnb.arithmetic.kernels.compiling import borrowing
from gpbnb.arithmetic.kernels.matrices import MANY, product_in_order, stays_within
from gpbnb.arithmetic.kernels.planes import product_in_planes
from gpbnb.arithmetic.kernels.scalar import (
    add,
    check,
    compare,
    first_product,
    freed,
    load,
    multiply_add,
    one,
    put,
    store,
    zero,
)
from gpbnb.arithmetic.kernels.tags import SAFE_TWICE, Binary

SOME = 100  # multiplications in a product by a measurement matrix, from which on the same look pays
_MAGNITUDE = np.int64(2**63 - 1)
_LEAST, _LARGEST = np.int64((1023 - 400) << 52), np.int64((1023 + 400) << 52)


@borrowing
def _is_moderate(a: Any) -> Any:
    """Whether all numbers are zero or between 2**-400 and 2**400 in magnitude."""
    numbers = a.reshape(a.size)  # in one loop, which is vectorized
    least, largest = _LARGEST, np.int64(0)
    for i in range(numbers.shape[0]):
        size = bits(numbers[i]) & _MAGNITUDE
        least = min(least, size if size != 0 else _LARGEST)
        largest = max(largest, size)
    return least >= _LEAST and largest < _LARGEST


_add_4, _add_2, _add_1 = ADDING_MULTIPLES


@borrowing(forceinline=True)
def _add_multiples(c: Any, i: Any, b: Any, k: Any, factor: Any, half: Any, mask: Any) -> None:
    """Add a multiple of row k of b to row i of c, both contiguous in memory."""
    width = b.shape[1]
    i, k, end = i * width, k * width, (i + 1) * width
    while i + 4 <= end:
        _add_4(c, i, b, k, factor, half, mask)
        i, k = i + 4, k + 4
    if i + 2 <= end:
        _add_2(c, i, b, k, factor, half, mask)
        i, k = i + 2, k + 2
    if i < end:
        _add_1(c, i, b, k, factor, half, mask)


def _short_product(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    """c = a b if the format is short and the numbers are moderate; returns whether they are."""
    raise TypeError("got a call of _short_product from Python; needed one from a function compiled by numba")


@overload(_short_product, strict=False, jit_options={"_nrt": False})
def _overloaded_short_product(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    def of_binary(fmt: Any, a: Any, b: Any, c: Any) -> Any:
        # Up to 25 bits, rounding a float64 result again is correct. Nothing leaves the range of float64: products are
        # at least 2**-800, and sums are multiples of 2**-850. So no operation needs a check.
        if not fmt.nearest or fmt.precision > SAFE_TWICE or not _is_moderate(a) or not _is_moderate(b):
            return False
        unit = np.int64(1) << (53 - fmt.precision)
        half, mask = unit >> 1, -unit
        for i in range(a.shape[0]):
            for j in range(b.shape[1]):
                c[i, j] = 0.0
        for k in range(a.shape[1]):
            for i in range(a.shape[0]):
                factor = a[i, k]
                if factor != 0.0:
                    _add_multiples(c, i, b, k, factor, half, mask)
        return True

    binary = getattr(fmt, "instance_class", None) is Binary and a.layout == b.layout == c.layout == "C"
    return of_binary if binary else lambda fmt, a, b, c: False


@borrowing(forceinline=True)
def _with_units(fmt: Any, a: Any, b: Any, c: Any) -> None:
    for i in range(a.shape[0]):
        fresh = True
        for k in range(a.shape[1]):
            factor = load(fmt, a, (i, k))
            if compare(fmt, factor, zero(fmt)) == 0:
                continue
            if fresh and compare(fmt, factor, one(fmt)) == 0:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), load(fmt, b, (k, j)))
            elif fresh:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), first_product(fmt, factor, load(fmt, b, (k, j))))
            else:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), multiply_add(fmt, factor, load(fmt, b, (k, j)), load(fmt, c, (i, j))))
            fresh = False
        if fresh:
            for j in range(b.shape[1]):
                put(fmt, c, (i, j), zero(fmt))


@borrowing
def product_with_units(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """c = a b, each entry summed from left to right over the nonzero entries of a; c must be neither a nor b."""
    if product_in_order(fmt, a, b, c) or product_in_planes(fmt, a, b, c):
        return
    # A square matrix is one of a transition, mostly zeros and ones, so that few products are rounded.
    least = MANY if a.shape[0] == a.shape[1] else SOME
    if a.shape[0] * a.shape[1] * b.shape[1] >= least and _short_product(fmt, a, b, c):
        return
    if stays_within(fmt, a, b, MANY):
        _with_units(freed(fmt), a, b, c)
    else:
        _with_units(fmt, a, b, c)
        check(fmt, c)


@borrowing(forceinline=True)
def _by_columns(fmt: Any, a: Any, b: Any, c: Any) -> None:
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            put(fmt, c, (i, j), zero(fmt))
    for k in range(a.shape[1]):
        for i in range(a.shape[0]):
            factor = load(fmt, a, (i, k))
            if compare(fmt, factor, zero(fmt)) != 0:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), multiply_add(fmt, factor, load(fmt, b, (k, j)), load(fmt, c, (i, j))))


@borrowing
def product_by_columns(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """Like :func:`product_with_units`, with the same digits, but one column of a at a time.

    A column adds one product to each row of c; the processor computes several rows at once, because none waits for
    another.
    """
    if _short_product(fmt, a, b, c) or product_in_order(fmt, a, b, c) or product_in_planes(fmt, a, b, c):
        return
    if stays_within(fmt, a, b, MANY):
        _by_columns(freed(fmt), a, b, c)
    else:
        _by_columns(fmt, a, b, c)
        check(fmt, c)


@borrowing
def add_transposed(fmt: Any, a: Any, c: Any) -> None:
    """c = c + a', skipping the zero entries of a."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            x = load(fmt, a, (i, j))
            if compare(fmt, x, zero(fmt)) != 0:
                store(fmt, c, (j, i), add(fmt, load(fmt, c, (j, i)), x))
