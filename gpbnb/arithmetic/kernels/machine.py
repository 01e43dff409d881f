"""The machine: it runs a program, a list of rounded operations, once for each lane, in any arithmetic with loops.

A row of a program has a code, three operands and the place of its result. Rows stand in segments of one destination
format, whose precision, rounding and range are data, so that one compiled loop serves all formats of a kind. The kinds
are tags without fields: :class:`Masks`, :class:`InPairs`, :class:`InTwoWords` and :class:`DoubleDouble`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels import scalar
from gpbnb.arithmetic.kernels.bits import bits, fma, from_bits, select
from gpbnb.arithmetic.kernels.compiling import borrowing, compiled, inner
from gpbnb.arithmetic.kernels.processor import fused_sum
from gpbnb.arithmetic.kernels.rows import copy_row, same_rows
from gpbnb.arithmetic.kernels.tags import (
    AWAY,
    DOWN,
    EVEN,
    HALF_UP,
    ODD,
    RANDOM,
    UP,
    DoubleDouble,
    LimitedDecimal,
    ShortDecimal,
    Wide,
)
from gpbnb.arithmetic.rounding import DRAW_BITS

# fmt: off
(
    ADD, SUBTRACT, MULTIPLY, DIVIDE, ROOT, NEGATIVE, ABSOLUTE, CHOOSE, COMPARE, COMBINE, ROUND, FUSED, NONZERO,
    SKIP,
) = range(14)
# fmt: on
"""Codes of operations. CHOOSE takes its second or third operand, as the truth value that is its first operand is true
or false. COMPARE compares two numbers; its third operand has bit 0, 1 or 2 set if it holds for the order less, equal or
greater. COMBINE combines two truth values by a table, the bits of its third operand. ROUND brings a number of another
format into that of the segment, FUSED adds its third operand to a product, NONZERO stops where a number is zero,
and SKIP leaves out as many rows as its second operand says if its truth value is false."""


class Masks(NamedTuple):
    """Bases 2 and 16 on float64: values (places,) or (places, lanes)."""


class InPairs(NamedTuple):
    """Base 10 on pairs of int64: values (places, lanes, 2)."""


class InTwoWords(NamedTuple):
    """Up to 113 bits or 34 digits: values (places, lanes, 3)."""


ONE_BY_ONE, GATHERED, NEIGHBOURS = range(3)
"""How rows of a segment run for one lane: one after the other, since one may take the result of another; together,
after their operands are gathered; or together, since their operands and results lie one after the other in memory."""


class Formats(NamedTuple):
    """Destination formats, as the machine takes them; what a column means depends on the kind."""

    #: (formats, 16).
    whole: NDArray[np.int64]
    #: (formats, 7).
    numbers: NDArray[np.float64]
    #: (2,), seed and count of random numbers, of all formats together.
    random: NDArray[np.uint64]


class Code(NamedTuple):
    """Operations, as the machine takes them."""

    #: (rows, 5).
    rows: NDArray[np.uint32]
    #: (segments, 4): first row, end, format, and how they run; rows of a segment have one code.
    segments: NDArray[np.int64]
    #: (2, rows), the first two operands of each row.
    operands: NDArray[np.uint32]
    #: (2, rows), for the operands of a segment.
    gathered: NDArray[np.float64]


class Places(NamedTuple):
    """Where a run finds and puts its numbers."""

    #: the first place of the numbers that each step takes.
    own: int
    #: (states,), places of the states, and of their next values.
    states: NDArray[np.int64]
    after: NDArray[np.int64]
    #: (kept,), numbers to keep, and the truth value to keep.
    kept: NDArray[np.int64]
    truth: int


class Kept(NamedTuple):
    """What is kept of each step."""

    #: (steps, kept, ...) and (steps, ...).
    numbers: NDArray[Any]
    truths: NDArray[np.uint8]
    #: (states, ...), the states with which later ones are compared.
    before: NDArray[Any]


class Feeds(NamedTuple):
    """Numbers that each step of a run takes from tables."""

    #: (numbers, [lanes], ...).
    table: NDArray[Any]
    #: (feeds, 4): the first place, count, number of members of the cycle, and where the first member begins.
    feeds: NDArray[np.int64]


class Loaded(NamedTuple):
    """A program with its formats and tables, as a run takes it."""

    formats: Formats
    code: Code
    feeds: Feeds
    #: whether numbers other than the states may be too small or too large for quick computation.
    distant: bool


# -- float64 with masks ------------------------------------------------------------------------------------------------

# Columns of Formats.whole.
BITS, PRECISION, MODE, QUICK, SHORT, UNIT, BELOW_ZERO, ABOVE_ZERO, STICKY_BELOW, STICKY_ABOVE, TO_EVEN, LOW, SPAN = (
    range(13)
)
_ONE = np.int64(1)
_SIGN, _MAGNITUDE = np.int64(-(2**63)), np.int64(2**63 - 1)
_EXPONENT, _HALF_ULP = np.int64(0x7FF << 52), np.int64(53 << 52)
_GOLDEN, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_DRAWN = np.uint64(64 - DRAW_BITS)


class Masked(NamedTuple):
    """A format of bases 2 and 16; see :class:`gpbnb.arithmetic.kernels.tags.Limited`."""

    bits: int  # of a digit
    precision: int
    mode: int
    gradual: float
    least: float
    below: float
    lowest: float
    largest: float
    under: float
    over: float


@borrowing(forceinline=True)
def _masked(formats: Any, f: Any) -> Any:
    whole, numbers = formats.whole[f], formats.numbers[f]
    return Masked(
        whole[BITS], whole[PRECISION], whole[MODE], numbers[0], numbers[1], numbers[2], numbers[3], numbers[4],
        numbers[5], numbers[6],
    )  # fmt: skip


@borrowing
def _draw(random: Any) -> Any:
    # The same random numbers as gpbnb.arithmetic.kernels.exact.draw.
    random[1] += np.uint64(1)
    z = random[0] + random[1] * _GOLDEN
    z = (z ^ (z >> np.uint64(30))) * _FIRST
    z = (z ^ (z >> np.uint64(27))) * _SECOND
    return np.int64((z ^ (z >> np.uint64(31))) >> _DRAWN)


@borrowing
def _rounded_magnitude(fmt: Any, random: Any, u: Any, k: Any, sticky: Any, negative: Any) -> Any:
    """Round a magnitude that is chopped to 53 bits and read as an integer, of which k bits are dropped."""
    unit, mode = _ONE << k, fmt.mode
    rest = u & (unit - 1)
    if mode == EVEN:
        return (u + ((unit >> 1) - 1) + np.int64(((u & unit) != 0) | sticky)) & -unit
    if mode == HALF_UP:
        return (u + (unit >> 1) - np.int64(negative & (not sticky))) & -unit
    if mode == RANDOM:
        scaled = _draw(random) << (k - DRAW_BITS)
        up = (scaled < rest) | ((scaled == rest) & sticky)
        return (u & -unit) + (np.int64(up) << k)
    outward = ((mode == UP) & (not negative)) | ((mode == DOWN) & negative)
    added = (unit - 1) + np.int64(sticky) if outward else unit >> 1 if mode == AWAY else np.int64(0)
    inexact = (rest != 0) | sticky
    return ((u + added) & -unit) | (np.int64(inexact & (mode == ODD)) << k)


@inner
def _within(fmt: Any, y: Any, exact_zero: Any) -> Any:
    """Apply the limits to a rounded number."""
    y = fmt.below if (abs(y) < fmt.least) & ((y != 0.0) | (not exact_zero)) else y
    y = fmt.over if y > fmt.largest else y
    return fmt.under if y < fmt.lowest else y


@inner
def _fit_53(fmt: Any, p: Any, r: Any, exact_zero: Any) -> Any:
    """Round p + r to 53 bits, ties to even; p is its nearest float64 and thus the result, except below `gradual`.

    There, adding `gradual` rounds p a second time. That is wrong if p, but not p + r, is a tie, and goes away from
    p + r.
    """
    a, rest = abs(p), (-r if p < 0.0 else r)
    base = fmt.gradual if a < fmt.gradual else 0.0
    s = a + base
    unit = base * 2.0**-52
    twice = 2.0 * (a - (s - base))
    s = s + unit if (twice == unit) & (rest > 0.0) else s
    s = s - unit if (twice == -unit) & (rest < 0.0) else s
    y = s - base
    return _within(fmt, 0.0 - y if p < 0.0 else y, exact_zero)


@borrowing
def _fit(fmt: Any, random: Any, p: Any, r: Any, exact_zero: Any) -> Any:
    """Round the exact p + r, where p is its nearest float64; NaN if the format has no such number."""
    if not abs(p) < np.inf:
        return np.nan
    if fmt.precision == 53 and fmt.bits == 1:
        if fmt.mode == EVEN:
            return _fit_53(fmt, p, r, exact_zero)
        if fmt.mode == AWAY:  # only the residual tells a tie, which the processor has rounded to even
            half = from_bits((bits(p) & _EXPONENT) - _HALF_ULP)
            tie = r == (half if p > 0.0 else -half)
            return _within(fmt, from_bits(bits(p) + np.int64(tie)) + 0.0, exact_zero)
    negative = p < 0.0
    a = abs(p)
    base = fmt.gradual if a < fmt.gradual else 0.0
    s = a + base
    e = a - (s - base)
    rest = e if e != 0.0 else (-r if negative else r)
    u = bits(s) - np.int64(rest < 0.0)
    k = np.int64(53) - fmt.precision
    if fmt.bits == 4:  # the first hexadecimal digit of 2**e * 1.f has 1 + e mod 4 bits
        k = np.int64(56) - np.int64(4) * fmt.precision - (((u >> 52) + 1) & 3)
    y = from_bits(_rounded_magnitude(fmt, random, u, k, rest != 0.0, negative)) - base
    return _within(fmt, 0.0 - y if negative else y, exact_zero)


@borrowing(error_model="numpy")
def _carefully(fmt: Any, random: Any, code: Any, x: Any, y: Any, z: Any) -> Any:
    """The result of an operation on numbers; NaN if the format has none."""
    if code in (ADD, SUBTRACT):
        y = 0.0 - y if code == SUBTRACT else y
        s = x + y
        c = s - x
        return _fit(fmt, random, s, (x - (s - c)) + (y - c), True)
    if code == MULTIPLY:
        p = x * y
        return _fit(fmt, random, p, fma(x, y, -p), (x == 0.0) | (y == 0.0))
    tied = fmt.precision == 53 and fmt.mode == AWAY  # no quotient or root is a tie, and residuals are not to scale
    if code == DIVIDE:
        if y == 0.0:
            return np.nan
        q = x / y
        r = fma(-q, y, x)
        return _fit(fmt, random, q, 0.0 if tied else -r if y < 0.0 else r, x == 0.0)
    if code == ROOT:
        if not x >= 0.0:
            return np.nan
        s = math.sqrt(x)
        return _fit(fmt, random, s, 0.0 if tied else fma(-s, s, x), x == 0.0)
    if code in (NEGATIVE, ABSOLUTE):  # fixed point has one more negative number than positive ones
        y = 0.0 - x if code == NEGATIVE or x < 0.0 else x
        return fmt.over if y > fmt.largest else y
    if code == ROUND:
        return _fit(fmt, random, x, 0.0, x == 0.0)
    w, rest, zero = fused_sum(x, y, z)
    if fmt.precision == 53 and fmt.mode == EVEN:
        near = fma(x, y, z)
        rest = rest if near == w else w - near
        w = near if w == w else w
    return _fit(fmt, random, w, rest, zero)


@inner(forceinline=True)
def _quick(p: Any, r: Any, rule: Any) -> Any:
    """Round p + r in a format of base 2 as if its range had no end; also return the size's bits."""
    unit, below, above, sticky_below, sticky_above, to_even = rule
    u = bits(p)
    sign = u & _SIGN
    size = u & _MAGNITUDE
    negative = u < 0
    size -= np.int64(((r < 0.0) & (p > 0.0)) | ((r > 0.0) & (p < 0.0)))
    sticky = select(negative, sticky_below, sticky_above) & np.int64(r != 0.0)
    odd = to_even & np.int64((size & unit) != 0)
    size = (size + select(negative, below, above) + (sticky | odd)) & -unit
    return from_bits(size | sign), size


@inner(forceinline=True)
def _quick_of_short(p: Any, rule: Any) -> Any:
    """Round p to nearest in a format of at most 25 bits: rounding twice is correct."""
    unit, above, to_even = rule[0], rule[2], rule[5]
    u = bits(p)
    size = u & _MAGNITUDE
    size = (size + above + (to_even & np.int64((size & unit) != 0))) & -unit
    return from_bits(size | (u & _SIGN)), size


@borrowing(forceinline=True)
def _rule(formats: Any, f: Any) -> Any:
    whole = formats.whole[f]
    return whole[UNIT], whole[BELOW_ZERO], whole[ABOVE_ZERO], whole[STICKY_BELOW], whole[STICKY_ABOVE], whole[TO_EVEN]


@inner(forceinline=True)
def _outside(size: Any, low: Any, span: Any) -> Any:
    # Sizes are so far from the ends of float64 that no product or quotient of other numbers is zero.
    return (np.uint64(size - low) > span) & (size != 0)


@inner
def _of_truths(code: Any, a: Any, b: Any, c: Any) -> Any:
    return (c >> (2 * a + b)) & 1


@borrowing(error_model="numpy", forceinline=True)
def _quick_result(operation: Any, short: Any, rule: Any, x: Any, y: Any) -> Any:
    """The result of a product, quotient or sum as if the range had no end, and the bits of its size."""
    if operation == MULTIPLY:
        p = x * y
        return _quick_of_short(p, rule) if short else _quick(p, fma(x, y, -p), rule)
    if operation == DIVIDE:
        p = x / y
        r = fma(-p, y, x)
        found, size = _quick_of_short(p, rule) if short else _quick(p, -r if y < 0.0 else r, rule)
        return found, select(y == 0.0, np.int64(-1), size)
    y = -y if operation == SUBTRACT else y
    p = x + y
    c = p - x
    return _quick_of_short(p, rule) if short else _quick(p, (x - (p - c)) + (y - c), rule)


@borrowing(forceinline=True)
def _along(operation: Any, short: Any, rule: Any, low: Any, span: Any, a: Any, b: Any, c: Any) -> Any:
    """Compute c from a and b, entry by entry."""
    gone = np.int64(0)
    for i in range(c.shape[0]):
        found, size = _quick_result(operation, short, rule, a[i], b[i])
        gone |= np.int64(_outside(size, low, span))
        c[i] = found + 0.0
    return gone


@borrowing
def _all_along(operation: Any, short: Any, rule: Any, low: Any, span: Any, a: Any, b: Any, c: Any) -> Any:
    if operation == MULTIPLY:
        if short:
            return _along(MULTIPLY, True, rule, low, span, a, b, c)
        return _along(MULTIPLY, False, rule, low, span, a, b, c)
    if operation == ADD:
        if short:
            return _along(ADD, True, rule, low, span, a, b, c)
        return _along(ADD, False, rule, low, span, a, b, c)
    if short:
        return _along(SUBTRACT, True, rule, low, span, a, b, c)
    return _along(SUBTRACT, False, rule, low, span, a, b, c)


@borrowing
def _quick_run(rule: Any, short: Any, low: Any, span: Any, code: Any, begin: int, end: int, values: Any) -> Any:
    """Run rows of one code; return whether a result is out of range."""
    gone = False
    rows = code.rows
    operation = rows[begin, 0]
    for o in range(begin, end):
        found, size = _quick_result(operation, short, rule, values[rows[o, 1]], values[rows[o, 2]])
        gone |= _outside(size, low, span)
        values[rows[o, 4]] = found + 0.0
    return gone


@borrowing
def quick_scalars(formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for one lane, assuming that nothing leaves the range; return whether anything did."""
    gone = False
    s = -1
    while s + 1 < code.segments.shape[0]:
        s += 1
        begin, end, f = code.segments[s, 0], code.segments[s, 1], code.segments[s, 2]
        if formats.whole[f, QUICK] == 0:
            return True
        operation = code.rows[begin, 0]
        if operation <= DIVIDE:
            low, span = formats.whole[f, LOW], np.uint64(formats.whole[f, SPAN])
            rule, short, pattern = _rule(formats, f), formats.whole[f, SHORT] != 0, code.segments[s, 3]
            if pattern == ONE_BY_ONE:
                gone |= _quick_run(rule, short, low, span, code, begin, end, values)
                continue
            a, b, out = np.int64(code.rows[begin, 1]), np.int64(code.rows[begin, 2]), np.int64(code.rows[begin, 4])
            count = end - begin
            first, second = values[a : a + count], values[b : b + count]
            if pattern == GATHERED:
                first, second = code.gathered[0, :count], code.gathered[1, :count]
                lefts, rights = code.operands[0, begin:end], code.operands[1, begin:end]
                for i in range(count):
                    first[i] = values[lefts[i]]
                    second[i] = values[rights[i]]
            gone |= _all_along(operation, short, rule, low, span, first, second, values[out : out + count]) != 0
            continue
        if operation == SKIP:
            if not truths[code.rows[begin, 1]]:
                after = end + np.int64(code.rows[begin, 2])
                while s + 1 < code.segments.shape[0] and code.segments[s + 1, 0] < after:
                    s += 1
            continue
        for o in range(begin, end):
            a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
            if operation == CHOOSE:
                values[out] = values[b] if truths[a] else values[c]
            elif operation == COMPARE:
                order = np.int64(values[a] > values[b]) - np.int64(values[a] < values[b]) + 1
                truths[out] = (np.int64(c) >> order) & 1
            elif operation == COMBINE:
                truths[out] = _of_truths(operation, np.int64(truths[a]), np.int64(truths[b]), np.int64(c))
            elif operation == NONZERO:
                gone |= values[a] == 0.0
            else:
                z = values[c] if operation == FUSED else 0.0
                found = _carefully(_masked(formats, f), formats.random, operation, values[a], values[b], z)
                gone |= found != found
                values[out] = found
    return gone


@borrowing
def careful_scalars(formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for one lane; return the number of rows that have a result, counted from the first."""
    o: Any = -1
    for s in range(code.segments.shape[0]):
        f = code.segments[s, 2]
        fmt, random = _masked(formats, f), formats.random
        while o + 1 < code.segments[s, 1]:
            o += 1
            operation = code.rows[o, 0]
            a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
            if operation == SKIP:
                o += 0 if truths[a] else np.int64(b)
            elif operation == CHOOSE:
                values[out] = values[b] if truths[a] else values[c]
            elif operation == COMPARE:
                order = np.int64(values[a] > values[b]) - np.int64(values[a] < values[b]) + 1
                truths[out] = (np.int64(c) >> order) & 1
            elif operation == COMBINE:
                truths[out] = _of_truths(operation, np.int64(truths[a]), np.int64(truths[b]), np.int64(c))
            elif operation == NONZERO:
                if values[a] == 0.0:
                    return o
            else:
                found = _carefully(
                    fmt, random, operation, values[a], values[b], values[c] if operation == FUSED else 0.0
                )
                if found != found:
                    return o
                values[out] = found
    return code.rows.shape[0]


@borrowing(error_model="numpy")
def quick_lanes(formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for each lane, assuming that nothing leaves the range; return whether anything did."""
    lanes = values.shape[1]
    gone = np.int64(0)
    for s in range(code.segments.shape[0]):
        f = code.segments[s, 2]
        rule, short = _rule(formats, f), formats.whole[f, SHORT] != 0
        low, span = formats.whole[f, LOW], np.uint64(formats.whole[f, SPAN])
        if formats.whole[f, QUICK] == 0:
            return True
        for o in range(code.segments[s, 0], code.segments[s, 1]):
            operation = code.rows[o, 0]
            a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
            if operation <= MULTIPLY:
                gone |= _all_along(operation, short, rule, low, span, values[a], values[b], values[out])
            elif operation == CHOOSE:
                for i in range(lanes):
                    values[out, i] = values[b, i] if truths[a, i] else values[c, i]
            elif operation == COMPARE:
                for i in range(lanes):
                    order = np.int64(values[a, i] > values[b, i]) - np.int64(values[a, i] < values[b, i]) + 1
                    truths[out, i] = (np.int64(c) >> order) & 1
            elif operation == COMBINE:
                for i in range(lanes):
                    truths[out, i] = _of_truths(operation, np.int64(truths[a, i]), np.int64(truths[b, i]), np.int64(c))
            elif operation == NONZERO:
                for i in range(lanes):
                    gone |= np.int64(values[a, i] == 0.0)
            elif operation == SKIP:
                pass
            else:
                fmt = _masked(formats, f)
                for i in range(lanes):
                    z = values[c, i] if operation == FUSED else 0.0
                    found = _carefully(fmt, formats.random, operation, values[a, i], values[b, i], z)
                    gone |= np.int64(found != found)
                    values[out, i] = found
    return gone != 0


# -- other numbers -----------------------------------------------------------------------------------------------------


@borrowing
def _run_segment(fmt: Any, code: Any, begin: int, end: int, values: Any, truths: Any) -> Any:
    """Run rows of a segment for each lane in an arithmetic of the scalar operations.

    Returns the row to go on with, or ~row for one that has no result.
    """
    o: Any
    operation = np.int64(code.rows[begin, 0])
    if operation == MULTIPLY:  # loops of their own, so that what depends on the format alone is computed once
        for o in range(begin, end):
            a, b, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 4]
            for i in range(values.shape[1]):
                found = scalar.multiply(fmt, scalar.load(fmt, values, (a, i)), scalar.load(fmt, values, (b, i)))
                if scalar.lost(fmt, found):
                    return ~o
                scalar.put(fmt, values, (out, i), found)
        return end
    if operation <= SUBTRACT:
        for o in range(begin, end):
            a, b, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 4]
            for i in range(values.shape[1]):
                y = scalar.load(fmt, values, (b, i))
                y = scalar.negative(fmt, y) if operation == SUBTRACT else y
                found = scalar.add(fmt, scalar.load(fmt, values, (a, i)), y)
                if scalar.lost(fmt, found):
                    return ~o
                scalar.put(fmt, values, (out, i), found)
        return end
    o = begin - 1
    while o + 1 < end:
        o += 1
        a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
        if operation == SKIP:
            holds = False
            for i in range(values.shape[1]):
                holds |= truths[a, i] != 0
            o += np.int64(0) if holds else np.int64(b)
            continue
        for i in range(values.shape[1]):
            if operation == COMBINE:
                truths[out, i] = _of_truths(operation, np.int64(truths[a, i]), np.int64(truths[b, i]), np.int64(c))
                continue
            if operation == CHOOSE:
                scalar.put(fmt, values, (out, i), scalar.load(fmt, values, (b if truths[a, i] else c, i)))
                continue
            x = scalar.load(fmt, values, (a, i))
            if operation == NONZERO:
                if scalar.compare(fmt, x, scalar.zero(fmt)) == 0:
                    return ~o
                continue
            y = scalar.load(fmt, values, (b, i))
            if operation == COMPARE:
                truths[out, i] = (np.int64(c) >> (scalar.compare(fmt, x, y) + 1)) & 1
                continue
            if operation == DIVIDE:
                if scalar.compare(fmt, y, scalar.zero(fmt)) == 0:
                    return ~o
                found = scalar.quotient(fmt, x, y)
            elif operation == ROOT:
                if scalar.compare(fmt, x, scalar.zero(fmt)) < 0:
                    return ~o
                found = scalar.root(fmt, x)
            elif operation == NEGATIVE:
                found = scalar.negative(fmt, x)
            elif operation == ABSOLUTE:
                found = scalar.absolute(fmt, x)
            elif operation == ROUND:
                found = scalar.round_(fmt, x)
            else:
                return ~o
            if scalar.lost(fmt, found):
                return ~o
            scalar.put(fmt, values, (out, i), found)
    return o + 1


LEAST = 2.0**-480
"""Least size of the numbers with which the machine computes quickly, and the inverse of the largest: no product and no
quotient of two of them leaves float64."""

_LEAST_BITS, _SPAN_BITS = (
    np.array([LEAST, 1 / LEAST]).view(np.int64)[0],
    np.uint64(np.diff(np.array([LEAST, 1 / LEAST]).view(np.int64))[0]),
)


def far(kind: Any, values: Any) -> Any:
    """Whether numbers are too small or too large for quick computation; those of other kinds never are."""
    raise TypeError("got a call of far from Python; needed one from a function compiled by numba")


@overload(far, strict=False, jit_options={"_nrt": False})
def _overloaded_far(kind: Any, values: Any) -> Any:
    def alone(kind: Any, values: Any) -> Any:
        found = False
        for i in range(values.shape[0]):
            found |= _outside(bits(values[i]) & _MAGNITUDE, _LEAST_BITS, _SPAN_BITS)
        return found

    def in_lanes(kind: Any, values: Any) -> Any:
        found = False
        for i in range(values.shape[0]):
            for j in range(values.shape[1]):
                found |= _outside(bits(values[i, j]) & _MAGNITUDE, _LEAST_BITS, _SPAN_BITS)
        return found

    if kind.instance_class is not Masks:
        return lambda kind, values: False
    return alone if values.ndim == 1 else in_lanes


@borrowing
def _run_segments(fmt: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for each lane in one format; return how many have results, counted from the first."""
    done = np.int64(0)
    for s in range(code.segments.shape[0]):
        if done < code.segments[s, 1]:
            done = _run_segment(fmt, code, done, code.segments[s, 1], values, truths)
        if done < 0:
            return ~done
    return code.rows.shape[0]


def execute(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
    """Run all rows for each lane; return how many rows have results in every lane, counted from the first.

    Parameters
    ----------
    far : whether numbers may be too small or too large for quick computation.
    """
    raise TypeError("got a call of execute from Python; needed one from a function compiled by numba")


@overload(execute, strict=False, jit_options={"_nrt": False})
def _overloaded_execute(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
    tag = kind.instance_class

    def of_one_lane(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
        if far or quick_scalars(formats, code, values, truths):
            return careful_scalars(formats, code, values, truths)
        return code.rows.shape[0]

    def of_lanes(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
        least = code.rows.shape[0]
        if far or quick_lanes(formats, code, values, truths):
            for i in range(values.shape[1]):
                least = min(least, careful_scalars(formats, code, values[:, i], truths[:, i]))
        return least

    def of_pairs(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
        done = np.int64(0)
        for s in range(code.segments.shape[0]):
            end, given = code.segments[s, 1], formats.whole[code.segments[s, 2]]
            if done >= end:
                continue
            if given[5] != 0:
                done = _run_segment(ShortDecimal(given[0], given[1] == AWAY), code, done, end, values, truths)
            else:
                fmt = LimitedDecimal(given[1], given[0], given[2], given[3], given[4])
                done = _run_segment(fmt, code, done, end, values, truths)
            if done < 0:
                return ~done
        return code.rows.shape[0]

    def of_two_words(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
        given = formats.whole[0]
        lowest, largest = (given[7], given[8], given[9]), (given[10], given[11], given[12])
        fmt = Wide(
            given[0], given[1], given[2], given[3], given[4], given[5], given[6], lowest, largest, given[13] != 0
        )
        return _run_segments(fmt, code, values, truths)

    def of_double_doubles(kind: Any, formats: Any, code: Any, values: Any, truths: Any, far: Any) -> Any:
        return _run_segments(kind, code, values, truths)

    if tag is Masks:
        return of_one_lane if values.ndim == 1 else of_lanes
    return {InPairs: of_pairs, InTwoWords: of_two_words, DoubleDouble: of_double_doubles}[tag]


@compiled
def evaluate(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows once for each lane; return how many have results, counted from the first."""
    return execute(kind, formats, code, values, truths, far(kind, values))


DONE, ROW, CYCLE, SINCE, LASTS = range(5)
"""Entries of the notes of a run: how many of its steps are done; the row that has no result in the step that ended it;
the number of steps after which the states repeat, once they do; and since when and until when they are compared with
those of one step."""


@compiled
def advance(
    kind: Any,
    loaded: Any,
    first: int,
    own: Any,
    places: Any,
    values: Any,
    truths: Any,
    kept: Any,
    cycle: int,
    notes: Any,
) -> None:
    """Take steps of a run, each of which replaces the states by their next values.

    Parameters
    ----------
    first : number of steps taken before.
    own : (steps, count, ...), numbers of each step.
    places, kept : see :class:`Places` and :class:`Kept`.
    cycle : number of steps after which the model repeats; 0 if states are not to be compared.
    notes : see :data:`DONE` and the following; brought up to date.
    """
    formats, code, feeds, distant = loaded
    states_at, outputs, kept_at, before = places.states, places.after, places.kept, kept.before
    after = before.copy()
    for j in range(outputs.shape[0]):
        copy_row(values, states_at[j], after, j)
    notes[DONE], notes[ROW] = 0, -1
    for step in range(own.shape[0]):
        for g in range(feeds.feeds.shape[0]):
            place, count, members, begin = feeds.feeds[g, 0], feeds.feeds[g, 1], feeds.feeds[g, 2], feeds.feeds[g, 3]
            if members > 1 or step == 0:
                begin += count * ((first + step) % members)
                for j in range(count):
                    copy_row(feeds.table, begin + j, values, place + j)
        for j in range(own.shape[1]):
            copy_row(own[step], j, values, places.own + j)
        notes[ROW] = 0
        done = execute(kind, formats, code, values, truths, distant | far(kind, after))
        if done < code.rows.shape[0]:
            notes[ROW] = done
            return
        for j in range(outputs.shape[0]):
            copy_row(values, outputs[j], after, j)
        for j in range(kept_at.shape[0]):
            copy_row(values, kept_at[j], kept.numbers[step], j)
        for j in range(outputs.shape[0]):
            copy_row(after, j, values, states_at[j])
        copy_row(truths, places.truth, kept.truths, step)
        notes[DONE] = step + 1
        if cycle > 0:
            notes[SINCE] += 1
            if notes[SINCE] % cycle == 0 and same_rows(after, before):
                notes[CYCLE] = notes[SINCE]
                return
            if notes[SINCE] == notes[LASTS]:
                for j in range(outputs.shape[0]):
                    copy_row(after, j, before, j)
                notes[SINCE] = 0
                notes[LASTS] += cycle * (notes[LASTS] // (8 * cycle) + 1)
    notes[ROW] = -1
