"""One step of a program in plain Python, with numbers of any type; slow and obvious."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

from gpbnb.filters.program import (
    ADD,
    AT_LEAST,
    CEILING,
    CHOOSE,
    CONSTANT,
    DIVIDE,
    EQUAL,
    FLOOR,
    LESS,
    MODULO,
    MULTIPLY,
    NEAREST,
    PRODUCT,
    ROOT,
    SUBTRACT,
    TRUNCATE,
    Program,
    values_of,
)


def steps_in_python(
    program: Program, round_: Callable[[Any], Any], coefficients: Any, x: Sequence[Any], z: Sequence[Any]
) -> list[Any]:
    """Take one step with numbers of any type, each result rounded by a function; slow and obvious.

    A ROOT takes Fractions, and rounds to formats with at most 1000 bits after the binary point.
    """
    values = [*x, *z]
    for (code, a, b), guard in zip(
        program.operations.tolist(), program.guards or (-1,) * len(program.operations), strict=True
    ):
        chosen = guard < 0 or values[guard] != 0
        if code == CHOOSE:
            values.append(values[a] if chosen else values[b])
        elif not chosen:
            values.append(None)
        elif code in _EXACT:
            values.append(round_(_EXACT[code](*(values[each] for each in values_of(code, a, b)))))
        elif code == MULTIPLY:
            values.append(round_(coefficients[a] * values[b]))
        elif code == CONSTANT:
            values.append(coefficients[a])
        else:
            values.append(max(coefficients[a], values[b]) if code == AT_LEAST else min(coefficients[a], values[b]))
    return [values[i] for i in program.outputs]


def _root(x: Fraction) -> Fraction:
    """Return a number that rounds as the square root does: the root itself, or one between the same long numbers."""
    whole = math.isqrt(math.floor(x * 4**_ROOT_BITS))
    exact = Fraction(whole, 2**_ROOT_BITS) ** 2 == x
    return Fraction(2 * whole + (not exact), 2 ** (_ROOT_BITS + 1))


_ROOT_BITS = 1100

_EXACT: dict[int, Callable[..., Any]] = {
    ADD: operator.add,
    SUBTRACT: operator.sub,
    PRODUCT: operator.mul,
    DIVIDE: operator.truediv,
    LESS: lambda a, b: int(a < b),
    EQUAL: lambda a, b: int(a == b),
    MODULO: lambda a, b: a - b * math.trunc(a / b),
    ROOT: _root,
    FLOOR: math.floor,
    CEILING: math.ceil,
    TRUNCATE: math.trunc,
    NEAREST: round,
}
