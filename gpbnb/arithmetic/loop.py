"""A program that takes steps on the machine, from numbers that each step takes."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.interpreting import Numbers
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
        self._pieces = [self.memory.pieces(each) for each in (states, after)]
        self.keep(np.zeros(0, np.int64))
        self._before = np.full(len(states) * self.memory.width, -1, self.values.dtype)
        self._notes = np.zeros(6, np.int64)
        self._cycles = list[tuple[int, NDArray[Any]]]()

    def hold(self, places: Any, numbers: NDArray[Any]) -> None:
        """Set numbers that stay as they are, the same in all lanes, (count, ...)."""
        super().hold(places, numbers)
        self._distant["held"] |= is_far(self.kind, numbers)

    def feed(self, cycles: Sequence[tuple[int, NDArray[Any]]]) -> None:
        """Take numbers (members, count, ...) of which each step has one member, at places from one on."""
        self._cycles = [(place, np.ascontiguousarray(numbers)) for place, numbers in cycles]
        self._distant["fed"] = any(is_far(self.kind, numbers) for _, numbers in self._cycles)

    def keep(self, places: NDArray[np.int64]) -> None:
        """Let :meth:`take` return the results at some places."""
        self._kept = len(places), self.memory.pieces(places)

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
        self,
        first: int,
        steps: int,
        own: Sequence[tuple[int, NDArray[Any]]] = (),
        cycle: int = 0,
    ) -> tuple[NDArray[Any], NDArray[np.bool_], int]:
        """Take steps, as far as they have results and until states repeat.

        Parameters
        ----------
        first, steps : numbers of steps taken before, and to take.
        own : the place of the first of some numbers, and these numbers of each step, (steps, count, ...); those of a
            step follow each other in memory.
        cycle : number of steps after which the model repeats; 0 if states are not compared.

        Returns
        -------
        kept, held : the results of each step at the places that are kept, and whether the truth value holds in all
            lanes, (steps,).
        row : the row without a result that ended the steps, or -1.
        """
        lanes, machine, memory = self.values.shape[1:], self._machine, self.memory
        (states_at, after_at), (count, places) = self._pieces, self._kept
        kept = np.empty((steps, count, *lanes), self.values.dtype)
        held, row = np.ones(steps * memory.lanes, np.uint8), 0
        feeds = [*(self._fed(first, *each) for each in self._cycles), *(self._fed(0, *each) for each in own)]
        after = np.empty(self._before.size, np.int64)
        # fmt: off
        run = Addresses(
            cycle, memory.lanes, memory.width, np.array(feeds, np.int64), len(feeds), after.size, states_at,
            len(states_at), after_at, len(after_at), count * memory.width, places, len(places), self._truth, kept,
            held, self._before, after,
        )
        # fmt: on
        given = self.states, *(numbers for _, numbers in own)
        far = any(self._distant.values()) or any(is_far(self.kind, each) for each in given)
        self._notes[machine.DONE] = 0
        with contextlib.suppress(OverflowError, ZeroDivisionError):
            row = self._advance(steps, run, functions(self.kind, far, memory))
        done = int(self._notes[machine.DONE])
        if row == 0:  # operations on integers do not tell which one it was
            row = self.first_without_result(self.rows, self._numbers)
        return kept[:done], np.asarray(np.all(held.reshape(steps, memory.lanes)[:done] != 0, axis=1)), row

    def _advance(self, steps: int, run: Addresses, functions: Iterator[int]) -> int:
        """Take steps, the second function those that the first leaves; return the row that has no result, or -1."""
        notes, machine = self._notes, self._machine
        tables = self.tables.address, self._code.table.address, self.memory.table.address, run.address

        def advance(function: int, until: int) -> bool:
            notes[machine.UNTIL] = until
            machine.advance(function, *tables, notes.ctypes.data)
            return int(notes[machine.ROW]) < 0

        first, second, some = next(functions), 0, 1  # some steps of the second, until the first is asked again
        while not advance(first, steps):
            second = second or next(functions, 0)
            until = min(int(notes[machine.DONE]) + some, steps)
            if not second or not advance(second, until) or until == steps or self.period:
                break
            some *= 2
        return int(notes[machine.ROW])

    @staticmethod
    def _fed(begin: int, place: int, numbers: NDArray[Any]) -> tuple[int, ...]:
        """Return the columns of a feed; see :data:`gpbnb.arithmetic.kernels.machine.PLACE`."""
        assert numbers[:1].flags.c_contiguous  # the machine reads those of a member one after the other
        (members, count), parts = numbers.shape[:2], math.prod(numbers.shape[2:])
        between = numbers.strides[0] // numbers.itemsize
        return place, count, members, begin, between, parts, numbers.__array_interface__["data"][0]
