"""The machine: it runs a program, a list of rounded operations, once for each lane, in any arithmetic with loops.

A row of a program has three operands and the place of its result. Rows stand in segments of one operation and one
destination format, whose precision, rounding and range are data, so that one compiled loop serves all formats of a kind
of :mod:`gpbnb.arithmetic.kernels.tags`. What :class:`~gpbnb.arithmetic.kernels.tags.Quick` cannot compute,
:class:`~gpbnb.arithmetic.kernels.tags.Careful` does.

The functions of the kinds have one signature, and :func:`advance` takes the address of one of them, so that the loop
over steps is compiled only once. numba compiles a function anew for a literal argument, such as True or a code, in each
place where it differs.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from gpbnb.arithmetic.kernels import decimal, doubledouble, shortdecimal, wide
from gpbnb.arithmetic.kernels.bits import at, call, copy, entries, words
from gpbnb.arithmetic.kernels.careful import carefully, masked
from gpbnb.arithmetic.kernels.compiling import address_of, addressed, borrowing, compiled, inner
from gpbnb.arithmetic.kernels.kinds import operations_of, pair_format, short_format, word_format
from gpbnb.arithmetic.kernels.quick import (
    COLUMNS,
    LONG,
    NUMBER,
    NUMBERS,
    RANDOM,
    SHORT,
    WHOLE,
    basic,
    other,
    rule_of,
)
from gpbnb.arithmetic.kernels.tags import (
    ABSOLUTE,
    ADD,
    CHOOSE,
    COMBINE,
    COMPARE,
    DIVIDE,
    FUSED,
    MULTIPLY,
    NONZERO,
    ROOT,
    ROUND,
    SKIP,
    SUBTRACT,
    Careful,
    DoubleDouble,
    InPairs,
    InShortPairs,
    InTwoWords,
    Quick,
)

ONE_BY_ONE, GATHERED, NEIGHBOURS = range(3)
"""How rows of a segment run for one lane: one after the other, since one may take the result of another; together,
after their operands are gathered; or together, since their operands and results lie one after the other in memory."""


# Entries of the tables of formats, of a program, of the numbers that it runs on and of a run. Each holds addresses of
# arrays, and integers; see gpbnb.arithmetic.machine and gpbnb.arithmetic.loop, which make them.
A, B, C, OUT, BEGINS, OPERATIONS, FORMAT, TOGETHER, ROOM, SEGMENTS, ROWS = range(11)
"""Operands and results of rows, uint32; where segments begin, and their operations, formats and how their rows run,
int64; room for the operands of a segment, float64; and how many segments and rows there are."""
VALUES, TRUTHS = range(2)
"""Numbers and truth values; those of all lanes lie beside each other, and so do the parts of a number."""
# fmt: off
(
    CYCLE_OF, LANES, WIDTH, FEEDS, FEED_COUNT, STATES, STATES_AT, STATE_PIECES, AFTER_AT, AFTER_PIECES, KEPT_ROW,
    KEPT_AT, KEPT_PIECES, TRUTH_AT, KEPT, KEPT_TRUTHS, BEFORE, AFTER,
) = range(18)
# fmt: on
"""Steps of a run; a place or a number of each lane counts as one, and so does each of its parts. Places are in pieces:
the first of some that follow each other, and how many there are."""
PLACE, COUNT, MEMBERS, BEGIN, BETWEEN, PARTS, ADDRESS = range(7)
"""Columns of feeds: the place of the first of some numbers, and how many there are; how many members a cycle of such
numbers has, and which is the first; how far members are apart; parts of a number, which are those of one lane if all
lanes take the same; and an address."""


# -- float64 with masks ------------------------------------------------------------------------------------------------

_ADD, _MULTIPLY, _SHORT, _LONG, _ONE = map(np.int64, (ADD, MULTIPLY, SHORT, LONG, 1))


@borrowing(forceinline=True)
def _along(operation: Any, how: Any, sign: Any, rule: Any, a: Any, b: Any, c: Any, count: Any) -> Any:
    """Compute c from a and b, entry by entry; return whether a result left the range."""
    any_gone = False
    for i in range(count):
        c[i], gone = basic(operation, how, rule, a[i], sign * b[i])
        any_gone |= gone
    return any_gone


@borrowing(forceinline=True)
def _all_along(operation: Any, formats: Any, f: Any, a: Any, b: Any, c: Any, count: Any) -> Any:
    # A loop for each case, so that none branches and processors compute several entries at once.
    how, rule = rule_of(formats, f)
    sign = -1.0 if operation == SUBTRACT else 1.0
    if operation == MULTIPLY:
        if how == SHORT:
            return _along(_MULTIPLY, _SHORT, 1.0, rule, a, b, c, count)
        if how == LONG:
            return _along(_MULTIPLY, _LONG, 1.0, rule, a, b, c, count)
        return _along(_MULTIPLY, how, 1.0, rule, a, b, c, count)
    if how == SHORT:
        return _along(_ADD, _SHORT, sign, rule, a, b, c, count)
    if how == LONG:
        return _along(_ADD, _LONG, sign, rule, a, b, c, count)
    return _along(_ADD, how, sign, rule, a, b, c, count)


@borrowing
def _one_by_one(operation: Any, how: Any, rule: Any, a: Any, b: Any, out: Any, count: Any, values: Any) -> Any:
    any_gone = False
    for i in range(count):
        values[out[i]], gone = basic(operation, how, rule, values[a[i]], values[b[i]])
        any_gone |= gone
    return any_gone


@borrowing
def _without_rounding(operation: Any, values: Any, truths: Any, a: Any, b: Any, c: Any, code: Any, out: Any) -> Any:
    """Choose, compare, combine, or return whether a number is zero; `code` is the third operand as it stands."""
    if operation == CHOOSE:
        values[out] = values[b] if truths[a] else values[c]
    elif operation == NONZERO:
        return values[a] == 0.0
    else:
        k = 2 * np.int64(truths[a]) + np.int64(truths[b])
        if operation == COMPARE:
            x, y = values[a], values[b]
            k = np.int64(x > y) - np.int64(x < y) + 1
        truths[out] = (code >> k) & 1
    return False


@borrowing
def _row(code: Any, lanes: Any, o: Any) -> Any:
    """The places of the operands and of the result of a row in the first lane, and its third operand as it stands."""
    a, b, c = entries(code, A, np.uint32)[o], entries(code, B, np.uint32)[o], np.int64(entries(code, C, np.uint32)[o])
    return lanes * a, lanes * b, lanes * c, lanes * entries(code, OUT, np.uint32)[o], c


@inner(forceinline=True)
def _rounds(operation: Any) -> Any:
    """Whether a result may be rounded, or have another sign."""
    return (operation < CHOOSE) | (operation == ROUND) | (operation == FUSED)


@addressed
def _quick_lane(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    values, truths = entries(held, VALUES, np.float64), entries(held, TRUTHS, np.uint8)
    operations, numbers = entries(code, OPERATIONS, np.int64), entries(code, FORMAT, np.int64)
    begins, together = entries(code, BEGINS, np.int64), entries(code, TOGETHER, np.int64)
    any_gone, f, after = False, np.int64(0), np.int64(0)
    how, rule = rule_of(formats, f)
    for s in range(code[SEGMENTS]):
        begin, count, operation = begins[s], begins[s + 1] - begins[s], operations[s]
        if begin < after:
            continue
        if numbers[s] != f:
            f = numbers[s]
            how, rule = rule_of(formats, f)
        a, b = at(entries(code, A, np.uint32), begin), at(entries(code, B, np.uint32), begin)
        c, out = at(entries(code, C, np.uint32), begin), at(entries(code, OUT, np.uint32), begin)
        if together[s] != ONE_BY_ONE:
            first, second = at(values, a[0]), at(values, b[0])
            if together[s] == GATHERED:
                first = entries(code, ROOM, np.float64)
                second = at(first, count)
                for i in range(count):
                    first[i] = values[a[i]]
                for i in range(count):
                    second[i] = values[b[i]]
            any_gone |= _all_along(operation, formats, f, first, second, at(values, out[0]), count)
        elif operation <= DIVIDE:
            any_gone |= _one_by_one(operation, how, rule, a, b, out, count, values)
        elif operation == SKIP:
            if not truths[a[0]]:
                after = begin + count + np.int64(b[0])
        else:
            for i in range(count):
                x, y, z = a[i], b[i], c[i]
                if _rounds(operation):
                    third = values[z] if operation == FUSED else 0.0
                    values[out[i]], gone = other(operation, how, rule, values[x], values[y], third)
                    any_gone |= gone
                else:
                    any_gone |= _without_rounding(operation, values, truths, x, y, z, np.int64(z), out[i])
    return 0 if any_gone else code[ROWS]


@addressed
def _quick_lanes(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    values, truths = entries(held, VALUES, np.float64), entries(held, TRUTHS, np.uint8)
    operations, numbers = entries(code, OPERATIONS, np.int64), entries(code, FORMAT, np.int64)
    begins, any_gone = entries(code, BEGINS, np.int64), False
    for s in range(code[SEGMENTS]):
        operation = operations[s]
        how, rule = rule_of(formats, numbers[s])
        if operation == SKIP:
            continue
        for o in range(begins[s], begins[s + 1]):
            a, b, c, out, third = _row(code, lanes, o)
            if operation <= MULTIPLY:
                any_gone |= _all_along(
                    operation, formats, numbers[s], at(values, a), at(values, b), at(values, out), lanes
                )
                continue
            for i in range(lanes):
                if operation <= DIVIDE:
                    values[out + i], gone = basic(operation, how, rule, values[a + i], values[b + i])
                    any_gone |= gone
                elif _rounds(operation):
                    z = values[c + i] if operation == FUSED else 0.0
                    values[out + i], gone = other(operation, how, rule, values[a + i], values[b + i], z)
                    any_gone |= gone
                else:
                    any_gone |= _without_rounding(operation, values, truths, a + i, b + i, c + i, third, out + i)
    return 0 if any_gone else code[ROWS]


@borrowing
def _careful_lane(formats: Any, code: Any, held: Any, lanes: Any, i: Any) -> Any:
    """Run all rows for one lane; return the number of rows that have a result, counted from the first."""
    values, truths = at(entries(held, VALUES, np.float64), i), at(entries(held, TRUTHS, np.uint8), i)
    whole, numbers = entries(formats, WHOLE, np.int64), entries(formats, NUMBER, np.float64)
    begins, random, o = entries(code, BEGINS, np.int64), entries(formats, RANDOM, np.uint64), np.int64(0)
    for s in range(code[SEGMENTS]):
        operation, f = entries(code, OPERATIONS, np.int64)[s], entries(code, FORMAT, np.int64)[s]
        fmt = masked(at(whole, COLUMNS * f), at(numbers, NUMBERS * f))
        while o < begins[s + 1]:
            a, b, c, out, third = _row(code, lanes, o)
            if operation == SKIP:
                o += 0 if truths[a] else np.int64(entries(code, B, np.uint32)[o])
            elif _rounds(operation):
                z = values[c] if operation == FUSED else 0.0
                found = carefully(fmt, random, operation, values[a], values[b], z)
                if found != found:
                    return o
                values[out] = found
            elif _without_rounding(operation, values, truths, a, b, c, third, out):
                return o
            o += 1
    return code[ROWS]


@addressed
def _careful_lanes(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    least = code[ROWS]
    for i in range(lanes):
        least = min(least, _careful_lane(formats, code, held, lanes, i))
    return least


# -- other numbers -----------------------------------------------------------------------------------------------------


@borrowing(forceinline=True)
def _no_format(columns: Any) -> Any:
    return DoubleDouble()


@inner(forceinline=True)
def _double_double(fmt: Any, operation: Any, x: Any, y: Any) -> Any:
    return doubledouble.operate(operation, x, y)


def _loop(kind: Any, operate: Any, parts: int) -> Any:
    """Return the function that runs rows of one operation in an arithmetic whose numbers have some parts."""
    load, put, compare = kind.load, kind.put, kind.compare

    @borrowing(forceinline=True)
    def run(fmt: Any, operation: Any, code: Any, o: Any, end: Any, values: Any, truths: Any, lanes: Any) -> Any:
        """Run rows from o on for each lane; return the row to go on with, or ~row if one has no result."""
        first, second, last = entries(code, A, np.uint32), entries(code, B, np.uint32), entries(code, C, np.uint32)
        results = entries(code, OUT, np.uint32)
        while o < end:
            a, b, c, out = lanes * first[o], lanes * second[o], lanes * last[o], lanes * results[o]
            third = np.int64(last[o])
            holds = operation != SKIP
            for i in range(lanes):
                if operation == SKIP:
                    holds |= truths[a + i] != 0
                elif operation == CHOOSE:
                    chosen = b if truths[a + i] else c
                    for j in range(parts):
                        values[(out + i) * parts + j] = values[(chosen + i) * parts + j]
                elif operation == COMBINE:
                    table = 2 * np.int64(truths[a + i]) + np.int64(truths[b + i])
                    truths[out + i] = (third >> table) & 1
                elif operation == NONZERO:
                    if values[(a + i) * parts] == 0:
                        return ~o
                elif operation == COMPARE:
                    order = compare(fmt, load(fmt, values, a + i), load(fmt, values, b + i))
                    truths[out + i] = (third >> (order + 1)) & 1
                else:
                    x, below = load(fmt, values, a + i), values[(a + i) * parts] < 0
                    y = load(fmt, values, b + i) if operation <= DIVIDE else x
                    if (
                        operation == FUSED
                        or (operation == DIVIDE and values[(b + i) * parts] == 0)
                        or (operation == ROOT and below)
                    ):
                        return ~o
                    found = x if operation == ABSOLUTE and not below else operate(fmt, operation, x, y)
                    put(fmt, values, out + i, found)
                    lead = values[(out + i) * parts]
                    if lead != lead:
                        return ~o
            o += 1 if holds else 1 + np.int64(second[o])
        return o

    @borrowing(forceinline=True)
    def in_copies(fmt: Any, operation: Any, code: Any, o: Any, end: Any, values: Any, truths: Any, lanes: Any) -> Any:
        """The same; copies of the loop serve products and sums, so that what depends on the format is computed once."""
        if operation == MULTIPLY:
            return run(fmt, _MULTIPLY, code, o, end, values, truths, lanes)
        if operation <= SUBTRACT:
            return run(fmt, operation & SUBTRACT, code, o, end, values, truths, lanes)
        return run(fmt, operation, code, o, end, values, truths, lanes)

    return run if kind is doubledouble else in_copies


@borrowing
def _segment(formats: Any, code: Any, s: Any) -> Any:
    """The columns of the format of a segment, its operation, and the row behind it."""
    f, operation = entries(code, FORMAT, np.int64)[s], entries(code, OPERATIONS, np.int64)[s]
    return at(entries(formats, WHOLE, np.int64), COLUMNS * f), operation, entries(code, BEGINS, np.int64)[s + 1]


_run_pairs, _run_short = (_loop(kind, operations_of(kind).any, 2) for kind in (decimal, shortdecimal))
_run_two_words, _run_double_doubles = _loop(wide, operations_of(wide).any, 3), _loop(doubledouble, _double_double, 2)


@borrowing(forceinline=True)
def _rows(run: Any, format_of: Any, values: Any, formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    """Run all rows; return the number of those that have a result, counted from the first."""
    truths, o = entries(held, TRUTHS, np.uint8), np.int64(0)
    for s in range(code[SEGMENTS]):
        given, operation, end = _segment(formats, code, s)
        o = run(format_of(given), operation, code, o, end, values, truths, lanes)
        if o < 0:
            return ~o
    return o


@addressed
def _pairs_lane(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    return _rows(_run_pairs, pair_format, entries(held, VALUES, np.int64), formats, code, held, _ONE)


@addressed
def _pairs_lanes(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    return _rows(_run_pairs, pair_format, entries(held, VALUES, np.int64), formats, code, held, lanes)


@addressed
def _short_pairs_lane(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    return _rows(_run_short, short_format, entries(held, VALUES, np.int64), formats, code, held, _ONE)


@addressed
def _short_pairs_lanes(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    return _rows(_run_short, short_format, entries(held, VALUES, np.int64), formats, code, held, lanes)


@addressed
def _two_words(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    return _rows(_run_two_words, word_format, entries(held, VALUES, np.int64), formats, code, held, lanes)


@borrowing(forceinline=True)
def _double_doubles_along(operation: Any, a: Any, b: Any, c: Any, count: Any) -> Any:
    """Compute c, pairs, from a and b, high parts before low ones; return whether a result left the range."""
    any_gone = False
    for i in range(count):
        c[2 * i], c[2 * i + 1] = doubledouble.operate(operation, (a[i], a[count + i]), (b[i], b[count + i]))
        any_gone |= c[2 * i] != c[2 * i]
    return any_gone


@borrowing
def _double_doubles_together(operation: Any, code: Any, o: Any, count: Any, values: Any) -> Any:
    """Run rows of one lane together, from row o on; return whether a result left the range."""
    a, b = at(entries(code, A, np.uint32), o), at(entries(code, B, np.uint32), o)
    first, sign = entries(code, ROOM, np.float64), -1.0 if operation == SUBTRACT else 1.0
    second, c = at(first, 2 * count), at(values, 2 * np.int64(entries(code, OUT, np.uint32)[o]))
    for i in range(count):
        first[i], first[count + i] = values[2 * a[i]], values[2 * a[i] + 1]
    for i in range(count):
        second[i], second[count + i] = sign * values[2 * b[i]], sign * values[2 * b[i] + 1]
    if operation == MULTIPLY:
        return _double_doubles_along(_MULTIPLY, first, second, c, count)
    return _double_doubles_along(_ADD, first, second, c, count)


@addressed
def _double_doubles_lane(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    values, truths, o = entries(held, VALUES, np.float64), entries(held, TRUTHS, np.uint8), np.int64(0)
    for s in range(code[SEGMENTS]):
        _, operation, end = _segment(formats, code, s)
        together = o < end and entries(code, TOGETHER, np.int64)[s] != ONE_BY_ONE
        if together and not _double_doubles_together(operation, code, o, end - o, values):
            o = end
        o = _run_double_doubles(DoubleDouble(), operation, code, o, end, values, truths, _ONE)
        if o < 0:
            return ~o
    return o


@addressed
def _double_doubles(formats: Any, code: Any, held: Any, lanes: Any) -> Any:
    return _rows(_run_double_doubles, _no_format, entries(held, VALUES, np.float64), formats, code, held, lanes)


def address(kind: Any, alone: bool) -> int:
    """Return the address of a kind's function, for one lane alone or for any number of them."""
    return _address(_FUNCTIONS[type(kind)][not alone])


_FUNCTIONS = {
    Quick: (_quick_lane, _quick_lanes),
    Careful: (_careful_lanes, _careful_lanes),
    InPairs: (_pairs_lane, _pairs_lanes),
    InShortPairs: (_short_pairs_lane, _short_pairs_lanes),
    InTwoWords: (_two_words, _two_words),
    DoubleDouble: (_double_doubles_lane, _double_doubles),
}


@cache
def _address(function: Any) -> int:
    return address_of(function, _TABLE, _TABLE, _TABLE, types.int64)


_TABLE = types.CPointer(types.int64)

# -- steps -------------------------------------------------------------------------------------------------------------

DONE, UNTIL, ROW, CYCLE, SINCE, LASTS = range(6)
"""Entries of the notes of a run: how many of its steps are done, and how many are to be done; the row that has no
result in the step that ended it; the number of steps after which the states repeat, once they do; and since when and
until when they are compared with those of one step."""


@compiled
def once(execute: int, formats: int, code: int, held: int, lanes: int) -> Any:
    """Run all rows; return how many have results in every lane, counted from the first, or 0."""
    return call(execute, words(formats), words(code), words(held), lanes)


@inner
def _gathered(values: Any, pieces: Any, count: Any, to: Any) -> None:
    for i in range(count):
        copy(to, at(values, pieces[2 * i]), pieces[2 * i + 1])
        to = at(to, pieces[2 * i + 1])


@inner
def _scattered(values: Any, pieces: Any, count: Any, given: Any) -> None:
    for i in range(count):
        copy(at(values, pieces[2 * i]), given, pieces[2 * i + 1])
        given = at(given, pieces[2 * i + 1])


@inner
def _feed(run: Any, values: Any, step: Any, begin: Any) -> None:
    """Bring the numbers that a step takes to their places."""
    wide = run[WIDTH]
    for g in range(run[FEED_COUNT]):
        feed = at(entries(run, FEEDS, np.int64), 7 * g)
        count, members, parts = feed[COUNT], feed[MEMBERS], feed[PARTS]
        if members > 1 or step == begin:
            taken = at(entries(feed, ADDRESS, np.int64), feed[BETWEEN] * ((feed[BEGIN] + step) % members))
            to = at(values, feed[PLACE] * wide)
            if parts == wide:
                copy(to, taken, count * wide)
                continue
            for i in range(count):
                for k in range(0, wide, parts):
                    for m in range(parts):
                        to[i * wide + k + m] = taken[i * parts + m]


@compiled
def advance(execute: int, formats: int, code: int, held: int, run: int, notes: int) -> None:
    """Take steps of a run, each of which replaces the states by their next values, from notes[DONE] to notes[UNTIL].

    Parameters
    ----------
    execute : the address of the kind's function.
    formats, code, held, run : addresses of tables.
    notes : the address of the notes, see :data:`DONE` and the following, which are brought up to date.
    """
    formats_at, code_at, held_at, run_at, noted = words(formats), words(code), words(held), words(run), words(notes)
    values, truths = entries(held_at, VALUES, np.int64), entries(held_at, TRUTHS, np.uint8)
    kept, states, lanes, cycle = run_at[KEPT_ROW], run_at[STATES], run_at[LANES], run_at[CYCLE_OF]
    after, before = entries(run_at, AFTER, np.int64), entries(run_at, BEFORE, np.int64)
    begin = noted[DONE]
    for step in range(begin, noted[UNTIL]):
        _feed(run_at, values, step, begin)
        noted[ROW] = 0
        done = call(execute, formats_at, code_at, held_at, lanes)
        if done < code_at[ROWS]:
            noted[ROW] = done
            return
        _gathered(values, entries(run_at, AFTER_AT, np.int64), run_at[AFTER_PIECES], after)
        row = at(entries(run_at, KEPT, np.int64), step * kept)
        _gathered(values, entries(run_at, KEPT_AT, np.int64), run_at[KEPT_PIECES], row)
        _scattered(values, entries(run_at, STATES_AT, np.int64), run_at[STATE_PIECES], after)
        for i in range(lanes):
            entries(run_at, KEPT_TRUTHS, np.uint8)[step * lanes + i] = truths[run_at[TRUTH_AT] * lanes + i]
        noted[DONE] = step + 1
        if cycle > 0:
            noted[SINCE] += 1
            if noted[SINCE] % cycle == 0:
                same = True
                for j in range(states):
                    same &= after[j] == before[j]
                if same:
                    noted[CYCLE] = noted[SINCE]
                    noted[ROW] = -1
                    return
            if noted[SINCE] == noted[LASTS]:
                copy(before, after, states)
                noted[SINCE] = 0
                noted[LASTS] += cycle * (noted[LASTS] // (8 * cycle) + 1)
    noted[ROW] = -1
