"""The functions that compiled loops call, one set for each kind of numbers.

A loop is written once. Its first argument is a kind of :mod:`gpbnb.arithmetic.kernels.tags`, for whose type numba
compiles it; precision, rounding and range are data. The functions here take the kind, and return what the loop needs
of it. Numbers are counted, not their parts. Results beyond the range are told, or, in kinds on integers, raise
OverflowError.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels import decimal, shortdecimal, wide
from gpbnb.arithmetic.kernels.bits import at, entries, fma
from gpbnb.arithmetic.kernels.careful import carefully, masked
from gpbnb.arithmetic.kernels.compiling import INLINE, borrowing, inner
from gpbnb.arithmetic.kernels.floats import TINY, TOGETHER, draw, fitted
from gpbnb.arithmetic.kernels.quick import (
    DIRECTED,
    EVENLY,
    GRADUAL,
    HEXADECIMAL,
    LONG,
    NUMBER,
    RANDOM,
    SHORT,
    TIED,
    WHOLE,
    basic,
    rule_of,
)
from gpbnb.arithmetic.kernels.tags import (
    ADD,
    AWAY,
    DIVIDE,
    MULTIPLY,
    NEGATIVE,
    QUICK_LEAST,
    ROOT,
    ROUND,
    SUBTRACT,
    Careful,
    Decimal,
    Double,
    InPairs,
    InShortPairs,
    InTwoWords,
    Proved,
    Quick,
    ShortDecimal,
    Single,
    Wide,
)
from gpbnb.arithmetic.kernels.tags import RANDOM as RANDOM_MODE

_ADD, _MULTIPLY, _DIVIDE = map(np.int64, (ADD, MULTIPLY, DIVIDE))
_SHORT, _GRADUAL, _LONG, _HEXADECIMAL = map(np.int64, (SHORT, GRADUAL, LONG, HEXADECIMAL))
_TIED, _DIRECTED = map(np.int64, (TIED, DIRECTED))


# -- what the loops need of a kind of numbers --------------------------------------------------------------------------


class _Kind(NamedTuple):
    """Functions of one kind. Numbers are counted, not their parts; `gone` tells that a result is beyond the range."""

    format_of: Any  # (formats, room) -> the format, as the others take it
    sign: Any  # (numbers, i) -> -1, 0 or 1
    load: Any
    put: Any
    opposite: Any
    negative: Any
    compare: Any
    divide: Any  # (format, x, y) -> quotient, gone
    scale: Any  # (format, factor, row, at, out, to, count) -> gone; multiplies a row
    add: Any  # (format, sign, factor, row, at, out, to, count) -> gone; adds a multiple of a row, or subtracts it
    dot: Any  # (format, row, at, column, count) -> sum of products, gone
    lost: Any  # (numbers, begin, end) -> whether one of them tells that it is beyond the range
    far: Any  # (numbers, count) -> whether one of them is too small or too large for the kind
    # Kinds on integers, whose arrays have a component for each part of a number:
    product: Any = None
    sum: Any = None
    other: Any = None
    fused: Any = None  # (format, x, y, z) -> x y + z, rounded once
    get: Any = None  # (format, components, i) -> number i
    set: Any = None


@borrowing(forceinline=True)
def _nothing_lost(values: Any, begin: Any, end: Any) -> Any:
    return False


@borrowing(forceinline=True)
def _nothing_far(values: Any, count: Any) -> Any:
    return False


def _floats(dtype: Any) -> dict[str, Any]:
    """What all kinds on single numbers of the processor share."""

    @borrowing(forceinline=True)
    def sign(values: Any, i: Any) -> Any:
        return np.int64(values[i] > 0.0) - np.int64(values[i] < 0.0)

    @borrowing(forceinline=True)
    def load(fmt: Any, values: Any, i: Any) -> Any:
        return values[i]

    @borrowing(forceinline=True)
    def put(fmt: Any, values: Any, i: Any, x: Any) -> None:
        values[i] = x

    @inner(forceinline=True)
    def opposite(fmt: Any, x: Any) -> Any:
        return dtype(0.0) - x

    @inner(forceinline=True)
    def compare(fmt: Any, x: Any, y: Any) -> Any:
        return np.int64(x > y) - np.int64(x < y)

    return {
        "sign": sign,
        "load": load,
        "put": put,
        "opposite": opposite,
        "negative": opposite,
        "compare": compare,
    }


def _plain(dtype: Any) -> _Kind:
    """The processor's own arithmetic. Sums are never a negative zero, as none of their terms is one."""

    @borrowing(forceinline=True)
    def format_of(formats: Any, room: Any) -> Any:
        return np.int64(0)

    @inner(error_model="numpy", forceinline=True)
    def divide(fmt: Any, x: Any, y: Any) -> Any:
        return x / y + dtype(0.0), False

    @borrowing(forceinline=True)
    def scale(fmt: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
        for k in range(count):
            out[j + k] = factor * row[i + k] + dtype(0.0)
        return False

    @borrowing(forceinline=True)
    def add(fmt: Any, sign: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
        factor = factor if sign > 0 else -factor
        for k in range(count):
            out[j + k] += factor * row[i + k]
        return False

    @borrowing(forceinline=True)
    def dot(fmt: Any, row: Any, i: Any, column: Any, count: Any) -> Any:
        s = row[i] * column[0] + dtype(0.0)
        for k in range(1, count):
            s += row[i + k] * column[k]
        return s, False

    @borrowing
    def lost(values: Any, begin: Any, end: Any) -> Any:
        gone = False
        for i in range(begin, end):
            gone |= not abs(values[i]) < np.inf
        return gone

    return _Kind(
        format_of=format_of,
        divide=divide,
        scale=scale,
        add=add,
        dot=dot,
        lost=lost,
        far=_nothing_far,
        **_floats(dtype),
    )


# -- float64 with masks


@borrowing(forceinline=True)
def _quick_format(formats: Any, room: Any) -> Any:
    how, rule = rule_of(formats, 0)
    return _GRADUAL if entries(formats, WHOLE, np.int64)[EVENLY] else how, rule


@inner(forceinline=True)
def _quick_divide(fmt: Any, x: Any, y: Any) -> Any:
    return basic(_DIVIDE, fmt[0], fmt[1], x, y)


@borrowing
def _quick_far(values: Any, count: Any) -> Any:
    any_far = False
    for i in range(count):
        size = abs(values[i])
        any_far |= ((size < QUICK_LEAST) & (size > 0.0)) | (size > 1.0 / QUICK_LEAST)
    return any_far


def _quick(checked: bool) -> _Kind:
    """Quick rounding; unchecked, for results of which none leaves the quick range."""

    @inner(forceinline=True)
    def scale_row(how: Any, rule: Any, factor: Any, row: Any, out: Any, count: Any) -> Any:
        any_gone = False
        for k in range(count):
            out[k], gone = basic(_MULTIPLY, how, rule, factor, row[k])
            any_gone |= gone
        return any_gone if checked else False

    @inner(forceinline=True)
    def add_row(how: Any, rule: Any, sign: Any, factor: Any, row: Any, out: Any, count: Any) -> Any:
        any_gone = False
        for k in range(count):
            p, gone = basic(_MULTIPLY, how, rule, factor, row[k])
            out[k], beyond = basic(_ADD, how, rule, out[k], sign * p)
            any_gone |= gone | beyond
        return any_gone if checked else False

    @inner(forceinline=True)
    def add_up(how: Any, first: Any, rule: Any, row: Any, column: Any, count: Any) -> Any:
        """Round sums in the first of two ways, which is faster, if it may serve."""
        s, any_gone = basic(_MULTIPLY, how, rule, row[0], column[0])
        for k in range(1, count):
            p, gone = basic(_MULTIPLY, how, rule, row[k], column[k])
            found, beyond = basic(_ADD, first, rule, s, p)
            if first != how and beyond:
                found, beyond = basic(_ADD, how, rule, s, p)
            s = found
            any_gone |= gone | beyond
        return s, any_gone if checked else np.int64(0)

    @borrowing
    def scale(fmt: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
        return scale_row(fmt[0], fmt[1], factor, at(row, i), at(out, j), count)

    @borrowing
    def add(fmt: Any, sign: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
        how, rule = fmt
        row, out = at(row, i), at(out, j)
        # A loop for each case, so that none branches.
        if how == SHORT:
            return add_row(_SHORT, rule, sign, factor, row, out, count)
        if how == GRADUAL:
            return add_row(_GRADUAL, rule, sign, factor, row, out, count)
        if how == LONG:
            return add_row(_LONG, rule, sign, factor, row, out, count)
        if how == HEXADECIMAL:
            return add_row(_HEXADECIMAL, rule, sign, factor, row, out, count)
        if how == TIED:
            return add_row(_TIED, rule, sign, factor, row, out, count)
        return add_row(_DIRECTED, rule, sign, factor, row, out, count)

    @borrowing
    def dot(fmt: Any, row: Any, i: Any, column: Any, count: Any) -> Any:
        how, rule = fmt
        row = at(row, i)
        if how == SHORT:
            return add_up(_SHORT, _SHORT, rule, row, column, count)
        if how == GRADUAL:
            return add_up(_GRADUAL, _SHORT, rule, row, column, count)
        return add_up(how, how, rule, row, column, count)

    return _Kind(
        format_of=_quick_format,
        divide=_quick_divide,
        scale=scale,
        add=add,
        dot=dot,
        lost=_nothing_lost,
        far=_quick_far if checked else _nothing_far,
        **_floats(np.float64),
    )


# -- float64 in any format


@borrowing(forceinline=True)
def _careful_format(formats: Any, room: Any) -> Any:
    fmt = masked(entries(formats, WHOLE, np.int64), entries(formats, NUMBER, np.float64))
    return fmt, entries(formats, RANDOM, np.uint64), room


@inner(forceinline=True)
def _careful_negative(fmt: Any, x: Any) -> Any:
    return carefully(fmt[0], fmt[1], NEGATIVE, x, x, x)


@inner(forceinline=True)
def _careful_divide(fmt: Any, x: Any, y: Any) -> Any:
    found = carefully(fmt[0], fmt[1], DIVIDE, x, y, x)
    return found, found != found


@borrowing
def _products(factor: Any, row: Any, p: Any, r: Any, count: Any) -> None:
    """The float64 nearest to each product, and what is left."""
    for k in range(count):
        s = factor * row[k]
        r[k] = fma(factor, row[k], -s)
        p[k] = TINY if (s == 0.0) & (factor != 0.0) & (row[k] != 0.0) else s


@borrowing
def _sums(sign: Any, out: Any, products: Any, p: Any, r: Any, count: Any) -> None:
    for k in range(count):
        x, y = out[k], sign * products[k]
        s = x + y
        t = s - x
        p[k], r[k] = s, (x - (s - t)) + (y - t)


@borrowing
def _careful_scale(fmt: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
    masks, random, room = fmt
    gone = False
    if masks.precision == 53:
        for k in range(count):
            out[j + k] = carefully(masks, random, MULTIPLY, factor, row[i + k], factor)
            gone |= out[j + k] != out[j + k]
        return gone
    p, r, draws = room, at(room, TOGETHER), at(room, 3 * TOGETHER)
    for begin in range(0, count, TOGETHER):
        some = min(count - begin, TOGETHER)
        if masks.mode == RANDOM_MODE:
            draw(random, 1, draws, some)
        _products(factor, at(row, i + begin), p, r, some)
        gone |= fitted(masks, draws, p, r, at(out, j + begin), some)
    return gone


@borrowing
def _careful_add(fmt: Any, sign: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
    masks, random, room = fmt
    gone = False
    if masks.precision == 53:
        for k in range(count):
            p = carefully(masks, random, MULTIPLY, factor, row[i + k], factor)
            out[j + k] = carefully(masks, random, ADD, out[j + k], sign * p, p)
            gone |= (p != p) | (out[j + k] != out[j + k])
        return gone
    p, r, products, draws = room, at(room, TOGETHER), at(room, 2 * TOGETHER), at(room, 3 * TOGETHER)
    for begin in range(0, count, TOGETHER):
        some, found = min(count - begin, TOGETHER), at(out, j + begin)
        if masks.mode == RANDOM_MODE:
            draw(random, 2, draws, some)
        _products(factor, at(row, i + begin), p, r, some)
        gone |= fitted(masks, draws, p, r, products, some)
        _sums(sign, found, products, p, r, some)
        gone |= fitted(masks, at(draws, some), p, r, found, some)
    return gone


@borrowing
def _careful_dot(fmt: Any, row: Any, i: Any, column: Any, count: Any) -> Any:
    masks, random, _ = fmt
    s = carefully(masks, random, MULTIPLY, row[i], column[0], 0.0)
    gone = s != s
    for k in range(1, count):
        p = carefully(masks, random, MULTIPLY, row[i + k], column[k], 0.0)
        s = carefully(masks, random, ADD, s, p, 0.0)
        gone |= (p != p) | (s != s)
    return s, gone


# -- integers


@borrowing(forceinline=True)
def pair_format(columns: Any) -> Any:
    """The format of base 10 of these columns."""
    return Decimal(columns[1], columns[0], columns[2], columns[3], columns[4])


@borrowing(forceinline=True)
def short_format(columns: Any) -> Any:
    """The short format of base 10 of these columns."""
    return ShortDecimal(columns[0], columns[1] == AWAY)


@borrowing(forceinline=True)
def word_format(columns: Any) -> Any:
    """The format with significands of two words of these columns."""
    lowest, largest = (columns[7], columns[8], columns[9]), (columns[10], columns[11], columns[12])
    bits, mode, precision, room, split = columns[0], columns[1], columns[2], columns[3], columns[4]
    return Wide(bits, mode, precision, room, split, columns[5], columns[6], lowest, largest, columns[13] != 0)


class Operations(NamedTuple):
    """Operations of an arithmetic on integers: (format, operation, x, y) -> result; some take one number."""

    product: Any
    sum: Any  # or difference
    other: Any
    any: Any


def operations_of(kind: Any) -> Operations:
    """Return the operations of an arithmetic on integers."""
    add, multiply, divide, sqrt, round_ = kind.add, kind.multiply, kind.divide, kind.sqrt, kind.round_
    opposite, negative = kind.opposite, kind.negative

    @borrowing(forceinline=True)
    def product_of(fmt: Any, operation: Any, x: Any, y: Any) -> Any:
        return multiply(fmt, x, y)

    @borrowing(forceinline=True)
    def sum_of(fmt: Any, operation: Any, x: Any, y: Any) -> Any:
        return add(fmt, x, opposite(fmt, y) if operation == SUBTRACT else y)

    @borrowing(forceinline=True)
    def other(fmt: Any, operation: Any, x: Any, y: Any) -> Any:
        if operation == DIVIDE:
            return divide(fmt, x, y)
        if operation == ROOT:
            return sqrt(fmt, x)
        return round_(fmt, x) if operation == ROUND else negative(fmt, x)

    @borrowing(forceinline=True)
    def any_of(fmt: Any, operation: Any, x: Any, y: Any) -> Any:
        if operation == MULTIPLY:
            return multiply(fmt, x, y)
        return sum_of(fmt, operation, x, y) if operation <= SUBTRACT else other(fmt, operation, x, y)

    return Operations(product_of, sum_of, other, any_of)


@inner(forceinline=True)
def _get_pair(fmt: Any, components: Any, i: Any) -> Any:
    return components[0][i], components[1][i]


@inner(forceinline=True)
def _set_pair(fmt: Any, components: Any, i: Any, x: Any) -> None:
    components[0][i], components[1][i] = x


@inner(forceinline=True)
def _get_words(fmt: Any, components: Any, i: Any) -> Any:
    return wide.number(fmt, components[0][i], components[1][i], components[2][i])


@inner(forceinline=True)
def _set_words(fmt: Any, components: Any, i: Any, x: Any) -> None:
    components[0][i], components[1][i], components[2][i] = wide.parts(fmt, x)


def _of_integers(kind: Any, parts: int, format_of: Any) -> _Kind:
    found = operations_of(kind)
    load, put, multiply, divided, add_two, opposite = (
        kind.load, kind.put, kind.multiply, kind.divide, kind.add, kind.opposite,
    )  # fmt: skip

    @borrowing(forceinline=True)
    def format_in(formats: Any, room: Any) -> Any:
        return format_of(entries(formats, WHOLE, np.int64))

    @borrowing(forceinline=True)
    def sign(values: Any, i: Any) -> Any:
        return np.int64(values[i * parts] > 0) - np.int64(values[i * parts] < 0)

    @inner
    def divide(fmt: Any, x: Any, y: Any) -> Any:
        return divided(fmt, x, y), False

    @borrowing
    def scale(fmt: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
        for k in range(count):
            put(fmt, out, j + k, multiply(fmt, factor, load(fmt, row, i + k)))
        return False

    @borrowing
    def add(fmt: Any, sign: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
        for k in range(count):
            p = multiply(fmt, factor, load(fmt, row, i + k))
            put(fmt, out, j + k, add_two(fmt, load(fmt, out, j + k), p if sign > 0 else opposite(fmt, p)))
        return False

    @borrowing
    def dot(fmt: Any, row: Any, i: Any, column: Any, count: Any) -> Any:
        s = multiply(fmt, load(fmt, row, i), load(fmt, column, 0))
        for k in range(1, count):
            s = add_two(fmt, s, multiply(fmt, load(fmt, row, i + k), load(fmt, column, k)))
        return s, False

    return _Kind(
        format_of=format_in,
        sign=sign,
        load=load,
        put=put,
        opposite=opposite,
        negative=kind.negative,
        compare=kind.compare,
        divide=divide,
        scale=scale,
        add=add,
        dot=dot,
        lost=_nothing_lost,
        far=_nothing_far,
        product=found.product,
        sum=found.sum,
        other=found.other,
        fused=getattr(kind, "fused", None),
        get=_get_pair if parts == 2 else _get_words,
        set=_set_pair if parts == 2 else _set_words,
    )


_KINDS = {
    Single: _plain(np.float32),
    Double: _plain(np.float64),
    Quick: _quick(True),
    Proved: _quick(False),
    Careful: _Kind(
        format_of=_careful_format,
        divide=_careful_divide,
        scale=_careful_scale,
        add=_careful_add,
        dot=_careful_dot,
        lost=_nothing_lost,
        far=_nothing_far,
        **{**_floats(np.float64), "negative": _careful_negative},
    ),
    InPairs: _of_integers(decimal, 2, pair_format),
    InShortPairs: _of_integers(shortdecimal, 2, short_format),
    InTwoWords: _of_integers(wide, 3, word_format),
}


def _of_kind(name: str) -> Callable[..., Any]:
    """Return what stands in the loops for a function of the kind that is their first argument."""

    def stub(kind: Any, *given: Any) -> Any:
        raise TypeError(f"got a call of {name} from Python; needed one from a function compiled by numba")

    @overload(stub, strict=False, jit_options=INLINE)
    def choose(kind: Any, *given: Any) -> Any:
        function = getattr(_KINDS[kind.instance_class], name)
        return lambda kind, *given: function(*given)

    return stub


format_of, sign, load, put, lost, far = map(_of_kind, ("format_of", "sign", "load", "put", "lost", "far"))
opposite, negative, compare, divide = map(_of_kind, ("opposite", "negative", "compare", "divide"))
scale, add, dot = map(_of_kind, ("scale", "add", "dot"))
product, sum_of, other, fused = map(_of_kind, ("product", "sum", "other", "fused"))
get_number, set_number = map(_of_kind, ("get", "set"))
