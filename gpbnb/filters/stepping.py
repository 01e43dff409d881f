"""A recorded step as the machine repeats it: the gain once for all records, then the estimates of all of them."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.machine import (
    Fault,
    Memory,
    advance,
    code_of,
    fault_of,
    first_without_result,
    is_far,
    packed_constants,
    tables,
)
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.recording import ProgramPart, RecordedStep
from gpbnb.interrupts import slices

_LONGEST_BLOCK, _NUMBERS = 1024, 1 << 17
"""Most steps of a block, and numbers that it keeps."""

LARGEST_KEPT = 1 << 18
"""Most numbers of covariances that repeat."""

_GAIN = ("P",)
_ESTIMATE = ("x", "carried")


class Stop(NamedTuple):
    """What has no result in a step: an operation, and the quantity to which it belongs."""

    fault: Fault
    quantity: str


class Block(NamedTuple):
    """Results after each of some steps, which are fewer than asked for if a step has none."""

    #: (steps, n, records, ...).
    x: NDArray[Any]
    #: (steps, n, m, ...), (steps, n, n, ...) and (steps, m, m, ...).
    K: NDArray[Any]
    P: NDArray[Any]
    S: NDArray[Any]
    #: (steps,).
    definite: NDArray[np.bool_]
    stop: Stop | None


class _Repeated:
    """A part of a step that is repeated on its own values.

    Parameters
    ----------
    lanes : lengths of the axes behind the places.
    loaded : kind and columns of the formats, from :func:`gpbnb.arithmetic.machine.tables`.
    """

    def __init__(
        self,
        step: RecordedStep,
        part: ProgramPart,
        formats: Sequence[Any],
        lanes: tuple[int, ...],
        changes: Sequence[str],
        loaded: tuple[Any, Any],
    ) -> None:
        from gpbnb.arithmetic.kernels import machine

        self._machine, self._step, self.part = machine, step, part
        self._kind, self._formats = loaded
        self._code = code_of(part.rows, part.formats)
        size = step.sizes[0] + len(step.shared)
        self.values = np.zeros((size, *lanes), formats[0].backend.dtype if formats[0] is not None else np.float64)
        self._truths = np.zeros((step.sizes[1], *lanes[:1]), np.uint8)
        self._truths[1] = 1
        for constants in step.constants:
            if constants.places:
                spread = (np.newaxis,) * (len(lanes) - (self._parts > 0))
                numbers = packed_constants(formats[0], constants)
                self.values[constants.places] = numbers[(slice(None), *spread)]
        self._constants = np.concatenate([self.values[np.array(each.places, np.int64)] for each in step.constants])
        self._memory, self._distant = Memory(self.values, self._truths), True
        self._states = np.concatenate([step.places[each].ravel() for each in changes])
        self.after = np.concatenate([step.after[each].ravel() for each in changes])
        self._before = np.full(len(self._states) * self._memory.width, -1, self.values.dtype)
        self.notes, self.cycle_at = np.zeros(5, np.int64), machine.CYCLE
        self._table, self._feeds = np.zeros((0, 1), self.values.dtype), np.zeros((0, 4), np.int64)

    @property
    def _parts(self) -> int:
        """How many numbers of the machine hold one."""
        floats = isinstance(self._kind, self._machine.Quick | self._machine.Careful)
        return 0 if floats else self.values.shape[-1]

    def uses(self, places: NDArray[np.int64]) -> bool:
        """Whether an operation takes a number at one of these places, or it is a result."""
        return bool(np.isin(places, self.part.rows[:, 1:4]).any() or np.isin(places, self.after).any())

    def feed(self, groups: Sequence[tuple[NDArray[np.int64], NDArray[Any]]]) -> None:
        """Take numbers (members, count, ...) of which each step has one member, at places (count,)."""
        flat, rows, at = [], [], 0
        for places, table in groups:
            members, count = table.shape[:2]
            rows.append((places[0], count, members, at))
            flat.append(table.reshape(members * count, *table.shape[2:]))
            at += members * count
        if flat:
            table = np.concatenate(flat)
            self._table, self._feeds = table.reshape(len(table), -1), np.array(rows, np.int64)
        self._distant = self._far(self._constants) or self._far(self._table)

    def _far(self, numbers: NDArray[Any]) -> bool:
        """Whether numbers may be too small or too large for quick computation."""
        return isinstance(self._kind, self._machine.Quick) and is_far(numbers)

    def compare_from(self, states: NDArray[Any], cycle: int) -> None:
        """Begin to look for states that repeat."""
        self.notes[:] = 0
        self.notes[self._machine.LASTS] = cycle
        self._before[:] = states.reshape(-1)

    @property
    def states(self) -> NDArray[Any]:
        """The states, (count, ...)."""
        return self.values[self._states]

    @states.setter
    def states(self, states: NDArray[Any]) -> None:
        self.values[self._states] = states.reshape(-1, *self.values.shape[1:])

    def take(
        self, first: int, own: NDArray[Any], at: int, kept_at: NDArray[np.int64], cycle: int
    ) -> tuple[NDArray[Any], NDArray[np.bool_], Stop | None]:
        """Take steps, as far as they have results and until states repeat.

        Parameters
        ----------
        first : number of steps taken before.
        own, at : (steps, count, ...), numbers of each step, and the place of the first.
        kept_at : places of results to return.
        cycle : number of steps after which the model repeats; 0 if states are not compared.

        Returns
        -------
        kept, definite : the results of each step, and whether it was definite.
        """
        steps, lanes, machine, memory = len(own), self.values.shape[1:], self._machine, self._memory
        kept = np.empty((steps, len(kept_at), *lanes), self.values.dtype)
        held, row = np.ones((steps, *lanes[:1]), np.uint8), 0
        results = machine.Kept(
            kept.reshape(steps, len(kept_at) * memory.width),
            held.reshape(steps, memory.truths.shape[1]),
            self._before,
            np.empty_like(self._before),
        )
        far = self._distant or self._far(own) or self._far(self.states)
        with contextlib.suppress(OverflowError, ZeroDivisionError):
            advance(
                self._kind,
                self._formats,
                self._code,
                memory,
                far,
                self.notes,
                machine.Feeds(own.reshape(steps, own.shape[1] * memory.width), self._table, self._feeds),
                machine.Places(
                    at * memory.width, *map(memory.places, (self._states, self.after, kept_at)), self._step.definite
                ),
                results,
                first,
                cycle,
            )
            row = int(self.notes[machine.ROW])
        done, stop = int(self.notes[self._machine.DONE]), None
        if done < steps and not self.notes[self._machine.CYCLE]:
            rows = self.part.rows
            if row == 0:  # operations on integers do not tell which one it was
                row = first_without_result(
                    self._kind, self._formats, rows, self.part.formats, self.values, self._truths
                )
            stop = Stop(fault_of(rows, self.values, row), self._step.quantity(self.part, row))
        definite = held[:done].reshape(done, *held.shape[1:2]) != 0
        return kept[:done], definite if definite.ndim == 1 else definite.all(axis=1), stop


class Stepper:
    """A filter that takes steps with packed numbers.

    Parameters
    ----------
    step : the recorded step.
    formats : the formats of the numbers that it names; None is double-double.
    model : matrices of the model by their letters, (p, rows, columns, ...) or (p, rows, ...), packed.
    records : number of records.
    cycle : number of steps after which covariances may repeat; 0 if they are not looked at.
    tag : the arithmetic of the run, from which both parts of a step draw random numbers.
    """

    def __init__(
        self,
        step: RecordedStep,
        formats: Sequence[Any],
        model: dict[str, NDArray[Any]],
        records: int,
        cycle: int,
        tag: Any = None,
    ) -> None:
        self._step, self._records, self._cycle = step, records, cycle
        parts = model["Phi"].shape[3:]
        alone = () if not parts else (1, *parts)
        lanes = (records, *parts) if parts or records > 1 else ()
        self._shared_at = step.sizes[0] + np.arange(len(step.shared))
        moved = np.arange(step.sizes[0] + len(step.shared))
        moved[step.shared] = self._shared_at
        rows = step.estimate.rows.copy()
        codes = rows[:, 0]
        for column, has in ((1, ~np.isin(codes, (7, 9, 13))), (2, codes != 9), (3, np.isin(codes, (7, 11)))):
            rows[has, column] = moved[rows[has, column]]
        late = step._replace(after={**step.after, **{each: moved[step.after[each]] for each in _ESTIMATE}})
        loaded = tables(formats, tag)
        self._gain = _Repeated(step, step.gain, formats, alone, _GAIN, loaded)
        self._estimate = _Repeated(late, step.estimate._replace(rows=rows), formats, lanes, _ESTIMATE, loaded)
        self._kept_at = np.concatenate([step.shared, step.K.ravel(), step.after["P"].ravel(), step.S.ravel()])
        self._ends = np.cumsum([len(step.shared), step.K.size, step.after["P"].size])
        repeats = formats[0] is None or formats[0].rounding is not Rounding.STOCHASTIC
        most = max(min(_LONGEST_BLOCK, _NUMBERS // max(len(self._kept_at), 1)), 16)
        work = len(step.gain.rows) + records * len(rows)
        #: Most steps that are taken at once; random numbers are drawn step by step.
        self.longest = 1 if not repeats else next(slices(most, work)).stop
        self._repeated: tuple[int, NDArray[Any], NDArray[np.bool_]] | None = None
        self._last: NDArray[Any] | None = None
        self._model = dict(model)
        self._feed_gain()

    def replace(self, letter: str, table: NDArray[Any]) -> None:
        """Take another cycle of matrices from now on."""
        self._model[letter] = table
        self._repeated = self._last = None
        self._feed_gain()

    def _groups(self, part: _Repeated) -> list[tuple[NDArray[np.int64], NDArray[Any]]]:
        found = []
        for letter, table in self._model.items():
            places = self._step.places[letter].ravel()
            if part.uses(places):
                parts = table.shape[1 + self._step.places[letter].ndim :]
                found.append((places, table.reshape(len(table), places.size, *parts)))
        return found

    def _feed_gain(self) -> None:
        self._gain.feed(self._groups(self._gain))
        self._of_estimate = self._groups(self._estimate)

    def take(self, first: int, z: NDArray[Any], x: NDArray[Any], carried: NDArray[Any], P: NDArray[Any]) -> Block:
        """Take one step for each of the measurements (steps, m, records, ...), at most :attr:`longest`.

        Parameters
        ----------
        first : number of steps taken before.
        x, carried (n, records, ...), P (n, n, ...) : before the first step; they are overwritten.
        """
        step = self._step
        kept, definite, gain_stop = self._gains(first, len(z), P)
        count, m = len(kept), z.shape[1]
        estimate = self._estimate
        lanes = estimate.values.shape[1:]
        parts = kept.shape[3:]
        table = kept[:, : self._ends[0]].reshape(count, self._ends[0], *parts)
        groups = list(self._of_estimate)
        if self._ends[0] and count:
            groups.append((self._shared_at, np.roll(table, first % count, axis=0)))
        estimate.feed(groups)
        estimate.states = np.concatenate([x, carried])
        n = len(x)
        own = np.ascontiguousarray(z[:count].reshape(count, m, *lanes))
        at = int(step.places["z"][0])
        found, _, stop = estimate.take(first, own, at, estimate.after[:n], 0)
        stop = stop or gain_stop
        done = len(found)
        states = estimate.states.reshape(2 * n, *x.shape[1:])
        x[:], carried[:] = states[:n], states[n:]
        K, covariances, S = (
            each.reshape(done, *like.shape, *parts)
            for each, like in zip(
                np.split(kept[:done, self._ends[0] :], self._ends[1:] - self._ends[0], axis=1),
                (step.K, step.after["P"], step.S),
                strict=True,
            )
        )
        if done:
            P[:] = covariances[-1]
        self._last = P.copy()
        return Block(found.reshape(done, *x.shape), K, covariances, S, definite[:done], stop)

    def _gains(self, first: int, count: int, P: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_], Stop | None]:
        """Return what the gain's program computes in some steps."""
        gain = self._gain
        if self._last is None or not np.array_equal(self._last, P):
            self._repeated = None
            gain.states = P
            gain.compare_from(gain.states, self._cycle)
        if self._repeated is not None:
            return (*self._of_cycle(first, count), None)
        gain.states = P
        kept, held, stop = self._gains_alone(first, count, self._cycle)
        period = int(gain.notes[gain.cycle_at])
        if not period:
            return kept, held, stop
        gain.notes[:] = 0
        first, count = first + len(kept), count - len(kept)
        if period * self._step.after["P"].size > LARGEST_KEPT:
            self._cycle = 0
            rest = self._gains_alone(first, count, 0)
        else:
            self._repeated = first, *self._gains_alone(first, period, 0)[:2]
            rest = (*self._of_cycle(first, count), None)
        return np.concatenate([kept, rest[0]]), np.concatenate([held, rest[1]]), rest[2]

    def _gains_alone(self, first: int, count: int, cycle: int) -> tuple[NDArray[Any], NDArray[np.bool_], Stop | None]:
        own = np.empty((count, 0, *self._gain.values.shape[1:]), self._gain.values.dtype)
        return self._gain.take(first, own, 0, self._kept_at, cycle)

    def _of_cycle(self, first: int, count: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        assert self._repeated is not None
        begin, table, definite = self._repeated
        rows = (first - begin + np.arange(count)) % len(table)
        return table[rows], definite[rows]
