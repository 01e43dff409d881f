"""Compiled loops over whole arrays: entry by entry, of numbers that are not float64.

If a result leaves the range of its backend, a loop returns True or raises OverflowError, and its output is invalid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gpbnb.arithmetic.kernels import scalar
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import compare, load, lost, put


def _two(operation: Any) -> Callable[..., bool]:
    @compiled
    def loop(fmt: Any, n: int, a: Any, b: Any, c: Any) -> Any:
        gone = False
        for i in range(n):
            x = operation(fmt, load(fmt, a, i), load(fmt, b, i))
            gone |= lost(fmt, x)
            put(fmt, c, i, x)
        return gone

    return loop


def _one(operation: Any) -> Callable[..., bool]:
    @compiled
    def loop(fmt: Any, n: int, a: Any, c: Any) -> Any:
        gone = False
        for i in range(n):
            x = operation(fmt, load(fmt, a, i))
            gone |= lost(fmt, x)
            put(fmt, c, i, x)
        return gone

    return loop


def _three(operation: Any) -> Callable[..., bool]:
    @compiled
    def loop(fmt: Any, n: int, a: Any, b: Any, c: Any, d: Any) -> Any:
        gone = False
        for i in range(n):
            x = operation(fmt, load(fmt, a, i), load(fmt, b, i), load(fmt, c, i))
            gone |= lost(fmt, x)
            put(fmt, d, i, x)
        return gone

    return loop


ENTRIES = {name: _two(getattr(scalar, name)) for name in ("add", "subtract", "multiply")}
ENTRIES |= {"divide": _two(scalar.quotient), "sqrt": _one(scalar.root), "round_": _one(scalar.round_)}
ENTRIES["fused"] = _three(scalar.fused)


@compiled
def compared(fmt: Any, n: int, a: Any, b: Any, c: Any) -> None:
    """c[i] = -1, 0 or 1 if a[i] is less than, equal to or greater than b[i]."""
    for i in range(n):
        c[i] = compare(fmt, load(fmt, a, i), load(fmt, b, i))
