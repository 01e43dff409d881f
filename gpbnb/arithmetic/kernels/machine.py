"""The machine: it runs a program, a list of rounded operations, once for each lane, in any arithmetic with loops.

A row of a program has a code, three operands and the place of its result. Rows stand in segments of one destination
format, whose precision, rounding and range are data, so that one compiled loop serves all formats of a kind. The kinds
are tags without fields: :class:`Quick`, :class:`Careful`, :class:`InPairs`, :class:`InTwoWords` and
:class:`DoubleDouble`. What :class:`Quick` cannot compute, :class:`Careful` does.

numba compiles a function anew for a literal argument, such as True or a code, in each place where it differs.
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


class Quick(NamedTuple):
    """Base 2 on float64, where no number is near the ends of its range: values (places,) or (places, lanes)."""


class Careful(NamedTuple):
    """Bases 2 and 16 on float64: values (places, lanes)."""


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


class Held(NamedTuple):
    """What a run computes with."""

    #: Its numbers, with the axes of the kind, and the same memory with one axis.
    numbers: NDArray[Any]
    flat: NDArray[Any]
    #: (truths, lanes).
    truths: NDArray[np.uint8]


class Places(NamedTuple):
    """Where a run finds and puts its numbers; a number of each lane counts as one, and so does each of its parts."""

    #: the first of the numbers that each step takes.
    own: int
    #: (states,), the states, and their next values.
    states: NDArray[np.int64]
    after: NDArray[np.int64]
    #: (kept,), numbers to keep, and the place of the truth value to keep.
    kept: NDArray[np.int64]
    truth: int


class Kept(NamedTuple):
    """What is kept of each step."""

    #: (steps, kept) and (steps, lanes).
    numbers: NDArray[Any]
    truths: NDArray[np.uint8]
    #: (states,), the states with which later ones are compared, and room for their next values.
    before: NDArray[Any]
    after: NDArray[Any]


class Feeds(NamedTuple):
    """Numbers that a run takes from outside."""

    #: (steps, own), those of each step.
    own: NDArray[Any]
    #: (numbers, width), of which steps take some in turn; of many lanes, or of one to be repeated for each lane.
    table: NDArray[Any]
    #: (feeds, 4): the first place, count, number of members of the cycle, and where the first member begins.
    feeds: NDArray[np.int64]


# -- float64 with masks ------------------------------------------------------------------------------------------------

# Columns of Formats.whole.
BITS, PRECISION, MODE, QUICK, HOW, UNIT, BELOW_ZERO, ABOVE_ZERO, STICKY_BELOW, STICKY_ABOVE, TO_EVEN, LOW, SPAN = range(
    13
)
_ONE = np.int64(1)
_SIGN, _MAGNITUDE = np.int64(-(2**63)), np.int64(2**63 - 1)
_EXPONENT, _HALF_ULP = np.int64(0x7FF << 52), np.int64(53 << 52)
_GOLDEN, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_DRAWN = np.uint64(64 - DRAW_BITS)
_NONE = np.int64(-1)
_ADD, _SUBTRACT, _MULTIPLY = np.int64(ADD), np.int64(SUBTRACT), np.int64(MULTIPLY)
LONG, SHORT, TIED = range(3)
"""How quick results are rounded: by the sign of a residual, without, or by the size of the residual, which tells ties
away from zero in 53 bits."""
_SHORT, _LONG = np.int64(SHORT), np.int64(LONG)


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
        return _fit(fmt, random, s, (x - (s - c)) + (y - c), s == 0.0)
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


@inner(forceinline=True)
def _quick_tied(p: Any, r: Any) -> Any:
    """Round p + r to 53 bits, where p is p + r to nearest with ties to even, with ties away from zero."""
    u = bits(p)
    half = from_bits((u & _EXPONENT) - _HALF_ULP)
    size = (u & _MAGNITUDE) + np.int64(r == (half if p > 0.0 else -half))
    return from_bits(size | (u & _SIGN)), size


@inner(forceinline=True)
def _quick_sum(how: Any, p: Any, r: Any, rule: Any) -> Any:
    if how == SHORT:
        return _quick_of_short(p, rule)
    return _quick(p, r, rule) if how == LONG else _quick_tied(p, r)


@borrowing(forceinline=True)
def _rule(formats: Any, f: Any) -> Any:
    whole = formats.whole[f]
    return whole[UNIT], whole[BELOW_ZERO], whole[ABOVE_ZERO], whole[STICKY_BELOW], whole[STICKY_ABOVE], whole[TO_EVEN]


@inner(forceinline=True)
def _outside(size: Any, low: Any, span: Any) -> Any:
    # Sizes are so far from the ends of float64 that no product or quotient of other numbers is zero.
    return (np.uint64(size - low) > span) & (size != 0)


@borrowing(error_model="numpy", forceinline=True)
def _quick_result(operation: Any, how: Any, rule: Any, x: Any, y: Any) -> Any:
    """The result of a product, quotient or sum as if the range had no end, and the bits of its size."""
    if operation == MULTIPLY:
        p = x * y
        return _quick_sum(how, p, fma(x, y, -p), rule)
    if operation == DIVIDE:
        p = x / y
        r = fma(-p, y, x)
        r = 0.0 if how == TIED else -r if y < 0.0 else r  # no quotient is a tie
        found, size = _quick_sum(how, p, r, rule)
        return found, select(y == 0.0, _NONE, size)
    y = -y if operation == SUBTRACT else y
    p = x + y
    c = p - x
    return _quick_sum(how, p, (x - (p - c)) + (y - c), rule)


@borrowing(forceinline=True)
def _along(operation: Any, how: Any, rule: Any, low: Any, span: Any, a: Any, b: Any, c: Any) -> Any:
    """Compute c from a and b, entry by entry."""
    gone = np.int64(0)
    for i in range(c.shape[0]):
        found, size = _quick_result(operation, how, rule, a[i], b[i])
        gone |= np.int64(_outside(size, low, span))
        c[i] = found + 0.0
    return gone


@borrowing
def _all_along(operation: Any, how: Any, rule: Any, low: Any, span: Any, a: Any, b: Any, c: Any) -> Any:
    # A loop for each case, so that none branches and processors compute several entries at once.
    if operation == MULTIPLY:
        if how == SHORT:
            return _along(_MULTIPLY, _SHORT, rule, low, span, a, b, c)
        return _along(_MULTIPLY, _LONG, rule, low, span, a, b, c)
    if operation == ADD:
        if how == SHORT:
            return _along(_ADD, _SHORT, rule, low, span, a, b, c)
        return _along(_ADD, _LONG, rule, low, span, a, b, c)
    if how == SHORT:
        return _along(_SUBTRACT, _SHORT, rule, low, span, a, b, c)
    return _along(_SUBTRACT, _LONG, rule, low, span, a, b, c)


@borrowing
def _one_by_one(operation: Any, how: Any, rule: Any, low: Any, span: Any, rows: Any, values: Any) -> Any:
    gone = False
    for o in range(rows.shape[0]):
        found, size = _quick_result(operation, how, rule, values[rows[o, 1]], values[rows[o, 2]])
        gone |= _outside(size, low, span)
        values[rows[o, 4]] = found + 0.0
    return gone


@borrowing(error_model="numpy")
def _quick_other(operation: Any, how: Any, rule: Any, x: Any, y: Any, z: Any) -> Any:
    """The result of any operation on numbers, as :func:`_quick_result`."""
    if operation <= DIVIDE:
        return _quick_result(operation, how, rule, x, y)
    if operation in (NEGATIVE, ABSOLUTE):
        return (0.0 - x if operation == NEGATIVE else abs(x)), np.int64(0)
    p, r = x, 0.0
    if operation == ROOT:
        p = math.sqrt(x)
        r = 0.0 if how == TIED else fma(-p, p, x)  # nor is a root
    elif operation == FUSED:
        if how == TIED:
            return x, _NONE
        if rule[0] == 1:  # 53 bits
            p = fma(x, y, z)
        else:
            p, r, _ = fused_sum(x, y, z)
            how = _LONG
    found, size = _quick_sum(how, p, r, rule)
    return found, select(p != p, _NONE, size)


@borrowing
def _of_truths(a: Any, b: Any, c: Any) -> Any:
    return (np.int64(c) >> (2 * np.int64(a) + np.int64(b))) & 1


@borrowing
def _compared(x: Any, y: Any, orders: Any) -> Any:
    return (np.int64(orders) >> (np.int64(x > y) - np.int64(x < y) + 1)) & 1


@borrowing(forceinline=True)
def _limits(formats: Any, f: Any) -> Any:
    """How results of a format are rounded, and the range of their sizes."""
    whole = formats.whole[f]
    return _rule(formats, f), whole[HOW], whole[LOW], np.uint64(whole[SPAN])


@borrowing
def quick_scalars(formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for one lane; return whether anything left the range."""
    gone = False
    s, f = -1, np.int64(0)
    rule, how, low, span = _limits(formats, f)
    while s + 1 < code.segments.shape[0]:
        s += 1
        begin, end, pattern = code.segments[s, 0], code.segments[s, 1], code.segments[s, 3]
        operation = np.int64(code.rows[begin, 0])
        if code.segments[s, 2] != f:
            f = code.segments[s, 2]
            rule, how, low, span = _limits(formats, f)
        if pattern != ONE_BY_ONE and how != TIED:
            a, b, out = np.int64(code.rows[begin, 1]), np.int64(code.rows[begin, 2]), np.int64(code.rows[begin, 4])
            count = end - begin
            first, second = values[a : a + count], values[b : b + count]
            if pattern == GATHERED:
                first, second = code.gathered[0, :count], code.gathered[1, :count]
                lefts, rights = code.operands[0, begin:end], code.operands[1, begin:end]
                for i in range(count):
                    first[i] = values[lefts[i]]
                    second[i] = values[rights[i]]
            gone |= _all_along(operation, how, rule, low, span, first, second, values[out : out + count]) != 0
        elif operation <= DIVIDE:
            gone |= _one_by_one(operation, how, rule, low, span, code.rows[begin:end], values)
        elif operation == SKIP:
            if not truths[code.rows[begin, 1], 0]:
                after = end + np.int64(code.rows[begin, 2])
                while s + 1 < code.segments.shape[0] and code.segments[s + 1, 0] < after:
                    s += 1
        else:
            for o in range(begin, end):
                a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
                if operation == CHOOSE:
                    values[out] = values[b] if truths[a, 0] else values[c]
                elif operation == COMPARE:
                    truths[out, 0] = _compared(values[a], values[b], c)
                elif operation == COMBINE:
                    truths[out, 0] = _of_truths(truths[a, 0], truths[b, 0], c)
                elif operation == NONZERO:
                    gone |= values[a] == 0.0
                else:
                    z = values[c] if operation == FUSED else 0.0
                    found, size = _quick_other(operation, how, rule, values[a], values[b], z)
                    gone |= _outside(size, low, span)
                    values[out] = found + 0.0
    return gone


@borrowing
def quick_lanes(formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for each lane; return whether anything left the range."""
    gone = np.int64(0)
    for s in range(code.segments.shape[0]):
        rule, how, low, span = _limits(formats, code.segments[s, 2])
        for o in range(code.segments[s, 0], code.segments[s, 1]):
            operation = np.int64(code.rows[o, 0])
            a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
            if operation <= MULTIPLY and how != TIED:
                gone |= _all_along(operation, how, rule, low, span, values[a], values[b], values[out])
                continue
            if operation == SKIP:
                continue
            for i in range(values.shape[1]):
                if operation == CHOOSE:
                    values[out, i] = values[b, i] if truths[a, i] else values[c, i]
                elif operation == COMPARE:
                    truths[out, i] = _compared(values[a, i], values[b, i], c)
                elif operation == COMBINE:
                    truths[out, i] = _of_truths(truths[a, i], truths[b, i], c)
                elif operation == NONZERO:
                    gone |= np.int64(values[a, i] == 0.0)
                else:
                    z = values[c, i] if operation == FUSED else 0.0
                    found, size = _quick_other(operation, how, rule, values[a, i], values[b, i], z)
                    gone |= np.int64(_outside(size, low, span))
                    values[out, i] = found + 0.0
    return gone != 0


@borrowing
def careful_lane(formats: Any, code: Any, values: Any, truths: Any, i: Any) -> Any:
    """Run all rows for one lane; return the number of rows that have a result, counted from the first."""
    o: Any = -1
    for s in range(code.segments.shape[0]):
        f = code.segments[s, 2]
        fmt, random = _masked(formats, f), formats.random
        while o + 1 < code.segments[s, 1]:
            o += 1
            operation = np.int64(code.rows[o, 0])
            a, b, c, out = code.rows[o, 1], code.rows[o, 2], code.rows[o, 3], code.rows[o, 4]
            if operation == SKIP:
                o += 0 if truths[a, i] else np.int64(b)
            elif operation == CHOOSE:
                values[out, i] = values[b, i] if truths[a, i] else values[c, i]
            elif operation == COMPARE:
                truths[out, i] = _compared(values[a, i], values[b, i], c)
            elif operation == COMBINE:
                truths[out, i] = _of_truths(truths[a, i], truths[b, i], c)
            elif operation == NONZERO:
                if values[a, i] == 0.0:
                    return o
            else:
                z = values[c, i] if operation == FUSED else 0.0
                found = _carefully(fmt, random, operation, values[a, i], values[b, i], z)
                if found != found:
                    return o
                values[out, i] = found
    return code.rows.shape[0]


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
                truths[out, i] = _of_truths(truths[a, i], truths[b, i], c)
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


def execute(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
    """Run all rows for each lane; return how many rows have results in every lane, counted from the first."""
    raise TypeError("got a call of execute from Python; needed one from a function compiled by numba")


@overload(execute, strict=False, jit_options={"_nrt": False})
def _overloaded_execute(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
    tag = kind.instance_class

    def of_one_lane(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
        return 0 if quick_scalars(formats, code, values, truths) else code.rows.shape[0]

    def of_lanes(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
        return 0 if quick_lanes(formats, code, values, truths) else code.rows.shape[0]

    def carefully(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
        least = code.rows.shape[0]
        for i in range(values.shape[1]):
            least = min(least, careful_lane(formats, code, values, truths, i))
        return least

    def of_pairs(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
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

    def of_two_words(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
        given = formats.whole[0]
        lowest, largest = (given[7], given[8], given[9]), (given[10], given[11], given[12])
        fmt = Wide(
            given[0], given[1], given[2], given[3], given[4], given[5], given[6], lowest, largest, given[13] != 0
        )
        return _run_segments(fmt, code, values, truths)

    def of_double_doubles(kind: Any, formats: Any, code: Any, values: Any, truths: Any) -> Any:
        return _run_segments(kind, code, values, truths)

    if tag is Quick:
        return of_one_lane if values.ndim == 1 else of_lanes
    return {Careful: carefully, InPairs: of_pairs, InTwoWords: of_two_words, DoubleDouble: of_double_doubles}[tag]


DONE, ROW, CYCLE, SINCE, LASTS = range(5)
"""Entries of the notes of a run: how many of its steps are done; the row that has no result in the step that ended it;
the number of steps after which the states repeat, once they do; and since when and until when they are compared with
those of one step."""


@borrowing
def _take_feeds(feeds: Any, step: int, every: bool, width: int, values: Any) -> None:
    table = feeds.table
    for g in range(feeds.feeds.shape[0]):
        place, count, members, at = feeds.feeds[g, 0], feeds.feeds[g, 1], feeds.feeds[g, 2], feeds.feeds[g, 3]
        if members > 1 or every:
            at += count * (step % members)
            to = values[place * width : (place + count) * width]
            for j in range(count):
                for k in range(0, width, table.shape[1]):
                    for m in range(table.shape[1]):
                        to[j * width + k + m] = table[at + j, m]


@compiled
def advance(
    kind: Any,
    formats: Any,
    code: Any,
    feeds: Any,
    places: Any,
    held: Any,
    kept: Any,
    first: int,
    cycle: int,
    notes: Any,
) -> None:
    """Take steps of a run, each of which replaces the states by their next values, from step notes[DONE] on.

    Parameters
    ----------
    held, places, kept, feeds : see :class:`Held`, :class:`Places`, :class:`Kept` and :class:`Feeds`.
    first : number of steps taken before those of `feeds`.
    cycle : number of steps after which the model repeats; 0 if states are not to be compared.
    notes : see :data:`DONE` and the following; brought up to date.
    """
    numbers, values, truths = held
    begin, own = notes[DONE], feeds.own
    width = values.shape[0] // numbers.shape[0]
    for step in range(begin, own.shape[0]):
        _take_feeds(feeds, first + step, step == begin, width, values)
        for j in range(own.shape[1]):
            values[places.own + j] = own[step, j]
        notes[ROW] = 0
        done = execute(kind, formats, code, numbers, truths)
        if done < code.rows.shape[0]:
            notes[ROW] = done
            return
        for j in range(places.after.shape[0]):
            kept.after[j] = values[places.after[j]]
        for j in range(places.kept.shape[0]):
            kept.numbers[step, j] = values[places.kept[j]]
        same = cycle > 0
        for j in range(places.after.shape[0]):
            values[places.states[j]] = kept.after[j]
            same &= kept.after[j] == kept.before[j]
        for i in range(truths.shape[1]):
            kept.truths[step, i] = truths[places.truth, i]
        notes[DONE] = step + 1
        if cycle > 0:
            notes[SINCE] += 1
            if notes[SINCE] % cycle == 0 and same:
                notes[CYCLE] = notes[SINCE]
                notes[ROW] = -1
                return
            if notes[SINCE] == notes[LASTS]:
                for j in range(places.after.shape[0]):
                    kept.before[j] = kept.after[j]
                notes[SINCE] = 0
                notes[LASTS] += cycle * (notes[LASTS] // (8 * cycle) + 1)
    notes[ROW] = -1
