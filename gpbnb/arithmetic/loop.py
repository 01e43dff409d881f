"""A program that takes steps on the machine, from numbers that each step takes."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.interpreting import Numbers
from gpbnb.arithmetic.kernels.tags import Quick
from gpbnb.arithmetic.machine import Addresses, code_of, functions, is_far
from gpbnb.interrupts import slices

DECAYED = 2.0**-700
"""Size below which an entry of a state becomes zero where a step would leave the range of float64."""


LONGEST_BLOCK, KEPT_NUMBERS = 4096, 1 << 17
"""Most steps that are taken at once, and numbers that they keep."""


def steps_at_once(kept: int, work: int) -> int:
    """Return the most steps that are taken at once, of which each keeps some numbers and takes some operations."""
    return next(slices(max(min(LONGEST_BLOCK, KEPT_NUMBERS // kept), 16), work)).stop


def drop_decayed(states: NDArray[Any], *carried: NDArray[Any]) -> bool:
    """Let small entries of states (n,) or (n, lanes, ...) be zero, and what is carried with them; tell if any are.

    Nothing decays that far in pairs of integers.
    """
    if states.dtype != np.float64:
        return False
    sizes = np.abs(states if states.ndim < 3 else states[..., 0])
    decayed = (sizes > 0) & (sizes < DECAYED)
    for each in (states, *carried):
        each[decayed] = 0.0
    return bool(decayed.any())


class Loop(Numbers):
    """A program whose steps replace its states by their next values.

    Parameters
    ----------
    formats, sizes, lanes, tag : as for :class:`~gpbnb.arithmetic.interpreting.Numbers`.
    rows, numbers : operations, (o, 5), and the number of the format of each, (o,).
    states, after : places of the states, and of their next values.
    truth : the truth value that is kept of each step.
    """

    def __init__(
        self,
        formats: Sequence[Any],
        rows: NDArray[np.int64],
        numbers: NDArray[np.int64],
        sizes: tuple[int, int],
        states: NDArray[np.int64],
        after: NDArray[np.int64],
        truth: int = 1,
        lanes: int | None = None,
        tag: Any = None,
    ) -> None:
        from gpbnb.arithmetic.kernels import machine

        super().__init__(formats, sizes, lanes, tag)
        self.rows, self._numbers, self._code = rows, numbers, code_of(rows, numbers)
        self._machine, self._distant = machine, {"held": False, "fed": False}
        self._states, self.after, self._truth = states, after, truth
        self._before = np.full(len(states) * self.memory.width, -1, self.values.dtype)
        self._notes = np.zeros(5, np.int64)
        self._table, self._feeds = np.zeros((0, 1), self.values.dtype), np.zeros((0, 4), np.int64)

    def hold(self, places: Any, numbers: NDArray[Any]) -> None:
        """Set numbers that stay as they are, the same in all lanes, (count, ...)."""
        super().hold(places, numbers)
        self._distant["held"] |= self._far(numbers)

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
        self._distant["fed"] = self._far(self._table)

    def _far(self, numbers: NDArray[Any]) -> bool:
        """Whether numbers may be too small or too large for quick computation."""
        return isinstance(self.kind, Quick) and is_far(numbers)

    def compare_from(self, states: NDArray[Any], cycle: int) -> None:
        """Begin to look for states that repeat."""
        self._notes[:] = 0
        self._notes[self._machine.LASTS] = cycle
        self._before[:] = states.reshape(-1)

    @property
    def period(self) -> int:
        """The number of steps after which the states repeat, once they do."""
        return int(self._notes[self._machine.CYCLE])

    @property
    def states(self) -> NDArray[Any]:
        """The states, (count, ...)."""
        return self.values[self._states]

    @states.setter
    def states(self, states: NDArray[Any]) -> None:
        self.values[self._states] = states.reshape(-1, *self.values.shape[1:])

    def take(
        self, first: int, own: NDArray[Any], at: int, kept_at: NDArray[np.int64], cycle: int = 0
    ) -> tuple[NDArray[Any], NDArray[np.bool_], int]:
        """Take steps, as far as they have results and until states repeat.

        Parameters
        ----------
        first : number of steps taken before.
        own, at : (steps, count, ...), numbers of each step, and the place of the first.
        kept_at : places of results to return.
        cycle : number of steps after which the model repeats; 0 if states are not compared.

        Returns
        -------
        kept, held : the results of each step, and whether the truth value holds in all lanes, (steps,).
        row : the row without a result that ended the steps, or -1.
        """
        steps, lanes, machine, memory = len(own), self.values.shape[1:], self._machine, self.memory
        kept = np.empty((steps, len(kept_at), *lanes), self.values.dtype)
        held, row = np.ones(steps * memory.lanes, np.uint8), 0
        states_at, after_at, places = map(memory.places, (self._states, self.after, kept_at))
        fed, after = self._table, np.empty(self._before.size, np.int64)
        # fmt: off
        run = Addresses(
            first, steps, cycle, memory.lanes, memory.width, own, at * memory.width, own.shape[1] * memory.width,
            fed, fed.shape[1], self._feeds, len(self._feeds), states_at, after_at, len(after_at), places, len(places),
            self._truth, kept, held, self._before, after,
        )
        # fmt: on
        far = any(self._distant.values()) or self._far(own) or self._far(self.states)
        self._notes[machine.DONE] = 0
        tables = self.tables.address, self._code.table.address, memory.table.address
        with contextlib.suppress(OverflowError, ZeroDivisionError):
            for execute in functions(self.kind, far, memory.lanes == 1):
                machine.advance(execute, *tables, run.address, self._notes.ctypes.data)
                row = int(self._notes[machine.ROW])
                if row < 0:
                    break
        done = int(self._notes[machine.DONE])
        if done == steps or self.period:
            row = -1
        elif row == 0:  # operations on integers do not tell which one it was
            row = self.first_without_result(self.rows, self._numbers)
        return kept[:done], np.asarray(np.all(held.reshape(steps, memory.lanes)[:done] != 0, axis=1)), row
