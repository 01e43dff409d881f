"""Compiled products of matrices and Gaussian elimination, in every kind of numbers of the machine.

The order of operations, and therefore each digit, is that of :mod:`gpbnb.arithmetic.linalg`. Loops add a multiple of
one row to another, so that processors compute several entries at once. Matrices are flat, row
after row. The functions take the address of a table of formats, of which they use the first, and room for intermediate
results, float64. They return whether a result is beyond the range, or, in kinds on integers, raise OverflowError;
matrices are then invalid.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import bits, from_bits, start, words
from gpbnb.arithmetic.kernels.compiling import borrowing, compiled, inner
from gpbnb.arithmetic.kernels.floats import TOGETHER
from gpbnb.arithmetic.kernels.kinds import (
    add,
    compare,
    divide,
    dot,
    far,
    format_of,
    load,
    lost,
    negative,
    opposite,
    put,
    scale,
    sign,
)

ROOM = 5 * TOGETHER
_MOST = np.int64(2**63 - 1)


# -- loops -------------------------------------------------------------------------------------------------------------


@compiled
def product(
    kind: Any, formats: int, room: Any, a: Any, b: Any, c: Any, begin: int, end: int, count: int, columns: int
) -> Any:
    """Rows of C = A B from `begin` on; each entry sums `count` products, at least one, from left to right."""
    fmt, gone, a, b, c = format_of(kind, words(formats), start(room)), False, start(a), start(b), start(c)
    if far(kind, a, end * count) or far(kind, b, count * columns):
        return True
    for i in range(begin, end):
        if columns == 1:
            found, beyond = dot(kind, fmt, a, i * count, b, count)
            put(kind, fmt, c, i, found)
            gone |= beyond
            continue
        gone |= scale(kind, fmt, load(kind, fmt, a, i * count), b, 0, c, i * columns, columns)
        for k in range(1, count):
            factor = load(kind, fmt, a, i * count + k)
            gone |= add(kind, fmt, 1, factor, b, k * columns, c, i * columns, columns)
    return gone | lost(kind, c, begin * columns, end * columns)


@borrowing
def _larger(kind: Any, fmt: Any, a: Any, i: Any, j: Any) -> Any:
    """Whether number i is larger in size than number j."""
    # Opposites of sizes, which fixed point has for its lowest number, too.
    x, y = load(kind, fmt, a, i), load(kind, fmt, a, j)
    x = x if sign(kind, a, i) < 0 else opposite(kind, fmt, x)
    y = y if sign(kind, a, j) < 0 else opposite(kind, fmt, y)
    return compare(kind, fmt, x, y) < 0


NONE, GONE = -1, -2


@compiled
def factor(kind: Any, formats: int, room: Any, a: Any, order: Any, pivot: bool, begin: int, end: int) -> Any:
    """Factor A (n, n): the upper factor on and above the diagonal, the multipliers of the lower factor below it.

    A call eliminates the columns from `begin` to before `end`. The order of the rows, int64 (n,), is permuted like
    them. Returns the column of the first zero pivot, NONE if there is none, or GONE.
    """
    fmt, gone, n, a = format_of(kind, words(formats), start(room)), False, len(order), start(a)
    if far(kind, a, n * n):
        return GONE
    for k in range(begin, end):
        if pivot:
            largest = k
            for i in range(k + 1, n):
                if _larger(kind, fmt, a, i * n + k, largest * n + k):
                    largest = i
            if largest != k:
                order[k], order[largest] = order[largest], order[k]
                for j in range(n):
                    moved = load(kind, fmt, a, k * n + j)
                    put(kind, fmt, a, k * n + j, load(kind, fmt, a, largest * n + j))
                    put(kind, fmt, a, largest * n + j, moved)
        if sign(kind, a, k * n + k) == 0:
            return GONE if gone | lost(kind, a, 0, n * n) else k
        head = load(kind, fmt, a, k * n + k)
        for i in range(k + 1, n):
            ratio, beyond = divide(kind, fmt, load(kind, fmt, a, i * n + k), head)
            put(kind, fmt, a, i * n + k, ratio)
            m = negative(kind, fmt, ratio)
            gone |= beyond
            gone |= add(kind, fmt, 1, m, a, k * n + k + 1, a, i * n + k + 1, n - k - 1)
    return GONE if gone | lost(kind, a, 0, n * n) else NONE


@compiled
def solved(kind: Any, formats: int, room: Any, a: Any, b: Any, n: int, columns: int) -> Any:
    """Overwrite right-hand sides B (n, columns), whose rows have the order of :func:`factor`, by the solutions."""
    fmt, gone, a, b = format_of(kind, words(formats), start(room)), False, start(a), start(b)
    if far(kind, a, n * n) or far(kind, b, n * columns):
        return True
    for k in range(n):
        for i in range(k + 1, n):
            m = negative(kind, fmt, load(kind, fmt, a, i * n + k))
            gone |= add(kind, fmt, 1, m, b, k * columns, b, i * columns, columns)
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            upper = load(kind, fmt, a, k * n + i)
            gone |= add(kind, fmt, -1, upper, b, i * columns, b, k * columns, columns)
        head = load(kind, fmt, a, k * n + k)
        for j in range(columns):
            found, beyond = divide(kind, fmt, load(kind, fmt, b, k * columns + j), head)
            put(kind, fmt, b, k * columns + j, found)
            gone |= beyond
    return gone | lost(kind, b, 0, n * columns)


@inner
def _extent(x: Any) -> Any:
    """The smallest size of a float64 other than zero, infinite if there is none, and the largest size."""
    smallest, largest = bits(np.inf), np.int64(0)
    for i in range(x.shape[0]):
        size = bits(abs(x[i]))
        smallest = min(smallest, size if size > 0 else _MOST)
        largest = max(largest, size)
    return from_bits(smallest), from_bits(largest)


@compiled
def extents(x: Any, y: Any) -> Any:
    """The smallest and the largest size of the numbers other than zero of two arrays."""
    return _extent(x), _extent(y)
