"""A tape: the operations of a function in the order in which they ran, to run again in any format.

A tape knows numbers and truth values by their places. :mod:`gpbnb.arithmetic.traced` records one by running a function
on arrays that hold places. :meth:`Tape.run` then repeats the operations on numbers, each rounded once, in compiled code
where the format has it.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.interpreting import Call, Constants, Numbers, OnIntegers, Segment
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.machine import CODES, NAMES, OPERANDS, independent

Places = NDArray[np.int64]
"""Numbers or truth values of a tape, of any shape."""

MOST_OPERATIONS = 1 << 22
"""Longest tape. Arrays of so many entries run fast without one."""

FEW_OPERATIONS = 5_000
"""Shortest tape that runs in compiled code; for fewer operations, integers of Python are fast and need no loading."""

TRUTHS = ("compare", "combine")
"""Operations whose results are truth values."""

_SHORTENED = ("add", "subtract", "multiply", "divide")
_WHOLE = (int, np.int64)


class UntraceableError(Exception):
    """A function has done what no tape can repeat."""


def _combined(a: Places, b: Places, table: int) -> Places:
    """Return the places of truth values that are known, or those of a or b, and -1 for others."""
    found = np.full(a.shape, -1)
    for known, other, columns in ((a, b, False), (b, a, True)):
        for truth in (0, 1):
            row = (table >> truth & 1) + 2 * (table >> truth + 2 & 1) if columns else table >> 2 * truth & 3
            result = {0: np.zeros_like(a), 2: other, 3: np.ones_like(a)}.get(row, found)
            found = np.where(known == truth, result, found)
    return found


def known_truth(name: str, a: Places, b: Places, table: Any) -> Places:
    """Return the places of truth values that a comparison or combination gives without a run, and -1 for others."""
    return np.where(a == b, table >> 1 & 1, -1) if name == "compare" else _combined(a, b, table)


def _exact_cases(name: str, a: Any, b: Any, one: int) -> list[tuple[Any, Any]]:
    """Return when an operation gives a number back, place 0 being zero, and which; the first case that holds counts."""
    if name == "divide":
        return [(a == 0, a), (b == one, a)]
    if name == "multiply":
        return [(a == 0, a), (b == 0, b), (a == one, b), (b == one, a)]
    return {"add": [(b == 0, a), (a == 0, b)], "subtract": [(b == 0, a)]}.get(name, [])


def exact_result(name: str, a: int, b: int, one: int) -> int:
    """Return the place of the number that an exact operation gives back, or -1; place 0 is zero, `one` is 1."""
    return next((place for holds, place in _exact_cases(name, a, b, one) if holds), -1)


def laid_out(shapes: Iterable[tuple[int, ...]]) -> list[Places]:
    """Return places for arrays of some shapes, which follow each other from place 1 on."""
    found, at = list[Places](), 1
    for shape in shapes:
        found.append(np.arange(at, at + math.prod(shape)).reshape(shape))
        at += found[-1].size
    return found


def depending(rows: NDArray[Any], numbers: NDArray[np.bool_], truths: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which operations depend on marked numbers or truth values, and mark their results.

    Operations that a run may leave out depend on them together.
    """
    marks, given = (numbers, truths), rows[:, 1:4]
    skips = np.flatnonzero(rows[:, 0] == CODES["skip"])
    regions = [slice(o, o + 1 + rows[o, 2]) for o in skips.tolist()]
    found, before = np.zeros(len(rows), np.bool_), -1
    while int(np.count_nonzero(found)) != before:
        before = int(np.count_nonzero(found))
        for begin, end in independent(rows):
            part, code = slice(begin, end), rows[begin, 0]
            for mark, taken in zip(marks, OPERANDS, strict=True):
                found[part] |= mark[given[part, taken[code]]].any(axis=1)
            if NAMES[code] not in ("nonzero", "skip"):
                marks[NAMES[code] in TRUTHS][rows[part, 4][found[part]]] = True
        if not regions:
            break
        for region in regions:
            found[region] |= found[region].any()
    return found


class Tape:
    """Operations in the order in which they ran. Place 0 is the number zero; truth values 0 and 1 are false and true.

    The places of the numbers that each run takes are 1 to `inputs`.
    """

    def __init__(self, inputs: int, one: bool = False) -> None:
        self.inputs = inputs
        #: The place of the number one if every format has it, else -1.
        self.one = -1
        #: The reason why the function cannot be repeated; empty if it can.
        self.refusal = ""
        self._instructions = array("i")
        self._values, self._truths = 1 + inputs, 2
        self._calls: list[Call] = []
        self._constants = (Constants(False), Constants(True))
        self._known: dict[Any, int] = {}
        #: Whether a number that several formats have is stored alike in all of them.
        self.alike = True
        #: Whether fused multiply-adds are operations, and not calls of a function.
        self.fuses = False
        self._segments_begin: list[tuple[int, int]] = []
        self._checked = set[int]()
        self._guarded = False
        #: The longest that it may become.
        self.most = MOST_OPERATIONS
        #: First operations of each quantity, and its name.
        self.labels: list[tuple[int, str]] = []
        if one:
            self.one = self.constant(1, exactly=False)

    def refuse(self, reason: str) -> NoReturn:
        """Stop recording, also if the function handles the error."""
        self.refusal = self.refusal or reason
        raise UntraceableError(reason)

    # -- recording -------------------------------------------------------------------------------------

    def constants(self, numbers: NDArray[Any], exactly: bool) -> Places:
        """Return places of constants, of the shape of an object array of numbers."""
        found = [self.constant(each, exactly) for each in numbers.ravel().tolist()]
        return np.array(found, dtype=np.int64).reshape(numbers.shape)

    def constant(self, number: Any, exactly: bool) -> int:
        """Return the place of a constant; equal constants of one type share a place."""
        if type(number) in _WHOLE and (number == 0 or (number == 1 and self.one > 0)):
            return self.one if number else 0
        key: tuple[Any, ...] = (type(number), number, exactly)
        try:
            place = self._known.get(key)
        except TypeError:  # a number without a hash
            key, place = (object(),), None
        if place is None:
            place = self._known[key] = self._values
            self._values += 1
            self._constants[exactly].places.append(place)
            self._constants[exactly].numbers.append(number)
        return place

    def record(self, name: str, *operands: Any, fmt: int = 0) -> Places:
        """Record an operation on places of one shape, entry by entry, and return the places of its results.

        Products with zero and one and sums with zero are exact, and left out. A third operand, a choice or a table, may
        be an int. Results are rounded in format number `fmt`.
        """
        if name == "round":
            (a,) = operands
            left = (a != 0) & ((a != self.one) | (not self.alike))
            found = np.where(left, 0, a)
            if left.any():
                found[left] = self._append(name, (a[left],), fmt)
            return found
        if name in TRUTHS:
            a, b, table = operands
            found = known_truth(name, a, b, table)
            left = found < 0
            if left.any():
                found[left] = self._append(name, (a[left], b[left], table), fmt)
            return found
        if name not in _SHORTENED:
            return self._append(name, operands, fmt)
        a, b = operands
        if a.size == 1:
            if name == "divide" and a == 0:
                self.check(b.item())
            same = exact_result(name, a.item(), b.item(), self.one)
            return self._append(name, operands, fmt) if same < 0 else np.full(a.shape, same)
        if name == "divide":
            for each in np.unique(b[a == 0]).tolist():
                self.check(each)
        holds, places = map(list, zip(*_exact_cases(name, a, b, self.one), strict=True))
        found = np.select(holds, places, -1)
        left = found < 0
        if left.all():
            return self._append(name, operands, fmt)
        found[left] = self._append(name, (a[left], b[left]), fmt)
        return found

    def check(self, place: int) -> None:
        """Stop each run in which a number is zero that will be a divisor."""
        if place not in self._checked and place != self.one:
            self._append("nonzero", (np.array(place),), 0)
            if not self._guarded:
                self._checked.add(place)

    def only_if(self, truth: Places, changed: Callable[[], Any]) -> Any:
        """Record operations that a run leaves out unless a truth value holds; another part must choose by it, too."""
        at = len(self._instructions)
        self._append("skip", (truth, np.array(0)), 0)
        before, self._guarded = self._guarded, True
        found = changed()
        self._guarded = before
        if rows := (len(self._instructions) - at) // 5 - 1:
            self._instructions[at + 2] = rows
        else:
            del self._instructions[at:]
        return found

    def about(self, quantity: str) -> None:
        """Name the quantity that the next operations compute."""
        self.labels.append((len(self._instructions) // 5, quantity))

    def _append(self, name: str, operands: Sequence[Any], fmt: int) -> Places:
        first = operands[0]
        code = CODES[name]
        truth = name in TRUTHS
        size, begin = first.size, self._truths if truth else self._values
        if len(self._instructions) + 5 * size > 5 * self.most:
            self.refuse(f"it takes more than {self.most} operations")
        if size and (not self._segments_begin or self._segments_begin[-1][1] != fmt):
            self._segments_begin.append((len(self._instructions) // 5, fmt))
        if size == 1:
            row = [code, 0, 0, 0, begin]
            for column, each in enumerate(operands, start=1):
                row[column] = each if type(each) is int else each.item()
            self._instructions.extend(row)
        else:
            rows = np.zeros((size, 5), dtype=np.intc)
            rows[:, 0], rows[:, 4] = code, np.arange(begin, begin + size)
            for column, each in enumerate(operands, start=1):
                rows[:, column] = each if type(each) is int else each.ravel()
            self._instructions.frombytes(rows.tobytes())
        if truth:
            self._truths += size
        elif name not in ("nonzero", "skip"):
            self._values += size
        return np.arange(begin, begin + size).reshape(first.shape) if first.ndim else np.array(begin)

    @property
    def formats(self) -> NDArray[np.int64]:
        """Return the number of the format of each operation."""
        found = np.zeros(len(self._instructions) // 5, np.int64)
        for begin, fmt in self._segments_begin:
            found[begin:] = fmt
        return found

    @property
    def sizes(self) -> tuple[int, int]:
        """Return the numbers of places of numbers and of truth values."""
        return self._values, self._truths

    def call(self, function: Callable[..., FloatArray], *operands: Places) -> Places:
        """Record the call of a function that takes one entry of each operand after the other."""
        results = np.arange(self._values, self._values + operands[0].size)
        self._values += len(results)
        self._calls.append(Call(len(self._instructions) // 5, function, [each.ravel() for each in operands], results))
        return results.reshape(operands[0].shape)

    @property
    def calls(self) -> Sequence[Call]:
        """The calls of functions, in their order."""
        return tuple(self._calls)

    @property
    def all_constants(self) -> tuple[Constants, Constants]:
        """The constants that a format may round, and those that it must hold."""
        return self._constants

    def constants_in(self, fmt: Any) -> dict[int, Fraction]:
        """Return the constants as a format stores them, by their places."""
        found: dict[int, Fraction] = {0: Fraction(0)}
        for each in self._constants:
            found.update(zip(each.places, np.ravel(each.rounded(fmt).to_fractions()).tolist(), strict=True))
        return found

    @property
    def instructions(self) -> NDArray[np.intc]:
        """Return the operations as an (n, 5) array with a code, three operands and the place of the result."""
        return np.frombuffer(self._instructions, dtype=np.intc).reshape(-1, 5)

    # -- running ---------------------------------------------------------------------------------------

    def run(self, inputs: FloatArray, results: Places) -> FloatArray:
        """Repeat the operations in the format of the inputs, (inputs,); return the numbers at the places of results."""
        fmt: Any = inputs.format
        found = None
        if len(self._instructions) >= 5 * FEW_OPERATIONS and isinstance(fmt.backend, Compiled):
            found = self._run_on(Numbers([fmt], self.sizes), inputs, results)
        if found is None:
            found = self._run_on(OnIntegers(fmt, self.sizes), inputs, results)
            assert found is not None  # integers hold every number
        return found

    def _run_on(self, numbers: Numbers | OnIntegers, inputs: FloatArray, results: Places) -> FloatArray | None:
        packed = numbers.packed(inputs)
        if packed is None or not numbers.hold_constants(self.all_constants):
            return None
        numbers.hold(np.arange(1, 1 + self.inputs), packed)
        if not numbers.run(numbers.ready(self.segments)):
            return None
        return numbers.unpacked(numbers.at(results.ravel()), results.shape, inputs.format)

    @property
    def segments(self) -> list[Segment]:
        """The operations before each call, and after the last."""
        ends = [(each.at, each) for each in self._calls] + [(len(self._instructions) // 5, None)]
        rows, formats = self.instructions, self.formats
        begins = [0, *(at for at, _ in ends)]
        return [
            Segment(rows[begin:end], formats[begin:end], call) for begin, (end, call) in zip(begins, ends, strict=False)
        ]

    def once_and_each(self, varying: Places) -> tuple[list[Segment], list[Segment]]:
        """Return the operations and calls that depend on no number at some places, to run once, and all others."""
        marks = np.zeros(self._values, np.bool_), np.zeros(self._truths, np.bool_)
        marks[0][varying] = True
        once, each = list[Segment](), list[Segment]()
        waiting: list[Segment] = []
        for rows, formats, call in self.segments:
            late = depending(rows, *marks)
            changes = call is not None and any(marks[0][places].any() for places in call.operands)
            if call is not None:
                marks[0][call.results] = changes
            once.append(Segment(rows[~late], formats[~late], None if changes else call))
            waiting.append(Segment(rows[late], formats[late], None))
            if changes or call is None:
                rows, formats = (np.concatenate([part[i] for part in waiting]) for i in range(2))
                each.append(Segment(rows, formats, call))
                waiting = []
        return once, each

    def equals(self, other: Tape) -> bool:
        """Whether another tape has the same operations, calls and constants."""

        def known(tape: Tape) -> Any:
            calls = [(each.at, each.name, *(at.tolist() for at in each.operands)) for each in tape.calls]
            constants = [(each.places, each.numbers, list(map(type, each.numbers))) for each in tape.all_constants]
            return tape.sizes, tape.instructions.tolist(), tape.formats.tolist(), calls, constants

        return bool(known(self) == known(other))
