"""Compiled loops over matrices for the topics' recursions, written once for every tag.

They are compiled into the loops that call them. Multiplications by zero are skipped: products with zero and sums with
zero are exact, so no digit changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels.bits import bits, from_bits
from gpbnb.arithmetic.kernels.compiling import borrowing, inner
from gpbnb.arithmetic.kernels.planes import product_in_planes
from gpbnb.arithmetic.kernels.scalar import (
    add,
    can_be_freed,
    check,
    compare,
    first_product,
    freed,
    guard,
    load,
    multiply,
    multiply_add,
    put,
    subtract,
    zero,
)
from gpbnb.arithmetic.kernels.tags import (
    LEAST,
    LIMIT,
    Blocked,
    Hexadecimal,
    Limited,
    Mixed,
    Pairwise,
    extents_of_sums,
)

_INLINE = {"forceinline": True, "no_cfunc_wrapper": True, "_nrt": False}
_MAKES_ARRAYS = {"no_cfunc_wrapper": True, "_nrt": True}
_MOST = np.int64(2**63 - 1)
MANY = 2000  # multiplications in a product, from which on a look at the range of its entries pays


@borrowing
def is_zero(fmt: Any, x: Any) -> Any:
    """Whether a number is zero."""
    return compare(fmt, x, zero(fmt)) == 0


@borrowing
def copy(fmt: Any, a: Any, c: Any) -> None:
    """c = a."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            put(fmt, c, (i, j), load(fmt, a, (i, j)))


@borrowing
def transpose(fmt: Any, a: Any, c: Any) -> None:
    """c = a'; c must not be a."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            put(fmt, c, (j, i), load(fmt, a, (i, j)))


@borrowing
def matrix_sum(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """c = a + b."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            put(fmt, c, (i, j), add(fmt, load(fmt, a, (i, j)), load(fmt, b, (i, j))))
    guard(fmt, c)


@borrowing
def difference(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """c = a - b."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            put(fmt, c, (i, j), subtract(fmt, load(fmt, a, (i, j)), load(fmt, b, (i, j))))
    guard(fmt, c)


@borrowing
def _extent(x: Any) -> Any:
    """The smallest size of the float64 numbers of a matrix other than zero, infinite if there are none; the largest."""
    smallest, largest = bits(np.inf), np.int64(0)
    for i in range(x.shape[0]):
        row = x[i]
        for j in range(row.shape[0]):
            size = bits(abs(row[j]))
            smallest = min(smallest, size if size > 0 else _MOST)
            largest = max(largest, size)
    return from_bits(smallest), from_bits(largest)


_extents_of_sums = inner(extents_of_sums)


def stays_within(fmt: Any, a: Any, b: Any, least: int) -> Any:
    """Whether no result of the product a b can leave the range, by its extents, and the tag has loops for that.

    Products of fewer than `least` multiplications are not looked at.
    """
    raise TypeError("got a call of stays_within from Python; needed one from a function compiled by numba")


@overload(stays_within, strict=False, jit_options=_INLINE)
def _stays_within(fmt: Any, a: Any, b: Any, least: int) -> Any:
    tag = getattr(fmt, "instance_class", None)
    if not can_be_freed(fmt):
        return lambda fmt, a, b, least: False
    base = 16 if tag is Hexadecimal else 2

    def unlimited(fmt: Any) -> Any:
        return 0.0, LEAST, LIMIT

    def limited(fmt: Any) -> Any:
        return fmt.gradual, fmt.least, fmt.largest

    limits = inner(limited if tag is Limited else unlimited)

    def of_floats(fmt: Any, a: Any, b: Any, least: int) -> Any:
        n = a.shape[1]
        if b.shape[1] < 2 or a.shape[0] * n * b.shape[1] < least:
            return False
        gradual, smallest, largest = limits(fmt)
        (low_a, high_a), (low_b, high_b) = _extent(a), _extent(b)
        low, high = _extents_of_sums(n, base, fmt.precision, gradual, low_a * low_b, high_a * high_b)
        return high <= largest and (gradual > 0.0 or low >= smallest)

    return of_floats


def product_in_order(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    """c = a b if the tag asks for pairwise or blocked sums; returns whether it does."""
    raise TypeError("got a call of product_in_order from Python; needed one from a function compiled by numba")


@borrowing
def _pairwise(fmt: Any, a: Any, b: Any, i: int, j: int, sums: Any) -> Any:
    # Not recursive, because numba cannot cache recursive functions: product k completes every part that it ends.
    count = 0
    for k in range(a.shape[1]):
        sums[count] = multiply(fmt, load(fmt, a, (i, k)), load(fmt, b, (k, j)))
        count += 1
        first, end = 0, a.shape[1]
        while end - first > 1:
            if k == end - 1:
                count -= 1
                sums[count - 1] = add(fmt, sums[count - 1], sums[count])
            middle = (first + end) // 2
            first, end = (first, middle) if k < middle else (middle, end)
    return sums[0]


@borrowing
def _blocked(fmt: Any, a: Any, b: Any, i: int, j: int, sums: Any) -> Any:
    for first in range(0, a.shape[1], fmt.sums.block):
        s = multiply(fmt, load(fmt, a, (i, first)), load(fmt, b, (first, j)))
        for k in range(first + 1, min(first + fmt.sums.block, a.shape[1])):
            s = multiply_add(fmt, load(fmt, a, (i, k)), load(fmt, b, (k, j)), s)
        sums[0] = s if first == 0 else add(fmt, sums[0], s)
    return sums[0]


@overload(product_in_order, strict=False, jit_options=_MAKES_ARRAYS)
def _product_in_order(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    mixed = getattr(fmt, "instance_class", None) is Mixed
    limited = fmt.types[1] if mixed else fmt
    order = limited.types[2].instance_class if getattr(limited, "instance_class", None) is Limited else None
    if order not in (Pairwise, Blocked):
        return lambda fmt, a, b, c: False
    entry = _pairwise if order is Pairwise else _blocked

    def in_order(fmt: Any, a: Any, b: Any, c: Any) -> Any:
        of_sums = fmt.sums if mixed else fmt
        sums = np.zeros(64)
        for i in range(c.shape[0]):
            for j in range(c.shape[1]):
                put(fmt, c, (i, j), entry(of_sums, a, b, i, j, sums))
        check(fmt, c)
        return True

    return in_order


@borrowing(forceinline=True)
def _add_products(fmt: Any, a: Any, b: Any, c: Any) -> None:
    for i in range(a.shape[0]):
        fresh = True
        for k in range(a.shape[1]):
            factor = load(fmt, a, (i, k))
            if is_zero(fmt, factor):
                continue
            if fresh:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), first_product(fmt, factor, load(fmt, b, (k, j))))
                fresh = False
            else:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), multiply_add(fmt, factor, load(fmt, b, (k, j)), load(fmt, c, (i, j))))
        if fresh:
            for j in range(b.shape[1]):
                put(fmt, c, (i, j), zero(fmt))


@borrowing
def product(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """c = a b, each entry summed from left to right over the nonzero entries of a; c must be neither a nor b."""
    if product_in_order(fmt, a, b, c) or product_in_planes(fmt, a, b, c):
        return
    if stays_within(fmt, a, b, MANY):
        _add_products(freed(fmt), a, b, c)
    else:
        _add_products(fmt, a, b, c)
        check(fmt, c)


@borrowing
def product_by_sparse(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """Like :func:`product`, with the same digits, but summed over the nonzero entries of b."""
    if product_in_order(fmt, a, b, c) or product_in_planes(fmt, a, b, c):
        return
    for j in range(b.shape[1]):
        fresh = True
        for k in range(a.shape[1]):
            factor = load(fmt, b, (k, j))
            if is_zero(fmt, factor):
                continue
            if fresh:
                for i in range(a.shape[0]):
                    put(fmt, c, (i, j), first_product(fmt, load(fmt, a, (i, k)), factor))
                fresh = False
            else:
                for i in range(a.shape[0]):
                    put(fmt, c, (i, j), multiply_add(fmt, load(fmt, a, (i, k)), factor, load(fmt, c, (i, j))))
        if fresh:
            for i in range(a.shape[0]):
                put(fmt, c, (i, j), zero(fmt))
    check(fmt, c)
