"""Compiled: products for the filter's step, which leave out factors of zero and of one.

Products with zero or one and sums with zero are exact, so no digit changes. The inner loops run along rows, where
numbers lie side by side in memory and the processor takes several at once.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from gpbnb.arithmetic.kernels.scalar import add, check, compare, load, multiply, multiply_add, one, put, store, zero


@njit(nogil=True)
def product_with_units(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """c = a b, each entry summed from left to right over the entries of a that are not zero; c is neither a nor b."""
    for i in range(a.shape[0]):
        fresh = True
        for k in range(a.shape[1]):
            factor = load(fmt, a, (i, k))
            if compare(fmt, factor, zero(fmt)) == 0:
                continue
            unit = compare(fmt, factor, one(fmt)) == 0
            if fresh and unit:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), load(fmt, b, (k, j)))
            elif fresh:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), multiply(fmt, factor, load(fmt, b, (k, j))))
            elif unit:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), add(fmt, load(fmt, c, (i, j)), load(fmt, b, (k, j))))
            else:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), multiply_add(fmt, factor, load(fmt, b, (k, j)), load(fmt, c, (i, j))))
            fresh = False
        if fresh:
            for j in range(b.shape[1]):
                put(fmt, c, (i, j), zero(fmt))
    check(fmt, c)


@njit(nogil=True)
def product_by_columns(fmt: Any, a: Any, b: Any, c: Any) -> None:
    """As :func:`product_with_units`, with the same digits, column after column of a.

    One row of c after another grows by a product; a processor computes them at once, as none waits for the last.
    """
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            put(fmt, c, (i, j), zero(fmt))
    for k in range(a.shape[1]):
        for i in range(a.shape[0]):
            factor = load(fmt, a, (i, k))
            if compare(fmt, factor, zero(fmt)) != 0:
                for j in range(b.shape[1]):
                    put(fmt, c, (i, j), multiply_add(fmt, factor, load(fmt, b, (k, j)), load(fmt, c, (i, j))))
    check(fmt, c)


@njit(nogil=True)
def add_transposed(fmt: Any, a: Any, c: Any) -> None:
    """c = c + a', over the entries of a that are not zero."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            x = load(fmt, a, (i, j))
            if compare(fmt, x, zero(fmt)) != 0:
                store(fmt, c, (j, i), add(fmt, load(fmt, c, (j, i)), x))
