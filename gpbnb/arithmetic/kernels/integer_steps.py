"""Steps of a linear program on integers: exact results, each rounded into the format of the sums and of the data."""

from __future__ import annotations

from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.tags import ADD, AT_LEAST, AWAY, DOWN, EVEN, HALF_UP, MULTIPLY, ODD, SUBTRACT, UP

_RAISE, _SATURATE, _WRAP = range(3)


class WordStore(NamedTuple):
    """How a format stores an integer; `mask` has the bits of its word."""

    mode: int
    policy: int
    low: int
    high: int
    mask: int


class WordCode(NamedTuple):
    """A program on integers, of 64 bits in compiled loops."""

    operations: NDArray[np.int64]
    factors: NDArray[Any]
    shifts: NDArray[Any]
    wide: NDArray[np.bool_]
    outputs: NDArray[np.int64]
    data: WordStore
    sums: WordStore
    gap: int
    accumulates: bool


@inner
def _shifted(n: int, shift: int, mode: int) -> int:
    """Return n / 2**shift, rounded."""
    if shift <= 0:
        return n << -shift
    m = n >> shift
    rest, unit = n - (m << shift), 1 << shift
    if rest == 0 or mode == DOWN:
        return m
    if mode == AWAY:
        up = 2 * rest > unit or (2 * rest == unit and n > 0)
    elif mode == EVEN:
        up = 2 * rest > unit or (2 * rest == unit and m % 2 == 1)
    elif mode == HALF_UP:
        up = 2 * rest >= unit
    elif mode == ODD:
        up = m % 2 == 0
    else:
        up = mode == UP or n < 0
    return m + 1 if up else m


@inner
def _kept(n: int, over: int, store: Any) -> Any:
    """Return an integer as a format keeps it, and whether it must not; `over` is the sign of a lost 64-bit overflow."""
    if over == 0 and store.low <= n <= store.high:
        return n, False
    if store.policy == _SATURATE:
        return (store.high if over > 0 or (over == 0 and n > 0) else store.low), False
    if store.policy == _WRAP:
        return ((n - store.low) & store.mask) + store.low, False
    return n, True


@compiled
def advance(code: Any, before: Any, u: Any, after: Any, stopped: Any) -> None:
    """Compute the state after each of some others, which may be the same memory, one step later.

    Parameters
    ----------
    before, after : (steps, n). u : (steps, m), or (1, m) for all of them.
    stopped : (steps,), -1 where no operation overflows, else to be set to its number; the state then stays as it was.
    """
    operations, factors, shifts, wide, outputs, data, sums, gap, accumulates = code
    n, m, count = before.shape[1], u.shape[1], operations.shape[0]
    values = np.zeros(n + m + count, before.dtype)
    bad = False
    for k in range(after.shape[0]):
        for i in range(n):
            values[i] = before[k, i]
        for i in range(m):
            values[n + i] = u[k % u.shape[0], i]
        for o in range(count):
            kind, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
            right, over = values[b], 0
            if kind == MULTIPLY:
                value = _shifted(factors[o] * right, shifts[o], sums.mode)
            elif kind in (ADD, SUBTRACT):
                left = values[a]
                if a < n + m or not wide[a - n - m]:
                    left <<= gap
                if b < n + m or not wide[b - n - m]:
                    right <<= gap
                value = left + right if kind == ADD else left - right
                same = (left ^ right) >= 0 if kind == ADD else (left ^ right) < 0
                if same and (value ^ left) < 0:
                    over = 1 if left >= 0 else -1
            else:
                beyond = right < factors[o] if kind == AT_LEAST else right > factors[o]
                values[n + m + o] = factors[o] if beyond else right
                continue
            value, bad = _kept(value, over, sums)
            if accumulates and not bad and not wide[o]:
                value, bad = _kept(_shifted(value, gap, data.mode), 0, data)
            if bad:
                stopped[k] = o
                break
            values[n + m + o] = value
        for i in range(n):
            after[k, i] = before[k, i] if stopped[k] >= 0 else values[outputs[i]]


_IN_PYTHON = {**globals(), "_shifted": _shifted.py_func, "_kept": _kept.py_func}
advance_in_python: Any = FunctionType(advance.py_func.__code__, _IN_PYTHON)
"""The same on Python's integers, of any length, none of which is lost."""
