"""Compiled Gaussian elimination, in every arithmetic of :mod:`gpbnb.arithmetic.kernels.scalar`.

The order of operations, and therefore each digit, is the same as in :mod:`gpbnb.arithmetic.linalg`. Matrices are packed
arrays, which the functions overwrite. If a number leaves the range of its backend, they raise OverflowError, and the
arrays are invalid. Such a number stays in its place, so that one look at the end finds it.
"""

from __future__ import annotations

from typing import Any

from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.scalar import (
    add,
    check,
    compare,
    less,
    load,
    multiply,
    negative,
    put,
    quotient,
    subtract,
    zero,
)


@inner
def _minus_size(fmt: Any, x: Any) -> Any:
    """Return -abs(x), which fixed point has for its lowest number, too."""
    return x if less(fmt, x, zero(fmt)) else negative(fmt, x)


@compiled
def lu(fmt: Any, a: Any, order: Any, pivot: bool, begin: int, end: int) -> int:
    """Factor a (n, n): the upper factor on and above the diagonal, the multipliers of the lower factor below it.

    A call eliminates the columns from `begin` to before `end`. `order` (n,) is permuted like the rows. Returns the
    column of the first zero pivot, or -1 if there is none.
    """
    n = a.shape[0]
    for k in range(begin, end):
        if pivot:
            largest = k
            for i in range(k + 1, n):
                if less(fmt, _minus_size(fmt, load(fmt, a, (i, k))), _minus_size(fmt, load(fmt, a, (largest, k)))):
                    largest = i
            if largest != k:
                order[k], order[largest] = order[largest], order[k]
                for j in range(n):
                    moved = load(fmt, a, (k, j))
                    put(fmt, a, (k, j), load(fmt, a, (largest, j)))
                    put(fmt, a, (largest, j), moved)
        head = load(fmt, a, (k, k))
        if compare(fmt, head, zero(fmt)) == 0:
            check(fmt, a)
            return k
        upper = a[k, k + 1 :]
        for i in range(k + 1, n):
            ratio = quotient(fmt, load(fmt, a, (i, k)), head)
            put(fmt, a, (i, k), ratio)
            m = negative(fmt, ratio)
            row = a[i, k + 1 :]
            for j in range(row.shape[0]):  # counting from zero, which numba vectorizes
                put(fmt, row, j, add(fmt, load(fmt, row, j), multiply(fmt, m, load(fmt, upper, j))))
    if end == n:
        check(fmt, a)
    return -1


@compiled
def reduce(fmt: Any, factors: Any, b: Any) -> None:
    """Forward substitution in the right-hand sides b (n, p), whose rows have the order that :func:`lu` made."""
    n = factors.shape[0]
    for k in range(n):
        for i in range(k + 1, n):
            m = negative(fmt, load(fmt, factors, (i, k)))
            for j in range(b.shape[1]):
                put(fmt, b, (i, j), add(fmt, load(fmt, b, (i, j)), multiply(fmt, m, load(fmt, b, (k, j)))))
    check(fmt, b)


@compiled
def substitute(fmt: Any, factors: Any, b: Any) -> None:
    """Back substitution: overwrite the reduced right-hand sides b (n, p) with the solutions."""
    n = factors.shape[0]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            upper = load(fmt, factors, (k, i))
            for j in range(b.shape[1]):
                put(fmt, b, (k, j), subtract(fmt, load(fmt, b, (k, j)), multiply(fmt, upper, load(fmt, b, (i, j)))))
        head = load(fmt, factors, (k, k))
        for j in range(b.shape[1]):
            put(fmt, b, (k, j), quotient(fmt, load(fmt, b, (k, j)), head))
    check(fmt, b)
