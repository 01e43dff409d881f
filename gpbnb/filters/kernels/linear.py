"""Compiled loops over linear programs: their steps, and the effect of an error in each value."""

from __future__ import annotations

from typing import Any

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
