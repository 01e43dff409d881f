"""A recorded step as the machine repeats it: what no measurement changes once for all records, then the rest.

A step takes numbers of its own, such as measurements, numbers of the model in cycles, and states, which it replaces.
States that depend on none of the step's own numbers, such as the covariance of a linear filter, may repeat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import compress
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.interpreting import Numbers
from gpbnb.arithmetic.loop import Loop, steps_at_once
from gpbnb.arithmetic.machine import CODES, OPERANDS, Fault, fault_of, takes_numbers
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.tape import TRUTHS, Places, depending, laid_out
from gpbnb.arithmetic.traced import TracedFormat, TracedTruth
from gpbnb.filters.program import Program, flat
from gpbnb.filters.steps import StepTaken

LARGEST_KEPT = 1 << 18
"""Most numbers that are kept of steps that repeat."""

_GIVES_TRUTH = np.array([name in TRUTHS for name in CODES])
_GIVES_NUMBER = np.array([name not in (*TRUTHS, "nonzero", "skip") for name in CODES])


StepFunction = Callable[[Sequence[Any], tuple[Any, ...], Sequence[Any]], StepTaken]
"""A function of formats, of states, and of what a step is given, that takes a step on arrays of any kind."""


def leaves(part: Any) -> Iterator[Any]:
    """Give the arrays in tuples and lists."""
    if isinstance(part, (list, tuple)):
        for each in part:
            yield from leaves(each)
    else:
        yield part


def record_step(
    function: StepFunction,
    formats: Sequence[TracedFormat],
    arrays: Sequence[tuple[int, tuple[int, ...]]],
    ends: tuple[int, int],
) -> tuple[Program, StepTaken]:
    """Record a step on the tape of some formats; also return what it gives.

    Parameters
    ----------
    arrays : the number of the format, and the shape, of each array that the step takes: states, its own, of cycles.
    ends : numbers of the first array of its own, and of the first of a cycle.
    """
    tape, places, (own, cycles) = formats[0].tape, laid_out(shape for _, shape in arrays), ends
    made = [formats[number].made(at) for (number, _), at in zip(arrays, places, strict=True)]
    taken = function(formats, tuple(made[:own]), made[own:])
    after, results = ([each.components[0] for each in leaves(part)] for part in (taken.states, taken.gain))
    definite = taken.definite
    holds = int(definite.components[0]) if isinstance(definite, TracedTruth) else int(bool(definite))
    given = places[:own], places[own:cycles], places[cycles:]
    return Program(tape, tape.instructions, tape.formats, *given, after, results, holds), taken


class StepPart(NamedTuple):
    """Operations of a step that run together.

    Parameters
    ----------
    rows, at : operations, and their numbers in the whole step.
    changes, gives : which of the states are its own, and which of all that a step gives, its states and then the rest.
    states, after, kept : places of these states before and after a step, and of what it gives.
    truth : the truth value that is kept of each step.
    """

    rows: NDArray[Any]
    at: NDArray[np.int64]
    changes: list[int]
    gives: list[int]
    states: Places
    after: Places
    kept: Places
    truth: int


class DividedStep(NamedTuple):
    """A recorded step in two parts: what depends on no number of its own, and the rest.

    Parameters
    ----------
    shared : places in the early part of the numbers that the rest takes from it; in the rest, these numbers follow each
        other behind all others.
    """

    step: Program
    early: StepPart
    rest: StepPart
    shared: Places


def divided(step: Program, together: bool = False) -> DividedStep:
    """Divide the operations of a step into those that depend on its own numbers and those that do not.

    Parameters
    ----------
    together : whether all operations are to run in the second part, in the order in which two parts take a step.
    """
    rows, (values, truths) = step.rows, step.tape.sizes
    given, before = [*step.after, *step.results], list[bool]()
    known = flat(step.late)
    changes = [bool(np.isin(each, known).any()) for each in step.states]
    while changes != before:
        before, marks = changes, (np.zeros(values, np.bool_), np.zeros(truths, np.bool_))
        for places in (*step.inputs, known, *compress(step.states, changes)):
            marks[0][places] = True
        late = depending(rows, *marks)
        is_late = [bool(marks[0][each].any()) for each in given]
        changes = [one or other for one, other in zip(is_late, before, strict=False)]
    is_late[: len(changes)] = changes
    order, early = np.argsort(late, kind="stable"), ~late
    if together:
        changes, is_late = [True] * len(changes), [True] * len(is_late)
        early[:], marks[1][step.definite] = False, True
    elif OPERANDS[1][rows[late, 0]].any():  # truth values are not shared: each part computes its own
        late |= _GIVES_TRUTH[rows[:, 0]]
    made, used = np.zeros(values, np.bool_), np.zeros(values, np.bool_)
    made[rows[early & _GIVES_NUMBER[rows[:, 0]], 4]] = True
    used[rows[late, 1:4][takes_numbers(rows[late, 0])]] = True
    for state in compress(step.states, [not each for each in changes]):
        made[state] = True
    for each in compress(given, is_late):
        used[each] = True
    shared = np.flatnonzero(made & used)
    moved = np.arange(values)
    moved[shared] = values + np.arange(len(shared))

    def part(own: bool, chosen: NDArray[np.int64]) -> StepPart:
        mine, gives = ([i for i, each in enumerate(some) if each == own] for some in (changes, is_late))
        states, after, kept = (
            flat([each[i] for i in some]) for each, some in ((step.states, mine), (step.after, mine), (given, gives))
        )
        part, truth = rows[chosen], step.definite if marks[1][step.definite] == own else 1
        if own:
            taken = takes_numbers(part[:, 0])
            part[:, 1:4][taken] = moved[part[:, 1:4][taken]]
            after, kept = moved[after], moved[kept]
        return StepPart(part, chosen, mine, gives, states, after, kept, truth)

    chosen = order if together else np.flatnonzero(late)
    return DividedStep(step, part(False, np.flatnonzero(early)), part(True, chosen), shared)


class Stop(NamedTuple):
    """What has no result in a step: an operation, and the quantity to which it belongs."""

    fault: Fault
    quantity: str


class StepsTaken(NamedTuple):
    """Results after each of some steps, which are fewer than asked for if a step has none.

    Parameters
    ----------
    given : states, and the rest that a step gives, each (steps, entries, ...).
    definite : (steps,).
    shared : what the second part of a step takes from the first, (steps, entries, ...), if it has two parts.
    """

    given: list[NDArray[Any]]
    definite: NDArray[np.bool_]
    stop: Stop | None
    shared: Sequence[NDArray[Any]] = ()


class Repeats(Protocol):
    """A step that is repeated on packed numbers."""

    @property
    def longest(self) -> int:
        """The largest number of steps taken at once."""

    def take(self, first: int, states: Sequence[NDArray[Any]], own: NDArray[Any]) -> StepsTaken:
        """Take one step for each row of the step's own numbers; see :meth:`RunningStep.take`."""


class RunningStep:
    """A recorded step that is repeated on packed numbers.

    Parameters
    ----------
    parts : the step.
    formats : the formats of the numbers that it names; None is double-double.
    cycles : numbers (p, entries, ...) for the places of its cycles.
    records : number of lanes of what depends on the step's own numbers.
    tag : the arithmetic of the run, from which both parts of a step draw random numbers.
    held : other numbers and truth values, which stay as they are.
    """

    def __init__(
        self,
        parts: DividedStep,
        formats: Sequence[Any],
        cycles: Sequence[NDArray[Any]],
        records: int = 1,
        tag: Any = None,
        held: Numbers | None = None,
    ) -> None:
        self._parts, step, shared = parts, parts.step, parts.shared
        self._shared_at = step.tape.sizes[0]
        self._kept_at = np.concatenate([shared, parts.early.kept])

        def loop(part: StepPart, lanes: int | None = None) -> Loop:
            """Return a part of a step that is repeated on its own values."""
            (places, truths), numbers = step.tape.sizes, step.formats[part.at]
            sizes = places + len(shared), truths
            found = Loop(formats, part.rows, numbers, sizes, part.states, part.after, part.truth, lanes, tag)
            if not found.hold_constants(step.tape.all_constants):
                raise OverflowError("got a constant beyond the range of the loops")
            if held is not None:
                found.hold(np.arange(len(held.values)), held.values)
                found.truths[:] = held.truths
            return found

        self._early, self._rest = loop(parts.early), loop(parts.rest, records if records > 1 else None)
        #: The number of states, and what holds the step's own numbers.
        self.states, self.numbers = len(step.states), self._rest
        of_early = self._taken_of(cycles, parts.early)
        self._early.feed(of_early)
        self._early.keep(self._kept_at)
        self._rest.feed(self._taken_of(cycles, parts.rest))
        self._rest.keep(parts.rest.kept)
        repeats = all(fmt is None or fmt.rounding is not Rounding.STOCHASTIC for fmt in formats)
        self._cycle = int(np.lcm.reduce([1, *(len(table) for _, table in of_early)])) if repeats else 0
        kept = len(self._kept_at) + records * len(parts.rest.kept)
        work = len(parts.early.rows) + records * len(parts.rest.rows)
        #: The largest number of steps taken at once; two parts draw random numbers step by step.
        self.longest = steps_at_once(kept, work) if repeats or not len(parts.early.rows) else 1
        self._repeated: tuple[int, NDArray[Any], NDArray[np.bool_]] | None = None
        self._last: NDArray[Any] | None = None

    def _taken_of(self, cycles: Sequence[NDArray[Any]], part: StepPart) -> list[tuple[int, NDArray[Any]]]:
        """Return first places and numbers of the cycles that a part of a step takes."""
        read = np.zeros(1 + max(len(self._rest.values), part.rows.max(initial=0)), np.bool_)
        for places in (part.rows[:, 1:4], part.after, part.kept):
            read[places] = True
        given = ((each.ravel(), table) for each, table in zip(self._parts.step.coefficients, cycles, strict=True))
        return [(int(at[0]), table) for at, table in given if read[at].any()]

    def take(self, first: int, states: Sequence[NDArray[Any]], own: NDArray[Any]) -> StepsTaken:
        """Take one step for each row of the step's own numbers (steps, entries, ...), at most :attr:`longest`.

        Parameters
        ----------
        first : number of steps taken before.
        states : (entries, ...), before the first step.
        """
        (step, of_early, of_rest, places), rest = self._parts, self._rest
        before, rest.states = (
            np.concatenate([loop.states[:0], *(states[i].reshape(-1, *loop.values.shape[1:]) for i in part.changes)])
            for loop, part in ((self._early, of_early), (rest, of_rest))
        )
        kept, definite, stop = self._early_steps(first, len(own), before)
        count, shared = len(kept), len(places)
        given = np.ascontiguousarray(own[:count].reshape(count, own.shape[1], *rest.values.shape[1:]))
        at = next((int(each.ravel()[0]) for each in step.inputs if each.size), 0)
        groups = [(at, given), (self._shared_at, kept[:, :shared])]
        found, held, row = rest.take(first, count, groups)
        stop = stop if row < 0 else self._stop(rest, of_rest, row)
        done, sizes = len(found), [each.size for each in (*step.after, *step.results)]
        results = dict[int, NDArray[Any]]()
        for part, each in ((of_early, kept[:done, shared:]), (of_rest, found)):
            ends = np.cumsum([sizes[i] for i in part.gives])[:-1]
            results.update(zip(part.gives, np.split(each, ends, axis=1), strict=False))
        self._last = None  # the early part is ahead of the rest
        if done == count:
            self._last = kept[-1, shared : shared + len(of_early.after)] if done else before
        whole = [results[i] for i in range(len(sizes))]
        return StepsTaken(whole, definite[:done] & held, stop, [kept[:done, :shared]])

    def _early_steps(
        self, first: int, count: int, states: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[np.bool_], Stop | None]:
        """Return what the early part computes in some steps."""
        early = self._early
        if not len(self._parts.early.rows) and not len(self._kept_at):
            return np.empty((count, 0, *early.values.shape[1:])), np.ones(count, np.bool_), None
        if self._last is None or not np.array_equal(self._last, states):
            self._repeated = None
            early.states = states
            early.compare_from(states, self._cycle)
        if self._repeated is not None:
            return (*self._of_cycle(first, count), None)
        early.states = states
        kept, held, stop = self._early_alone(first, count, self._cycle)
        period = early.period
        if not period:
            return kept, held, stop
        early.compare_from(early.states, 0)
        first, count = first + len(kept), count - len(kept)
        if period * len(self._kept_at) > LARGEST_KEPT:
            self._cycle = 0
            rest = self._early_alone(first, count, 0)
        else:
            self._repeated = first, *self._early_alone(first, period, 0)[:2]
            rest = (*self._of_cycle(first, count), None)
        return np.concatenate([kept, rest[0]]), np.concatenate([held, rest[1]]), rest[2]

    def _early_alone(self, first: int, count: int, cycle: int) -> tuple[NDArray[Any], NDArray[np.bool_], Stop | None]:
        early = self._early
        kept, held, row = early.take(first, count, cycle=cycle)
        return kept, held, None if row < 0 else self._stop(early, self._parts.early, row)

    def _stop(self, loop: Loop, part: StepPart, row: int) -> Stop:
        return Stop(fault_of(loop.rows, loop.values, row), self._parts.step.quantity(int(part.at[row])))

    def _of_cycle(self, first: int, count: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        assert self._repeated is not None
        begin, table, definite = self._repeated
        rows = (first - begin + np.arange(count)) % len(table)
        return table[rows], definite[rows]
