"""Compiled products of matrices and Gaussian elimination, in every kind of numbers of the machine.

The order of operations, and therefore each digit, is that of :mod:`gpbnb.arithmetic.linalg`. Loops add a multiple of
one row to another, so that processors compute several entries at once. Matrices are flat, row
after row. The functions take the address of a table of formats, of which they use the first, and room for intermediate
results, float64. They return whether a result is beyond the range, or, in kinds on integers, raise OverflowError;
matrices are then invalid.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels import decimal, shortdecimal, wide
from gpbnb.arithmetic.kernels.bits import at, bits, entries, fma, from_bits, start, words
from gpbnb.arithmetic.kernels.careful import carefully, masked
from gpbnb.arithmetic.kernels.compiling import INLINE, borrowing, compiled, inner
from gpbnb.arithmetic.kernels.floats import TINY, TOGETHER, fitted
from gpbnb.arithmetic.kernels.machine import pair_format, short_format, word_format
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
    DIVIDE,
    MULTIPLY,
    NEGATIVE,
    QUICK_LEAST,
    Careful,
    Double,
    InPairs,
    InShortPairs,
    InTwoWords,
    Proved,
    Quick,
    Single,
)
from gpbnb.arithmetic.kernels.tags import RANDOM as RANDOM_MODE

ROOM = 3 * TOGETHER
_MOST = np.int64(2**63 - 1)
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
        any_gone = np.int64(0)
        for k in range(count):
            out[k], gone = basic(_MULTIPLY, how, rule, factor, row[k])
            any_gone |= gone
        return any_gone if checked else np.int64(0)

    @inner(forceinline=True)
    def add_row(how: Any, rule: Any, sign: Any, factor: Any, row: Any, out: Any, count: Any) -> Any:
        any_gone = np.int64(0)
        for k in range(count):
            p, gone = basic(_MULTIPLY, how, rule, factor, row[k])
            out[k], beyond = basic(_ADD, how, rule, out[k], sign * p)
            any_gone |= gone | beyond
        return any_gone if checked else np.int64(0)

    @inner(forceinline=True)
    def add_up(how: Any, first: Any, rule: Any, row: Any, column: Any, count: Any) -> Any:
        """Round sums in the first of two ways, which is faster, if it may serve."""
        s, any_gone = basic(_MULTIPLY, how, rule, row[0], column[0])
        for k in range(1, count):
            p, gone = basic(_MULTIPLY, how, rule, row[k], column[k])
            found, beyond = basic(_ADD, first, rule, s, p)
            if first != how and beyond != 0:
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


@inner(forceinline=True)
def _one_by_one(fmt: Any) -> Any:
    return (fmt.precision == 53) | (fmt.mode == RANDOM_MODE)


@borrowing
def _careful_scale(fmt: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
    masks, random, room = fmt
    gone = False
    if _one_by_one(masks):
        for k in range(count):
            out[j + k] = carefully(masks, random, MULTIPLY, factor, row[i + k], factor)
            gone |= out[j + k] != out[j + k]
        return gone
    p, r = room, at(room, TOGETHER)
    for begin in range(0, count, TOGETHER):
        some = min(count - begin, TOGETHER)
        _products(factor, at(row, i + begin), p, r, some)
        gone |= fitted(masks, p, r, at(out, j + begin), some) != 0
    return gone


@borrowing
def _careful_add(fmt: Any, sign: Any, factor: Any, row: Any, i: Any, out: Any, j: Any, count: Any) -> Any:
    masks, random, room = fmt
    gone = False
    if _one_by_one(masks):
        for k in range(count):
            p = carefully(masks, random, MULTIPLY, factor, row[i + k], factor)
            out[j + k] = carefully(masks, random, ADD, out[j + k], sign * p, p)
            gone |= (p != p) | (out[j + k] != out[j + k])
        return gone
    p, r, products = room, at(room, TOGETHER), at(room, 2 * TOGETHER)
    for begin in range(0, count, TOGETHER):
        some, found = min(count - begin, TOGETHER), at(out, j + begin)
        _products(factor, at(row, i + begin), p, r, some)
        gone |= fitted(masks, p, r, products, some) != 0
        _sums(sign, found, products, p, r, some)
        gone |= fitted(masks, p, r, found, some) != 0
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


def _of_integers(kind: Any, parts: int, format_of: Any) -> _Kind:
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
        format_in,
        sign,
        load,
        put,
        opposite,
        kind.negative,
        kind.compare,
        divide,
        scale,
        add,
        dot,
        _nothing_lost,
        _nothing_far,
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


_format_of, _sign, _load, _put = map(_of_kind, ("format_of", "sign", "load", "put"))
_lost, _far = map(_of_kind, ("lost", "far"))
_opposite, _negative, _compare, _divide = map(_of_kind, ("opposite", "negative", "compare", "divide"))
_scale, _add, _dot = map(_of_kind, ("scale", "add", "dot"))


# -- loops -------------------------------------------------------------------------------------------------------------


@compiled
def product(
    kind: Any, formats: int, room: Any, a: Any, b: Any, c: Any, begin: int, end: int, count: int, columns: int
) -> Any:
    """Rows of C = A B from `begin` on; each entry sums `count` products, at least one, from left to right."""
    fmt, gone, a, b, c = _format_of(kind, words(formats), start(room)), False, start(a), start(b), start(c)
    if _far(kind, a, end * count) or _far(kind, b, count * columns):
        return True
    for i in range(begin, end):
        if columns == 1:
            found, beyond = _dot(kind, fmt, a, i * count, b, count)
            _put(kind, fmt, c, i, found)
            gone |= beyond != 0
            continue
        gone |= _scale(kind, fmt, _load(kind, fmt, a, i * count), b, 0, c, i * columns, columns) != 0
        for k in range(1, count):
            factor = _load(kind, fmt, a, i * count + k)
            gone |= _add(kind, fmt, 1, factor, b, k * columns, c, i * columns, columns) != 0
    return gone | _lost(kind, c, begin * columns, end * columns)


@borrowing
def _larger(kind: Any, fmt: Any, a: Any, i: Any, j: Any) -> Any:
    """Whether number i is larger in size than number j."""
    # Opposites of sizes, which fixed point has for its lowest number, too.
    x, y = _load(kind, fmt, a, i), _load(kind, fmt, a, j)
    x = x if _sign(kind, a, i) < 0 else _opposite(kind, fmt, x)
    y = y if _sign(kind, a, j) < 0 else _opposite(kind, fmt, y)
    return _compare(kind, fmt, x, y) < 0


NONE, GONE = -1, -2


@compiled
def factor(kind: Any, formats: int, room: Any, a: Any, order: Any, pivot: bool, begin: int, end: int) -> Any:
    """Factor A (n, n): the upper factor on and above the diagonal, the multipliers of the lower factor below it.

    A call eliminates the columns from `begin` to before `end`. The order of the rows, int64 (n,), is permuted like
    them. Returns the column of the first zero pivot, NONE if there is none, or GONE.
    """
    fmt, gone, n, a = _format_of(kind, words(formats), start(room)), False, len(order), start(a)
    if _far(kind, a, n * n):
        return GONE
    for k in range(begin, end):
        if pivot:
            largest = k
            for i in range(k + 1, n):
                if _larger(kind, fmt, a, i * n + k, largest * n + k):
                    largest = i
            if largest != k:
                order[k], order[largest] = order[largest], order[k]
                for j in range(n):
                    moved = _load(kind, fmt, a, k * n + j)
                    _put(kind, fmt, a, k * n + j, _load(kind, fmt, a, largest * n + j))
                    _put(kind, fmt, a, largest * n + j, moved)
        if _sign(kind, a, k * n + k) == 0:
            return GONE if gone | _lost(kind, a, 0, n * n) else k
        head = _load(kind, fmt, a, k * n + k)
        for i in range(k + 1, n):
            ratio, beyond = _divide(kind, fmt, _load(kind, fmt, a, i * n + k), head)
            _put(kind, fmt, a, i * n + k, ratio)
            m = _negative(kind, fmt, ratio)
            gone |= beyond != 0
            gone |= _add(kind, fmt, 1, m, a, k * n + k + 1, a, i * n + k + 1, n - k - 1) != 0
    return GONE if gone | _lost(kind, a, 0, n * n) else NONE


@compiled
def solved(kind: Any, formats: int, room: Any, a: Any, b: Any, n: int, columns: int) -> Any:
    """Overwrite right-hand sides B (n, columns), whose rows have the order of :func:`factor`, by the solutions."""
    fmt, gone, a, b = _format_of(kind, words(formats), start(room)), False, start(a), start(b)
    if _far(kind, a, n * n) or _far(kind, b, n * columns):
        return True
    for k in range(n):
        for i in range(k + 1, n):
            m = _negative(kind, fmt, _load(kind, fmt, a, i * n + k))
            gone |= _add(kind, fmt, 1, m, b, k * columns, b, i * columns, columns) != 0
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            upper = _load(kind, fmt, a, k * n + i)
            gone |= _add(kind, fmt, -1, upper, b, i * columns, b, k * columns, columns) != 0
        head = _load(kind, fmt, a, k * n + k)
        for j in range(columns):
            found, beyond = _divide(kind, fmt, _load(kind, fmt, b, k * columns + j), head)
            _put(kind, fmt, b, k * columns + j, found)
            gone |= beyond != 0
    return gone | _lost(kind, b, 0, n * columns)


@inner
def _extent(x: Any) -> Any:
    """The smallest size of a float64 other than zero, infinite if there is none, and the largest size."""
    smallest, largest = bits(np.inf), np.int64(0)
    for i in range(x.shape[0]):
        size = bits(abs(x[i]))
        smallest = min(smallest, size if size > 0 else _MOST)
        largest = max(largest, size)
    return from_bits(smallest), from_bits(largest)


@compiled
def extents(x: Any, y: Any) -> Any:
    """The smallest and the largest size of the numbers other than zero of two arrays."""
    return _extent(x), _extent(y)
