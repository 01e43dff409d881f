"""A function of arrays that is recorded once, and then runs on many arrays together, each a lane, or step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.interpreting import Constants, Numbers
from gpbnb.arithmetic.loop import Loop
from gpbnb.arithmetic.machine import code_of, fault_of
from gpbnb.arithmetic.tape import Tape, laid_out
from gpbnb.arithmetic.traced import TracedFormat, TracedTruth

_NUMBERS = 1 << 19  # that are computed at once


class Lanes:
    """A program of one format that runs on many arrays, in any format with loops or in double-double.

    Given and found are places of the arrays that it takes and returns; a truth value that it returns is an array of its
    own.
    """

    def __init__(
        self,
        rows: NDArray[np.int64],
        sizes: tuple[int, int],
        constants: Sequence[Constants],
        given: Sequence[NDArray[np.int64]],
        found: Sequence[NDArray[np.int64] | TracedTruth],
    ) -> None:
        self._rows, self._code = rows, code_of(rows, np.zeros(len(rows), np.int64))
        self._sizes, self._constants = sizes, constants
        self._given, self._found = given, found

    def run(self, fmt: Any, *given: NDArray[Any], tag: Any = None) -> list[NDArray[Any]]:
        """Return the results for packed arrays (lanes, ...), in double-double (lanes, ..., 2) if `fmt` is None.

        Random numbers are drawn from `tag`. A lane without a result raises OverflowError or ZeroDivisionError.
        """
        found, error = self.begin(fmt, *given, tag=tag)
        if error is not None:
            raise error
        return found

    def begin(
        self, fmt: Any, *given: NDArray[Any], tag: Any = None
    ) -> tuple[list[NDArray[Any]], ArithmeticError | None]:
        """Return the results of the first lanes, as far as they have any, and the error of the next one, if it has."""
        lanes, most, done = len(given[0]), max(_NUMBERS // self._sizes[0], 1), 0
        parts = [self._together(fmt, tag, [each[:0] for each in given])]
        while done < lanes:
            try:
                parts.append(self._together(fmt, tag, [each[done : done + most] for each in given]))
            except ArithmeticError as error:
                if most == 1:
                    return [np.concatenate(each) for each in zip(*parts, strict=True)], error
                most = 1  # some of them, one by one
            else:
                done += most
        return [np.concatenate(each) for each in zip(*parts, strict=True)], None

    def _together(self, fmt: Any, tag: Any, given: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
        lanes, parts = len(given[0]), given[0].shape[1 + self._given[0].ndim :]
        numbers = Numbers([fmt], self._sizes, lanes, tag)
        numbers.hold_constants(self._constants)
        values, truths = numbers.values, numbers.truths
        for places, each in zip(self._given, given, strict=True):
            values[places.ravel()] = np.moveaxis(each.reshape(lanes, places.size, *parts), 0, 1)
        if lanes and len(self._rows):
            done = numbers.evaluate(self._code)
            if done < len(self._rows):
                fault = fault_of(self._rows, values, done)
                raise (OverflowError if fault.overflows else ZeroDivisionError)(f"got {fault.reason}")
        return [
            truths[int(each.components[0])] != 0
            if isinstance(each, TracedTruth)
            else np.moveaxis(values[each.ravel()], 1, 0).reshape(lanes, *each.shape, *parts)
            for each in self._found
        ]


@lru_cache(maxsize=128)
def recorded(function: Callable[..., Any], *shapes: tuple[int, ...]) -> Lanes:
    """Record a function of arrays of some shapes, which returns an array, or arrays and truth values in a tuple."""
    step = repeatable(function, shapes)
    return Lanes(step.rows, step.tape.sizes, step.tape.all_constants, step.given, step.found)


class Repeatable(NamedTuple):
    """A function of arrays as operations."""

    tape: Tape
    rows: NDArray[np.int64]
    given: list[NDArray[np.int64]]  # places of the arrays that it takes
    found: list[Any]  # places of the arrays that it returns, or truth values

    def loop(self, fmt: Any) -> Loop:
        """Return a loop whose state is the first array that the function takes, and then the first that it returns."""
        states, after = self.given[0].ravel(), self.found[0].ravel()
        loop = Loop([fmt], self.rows, self.tape.formats, self.tape.sizes, states, after)
        loop.hold_constants(self.tape.all_constants)
        return loop


@lru_cache(maxsize=128)
def repeatable(
    function: Callable[..., Any], shapes: tuple[tuple[int, ...], ...], nonzero: tuple[bytes, ...] = ()
) -> Repeatable:
    """Record a function of arrays of some shapes, which returns arrays as :func:`recorded` has them.

    For each array, `nonzero` tells which entries are ever other than zero, as the bytes of truth values; all by
    default.
    """
    tape, given = Tape(sum(map(math.prod, shapes))), laid_out(shapes)
    masks = [np.frombuffer(each, np.bool_) for each in nonzero] or [each > 0 for each in given]
    read = [np.where(mask.reshape(each.shape), each, 0) for mask, each in zip(masks, given, strict=True)]
    returned = function(*map(TracedFormat(tape).made, read))
    results = returned if isinstance(returned, tuple) else (returned,)
    found = [each if isinstance(each, TracedTruth) else each.components[0] for each in results]
    return Repeatable(tape, tape.instructions.astype(np.int64), given, found)
