"""A linear program with limits on the machine: one step after another, from numbers that each step takes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.loop import Loop, drop_decayed
from gpbnb.arithmetic.machine import CODES
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.program import ADD, AT_LEAST, MULTIPLY, SUBTRACT, Program, values_of
from gpbnb.interrupts import slices

_LESS = 1  # the order in which a comparison holds
_NAMES = {MULTIPLY: "multiply", ADD: "add", SUBTRACT: "subtract"}


class LinearSteps:
    """A linear program in a format.

    Operations that do not need each other run together if they have one code, which takes half the time, unless each
    draws a random number.

    Parameters
    ----------
    fmt, tag : the format, None for double-double, and the arithmetic from which random numbers are drawn.
    coefficients, x : (c, ...) and (n, ...), packed.
    """

    def __init__(self, program: Program, fmt: Any, tag: Any, coefficients: NDArray[Any], x: NDArray[Any]) -> None:
        n, first, count = program.n, program.n + program.m, len(program.operations)
        random = fmt is not None and fmt.rounding is Rounding.STOCHASTIC
        order = np.arange(count) if random else _grouped(program)
        place = np.arange(first + count)
        place[first + order] = first + np.arange(count)
        operations, at, truths = program.operations.tolist(), first + count, 2
        rows, numbers = list[tuple[int, ...]](), list[int]()
        for o, (code, a, b) in enumerate(operations):
            b, out, limit = place[b], place[first + o], at + a
            if code in _NAMES:
                rows.append((CODES[_NAMES[code]], limit if code == MULTIPLY else place[a], b, 0, out))
            else:
                lesser = (b, limit) if code == AT_LEAST else (limit, b)
                rows += [(CODES["compare"], *lesser, _LESS, truths), (CODES["choose"], truths, limit, b, out)]
                truths += 1
            numbers += [o] * (len(rows) - len(numbers))
        #: The rows in the order of the program, and the operation of each.
        self._rows, self._operations, self._m = np.array(rows, np.int64).reshape(-1, 5), np.array(numbers), program.m
        self._outputs, self._places = program.outputs - first, place
        moved = np.argsort(place[first + self._operations], kind="stable") if rows else np.zeros(0, np.int64)
        self._formats = np.zeros(len(rows), np.int64)
        self._loop = Loop(
            [fmt], self._rows[moved], self._formats, (at + len(coefficients), truths), np.arange(n),
            place[program.outputs], tag=tag,
        )  # fmt: skip
        self._loop.hold(slice(at, None), coefficients)
        self._loop.states = x

    def take(self, z: NDArray[Any]) -> tuple[NDArray[Any], int]:
        """Take a step with each of the numbers z, (steps, m, ...).

        A number may be too small only because a state has decayed. Such a state becomes zero, and the run resumes.

        Returns
        -------
        states : (steps, n, ...), of the steps that have results.
        output : number of the first output that the next step cannot compute; -1 if all steps have results.
        """
        loop, n = self._loop, len(self._outputs)
        out, done = np.empty((len(z), n, *z.shape[2:]), z.dtype), 0
        most = next(slices(len(z), len(self._rows)), slice(0)).stop
        while done < len(z):
            some = z[done : done + most]
            found, _, row = loop.take(done, some.reshape(len(some), self._m, *loop.values.shape[1:]), n, loop.after)
            out[done : done + len(found)] = found.reshape(len(found), *out.shape[1:])
            done += len(found)
            if row >= 0:
                states = loop.states
                if not drop_decayed(states):
                    operation = self._operations[loop.first_without_result(self._rows, self._formats)]
                    return out[:done], int(np.argmax(self._outputs >= operation))
                loop.states = states
        return out, -1

    def largest(self, z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest size of each value over steps with the numbers z, (steps, m), in a format on float64.

        Raises
        ------
        OverflowError : a step has no result.
        """
        loop, sizes = self._loop, np.zeros(len(self._places))
        for part in slices(len(z), len(self._rows)):
            kept, _, row = loop.take(part.start, z[part], len(self._outputs), self._places)
            if row >= 0:
                raise OverflowError(f"got no result of step {part.start + len(kept) + 1}")
            np.maximum(sizes, np.abs(kept).max(axis=0), out=sizes)
        states = sizes[: len(self._outputs)]
        np.maximum(states, np.abs(loop.states), out=states)
        return sizes


def _grouped(program: Program) -> NDArray[np.int64]:
    """Return an order of operations in which each follows those that it needs, and equal codes stand together."""
    first = program.n + program.m
    level = [0] * (first + len(program.operations))
    for o, (code, a, b) in enumerate(program.operations.tolist()):
        level[first + o] = 1 + max(level[each] for each in values_of(code, a, b))
    return np.lexsort((program.operations[:, 0], np.array(level[first:], np.int64)))
