"""A linear program with limits on the machine: one step after another, from numbers that each step takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.loop import Loop, drop_decayed
from gpbnb.arithmetic.machine import CODES, operands_of, takes_numbers
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.program import Program
from gpbnb.interrupts import slices


class LinearSteps:
    """A linear program in a format, None for double-double, from packed coefficients (c, ...) and states x (n, ...).

    Operations that do not need each other run together if they have one code, which takes half the time, unless each
    draws a random number, from `tag`.
    """

    def __init__(self, program: Program, fmt: Any, tag: Any, coefficients: NDArray[Any], x: NDArray[Any]) -> None:
        rows, random = program.rows.copy(), fmt is not None and fmt.rounding is Rounding.STOCHASTIC
        order = np.arange(len(rows)) if random else _grouped(program)
        place = np.arange(program.sizes[0])
        results = rows[order, 4][rows[order, 0] != CODES["compare"]]
        place[results] = np.sort(results)
        takes = takes_numbers(rows[:, 0])
        rows[:, 1:4][takes] = place[rows[:, 1:4][takes]]
        given = rows[:, 0] != CODES["compare"]
        rows[given, 4] = place[rows[given, 4]]
        #: The rows in the order of the program, and the number of the row that computes each output.
        self._rows, self._formats = rows, np.zeros(len(rows), np.int64)
        self._m, self._input = program.m, next(iter(program.inputs.tolist()), 0)
        self._after = place[program.after]
        self._outputs = np.array([np.flatnonzero(given & (rows[:, 4] == each)).max(initial=-1) for each in self._after])
        #: The place of each value.
        self._places = place[program.places]
        self._loop = Loop([fmt], rows[order], self._formats, program.sizes, program.states, self._after, tag=tag)
        self._loop.hold(program.coefficients, coefficients)
        self._loop.states = x

    def take(self, z: NDArray[Any]) -> tuple[NDArray[Any], int]:
        """Take a step with each of the numbers z, (steps, m, ...).

        A number may be too small only because a state has decayed. Such a state becomes zero, and the run resumes.
        Return the states of steps that have results, (steps, n, ...), and the first output that the next step cannot
        compute, or -1.
        """
        loop, z = self._loop, np.ascontiguousarray(z)
        loop.keep(loop.after)
        out, done = np.empty((len(z), len(self._after), *z.shape[2:]), z.dtype), 0
        most = next(slices(len(z), len(self._rows)), slice(0)).stop
        while done < len(z):
            some = z[done : done + most]
            own = some.reshape(len(some), self._m, *loop.values.shape[1:])
            found, _, row = loop.take(done, len(some), [(self._input, own)])
            out[done : done + len(found)] = found.reshape(len(found), *out.shape[1:])
            done += len(found)
            if row >= 0:
                states = loop.states
                if not drop_decayed(states):
                    fault = loop.first_without_result(self._rows, self._formats)
                    return out[:done], int(np.argmax(self._outputs >= fault))
                loop.states = states
        return out, -1

    def largest(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest size of each value over steps with the numbers z, (steps, m), in a format on float64.

        A step that has no result raises OverflowError.
        """
        loop, sizes = self._loop, np.zeros(len(self._places))
        loop.keep(self._places)
        for part in slices(len(z), len(self._rows)):
            kept, _, row = loop.take(part.start, part.stop - part.start, [(self._input, z[part])])
            if row >= 0:
                raise OverflowError(f"got no result of step {part.start + len(kept) + 1}")
            np.maximum(sizes, np.abs(kept).max(axis=0), out=sizes)
        return sizes


def _grouped(program: Program) -> NDArray[np.int64]:
    """Return an order of rows in which each follows those that it needs, and equal codes stand together."""
    numbers, truths, level = [0] * program.sizes[0], [0] * program.sizes[1], list[int]()
    for code, *given, out in program.rows.tolist():
        taken = zip((numbers, truths), operands_of(code, *given), strict=True)
        level.append(1 + max(levels[place] for levels, places in taken for place in places))
        (truths if code == CODES["compare"] else numbers)[out] = level[-1]
    return np.lexsort((program.rows[:, 0], np.array(level, np.int64)))
