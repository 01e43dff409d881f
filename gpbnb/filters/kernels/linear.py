"""Compiled loops over linear programs: their steps, and the linear functions that their values approximate."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels import doubledouble, tags
from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.scalar import add, less, load, multiply, put, store, subtract
from gpbnb.filters.program import ADD, AT_LEAST, MULTIPLY, SUBTRACT


@inner
def execute(fmt: Any, operations: Any, outputs: Any, coefficients: Any, x: Any, z: Any, values: Any) -> None:
    """Take one step in the arithmetic that the tag selects, and overwrite x and the workspace `values`."""
    n, m = x.shape[0], z.shape[0]
    for i in range(n):
        put(fmt, values, i, load(fmt, x, i))
    for i in range(m):
        put(fmt, values, n + i, load(fmt, z, i))
    for o in range(operations.shape[0]):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        right = load(fmt, values, b)
        if code == MULTIPLY:
            put(fmt, values, n + m + o, multiply(fmt, load(fmt, coefficients, a), right))
        elif code == ADD:
            put(fmt, values, n + m + o, add(fmt, load(fmt, values, a), right))
        elif code == SUBTRACT:
            put(fmt, values, n + m + o, subtract(fmt, load(fmt, values, a), right))
        else:
            limit = load(fmt, coefficients, a)
            beyond = less(fmt, right, limit) if code == AT_LEAST else less(fmt, limit, right)
            put(fmt, values, n + m + o, limit if beyond else right)
    for i in range(n):
        store(fmt, x, i, load(fmt, values, outputs[i]))


@compiled
def functionals(operations: Any, coefficients: Any, first: int, rows: Any, sizes: Any) -> None:
    """Compute the linear function of (x, z) that each value approximates.

    Parameters
    ----------
    coefficients : (c, 2), double-double.
    first : n + m.
    rows : (n + m + o, n + m, 2), to be filled, double-double; relative to `sizes`, errors are below 2**-90.
    sizes : (n + m + o, n + m), to be filled: the result with all signs made positive.
    """
    reach = extents(operations, first)
    rows[:] = 0.0
    sizes[:] = 0.0
    for i in range(first):
        rows[i, i, 0] = 1.0
        sizes[i, i] = 1.0
    for o in range(operations.shape[0]):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        v = first + o
        if code == MULTIPLY:
            c = (coefficients[a, 0], coefficients[a, 1])
            for j in range(reach[b, 0], reach[b, 1]):
                right = (rows[b, j, 0], rows[b, j, 1])
                s = doubledouble.operate(tags.MULTIPLY, c, right) if c[0] != 0.0 and right[0] != 0.0 else (0.0, 0.0)
                rows[v, j, 0], rows[v, j, 1] = s[0], s[1]
                sizes[v, j] = abs(c[0]) * sizes[b, j]
            continue
        for j in range(reach[a, 0], reach[a, 1]):
            rows[v, j, 0], rows[v, j, 1] = rows[a, j, 0], rows[a, j, 1]
            sizes[v, j] = sizes[a, j]
        for j in range(reach[b, 0], reach[b, 1]):
            right = (rows[b, j, 0], rows[b, j, 1])
            if code == SUBTRACT:
                right = (-right[0], -right[1])
            s = doubledouble.operate(tags.ADD, (rows[v, j, 0], rows[v, j, 1]), right)
            rows[v, j, 0], rows[v, j, 1] = s[0], s[1]
            sizes[v, j] += sizes[b, j]


@compiled
def extents(operations: Any, first: int) -> Any:
    """Return the range of states and measurements, begin and end, outside of which each value does not depend on any.

    A sum of products with the states, from left to right, depends on the first states only. Bounds that know this take
    half the time.
    """
    found = np.empty((first + operations.shape[0], 2), np.int64)
    for i in range(first):
        found[i, 0], found[i, 1] = i, i + 1
    for o in range(operations.shape[0]):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        begin, end = found[b, 0], found[b, 1]
        if code != MULTIPLY:
            begin, end = min(begin, found[a, 0]), max(end, found[a, 1])
        found[first + o, 0], found[first + o, 1] = begin, end
    return found


@compiled
def effects(operations: Any, outputs: Any, coefficients: Any, first: int, G: Any, sizes: Any) -> None:
    """Compute the effect of an error in each value on the states after the step.

    Parameters
    ----------
    coefficients : (c,), float64.
    G : (n + m + o, n), to be filled; relative to `sizes`, errors are below (3 o + 3) 2**-53.
    sizes : (n + m + o, n), to be filled: the result with all signs made positive.
    """
    n = outputs.shape[0]
    G[:] = 0.0
    sizes[:] = 0.0
    for i in range(n):
        G[outputs[i], i] += 1.0
        sizes[outputs[i], i] += 1.0
    for o in range(operations.shape[0] - 1, -1, -1):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        v = first + o
        if code == MULTIPLY:
            c = coefficients[a]
            for i in range(n):
                G[b, i] += c * G[v, i]
                sizes[b, i] += abs(c) * sizes[v, i]
            continue
        sign = 1.0 if code == ADD else -1.0
        for i in range(n):
            G[a, i] += G[v, i]
            sizes[a, i] += sizes[v, i]
        for i in range(n):
            G[b, i] += sign * G[v, i]
            sizes[b, i] += sizes[v, i]
