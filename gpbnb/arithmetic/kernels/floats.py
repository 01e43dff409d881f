"""Compiled loops over arrays of float64, in any format of bases 2 and 16: precision, rounding and range are data.

A part of an array is computed in two passes: the float64 nearest to each result, with what is left; then each is
rounded, quickly where the format and the numbers allow it. What leaves the quick range is rounded by :func:`fitted`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels import tags
from gpbnb.arithmetic.kernels.bits import at, bits, entries, fma, from_bits, select, start, words
from gpbnb.arithmetic.kernels.careful import carefully, drawn, fused_sum, masked, within
from gpbnb.arithmetic.kernels.compiling import borrowing, compiled, inner
from gpbnb.arithmetic.kernels.quick import (
    DIRECTED,
    HEXADECIMAL,
    LONG,
    NONE,
    NUMBER,
    RANDOM,
    SHORT,
    TIED,
    WHOLE,
    basic,
    other,
    rounded,
    rule_of,
)
from gpbnb.arithmetic.rounding import DRAW_BITS

TOGETHER = 512  # entries whose intermediate results stay in the processor's nearest memory
TINY = 2.0**-1022  # stands for a result that underflowed to zero, in formats which do not have it
_ONE = np.int64(1)
_BINARY, _BASE_16 = np.int64(0), np.int64(3)
_ADD, _MULTIPLY, _DIVIDE, _ROOT = map(np.int64, (tags.ADD, tags.MULTIPLY, tags.DIVIDE, tags.ROOT))
_SHORT, _LONG, _TIED, _DIRECTED, _HEXADECIMAL = map(np.int64, (SHORT, LONG, TIED, DIRECTED, HEXADECIMAL))


@borrowing(error_model="numpy")
def _computed(operation: Any, exact: Any, a: Any, b: Any, c: Any, p: Any, r: Any, count: Any) -> None:
    """The float64 nearest to each result, and what is left; `exact`: fused results are rounded to float64 at once."""
    if operation <= tags.SUBTRACT:
        sign = -1.0 if operation == tags.SUBTRACT else 1.0
        for i in range(count):
            x, y = a[i], sign * b[i]
            s = x + y
            t = s - x
            p[i], r[i] = s, (x - (s - t)) + (y - t)
    elif operation == tags.MULTIPLY:
        for i in range(count):
            x, y = a[i], b[i]
            s = x * y
            r[i] = fma(x, y, -s)
            p[i] = TINY if (s == 0.0) & (x != 0.0) & (y != 0.0) else s
    elif operation == tags.DIVIDE:
        for i in range(count):
            x, y = a[i], b[i]
            s = x / y
            left = fma(-s, y, x)
            r[i] = -left if y < 0.0 else left
            p[i] = TINY if (s == 0.0) & (x != 0.0) else s
    elif operation == tags.ROOT:
        for i in range(count):
            s = math.sqrt(a[i])
            p[i], r[i] = s, fma(-s, s, a[i])
    elif exact:
        for i in range(count):
            p[i], r[i] = fma(a[i], b[i], c[i]), 0.0
    else:
        for i in range(count):
            p[i], r[i], _ = fused_sum(a[i], b[i], c[i])


@inner(forceinline=True)
def _round(how: Any, rule: Any, p: Any, r: Any, out: Any, count: Any) -> Any:
    any_gone = False
    for i in range(count):
        out[i], gone = rounded(how, p[i], r[i], rule)
        any_gone |= gone
    return any_gone


@borrowing
def _rounded(how: Any, rule: Any, p: Any, r: Any, out: Any, count: Any) -> Any:
    """Round quickly; return whether a result is out of the quick range."""
    # A loop for each case, so that none branches and processors compute several entries at once.
    if how == SHORT:
        return _round(_SHORT, rule, p, r, out, count)
    if how == LONG:
        return _round(_LONG, rule, p, r, out, count)
    if how == HEXADECIMAL:
        return _round(_HEXADECIMAL, rule, p, r, out, count)
    if how == TIED:
        return _round(_TIED, rule, p, r, out, count)
    return _round(_DIRECTED, rule, p, r, out, count)


@inner(forceinline=True)
def _fit(fmt: Any, digits: Any, random: Any, draws: Any, p: Any, r: Any, out: Any, count: Any) -> Any:
    """Round to at most 52 bits, within any limits, at random or else in another mode; return whether a format has none.

    As :func:`gpbnb.arithmetic.kernels.careful.carefully`, without branches.
    """
    mode, any_gone = fmt.mode, False
    near = -np.int64(mode in (tags.AWAY, tags.EVEN, tags.HALF_UP))
    even, odd = np.int64(mode == tags.EVEN), np.int64(mode == tags.ODD)
    up, down, ties_up = np.int64(mode == tags.UP), np.int64(mode == tags.DOWN), np.int64(mode == tags.HALF_UP)
    places = np.int64(56 - 4 * fmt.precision if fmt.bits == 4 else 53 - fmt.precision)
    for i in range(count):
        x = p[i]
        a, below = abs(x), x < 0.0
        base = fmt.gradual if a < fmt.gradual else 0.0
        s = a + base
        rest = a - (s - base)
        rest = rest if rest != 0.0 else (-r[i] if below else r[i])
        u = bits(s) - np.int64(rest < 0.0)
        k = places - (((u >> 52) + 1) & digits)
        unit, more = _ONE << k, np.int64(rest != 0.0)
        half = ((unit >> 1) & near) - even
        added = select(below, half + (unit & -down) - (down | ties_up), half + (unit & -up) - up)
        added += (even & ((u >> k) | more)) + (more & select(below, down | ties_up, up))
        cut = u & (unit - 1)
        if random:
            limit = bits(draws[i]) << (k - DRAW_BITS)
            added += select((limit < cut) | ((limit == cut) & (more != 0)), unit, np.int64(0))
        y = from_bits(((u + added) & -unit) | select((cut | more) != 0, odd << k, np.int64(0))) - base
        y = y if (y >= fmt.least) | (a == 0.0) else fmt.below
        y = 0.0 - y if below else y
        y = fmt.over if y > fmt.largest else y
        y = fmt.under if y < fmt.lowest else y
        out[i] = y
        any_gone |= (y != y) | (a == np.inf)
    return any_gone


@borrowing
def draw(random: Any, operations: Any, draws: Any, count: Any) -> None:
    """Draw for some results of one or two operations that take turns; as bits, those of the second after the first."""
    seed, done = random[0], random[1] + np.uint64(1)
    for k in range(operations):
        for i in range(count):
            draws[k * count + i] = from_bits(drawn(seed, done + np.uint64(operations * i + k)))
    random[1] += np.uint64(operations * count)


@borrowing
def fitted(fmt: Any, draws: Any, p: Any, r: Any, out: Any, count: Any) -> Any:
    """Round to at most 52 bits in any format; return whether it does not have one of the results."""
    if fmt.mode == tags.RANDOM:
        return _fit(fmt, _BINARY, True, draws, p, r, out, count)
    if fmt.bits == 1:
        return _fit(fmt, _BINARY, False, draws, p, r, out, count)
    return _fit(fmt, _BASE_16, False, draws, p, r, out, count)


@inner(forceinline=True)
def _run(operation: Any, how: Any, sign: Any, rule: Any, doubtful: Any, a: Any, b: Any, out: Any, count: Any) -> Any:
    any_gone = False
    for i in range(count):
        if operation == tags.ROOT:
            out[i], gone = other(operation, how, rule, a[i], a[i], a[i])
        else:
            out[i], gone = basic(operation, how, rule, a[i], sign * b[i])
            if operation in (tags.MULTIPLY, tags.DIVIDE):
                gone |= doubtful & (out[i] == 0.0)
        any_gone |= gone
    return any_gone


@borrowing
def _at_once(operation: Any, how: Any, rule: Any, doubtful: Any, a: Any, b: Any, out: Any, count: Any) -> Any:
    """Compute and round in one pass, in three quarters of the time of two.

    Parameters
    ----------
    doubtful : 1 where products and quotients that are zero may have underflowed, else 0.
    """
    if operation == tags.MULTIPLY:
        return _run(_MULTIPLY, _SHORT, 1.0, rule, doubtful, a, b, out, count)
    if operation == tags.DIVIDE:
        return _run(_DIVIDE, _SHORT, 1.0, rule, doubtful, a, b, out, count)
    if operation == tags.ROOT:
        if how == SHORT:
            return _run(_ROOT, _SHORT, 1.0, rule, doubtful, a, b, out, count)
        return _run(_ROOT, _LONG, 1.0, rule, doubtful, a, b, out, count)
    return _run(_ADD, _SHORT, -1.0 if operation == tags.SUBTRACT else 1.0, rule, doubtful, a, b, out, count)


@borrowing
def _along(formats: Any, operation: Any, a: Any, b: Any, c: Any, out: Any, room: Any, count: Any) -> Any:
    """Compute a few results; return whether the format does not have one, or this function does not tell."""
    fmt = masked(entries(formats, WHOLE, np.int64), entries(formats, NUMBER, np.float64))
    how, rule = rule_of(formats, 0)
    together = (how == SHORT and operation <= tags.ROOT) or (how == LONG and operation == tags.ROOT)
    if together and not _at_once(operation, how, rule, fmt.below != fmt.below, a, b, out, count):
        return False
    p, r, draws, exact = room, at(room, TOGETHER), at(room, 2 * TOGETHER), (how == SHORT) & (fmt.precision == 53)
    if operation == tags.ROUND:
        p = a
        for i in range(count):
            r[i] = 0.0
    else:
        _computed(operation, exact, a, b, c, p, r, count)
    if how == TIED and operation in (tags.DIVIDE, tags.ROOT):  # no quotient or root is a tie
        for i in range(count):
            r[i] = 0.0
    chosen = LONG if operation == tags.FUSED and how == SHORT and not exact else how
    if how != NONE and not _rounded(chosen, rule, p, r, out, count):
        return False
    if fmt.mode == tags.RANDOM:
        draw(entries(formats, RANDOM, np.uint64), 1, draws, count)
    return fmt.precision == 53 or fitted(fmt, draws, p, r, out, count)


@compiled
def along(formats: int, operation: int, n: int, a: Any, b: Any, c: Any, out: Any) -> Any:
    """out = the results of an operation, entry by entry; return whether :func:`carefully_along` has to compute them."""
    table, any_gone, room = words(formats), False, start(np.empty(3 * TOGETHER))
    for begin in range(0, n, TOGETHER):
        x, y, z, found = at(start(a), begin), at(start(b), begin), at(start(c), begin), at(start(out), begin)
        any_gone |= _along(table, operation, x, y, z, found, room, min(n - begin, TOGETHER))
    return any_gone


@compiled
def carefully_along(formats: int, operation: int, n: int, a: Any, b: Any, c: Any, out: Any) -> Any:
    """:func:`along` one by one, in every format; return whether it does not have one of the results."""
    table, any_gone = words(formats), False
    fmt = masked(entries(table, WHOLE, np.int64), entries(table, NUMBER, np.float64))
    random = entries(table, RANDOM, np.uint64)
    x, y, z, found = start(a), start(b), start(c), start(out)
    for i in range(n):
        found[i] = carefully(fmt, random, operation, x[i], y[i], z[i])
        any_gone |= found[i] != found[i]
    return any_gone


@compiled
def accumulate(formats: int, operation: int, rows: Any, width: int, numbers: Any) -> Any:
    """Combine each of some rows with the one before it; return whether the format does not have one of the results."""
    table, any_gone = words(formats), False
    fmt = masked(entries(table, WHOLE, np.int64), entries(table, NUMBER, np.float64))
    random, found = entries(table, RANDOM, np.uint64), start(numbers)
    how, rule = rule_of(table, 0)
    exact = (fmt.gradual > fmt.largest) & (operation <= tags.SUBTRACT) & (fmt.mode != tags.RANDOM)
    for j in range(width):
        x = found[(rows[0] - 1) * width + j]
        for i in range(rows[0], rows[1]):
            y = found[i * width + j]
            z, gone = x, not exact
            if exact:  # in fixed point
                z = within(fmt, x + y if operation == tags.ADD else x - y, True)
                any_gone |= z != z
            elif how != NONE:
                z, gone = basic(operation, how, rule, x, y)
                gone |= (operation == tags.MULTIPLY) & (z == 0.0)  # it may have underflowed
            if gone:
                z = carefully(fmt, random, operation, x, y, y)
                any_gone |= z != z
            x = z
            found[i * width + j] = x
    return any_gone
