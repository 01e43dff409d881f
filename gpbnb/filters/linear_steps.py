"""A linear program with limits on the machine: one step after another, from numbers that each step takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.machine import CODES, Memory, advance, code_of, first_without_result, is_far, tables
from gpbnb.filters.program import ADD, AT_LEAST, MULTIPLY, SUBTRACT, Program
from gpbnb.interrupts import slices

_TINY = 2.0**-700
"""A decayed state below this becomes zero where its products would leave the range of float64."""

_LESS = 1  # the order in which a comparison holds
_NAMES = {MULTIPLY: "multiply", ADD: "add", SUBTRACT: "subtract"}


class LinearSteps:
    """A linear program in a format.

    Parameters
    ----------
    fmt, tag : the format, None for double-double, and the arithmetic from which random numbers are drawn.
    coefficients, x : (c, ...) and (n, ...), packed.
    """

    def __init__(self, program: Program, fmt: Any, tag: Any, coefficients: NDArray[Any], x: NDArray[Any]) -> None:
        self._program, self._kind, self._formats = program, *tables([fmt], tag)
        self._first, parts = program.n + program.m, x.shape[1:]
        at, truths = self._first + len(program.operations), 2
        rows, numbers = list[tuple[int, ...]](), list[int]()
        for o, (code, a, b) in enumerate(program.operations.tolist()):
            out, limit = self._first + o, at + a
            if code in _NAMES:
                rows.append((CODES[_NAMES[code]], limit if code == MULTIPLY else a, b, 0, out))
            else:
                lesser = (b, limit) if code == AT_LEAST else (limit, b)
                rows += [(CODES["compare"], *lesser, _LESS, truths), (CODES["choose"], truths, limit, b, out)]
                truths += 1
            numbers += [o] * (len(rows) - len(numbers))
        self._rows, self._numbers = np.array(rows, np.int64).reshape(-1, 5), numbers
        self._one_format = np.zeros(len(rows), np.int64)
        self._code = code_of(self._rows, self._one_format)
        values = np.zeros((at + len(coefficients), *((1, *parts) if parts else ())), x.dtype)
        self._memory = Memory(values, np.zeros((truths, *((1,) if parts else ())), np.uint8))
        self._states, self._far = values[: program.n].reshape(x.shape), not parts and is_far(coefficients)
        self._states[:] = x
        values[at:] = coefficients.reshape(-1, *values.shape[1:])

    def take(self, z: NDArray[Any]) -> tuple[NDArray[Any], int]:
        """Take a step with each of the numbers z, (steps, m, ...).

        A number may be too small only because a state has decayed. Such a state becomes zero, and the run resumes.

        Returns
        -------
        states : (steps, n, ...), of the steps that have results.
        output : number of the first output that the next step cannot compute; -1 if all steps have results.
        """
        from gpbnb.arithmetic.kernels import machine

        memory, program, width = self._memory, self._program, self._memory.width
        out = np.empty((len(z), *self._states.shape), z.dtype)
        room, none = np.empty((2, program.n * width), z.dtype), np.zeros(0, np.int64)
        states, after = (memory.places(np.asarray(each)) for each in (np.arange(program.n), program.outputs))
        places = machine.Places(program.n * width, states, after, after, 0)
        done, most = 0, next(slices(len(z), len(self._rows)), slice(0)).stop
        while done < len(z):
            some = z[done : done + most]
            own = some.reshape(len(some), program.m * width)
            feeds = machine.Feeds(own, room[:0, :1], none.reshape(0, 4))
            found = out[done : done + len(own)].reshape(len(own), program.n * width)
            kept = machine.Kept(found, np.empty((len(own), 1), np.uint8), *room)
            far = self._far or (isinstance(self._kind, machine.Quick) and (is_far(own) or is_far(self._states)))
            notes, row = np.zeros(5, np.int64), 0
            try:
                advance(self._kind, self._formats, self._code, memory, far, notes, feeds, places, kept, 0, 0)
                row = int(notes[machine.ROW])
            except (OverflowError, ZeroDivisionError):
                pass  # operations on integers do not tell which one it was
            done += int(notes[machine.DONE])
            if row >= 0 and not self._decayed():
                return out[:done], self._output(row)
        return out, -1

    def _decayed(self) -> bool:
        """Let decayed states be zero; whether there are any. In base 10, nothing decays that far."""
        states = self._states
        if states.dtype != np.float64:
            return False
        sizes = np.abs(states.reshape(len(states), -1)).max(axis=1)
        tiny = (sizes > 0) & (sizes < _TINY)
        states[tiny] = 0.0
        return bool(tiny.any())

    def _output(self, row: int) -> int:
        if row == 0 and self._states.dtype != np.float64:
            memory = self._memory
            given = self._kind, self._formats, self._rows, self._one_format, memory.values, memory.truths
            row = first_without_result(*given)
        return int(np.argmax(np.asarray(self._program.outputs) >= self._first + self._numbers[row]))
