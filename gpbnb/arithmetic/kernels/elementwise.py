"""Compiled loops over the entries of arrays whose numbers are stored as integers.

Arrays have a component for each part of their numbers. If a format does not have a result, a loop raises
OverflowError, and its output is invalid.
"""

from __future__ import annotations

from typing import Any

from gpbnb.arithmetic.kernels.bits import words
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.kinds import compare, format_of, get_number, other, product, set_number, sum_of
from gpbnb.arithmetic.kernels.kinds import fused as fused_of
from gpbnb.arithmetic.kernels.tags import ADD, MULTIPLY, SKIP, SUBTRACT


def _loop(operate: Any) -> Any:
    @compiled
    def along(kind: Any, formats: int, operation: int, n: int, a: Any, b: Any, out: Any) -> None:
        fmt = format_of(kind, words(formats), formats)
        for i in range(n):
            x, y = get_number(kind, fmt, a, i), get_number(kind, fmt, b, i)
            set_number(kind, fmt, out, i, operate(kind, fmt, operation, x, y))

    return along


_sums, _products, _others = map(_loop, (sum_of, product, other))
ALONG = {code: {MULTIPLY: _products, ADD: _sums, SUBTRACT: _sums}.get(code, _others) for code in range(SKIP)}
"""For each code of an operation, the loop (kind, formats, operation, n, a, b, out) that sets `out` to its results.
For an operation on one number, `a` and `b` are the same array. Sums and products have loops of their own, because one
loop for all operations takes about five times as long to compile."""


@compiled
def fused(kind: Any, formats: int, n: int, a: Any, b: Any, c: Any, out: Any) -> None:
    """out = a b + c, rounded once."""
    fmt = format_of(kind, words(formats), formats)
    for i in range(n):
        x, y, z = get_number(kind, fmt, a, i), get_number(kind, fmt, b, i), get_number(kind, fmt, c, i)
        set_number(kind, fmt, out, i, fused_of(kind, fmt, x, y, z))


@compiled
def compared(kind: Any, formats: int, n: int, a: Any, b: Any, order: Any) -> None:
    """order[i] = -1, 0 or 1 if a[i] is less than, equal to or greater than b[i]."""
    fmt = format_of(kind, words(formats), formats)
    for i in range(n):
        order[i] = compare(kind, fmt, get_number(kind, fmt, a, i), get_number(kind, fmt, b, i))
