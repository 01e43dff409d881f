"""A recorded step as the machine repeats it: the gain once for all records, then the estimates of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.loop import Loop, steps_at_once
from gpbnb.arithmetic.machine import Fault, fault_of, takes_numbers
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.recording import ProgramPart, RecordedStep

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
    #: (steps, n, m, ...) and (steps, n, n, ...).
    K: NDArray[Any]
    P: NDArray[Any]
    #: (steps,).
    definite: NDArray[np.bool_]
    stop: Stop | None


class Stepper:
    """A filter that takes steps with packed numbers.

    Parameters
    ----------
    step : the recorded step.
    formats : the formats of the numbers that it names; None is double-double.
    model : matrices of the model by their letters, (p, rows, columns, ...) or (p, rows, ...), packed.
    records : number of records.
    cycle : number of steps after which covariances may repeat, if no format draws random numbers.
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
        self._step = step
        self._shared_at = step.sizes[0] + np.arange(len(step.shared))
        moved = np.arange(step.sizes[0] + len(step.shared))
        moved[step.shared] = self._shared_at
        rows = step.estimate.rows.copy()
        given, taken = rows[:, 1:4], takes_numbers(rows[:, 0])
        given[taken] = moved[given[taken]]
        late = step._replace(after={**step.after, **{each: moved[step.after[each]] for each in _ESTIMATE}})
        lanes = records if records > 1 else None

        def loop(step: RecordedStep, part: ProgramPart, changes: Sequence[str], lanes: int | None = None) -> Loop:
            """Return a part of a step that is repeated on its own values."""
            sizes = step.sizes[0] + len(step.shared), step.sizes[1]
            states, after = (np.concatenate([at[each].ravel() for each in changes]) for at in (step.places, step.after))
            found = Loop(formats, part.rows, part.formats, sizes, states, after, step.definite, lanes, tag)
            found.hold_constants(step.constants)
            return found

        self._gain = loop(step, step.gain, _GAIN)
        self._estimate = loop(late, step.estimate._replace(rows=rows), _ESTIMATE, lanes)
        self._kept_at = np.concatenate([step.shared, step.K.ravel(), step.after["P"].ravel()])
        repeats = all(fmt is None or fmt.rounding is not Rounding.STOCHASTIC for fmt in formats)
        self._cycle = cycle if repeats else 0
        kept, work = len(self._kept_at) + len(step.after["x"]) * records, len(step.gain.rows) + records * len(rows)
        #: The largest number of steps taken at once; random numbers are drawn step by step.
        self.longest = steps_at_once(kept, work) if repeats else 1
        self._repeated: tuple[int, NDArray[Any], NDArray[np.bool_]] | None = None
        self._last: NDArray[Any] | None = None
        self._gain.feed(self._groups(model, self._gain))
        self._of_estimate = self._groups(model, self._estimate)

    def _groups(self, model: dict[str, NDArray[Any]], part: Loop) -> list[tuple[NDArray[np.int64], NDArray[Any]]]:
        """Return the numbers of the model that a part of a step takes, and their places."""
        found = []
        for letter, table in model.items():
            places = self._step.places[letter].ravel()
            if np.isin(places, part.rows[:, 1:4]).any() or np.isin(places, part.after).any():
                parts = table.shape[1 + self._step.places[letter].ndim :]
                found.append((places, table.reshape(len(table), places.size, *parts)))
        return found

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
        shared = len(step.shared)
        table = kept[:, :shared].reshape(count, shared, *parts)
        groups = list(self._of_estimate)
        if shared and count:
            groups.append((self._shared_at, np.roll(table, first % count, axis=0)))
        estimate.feed(groups)
        estimate.states = np.concatenate([x, carried])
        n = len(x)
        own = np.ascontiguousarray(z[:count].reshape(count, m, *lanes))
        at = int(step.places["z"][0])
        found, _, row = estimate.take(first, own, at, estimate.after[:n])
        stop = gain_stop if row < 0 else self._stop(estimate, step.estimate, row)
        done = len(found)
        states = estimate.states.reshape(2 * n, *x.shape[1:])
        x[:], carried[:] = states[:n], states[n:]
        K, covariances = (
            each.reshape(done, *like.shape, *parts)
            for each, like in zip(
                np.split(kept[:done, shared:], [step.K.size], axis=1), (step.K, step.after["P"]), strict=True
            )
        )
        if done:
            P[:] = covariances[-1]
        self._last = P.copy() if done == count else None  # the gain is ahead of the estimate
        return Block(found.reshape(done, *x.shape), K, covariances, definite[:done], stop)

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
        period = gain.period
        if not period:
            return kept, held, stop
        gain.compare_from(gain.states, 0)
        first, count = first + len(kept), count - len(kept)
        if period * self._step.after["P"].size > LARGEST_KEPT:
            self._cycle = 0
            rest = self._gains_alone(first, count, 0)
        else:
            self._repeated = first, *self._gains_alone(first, period, 0)[:2]
            rest = (*self._of_cycle(first, count), None)
        return np.concatenate([kept, rest[0]]), np.concatenate([held, rest[1]]), rest[2]

    def _gains_alone(self, first: int, count: int, cycle: int) -> tuple[NDArray[Any], NDArray[np.bool_], Stop | None]:
        gain = self._gain
        own = np.empty((count, 0, *gain.values.shape[1:]), gain.values.dtype)
        kept, held, row = gain.take(first, own, 0, self._kept_at, cycle)
        stop = None if row < 0 else self._stop(gain, self._step.gain, row)
        return kept, held, stop

    def _stop(self, loop: Loop, part: ProgramPart, row: int) -> Stop:
        return Stop(fault_of(loop.rows, loop.values, row), self._step.quantity(part, row))

    def _of_cycle(self, first: int, count: int) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        assert self._repeated is not None
        begin, table, definite = self._repeated
        rows = (first - begin + np.arange(count)) % len(table)
        return table[rows], definite[rows]
