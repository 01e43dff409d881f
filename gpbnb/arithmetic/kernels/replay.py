"""Compiled replay of a recorded list of operations, one after the other, in any arithmetic with compiled loops.

The loop is compiled once for each arithmetic, and not for each list.
"""

from __future__ import annotations

from typing import Any

from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import (
    absolute,
    add,
    compare,
    load,
    lost,
    multiply,
    negative,
    put,
    quotient,
    root,
    subtract,
    zero,
)

ADD, SUBTRACT, MULTIPLY, DIVIDE, ROOT, NEGATIVE, ABSOLUTE, CHOOSE, COMPARE, COMBINE = range(10)
"""Codes of operations. The first four take two numbers, the next three take one. CHOOSE takes its second or third
operand, as the truth value that is its first operand is true or false. COMPARE compares two numbers; its third operand
has bit 0, 1 or 2 set if it holds for the order less, equal or greater. COMBINE combines two truth values by a table,
the bits of its third operand."""


@compiled
def replay(fmt: Any, instructions: Any, begin: int, end: int, values: Any, truths: Any) -> int:
    """Run the instructions from `begin` to before `end`; return `end`, or the first that has no result in the format.

    Parameters
    ----------
    instructions : (n, 5), code, three operands and the number of the result.
    values : numbers, in the layout of the arithmetic.
    truths : truth values, as 0 and 1.
    """
    for o in range(begin, end):
        code = instructions[o, 0]
        a, b, c, out = instructions[o, 1], instructions[o, 2], instructions[o, 3], instructions[o, 4]
        if code == COMBINE:
            truths[out] = (c >> (2 * truths[a] + truths[b])) & 1
            continue
        if code == CHOOSE:
            put(fmt, values, out, load(fmt, values, b if truths[a] else c))
            continue
        x, y = load(fmt, values, a), load(fmt, values, b)
        if code == COMPARE:
            truths[out] = (c >> (compare(fmt, x, y) + 1)) & 1
            continue
        if code == ADD:
            found = add(fmt, x, y)
        elif code == SUBTRACT:
            found = subtract(fmt, x, y)
        elif code == MULTIPLY:
            found = multiply(fmt, x, y)
        elif code == DIVIDE:
            if compare(fmt, y, zero(fmt)) == 0:
                return o
            found = quotient(fmt, x, y)
        elif code == ROOT:
            if compare(fmt, x, zero(fmt)) < 0:
                return o
            found = root(fmt, x)
        elif code == NEGATIVE:
            found = negative(fmt, x)
        else:
            found = absolute(fmt, x)
        if lost(fmt, found):
            return o
        put(fmt, values, out, found)
    return end
