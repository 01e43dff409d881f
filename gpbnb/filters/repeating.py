"""A step of a filter on arrays, recorded once and repeated: the elementary functions in it are called between its rows.

A step that no tape can repeat, because it branches on a number or because its functions depend on more than their
arguments, runs operation by operation. So does a single step in which the recorded operations have no result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.exits import unseen
from gpbnb.arithmetic.interpreting import Numbers, OnIntegers
from gpbnb.arithmetic.kernels.backends import Looped
from gpbnb.arithmetic.loop import Loop, steps_at_once
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.tape import FEW_OPERATIONS, Tape
from gpbnb.arithmetic.traced import TracedFormat, TracedTruth


class StepTaken(NamedTuple):
    """What a step gives: its states, its gain as arrays in tuples or lists, and whether all is definite.

    Of several steps, arrays and truth values have one row for each.
    """

    states: tuple[Any, ...]
    gain: Any
    definite: Any


StepFunction = Callable[[Sequence[Any], tuple[Any, ...], Sequence[Any]], StepTaken]
"""A function of formats, of states, and of what a step is given, that takes a step on arrays of any kind."""


class RecordedArrays(NamedTuple):
    """A recorded step: its tape, the places of what it takes, and what it gives."""

    tape: Tape
    places: list[NDArray[np.int64]]
    taken: StepTaken


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
        self._inside: _Inside | None = None
        self._opens = type(formats[0]) is not TracedFormat  # else it is part of a function that is traced itself

    def take(self, *own: FloatArray) -> Iterator[StepTaken]:
        """Take a step for each row of some arrays (steps, ...), and give the results of some steps at a time."""
        count, at = len(own[0]), 0
        if self._opens:
            self._opens, self._inside = False, self._opened(self.given(*(each[0] for each in own)), count)
        while at < count:
            longest = 0
            if self._inside is not None:
                longest = min(self._inside.longest, count - at)
                found = self._inside.take(self.steps, self.states, [each[at : at + longest] for each in own])
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

    def recorded(self, given: Sequence[FloatArray]) -> RecordedArrays:
        """Return the operations of a step in one format, whose numbers are not looked at.

        Raises
        ------
        ValueError : no tape can repeat the step; the message says why.
        """
        arrays = (*self.states, *given)
        found, again = (self._recorded(arrays, [0] * len(arrays), True) for _ in range(2))
        if isinstance(found, str) or isinstance(again, str) or not found.tape.equals(again.tape):
            why = found if isinstance(found, str) else "its functions depend on more than their arguments"
            raise ValueError(f"got a step that cannot be traced: {why}; needed one that can, without branches")
        return found

    def _opened(self, given: Sequence[FloatArray], steps: int) -> _Inside | None:
        """Record a step, and make it ready to run; None if it cannot be repeated."""
        formats, alike = self._formats, True
        if any(fmt.rounding is Rounding.STOCHASTIC for fmt in formats):
            return None
        if len(formats) > 1:
            if not all(isinstance(fmt.backend, Looped) for fmt in formats):
                return None
            alike = formats[0].backend.count == 1
        arrays = (*self.states, *given)
        numbers = [formats.index(each.format) for each in arrays]
        found, again = (self._recorded(arrays, numbers, alike) for _ in range(2))
        if isinstance(found, str) or isinstance(again, str) or not found.tape.equals(again.tape):
            return None
        try:
            return _Inside(found, formats, self._cycles, steps)
        except (ArithmeticError, ValueError, TypeError):
            return None

    def _recorded(self, arrays: Sequence[FloatArray], numbers: Sequence[int], alike: bool) -> RecordedArrays | str:
        """Record a step; return why not, if it does what no tape repeats."""
        tape = Tape(sum(each.size for each in arrays), one=True)
        tape.alike = alike
        formats = [TracedFormat(tape, i) for i in range(len(self._formats))]
        places, made = [], []
        at = 1
        for each, number in zip(arrays, numbers, strict=True):
            places.append(np.arange(at, at + each.size).reshape(each.shape))
            made.append(formats[number].made(places[-1]))
            at += each.size
        count = len(self.states)
        try:
            with unseen(formats[0]) as shown:
                taken = self._function(formats, tuple(made[:count]), made[count:])
        except Exception as error:  # the function runs itself, and raises its own error
            return tape.refusal or f"without numbers it stops: {error}"
        if tape.refusal or shown:
            return tape.refusal or "it shows values with peek"
        return RecordedArrays(tape, places, taken)


class _Inside:
    """A recorded step with its numbers.

    Parameters
    ----------
    steps : number of steps that are taken first: few operations run on integers, which need no loading.
    """

    def __init__(
        self, recorded: RecordedArrays, formats: Sequence[Any], cycles: Sequence[FloatArray], steps: int
    ) -> None:
        tape, (states, gain, definite) = recorded.tape, recorded.taken
        self._formats, self._given = formats, (states, gain)
        leaves = list(_leaves(self._given))
        self._kept_at = np.concatenate([each.components[0].ravel() for each in leaves])
        self._states_at = np.concatenate([each.ravel() for each in recorded.places[: len(states)]])
        self._truth = int(definite.components[0]) if isinstance(definite, TracedTruth) else int(bool(definite))
        own = recorded.places[len(states) : len(recorded.places) - len(cycles)]
        self._own_at = np.concatenate([each.ravel() for each in own])
        tables = list(zip((each.ravel() for each in recorded.places[len(states) + len(own) :]), cycles, strict=True))
        changing = [(at, table) for at, table in tables if len(table) > 1]
        once, each = tape.divided(np.concatenate([self._states_at, self._own_at, *(at for at, _ in changing)]))
        self._numbers: Numbers | OnIntegers
        few = len(formats) == 1 and steps * len(tape.instructions) < FEW_OPERATIONS
        if few or not isinstance(formats[0].backend, Looped):
            self._numbers = OnIntegers(formats[0], tape.sizes)
        elif len(each) > 1:
            self._numbers = Numbers(formats, tape.sizes)
        else:
            after, (rows, numbers, _) = self._kept_at[: len(self._states_at)], each[0]
            self._numbers = Loop(
                formats, rows.astype(np.int64), numbers, tape.sizes, self._states_at, after, self._truth
            )
        held = self._numbers.hold_constants(tape.all_constants)
        packed = [(at, self._packed(table, len(table))) for at, table in tables]
        for at, table in packed:
            self._numbers.hold(at, table[0])
        if not held or not self._numbers.run(self._numbers.ready(once)):
            raise OverflowError("got a constant beyond the range of the loops")
        self._changing = [(at, table) for at, table in packed if len(table) > 1]
        if isinstance(self._numbers, Loop):
            self._numbers.feed(self._changing)
        self._each = self._numbers.ready(each)
        #: The largest number of steps taken at once.
        self.longest = steps_at_once(len(self._kept_at), len(tape.instructions))

    def take(self, first: int, states: tuple[Any, ...], own: Sequence[FloatArray]) -> StepTaken | None:
        """Take steps from given states until one has no result; return None if the first has none.

        Parameters
        ----------
        first : number of steps taken before.
        """
        steps = len(own[0])
        try:
            before = np.concatenate([self._packed(each, 1) for each in states], axis=1)[0]
            given = np.concatenate([self._packed(each, steps) for each in own], axis=1)
        except OverflowError:
            return None
        kept, held = (self._in_a_loop if isinstance(self._numbers, Loop) else self._one_by_one)(first, before, given)
        if not len(kept):
            return None
        at, found = 0, list[FloatArray]()
        for leaf in _leaves(self._given):
            fmt, some = self._formats[leaf.format.number], kept[:, at : at + leaf.size]
            found.append(self._numbers.unpacked(some, (len(kept), *leaf.shape), fmt))
            at += leaf.size
        states, gain = _filled(self._given, iter(found))
        return StepTaken(states, gain, held)

    def _packed(self, numbers: FloatArray, rows: int) -> NDArray[Any]:
        """Return numbers in rows."""
        found = self._numbers.packed(numbers)
        if found is None:
            raise OverflowError("got a number beyond the range of the loops")
        return found.reshape(rows, numbers.size // rows, *found.shape[numbers.ndim :])

    def _in_a_loop(self, first: int, states: Any, own: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        loop = cast(Loop, self._numbers)
        loop.states = states
        own = own.reshape(*own.shape[:2], *loop.values.shape[1:])
        return loop.take(first, np.ascontiguousarray(own), int(self._own_at[0]), self._kept_at)[:2]

    def _one_by_one(self, first: int, states: Any, own: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Take steps whose calls of functions stand between operations, or which run on integers."""
        numbers, kept, held = self._numbers, [], []
        with suppress(ArithmeticError, ValueError, TypeError):
            for k, given in enumerate(own):
                numbers.hold(self._states_at, states)
                numbers.hold(self._own_at, given)
                for at, table in self._changing:
                    numbers.hold(at, table[(first + k) % len(table)])
                if not numbers.run(self._each):
                    break
                kept.append(numbers.at(self._kept_at))
                held.append(numbers.truth(self._truth))
                states = kept[-1][: len(self._states_at)]
        return np.array(kept, dtype=object if isinstance(numbers, OnIntegers) else None), np.array(held)


def _leaves(part: Any) -> Iterator[Any]:
    """Give the arrays in tuples and lists."""
    if isinstance(part, (list, tuple)):
        for each in part:
            yield from _leaves(each)
    else:
        yield part


def _filled(part: Any, arrays: Iterator[Any]) -> Any:
    """Return tuples and lists with other arrays in them."""
    return type(part)([_filled(each, arrays) for each in part]) if isinstance(part, (list, tuple)) else next(arrays)


def _in_rows(part: Any) -> Any:
    """Return the arrays of a step with an axis of steps."""
    return _filled(part, (np.stack([each]) for each in _leaves(part)))
