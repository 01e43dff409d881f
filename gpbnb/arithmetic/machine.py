"""Programs as the machine runs them: rows, destination formats, and the numbers they start from."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels import selection, tags
from gpbnb.arithmetic.kernels.tags import AWAY, EVEN, HALF_UP, ZERO
from gpbnb.interrupts import slices

# fmt: off
CODES = {
    name: code for code, name in enumerate(
        (
            "add", "subtract", "multiply", "divide", "sqrt", "negative", "absolute", "choose", "compare", "combine",
            "round", "fused", "nonzero", "skip",
        )
    )
}
# fmt: on
"""Codes of operations, as in :mod:`gpbnb.arithmetic.kernels.tags`."""

NAMES = {code: name for name, code in CODES.items()}


_TAKEN = [
    {"fused": ((0, 1, 2), ()), "choose": ((1, 2), (0,)), "combine": ((), (0, 1)), "skip": ((), (0,))}.get(
        name, ((0, 1) if name in ("add", "subtract", "multiply", "divide", "compare") else (0,), ())
    )
    for name in CODES
]
"""For each code, which of the three operands are places of numbers, and which of truth values."""

OPERANDS = tuple(np.array([[i in taken[sort] for i in range(3)] for taken in _TAKEN]) for sort in (0, 1))
"""The same as masks, (codes, 3), of numbers and of truth values."""

_IS_COMBINED = np.arange(len(CODES))[:, np.newaxis] == CODES["combine"]
_OWN = np.where(_IS_COMBINED, OPERANDS[1], OPERANDS[0])
_OWN[CODES["compare"]] = False
"""For each code, which operands may be results of the same operation."""


def operands_of(code: int, *given: int) -> tuple[list[int], list[int]]:
    """Return the numbers and the truth values that an operation takes."""
    numbers, truths = _TAKEN[code]
    return [given[i] for i in numbers], [given[i] for i in truths]


def takes_numbers(codes: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which operands of each operation are places of numbers, (o, 3)."""
    return np.asarray(OPERANDS[0][codes])


@cache
def _loops() -> Any:
    """Return the compiled loops, which take a second to import."""
    from gpbnb.arithmetic.kernels import machine

    return machine


class Addresses:
    """Arrays, contiguous, and integers as compiled functions take them: addresses and integers in one array."""

    def __init__(self, *given: Any) -> None:
        self._given = given
        self._entries = np.array([each if isinstance(each, int) else _address(each) for each in given], np.int64)
        self.address = _address(self._entries)


def _address(array: NDArray[Any]) -> int:
    return int(array.__array_interface__["data"][0])


def tables(formats: Sequence[Any], tag: Any = None) -> tuple[Any, Any]:
    """Return the kind of numbers of some formats of one base, None being double-double, and their columns.

    All parts of a run draw random numbers from its `tag`.
    """
    from gpbnb.arithmetic.kernels import quick

    whole = np.zeros((len(formats), quick.COLUMNS), np.int64)
    numbers = np.zeros((len(formats), quick.NUMBERS))
    state = tags.random_state(tag)
    random = np.zeros(2, np.uint64) if state is None else state
    if formats[0] is None:
        return tags.DoubleDouble(), Addresses(whole, numbers, random)
    kinds = set()
    for i, fmt in enumerate(formats):
        found = None if isinstance(tag, tags.Wide) else selection.tag_of(fmt.rules)
        if found is None:
            found = selection.wide_tag(fmt.rules)
        if found is None:
            raise ValueError("no loops")
        kinds.add(_row(fmt, found, whole[i], numbers[i]))
    (kind,) = kinds
    made: Any = tags.Careful() if (whole[:, quick.HOW] == quick.NONE).any() else tags.Quick()
    if kind == "pairs":
        made = tags.InShortPairs() if whole[:, _SHORT].all() else tags.InPairs()
    elif kind == "words":
        made = tags.InTwoWords()
    return made, Addresses(whole, numbers, random)


_SHORT = 5  # the column that tells whether a decimal format has few digits and no range


def _row(fmt: Any, tag: Any, whole: NDArray[np.int64], numbers: NDArray[np.float64]) -> str:
    from gpbnb.arithmetic.kernels import quick

    if isinstance(tag, tags.Wide):
        whole[:14] = (*tag[:7], *tag.lowest, *tag.largest, tag.saturates)
        return "words"
    if isinstance(tag, tags.Decimal):
        short = tag.precision <= tags.LARGEST_SHORT and tag.mode in (AWAY, ZERO) and tag.small == tags.UNLIMITED
        whole[:6] = tag.precision, tag.mode, tag.least, tag.largest, tag.small, short
        return "pairs"
    bits, precision, mode, *limits, _ = tag
    whole[:3], numbers[:] = (bits, precision, mode), limits
    low, high = max(tag.gradual, tag.least), min(tag.largest, -tag.lowest)
    low, high = max(low, tags.QUICK_LEAST), min(high, 1 / tags.QUICK_LEAST)
    least, most = np.array([low, high]).view(np.int64).tolist()
    how, *rounding = _rounding(bits, precision, mode, fmt.rules)
    evenly = how == quick.SHORT and mode == EVEN and precision <= tags.SAFE_TWICE and limits[0] >= tags.QUICK_LEAST
    whole[3:15] = how, *rounding, least, most - least, *_outward(precision, mode), evenly
    return "floats"


def _rounding(bits: int, precision: int, mode: int, rules: Any) -> tuple[int, int, int, int, int]:
    """How quick results are rounded, and the columns from CLEAR to EVEN."""
    from gpbnb.arithmetic.kernels import quick

    if mode in (tags.ODD, tags.RANDOM) or (rules.limits is not None and rules.limits.fixed):
        return quick.NONE, 0, 0, 0, 0
    if bits == 4:
        return quick.HEXADECIMAL if mode in (AWAY, ZERO) else quick.NONE, 0, 56 - 4 * precision, mode == AWAY, 0
    exact, unit = mode == EVEN and precision == 53, 1 << (53 - precision)
    even = mode == EVEN and not exact
    how = quick.LONG if mode in (AWAY, EVEN, ZERO) else quick.DIRECTED
    if exact or (mode in (AWAY, EVEN) and precision <= tags.SAFE_TWICE):
        how = quick.SHORT
    elif precision == 53 and mode == AWAY:
        how = quick.TIED
    return how, -unit, 53 - precision, (unit >> 1 if mode in (AWAY, EVEN) else 0) - even, even


def _outward(precision: int, mode: int) -> tuple[int, int, int, int]:
    """The columns from BELOW_ZERO on, which round in directions: what is added to sizes, and more if digits are cut."""
    unit, ties_up = 1 << (53 - precision), mode == HALF_UP
    half, down, up = ties_up * (unit >> 1), mode == tags.DOWN, mode == tags.UP
    return half - ties_up + down * (unit - 1), half + up * (unit - 1), ties_up or down, up


class Fault(NamedTuple):
    """An operation without a result: its row, and what is wrong."""

    row: int
    reason: str

    @property
    def overflows(self) -> bool:
        """Whether the result is beyond the range."""
        return self.reason == OVERFLOW


OVERFLOW = "overflow"
ZERO_DIVISOR = "a division by zero"
ZERO_PIVOT = "a zero pivot"
NEGATIVE_ROOT = "the square root of a negative number"


def fault_of(rows: NDArray[np.int64], values: NDArray[Any], row: int) -> Fault:
    """Say why a row has no result, from the numbers of the machine."""
    name = NAMES[int(rows[row, 0])]
    reason = {"divide": ZERO_DIVISOR, "nonzero": ZERO_PIVOT, "sqrt": NEGATIVE_ROOT}.get(name, OVERFLOW)
    if name == "divide" and np.all(np.atleast_1d(values[rows[row, 2]]).reshape(-1, *values.shape[2:])[..., :1] != 0):
        reason = OVERFLOW
    return Fault(row, reason)


def packed_one(fmt: Any) -> Any:
    """Return the number one as the machine takes it, None being double-double; None if a format does not have it."""
    if fmt is None:
        return np.array([1.0, 0.0])
    try:
        array = fmt.array(1)
    except OverflowError:
        return None
    return array.backend.pack(array.components) if array.to_fractions() == 1 else None


class Code(NamedTuple):
    """Operations, and how many there are."""

    table: Addresses
    rows: int


def code_of(rows: NDArray[Any], formats: NDArray[np.int64]) -> Code:
    """Return operations, and the number of the format of each, as the machine takes them."""
    how = _together(rows)
    skips = np.flatnonzero(rows[:, 0] == tags.SKIP)
    edges = np.zeros(len(rows) + 1, np.bool_)
    edges[1:-1] = (np.diff(rows[:, 0]) != 0) | (np.diff(formats) != 0) | (np.diff(how) != 0)
    for each in (skips, skips + 1, skips + 1 + rows[skips, 2]):
        edges[np.minimum(each, len(rows))] = True
    edges[[0, -1]] = True
    begins = np.flatnonzero(edges) if len(rows) else np.zeros(1, np.int64)
    columns = np.ascontiguousarray(rows.T[1:], np.uint32)
    gathered = np.empty(4 * max(np.diff(begins), default=0))
    segments = (each[begins[:-1]].astype(np.int64) for each in (rows[:, 0], formats, how & 3))
    return Code(Addresses(*columns, begins, *segments, gathered, len(begins) - 1, len(rows)), len(rows))


_FEWEST, _MANY = 4, 24
"""Fewest rows that run together, and fewest whose operands are not gathered with those of the rows beside them."""


def _together(rows: NDArray[Any]) -> NDArray[np.int64]:
    """Return for each row 4 times the number of its run, plus how it runs; 0 if it runs on its own."""
    found, number = np.zeros(len(rows), np.int64), 0
    for begin, end in independent(rows):
        if end - begin >= _FEWEST and rows[begin, 0] <= CODES["multiply"]:
            for first, last, along in _stretches(rows[begin:end, 1:3], begin):
                number += 1
                found[first:last] = 4 * number + (_loops().NEIGHBOURS if along else _loops().GATHERED)
    return found


def independent(rows: NDArray[Any]) -> Iterator[tuple[int, int]]:
    """Yield first and last of rows of one operation, with results in consecutive places, which they do not take."""
    if not len(rows):
        return
    codes, places, results = rows[:, 0], rows[:, 1:4], rows[:, 4]
    own = _OWN[codes] & (places < results[:, np.newaxis])
    latest = np.where(own, places, -1).max(axis=1)  # place of the last operand that may be a result
    edges = np.flatnonzero((np.diff(codes) != 0) | (np.diff(results) != 1)) + 1
    for begin, end in pairwise([0, *edges.tolist(), len(rows)]):
        while begin < end:
            last, width = begin + 1, 8
            while last < end:  # wider and wider, since most rows run alone or with many others
                taken = np.flatnonzero(latest[last : min(last + width, end)] >= results[begin])
                last = last + int(taken[0]) if len(taken) else min(last + width, end)
                if len(taken):
                    break
                width *= 2
            yield begin, last
            begin = last


def _stretches(operands: NDArray[Any], begin: int) -> Iterator[tuple[int, int, bool]]:
    """Yield first and last of parts of a run, and whether their operands are neighbours."""
    along = (operands[1:] - operands[:-1] == 1).all(axis=1)
    if len(operands) < _MANY or along.all():
        yield begin, begin + len(operands), bool(along.all())
        return
    edges = np.array([0, *np.flatnonzero(~along) + 1, len(operands)])
    waiting = 0
    for i in np.flatnonzero(np.diff(edges) >= _MANY):
        first, last = edges[i], edges[i + 1]
        if waiting < first:
            yield begin + waiting, begin + first, False
        yield begin + first, begin + last, True
        waiting = last
    if waiting < len(operands):
        yield begin + waiting, begin + len(operands), False


class Memory:
    """Numbers (places, [lanes], ...) and truth values (truths, [lanes]) of the machine."""

    def __init__(self, values: NDArray[Any], truths: NDArray[np.uint8]) -> None:
        self.values, self.truths = values, truths
        self.width, self.lanes = math.prod(values.shape[1:]), math.prod(truths.shape[1:])
        self.table = Addresses(values, truths)

    def pieces(self, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return where numbers are in flat memory: the first of those that follow each other, and how many, (p, 2)."""
        begins = np.flatnonzero(np.diff(numbers, prepend=-2) != 1)
        return self.width * np.stack([numbers[begins], np.diff(begins, append=len(numbers))], axis=1)


_FEW_NUMBERS = 24
"""Numbers that Python compares faster than NumPy."""


def is_far(kind: Any, numbers: NDArray[Any]) -> bool:
    """Whether some numbers are too small or too large for quick computation, if a kind has it."""
    if not isinstance(kind, tags.Quick):
        return False
    if numbers.size < _FEW_NUMBERS:
        return any(not tags.QUICK_LEAST <= abs(x) <= 1 / tags.QUICK_LEAST for x in numbers.ravel().tolist() if x)
    sizes = np.abs(numbers)
    if sizes.min(initial=1) >= tags.QUICK_LEAST and sizes.max(initial=1) <= 1 / tags.QUICK_LEAST:
        return False
    return bool((((sizes < tags.QUICK_LEAST) & (sizes > 0)) | (sizes > 1 / tags.QUICK_LEAST)).any())


_FEW_PLACES = 300
"""Places of a short program, for which no loop is compiled that runs rows of double-double together."""


def functions(kind: Any, far: bool, memory: Memory) -> Iterator[int]:
    """Yield the address of a kind's function for one lane or many, and of those that compute what it leaves.

    Numbers that may be too small or too large for quick computation are `far`.
    """
    quick, short = isinstance(kind, tags.Quick), len(memory.values) < _FEW_PLACES
    alone = memory.lanes == 1 and not (short and isinstance(kind, tags.DoubleDouble))
    if not (quick and far):
        yield _loops().address(kind, alone)
    if quick:
        yield _loops().address(tags.Careful(), alone)


def evaluate(memory: Memory, kind: Any, formats: Any, code: Any) -> int:
    """Run operations once in each lane; return how many have results, 0 if the machine does not tell."""
    return evaluated(memory, kind, formats, code, is_far(kind, memory.values))[0]


def evaluated(memory: Memory, kind: Any, formats: Any, code: Any, far: bool = False) -> tuple[int, bool]:
    """Run operations as :func:`evaluate` does.

    Also return whether a number may now be too small or too large for quick loops; `far` says so for the start.
    """
    done, once, given = 0, _loops().once, (formats.address, code.table.address, memory.table.address, memory.lanes)
    with contextlib.suppress(OverflowError, ZeroDivisionError):
        for execute in functions(kind, far, memory):
            done = once(execute, *given)
            if done == code.rows:
                break
            far = True
    return int(done), far


_NO_TRUTHS = np.array([0, 1], np.uint8)


def rounded(kind: Any, formats: Any, numbers: NDArray[Any]) -> NDArray[Any] | None:
    """Round packed numbers, (count, ...), into a format; None if it does not have one of them."""
    found, sums = [], numbers.ndim == 1  # sums with zero, which run together, round float64 as well
    for begin in range(0, len(numbers), _AT_ONCE):
        part = numbers[begin : begin + _AT_ONCE]
        count = len(part)
        values = np.zeros(((2 + sums) * count, *part.shape[1:]), part.dtype)
        values[:count] = part
        # However small or large they are, quick computation rounds them, or tells that it cannot.
        if evaluated(Memory(values, _NO_TRUTHS), kind, formats, _of_rounding(count, sums))[0] < count:
            return None
        found.append(values[-count:])
    return found[0] if len(found) == 1 else np.concatenate(found)


def accumulate(kind: Any, formats: Any, name: str, numbers: NDArray[Any]) -> bool:
    """Combine packed rows, (count, width, ...), each with the result before it; return whether the format has all."""
    code, none = np.array([CODES[name]]), np.zeros(1, np.int64)
    memory = Memory(numbers, np.zeros((2, numbers.shape[1]), np.uint8))
    for part in slices(len(numbers) - 1, memory.width):
        at, count = np.arange(part.start, part.stop, dtype=np.uint32), part.stop - part.start
        table = Addresses(at, at + 1, at, at + 1, np.array([0, count]), code, none, none, np.empty(0), 1, count)
        if evaluated(memory, kind, formats, Code(table, count))[0] < count:
            return False
    return True


_AT_ONCE = 1 << 14  # numbers that stay in the processor's cache


@lru_cache(maxsize=64)
def _of_rounding(count: int, sums: bool) -> Code:
    at, none = np.arange(count, dtype=np.uint32), np.zeros(1, np.int64)
    b, out = at + np.uint32(count * sums), at + np.uint32(count * (1 + sums))
    begins, codes = np.array([0, count]), np.array([CODES["add" if sums else "round"]])
    together = none + (_loops().NEIGHBOURS if sums else _loops().ONE_BY_ONE)
    return Code(Addresses(at, b, at, out, begins, codes, none, together, np.empty(0), 1, count), count)
