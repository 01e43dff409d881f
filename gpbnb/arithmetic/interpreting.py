"""Interpreters of a tape: its operations run on the machine, or on integers of Python, and its calls between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import machine
from gpbnb.arithmetic.array import FloatArray, NegativeRootError
from gpbnb.arithmetic.kernels.exact import ExactKernel
from gpbnb.arithmetic.kernels.tags import CHOOSE, COMBINE, COMPARE, DIVIDE, NONZERO, ROOT, SKIP


class Call(NamedTuple):
    """A function of arrays that is called between two operations of a tape."""

    at: int  # number of operations before it
    function: Callable[..., FloatArray]  # takes arrays of the format, each (n,), and returns another
    operands: Sequence[NDArray[np.int64]]  # places, each (n,)
    results: NDArray[np.int64]

    @property
    def name(self) -> str:
        """The name of the function, as in NumPy."""
        return str(self.function.args[0] if isinstance(self.function, partial) else self.function.__name__)


class Constants:
    """Numbers that each run rounds into its format or, with `exactly`, that its format must hold."""

    def __init__(self, exactly: bool) -> None:
        self.exactly = exactly
        self.places: list[int] = []
        self.numbers: list[Any] = []

    def rounded(self, fmt: Any) -> FloatArray:
        """Return the numbers in a format."""
        found: FloatArray = fmt.array([]).operand(self.numbers) if self.exactly else fmt.array(self.numbers)
        return found

    def in_double_double(self) -> NDArray[np.float64]:
        """Return the numbers nearest to these in float64, (count, 2)."""
        return np.array([[float(each), 0.0] for each in self.numbers])


class Segment(NamedTuple):
    """Operations of a tape, (o, 5), the numbers of their formats, (o,), and the call after them, if any."""

    rows: NDArray[Any]
    formats: NDArray[np.int64]
    call: Call | None


class Numbers:
    """Numbers and truth values of a program on the machine.

    Parameters
    ----------
    formats : those that the program names, all with one kind of numbers; None is double-double.
    sizes : numbers of places, and of truth values.
    lanes : number of lanes, which lie behind the places; None for one, which only numbers with parts have an axis for.
    tag : the arithmetic of a run, from which random numbers are drawn.
    """

    def __init__(
        self, formats: Sequence[Any], sizes: tuple[int, int], lanes: int | None = None, tag: Any = None
    ) -> None:
        self.formats, backend = formats, None if formats[0] is None else formats[0].backend
        count, dtype = (2, np.float64) if backend is None else (backend.count, backend.dtype)
        parts = () if count == 1 else (count,)
        shape = (1,) * bool(parts) if lanes is None else (lanes,)
        self._parts, self._made = parts, FloatArray if formats[0] is None else type(formats[0].array([]))
        #: Their kind, and their columns.
        self.kind, self.tables = machine.tables(formats, tag)
        #: (places, [lanes], [parts]) and (truths, [lanes]).
        self.values, self.truths = np.zeros((sizes[0], *shape, *parts), dtype), np.zeros((sizes[1], *shape), np.uint8)
        self.truths[1] = 1
        self.memory = machine.Memory(self.values, self.truths)

    def hold(self, places: Any, numbers: NDArray[Any]) -> None:
        """Set packed numbers that are the same in all lanes, (count, ...)."""
        lanes = self.values.ndim - numbers.ndim
        self.values[places] = numbers[(slice(None), *(np.newaxis,) * lanes)]

    def hold_constants(self, constants: Iterable[Constants]) -> bool:
        """Set the constants of a tape; return whether the machine holds them all."""
        fmt = self.formats[0]
        for each in constants:
            if each.places:
                packed = each.in_double_double() if fmt is None else self.packed(each.rounded(fmt))
                if packed is None:
                    return False
                self.hold(each.places, packed)
        return True

    @staticmethod
    def packed(numbers: FloatArray) -> NDArray[Any] | None:
        """Return numbers as the machine takes them; None if it does not hold them."""
        fmt: Any = numbers.format
        held = numbers.backend is fmt.backend
        return fmt.backend.pack(numbers.components) if held else None

    def unpacked(self, numbers: Any, shape: tuple[int, ...], fmt: Any) -> FloatArray:
        """Return numbers of the machine, of one lane, as an array."""
        return self._made.from_packed(numbers.reshape(*shape, *self._parts), fmt)

    def at(self, places: NDArray[np.int64]) -> NDArray[Any]:
        """Return the numbers at some places."""
        found: NDArray[Any] = self.values[places]
        return found

    def truth(self, place: int) -> bool:
        """Return whether a truth value holds in all lanes."""
        return bool(self.truths[place].all())

    @staticmethod
    def ready(segments: Iterable[Segment]) -> list[Any]:
        """Return operations and calls as :meth:`run` takes them."""
        return [(machine.code_of(each.rows, each.formats), len(each.rows), each.call) for each in segments]

    def run(self, ready: list[Any]) -> bool:
        """Run operations and calls; return whether the machine holds every result."""
        far = machine.is_far(self.kind, self.values)
        for code, count, call in ready:
            if count:
                done, far = machine.evaluated(self.memory, self.kind, self.tables, code, far)
                if done < count:
                    return False
            if call is not None:
                given = (self.unpacked(self.values[each], each.shape, self.formats[0]) for each in call.operands)
                packed = self.packed(call.function(*given))
                if packed is None:
                    return False
                self.hold(call.results, packed)
                far = far or machine.is_far(self.kind, packed)
        return True

    def first_without_result(self, rows: NDArray[Any], formats: NDArray[np.int64]) -> int:
        """Return the first of some operations that has no result, by halving: one of them has none."""
        good, bad = 0, len(rows)
        while bad - good > 1:
            middle = (good + bad) // 2
            done = self.evaluate(machine.code_of(rows[:middle], formats[:middle]))
            good, bad = (middle, bad) if done == middle else (good, middle)
        return good

    def evaluate(self, code: Any) -> int:
        """Run operations once in each lane; return how many have results, 0 if the machine does not tell."""
        return machine.evaluate(self.memory, self.kind, self.tables, code)


class OnIntegers:
    """Numbers of a program as significands and exponents of Python, which hold the numbers of every format."""

    def __init__(self, fmt: Any, sizes: tuple[int, int]) -> None:
        self._kernel: ExactKernel = fmt.kernel
        self._significands, self._exponents = [0] * sizes[0], [0] * sizes[0]
        self._truths, self._fmt, self._made = [False, True] + [False] * (sizes[1] - 2), fmt, type(fmt.array([]))

    def hold(self, places: Any, numbers: Any) -> None:
        """Set numbers, pairs of significands and exponents."""
        for place, (significand, exponent) in zip(places, numbers, strict=True):
            self._significands[place], self._exponents[place] = significand, exponent

    def hold_constants(self, constants: Iterable[Constants]) -> bool:
        """Set the constants of a tape, all of which it holds."""
        for each in constants:
            self.hold(each.places, self.packed(each.rounded(self._fmt)))
        return True

    @staticmethod
    def packed(numbers: FloatArray) -> NDArray[Any]:
        """Return numbers as pairs, (..., 2)."""
        return np.stack(numbers.on_exact_backend().components, axis=-1)

    def unpacked(self, numbers: Any, shape: tuple[int, ...], fmt: Any) -> FloatArray:
        """Return pairs as an array."""
        pairs = np.array(numbers, dtype=object).reshape(*shape, 2)
        return self._made.from_pairs(pairs[..., 0], pairs[..., 1], fmt)

    def at(self, places: NDArray[np.int64]) -> list[tuple[int, int]]:
        """Return the numbers at some places."""
        return [(self._significands[i], self._exponents[i]) for i in places.tolist()]

    def truth(self, place: int) -> bool:
        """Return a truth value."""
        return self._truths[place]

    @staticmethod
    def ready(segments: Iterable[Segment]) -> list[Any]:
        """Return operations and calls as :meth:`run` takes them."""
        return [(each.rows.tolist(), each.call) for each in segments]

    def run(self, ready: list[Any]) -> bool:
        """Run operations and calls."""
        for rows, call in ready:
            _run_exactly(self._kernel, rows, self._significands, self._exponents, self._truths)
            if call is not None:
                given = (self.unpacked(self.at(each), each.shape, self._fmt) for each in call.operands)
                self.hold(call.results.tolist(), self.packed(call.function(*given)))
        return True


def _run_exactly(
    kernel: ExactKernel, rows: list[list[int]], significands: list[int], exponents: list[int], truths: list[bool]
) -> None:
    m, e = significands, exponents
    of_two: list[Callable[..., tuple[int, int]]] = [kernel.add, kernel.subtract, kernel.multiply, kernel.divide]
    of_one: list[Callable[..., tuple[int, int]]] = [kernel.sqrt, kernel.negative, kernel.absolute]
    compare, after = kernel.compare, 0
    for o, (code, a, b, c, out) in enumerate(rows):
        if o < after:
            continue
        if code <= DIVIDE or code == NONZERO:
            if code >= DIVIDE and m[b if code == DIVIDE else a] == 0:
                raise ZeroDivisionError("got a division by zero; needed a divisor other than zero")
            if code <= DIVIDE:
                m[out], e[out] = of_two[code](m[a], e[a], m[b], e[b])
        elif code == CHOOSE:
            chosen = b if truths[a] else c
            m[out], e[out] = m[chosen], e[chosen]
        elif code == COMPARE:
            truths[out] = bool(c >> (compare(m[a], e[a], m[b], e[b]) + 1) & 1)
        elif code == COMBINE:
            truths[out] = bool(c >> (2 * truths[a] + truths[b]) & 1)
        elif code == SKIP:
            after = 0 if truths[a] else o + 1 + b
        else:
            if code == ROOT and m[a] < 0:
                raise NegativeRootError("got the square root of a negative number; needed x >= 0")
            m[out], e[out] = of_one[code - ROOT](m[a], e[a])
