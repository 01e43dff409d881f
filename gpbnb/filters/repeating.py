"""A step of a filter on arrays, recorded once and repeated: the elementary functions in it are called between its rows.

A step that no tape can repeat, because it branches on a number or because its functions depend on more than their
arguments, runs operation by operation. So does a single step in which the recorded operations have no result.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.exits import unseen
from gpbnb.arithmetic.interpreting import Numbers, OnIntegers, Segment
from gpbnb.arithmetic.kernels.backends import Looped
from gpbnb.arithmetic.loop import steps_at_once
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.tape import FEW_OPERATIONS, Tape
from gpbnb.arithmetic.traced import TracedFormat
from gpbnb.filters.program import Program, flat
from gpbnb.filters.stepping import (
    RunningStep,
    StepFunction,
    StepsTaken,
    divided,
    leaves,
    record_step,
)
from gpbnb.filters.steps import StepTaken


class RepeatedStep:
    """A step that is repeated in some formats.

    Parameters
    ----------
    function : the step.
    formats : its formats; the first is that of its functions.
    states : the arrays before the first step.
    cycles : arrays (p, ...) of which step k = 0, 1, … is given member k mod p, after what it is given of its own.
    """

    def __init__(
        self,
        function: StepFunction,
        formats: Sequence[Any],
        states: tuple[FloatArray, ...],
        cycles: Sequence[FloatArray] = (),
    ) -> None:
        self._function, self._formats, self._cycles = function, formats, cycles
        #: The states after the last step.
        self.states: tuple[Any, ...] = states
        #: Number of steps taken.
        self.steps = 0
        self._repeated: RunningStep | _OneByOne | None = None
        self._given: Any = None  # what a recorded step gives
        self._opens = type(formats[0]) is not TracedFormat  # else it is part of a function that is traced itself

    def take(self, *own: FloatArray) -> Iterator[StepTaken]:
        """Take a step for each row of some arrays (steps, ...), and give the results of some steps at a time."""
        count, at = len(own[0]), 0
        if self._opens and count:
            self._opens, self._repeated = False, self._opened(self.given(*(each[0] for each in own)), count)
        while at < count:
            if self._repeated is not None:
                longest = min(self._repeated.longest, count - at)
                found = self._taken(self._repeated, [each[at : at + longest] for each in own])
                if found is not None:
                    self.states, done = tuple(each[-1] for each in found.states), len(found.definite)
                    self.steps, at = self.steps + done, at + done
                    yield found
                    if done == longest:
                        continue
            taken = self._function(self._formats, self.states, self.given(*(each[at] for each in own)))
            self.states = taken.states
            self.steps, at = self.steps + 1, at + 1
            yield StepTaken(_in_rows(taken.states), _in_rows(taken.gain), np.array([bool(taken.definite)]))

    def given(self, *own: FloatArray) -> list[FloatArray]:
        """Return what the next step is given, with its own arrays."""
        return [*own, *(each[self.steps % len(each)] for each in self._cycles)]

    def recorded(self, given: Sequence[FloatArray]) -> Program:
        """Return the operations of a step in one format, whose numbers are not looked at.

        ValueError says why no tape can repeat the step.
        """
        found = self._recorded(given, [0] * (len(self.states) + len(given)), True)
        if isinstance(found, str):
            raise ValueError(f"got a step that cannot be traced: {found}; needed one that can, without branches")
        return found

    def _opened(self, given: Sequence[FloatArray], steps: int) -> RunningStep | _OneByOne | None:
        """Record a step and load it; return None if it cannot be repeated.

        A run of few operations uses Python's integers, which need no loading.
        """
        formats = self._formats
        if any(fmt.rounding is Rounding.STOCHASTIC for fmt in formats):
            return None
        alike = len(formats) == 1 or formats[0].backend.count == 1
        step = self._recorded(given, [formats.index(each.format) for each in (*self.states, *given)], alike)
        if isinstance(step, str):
            return None
        tape, tables = step.tape, list(zip(step.coefficients, self._cycles, strict=True))
        changing = (places for places, table in tables if len(table) > 1)
        once, each = tape.once_and_each(flat([*step.states, *step.inputs, *changing]))
        few = len(formats) == 1 and steps * len(tape.instructions) < FEW_OPERATIONS
        exactly = few or not isinstance(formats[0].backend, Looped)
        numbers = OnIntegers(formats[0], tape.sizes) if exactly else Numbers(formats, tape.sizes)
        try:
            cycles = [_packed(numbers, table, len(table)) for _, table in tables]
            held = numbers.hold_constants(tape.all_constants)
            for (places, _), table in zip(tables, cycles, strict=True):
                numbers.hold(places.ravel(), table[0])
            if not held or not numbers.run(numbers.ready(once)):
                return None
            if isinstance(numbers, OnIntegers) or len(each) > 1:
                return _OneByOne(step, numbers, cycles, each)
            rows, of_rows, _ = each[0]
            parts = divided(replace(step, rows=rows.astype(np.int64), formats=of_rows))
            return RunningStep(parts, formats, cycles, held=numbers)
        except (ArithmeticError, ValueError, TypeError):
            return None

    def _recorded(self, given: Sequence[FloatArray], numbers: Sequence[int], alike: bool) -> Program | str:
        """Record a step, twice; return why not, if it does what no tape repeats."""
        found, again = (self._recorded_once((*self.states, *given), numbers, alike) for _ in range(2))
        if isinstance(found, str) or isinstance(again, str):
            return found if isinstance(found, str) else "its functions depend on more than their arguments"
        if not found.tape.equals(again.tape):
            return "its functions depend on more than their arguments"
        return found

    def _recorded_once(self, arrays: Sequence[FloatArray], numbers: Sequence[int], alike: bool) -> Program | str:
        tape = Tape(sum(each.size for each in arrays), one=True)
        tape.alike = alike
        formats = [TracedFormat(tape, i) for i in range(len(self._formats))]
        shapes = [(number, each.shape) for number, each in zip(numbers, arrays, strict=True)]
        try:
            with unseen(formats[0]) as shown:
                ends = len(self.states), len(shapes) - len(self._cycles)
                step, taken = record_step(self._function, formats, shapes, ends)
        except Exception as error:  # the function runs itself, and raises its own error
            return tape.refusal or f"without numbers it stops: {error}"
        if tape.refusal or shown:
            return tape.refusal or "it shows values with peek"
        self._given = taken.states, taken.gain
        return step

    def _taken(self, repeated: RunningStep | _OneByOne, own: Sequence[FloatArray]) -> StepTaken | None:
        """Repeat a recorded step until one has no result; return None if the first has none."""
        numbers = repeated.numbers
        try:
            states = [_packed(numbers, each, 1)[0] for each in self.states]
            given = np.concatenate([_packed(numbers, each, len(each)) for each in own], axis=1)
        except OverflowError:
            return None
        found = repeated.take(self.steps, states, given)
        done = len(found.definite)
        if not done:
            return None
        packed = zip(leaves(self._given), found.given, strict=True)
        arrays = (
            numbers.unpacked(each, (done, *leaf.shape), self._formats[leaf.format.number]) for leaf, each in packed
        )
        states, gain = _filled(self._given, arrays)
        return StepTaken(states, gain, found.definite)


class _OneByOne:
    """A recorded step that runs on integers, or whose calls of functions stand between its operations.

    Numbers hold what no step changes; cycles are packed.
    """

    def __init__(
        self, step: Program, numbers: Numbers | OnIntegers, cycles: Sequence[NDArray[Any]], each: list[Segment]
    ) -> None:
        self.numbers, self._step, self._each = numbers, step, numbers.ready(each)
        self._states_at, self._own_at, self._kept_at = (
            flat(places) for places in (step.states, step.inputs, [*step.after, *step.results])
        )
        tables = ((at.ravel(), table) for at, table in zip(step.coefficients, cycles, strict=True))
        self._changing = [(at, table) for at, table in tables if len(table) > 1]
        #: The largest number of steps taken at once.
        self.longest = steps_at_once(len(self._kept_at), len(step.rows))

    def take(self, first: int, states: Sequence[NDArray[Any]], own: NDArray[Any]) -> StepsTaken:
        """Take steps as :meth:`RunningStep.take` does, without saying why one has no result."""
        numbers, kept, held = self.numbers, [], []
        before: Any = np.concatenate(states)
        with suppress(ArithmeticError, ValueError, TypeError):
            for k, given in enumerate(own):
                numbers.hold(self._states_at, before)
                numbers.hold(self._own_at, given)
                for at, table in self._changing:
                    numbers.hold(at, table[(first + k) % len(table)])
                if not numbers.run(self._each):
                    break
                kept.append(numbers.at(self._kept_at))
                held.append(numbers.truth(self._step.definite))
                before = kept[-1][: len(self._states_at)]
        found = np.array(kept, dtype=object if isinstance(numbers, OnIntegers) else None)
        ends = np.cumsum([each.size for each in (*self._step.after, *self._step.results)])[:-1]
        return StepsTaken(np.split(found, ends, axis=1) if kept else [], np.array(held, np.bool_), None)


def _packed(numbers: Numbers | OnIntegers, array: FloatArray, rows: int) -> NDArray[Any]:
    """Return an array in rows, as some numbers of a program hold it."""
    found = numbers.packed(array)
    if found is None:
        raise OverflowError("got a number beyond the range of the loops")
    return found.reshape(rows, array.size // rows, *found.shape[array.ndim :])


def _filled(part: Any, arrays: Iterator[Any]) -> Any:
    """Return tuples and lists with other arrays in them."""
    return type(part)([_filled(each, arrays) for each in part]) if isinstance(part, (list, tuple)) else next(arrays)


def _in_rows(part: Any) -> Any:
    """Return the arrays of a step with an axis of steps."""
    return _filled(part, (np.stack([each]) for each in leaves(part)))
