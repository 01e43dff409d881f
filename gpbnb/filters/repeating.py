"""A step of a filter on arrays, recorded once and repeated: the elementary functions in it are called between its rows.

A step that no tape can repeat, because it branches on a number or because its functions depend on more than their
arguments, runs operation by operation. So does a single step in which the recorded operations have no result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.exits import unseen
from gpbnb.arithmetic.interpreting import InLoops, OnIntegers, Segment
from gpbnb.arithmetic.kernels.backends import Looped
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.tape import FEW_OPERATIONS, Tape
from gpbnb.arithmetic.traced import TracedFormat, TracedTruth


class StepTaken(NamedTuple):
    """What a step gives: its states, its gain as arrays in tuples or lists, and whether all is definite."""

    states: tuple[Any, ...]
    gain: Any
    definite: Any


StepFunction = Callable[[Sequence[Any], tuple[Any, ...], Sequence[Any]], StepTaken]
"""A function of formats, of states, and of what a step is given, that takes a step on arrays of any kind."""


class RecordedArrays(NamedTuple):
    """A recorded step: its tape, the places of what it takes, what it gives, and how it is divided."""

    tape: Tape
    places: list[NDArray[np.int64]]
    taken: StepTaken
    once: list[Segment]
    each: list[Segment]


class RepeatedStep:
    """A step that is repeated in some formats.

    Parameters
    ----------
    function : the step.
    formats : its formats; the first is that of its functions.
    states : the arrays before the first step.
    steps : number of steps, if it is known: few operations run on integers, which need no loading.
    """

    def __init__(
        self, function: StepFunction, formats: Sequence[Any], states: tuple[FloatArray, ...], steps: int | None = None
    ) -> None:
        self._function, self._formats, self._steps = function, formats, steps
        self._states: tuple[FloatArray, ...] | None = states
        self._inside: _Inside | None = None
        self._made = dict[Any, _Inside | None]()
        self._gain: Any = None

    @property
    def states(self) -> tuple[FloatArray, ...]:
        """The states after the last step."""
        if self._states is None:
            assert self._inside is not None
            self._states = self._inside.after
        return self._states

    @property
    def gain(self) -> Any:
        """The gain of the last step."""
        if self._gain is None:
            assert self._inside is not None
            self._gain = self._inside.filled(self._inside.recorded.taken.gain)
        return self._gain

    def take(self, given: Sequence[FloatArray], kind: Any = None) -> bool:
        """Take a step, and return whether all is definite.

        Parameters
        ----------
        kind : tells steps apart that have other operations.
        """
        if type(self._formats[0]) is TracedFormat:  # part of a function that is traced itself
            self._made[kind] = None
        if kind not in self._made:
            self._made[kind] = self._opened(given, kind)
        inside = self._made[kind]
        if inside is not None:
            states = None if self._states is None and inside is self._inside else self.states
            if inside.take(states, given):
                self._inside, self._states, self._gain = inside, None, None
                return inside.definite
            if states is None:
                self._states = inside.before
        before = self.states
        taken = self._function(self._formats, before, given)
        self._states, self._gain = taken.states, taken.gain
        return bool(taken.definite)

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

    def _opened(self, given: Sequence[FloatArray], kind: Any) -> _Inside | None:
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
            return _Inside(found, formats, self._steps)
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
        return RecordedArrays(tape, places, taken, *tape.divided(np.arange(1, at)))


class _Inside:
    """A recorded step with its numbers."""

    def __init__(self, recorded: RecordedArrays, formats: Sequence[Any], steps: int | None) -> None:
        self.recorded, self._formats = recorded, formats
        tape = recorded.tape
        few = steps is not None and steps * len(tape.instructions) < FEW_OPERATIONS
        loops = isinstance(formats[0].backend, Looped) and not few
        self._run: InLoops | OnIntegers = InLoops(tape, formats) if loops else OnIntegers(tape, formats[0])
        if not self._run.sound or not self._run.run(self._run.ready(recorded.once)):
            raise OverflowError("got a constant beyond the range of the loops")
        self._each = self._run.ready(recorded.each)
        count = len(recorded.taken.states)
        self._before = np.concatenate([each.ravel() for each in recorded.places[:count]])
        self._after = np.concatenate([each.components[0].ravel() for each in recorded.taken.states])
        self._given: list[FloatArray | None] = [None] * (len(recorded.places) - count)

    def take(self, states: tuple[FloatArray, ...] | None, given: Sequence[FloatArray]) -> bool:
        """Take a step from states, or from those after the last one; return whether it has a result."""
        run, places = self._run, self.recorded.places
        try:
            if states is None:
                run.move(self._after, self._before)
            elif not all(run.put(at, each) for at, each in zip(places, states, strict=False)):
                return False
            first = len(places) - len(given)
            for i, each in enumerate(given):
                if each is not self._given[i]:
                    if not run.put(places[first + i], each):
                        return False
                    self._given[i] = each
            return run.run(self._each)
        except (ArithmeticError, ValueError, TypeError):
            return False

    @property
    def definite(self) -> bool:
        """Whether all was definite in the last step."""
        found = self.recorded.taken.definite
        return self._run.truth(int(found.components[0])) if isinstance(found, TracedTruth) else bool(found)

    @property
    def before(self) -> tuple[FloatArray, ...]:
        """The states before the last step, also if it has failed."""
        pairs = zip(self.recorded.places, self.recorded.taken.states, strict=False)
        return tuple(self._run.array(at, self._formats[each.format.number]) for at, each in pairs)

    @property
    def after(self) -> tuple[FloatArray, ...]:
        """The states after the last step."""
        return tuple(map(self.filled, self.recorded.taken.states))

    def filled(self, part: Any) -> Any:
        """Return arrays that the step gave, in tuples and lists."""
        if isinstance(part, (list, tuple)):
            return type(part)(map(self.filled, part))
        return self._run.array(part.components[0], self._formats[part.format.number])
