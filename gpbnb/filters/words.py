r"""Filters on a processor with integers: coefficients, data and sums in fixed-point formats of their own.

A digital signal processor multiplies data by coefficients, adds the products in a long accumulator, and rounds a sum
once, when it stores it. Which results stay in the accumulator follows from the program of the filter; see ``wide`` of
:class:`gpbnb.filters.program.Program`. Each operation computes its exact result from integers and then

1. rounds it to the fraction bits of the sums and applies their overflow;
2. unless it stays there, rounds it to the fraction bits of the data and applies their overflow.

Without an accumulator, only the second step remains, for each product and each sum. A limit, as of a controller's
output, is stored in the format of the data.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.kernels.integer_steps import WordCode, WordStore, advance, advance_in_python
from gpbnb.arithmetic.kernels.selection import MODES
from gpbnb.arithmetic.machine import OVERFLOW, Fault
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.program import AT_LEAST, MULTIPLY, Program
from gpbnb.filters.stepping import StepsTaken, Stop
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.word_formats import WordFormats
from gpbnb.interrupts import slices

_POLICIES = ("raise", "saturate", "wrap")
_FITS = 62
"""Bits of a product, or of a number of the data, without its sign, up to which compiled loops run."""
_LONGEST_SUM = 63
"""Bits of a sum without its sign up to which compiled loops run."""
_FAST = 6
"""Operations that Python does on its integers in the time of one operation of exact arithmetic on arrays."""
_done = 0


class IntegerProgram(NamedTuple):
    """A program on integers, in some formats of words."""

    program: Program
    words: WordFormats
    factors: tuple[int, ...]  # (o,), of the coefficient of a product, and of a limit in units of the data; else 0
    shifts: tuple[int, ...]  # (o,), fraction bits that a product loses before the accumulator, negative if it gains
    coefficients: NDArray[Any]  # (c,), exact value of each stored coefficient

    @property
    def is_short(self) -> bool:
        """Whether every integer fits in 64 bits, so that compiled loops run it."""
        data, gap = self.words.data.precision, self.words.gap
        sizes = [abs(each).bit_length() + data for each in self.factors]
        products = [size + max(-shift, 0) for size, shift in zip(sizes, self.shifts, strict=True)]
        most = max([data + gap, *products, *self.shifts])
        return most <= _FITS and self.words.accumulator.precision <= _LONGEST_SUM


def integer_program(made: LinearFilter, words: WordFormats) -> IntegerProgram:
    """Store the coefficients of a filter in words."""
    program, stored = made.program, made.stored(words)
    point, target = words.data.fraction_bits, words.accumulator.fraction_bits
    factors, shifts = list[int](), list[int]()
    for code, a, _ in program.operations.tolist():
        if code == MULTIPLY:
            shift = stored[a].denominator.bit_length() - 1
            factors.append(stored[a].numerator)
            shifts.append(shift + point - target)
        else:
            factors.append(int(stored[a] / words.data.unit) if code >= AT_LEAST else 0)
            shifts.append(0)
    return IntegerProgram(program, words, tuple(factors), tuple(shifts), stored)


def pairs_of(integers: NDArray[Any], unit: Fraction) -> NDArray[np.float64]:
    """Return integers in some units, (...), as sums of two float64, (..., 2)."""
    high = integers.astype(np.float64)
    if integers.dtype == object:
        low = np.vectorize(lambda n, h: float(int(n) - int(h)), otypes=[float])(integers, high)
    else:
        low = (integers - high.astype(np.int64)).astype(np.float64)
    return np.stack([high, low], axis=-1) * float(unit)


def integers_of(values: Any, fmt: FixedFormat) -> NDArray[Any]:
    """Round numbers into a format, in its units, as int64, or as Python integers if those are longer."""
    given = np.asarray(values)
    if given.dtype.kind == "f" and fmt.precision <= 52 and -900 < fmt.fraction_bits < 900:
        scaled = given.astype(np.float64) * 2.0**fmt.fraction_bits
        low = np.floor(scaled)
        if np.abs(low).max(initial=0.0) < 2.0**52:
            found = low.astype(np.int64) + _rounded_up(low, scaled - low, fmt.rounding)
            if fmt.overflow == "saturate":
                return np.clip(found, int(fmt.lowest / fmt.unit), int(fmt.largest / fmt.unit))
            if (found >= int(fmt.lowest / fmt.unit)).all() and (found <= int(fmt.largest / fmt.unit)).all():
                return found
    stored = fmt.array(exact(given)).to_fractions()
    counts = [int(each / fmt.unit) for each in np.ravel(stored)]
    return np.array(counts, dtype=np.int64 if fmt.precision <= _FITS else object).reshape(given.shape)


def _rounded_up(low: NDArray[np.float64], rest: NDArray[np.float64], rounding: Rounding) -> NDArray[np.int64]:
    """Return 1 where a number rounds up, and 0 elsewhere."""
    if rounding is Rounding.NEAREST:
        up = (rest > 0.5) | ((rest == 0.5) & (low >= 0))
    elif rounding is Rounding.EVEN:
        up = (rest > 0.5) | ((rest == 0.5) & (low % 2 == 1))
    elif rounding is Rounding.HALF_UP:
        up = rest >= 0.5
    elif rounding is Rounding.CHOP:
        up = (rest > 0) & (low < 0)
    elif rounding is Rounding.ODD:
        up = (rest > 0) & (low % 2 == 0)
    else:
        up = (rest > 0) & (rounding is Rounding.UP)
    return np.asarray(up, dtype=np.int64)


# -- the loops --------------------------------------------------------------------------------------------------------


def _store(fmt: FixedFormat, dtype: Any) -> WordStore:
    low, high = int(fmt.lowest / fmt.unit), int(fmt.largest / fmt.unit)
    mask = (2 << fmt.precision) - 1
    if dtype is not object and mask >> 63:
        mask = -1  # all 64 bits
    return WordStore(MODES[fmt.rounding], _POLICIES.index(fmt.overflow), low, high, mask)


def _code(made: IntegerProgram, dtype: Any = np.int64) -> WordCode:
    program, words = made.program, made.words
    return WordCode(
        program.operations,
        np.array(made.factors, dtype),
        np.array(made.shifts, dtype),
        program.wide,
        program.outputs,
        _store(words.data, dtype),
        _store(words.accumulator, dtype),
        words.gap,
        words.sums is not None,
    )


class WordSteps(NamedTuple):
    """A linear program that is repeated on integers, in units of the data."""

    made: IntegerProgram

    @property
    def longest(self) -> int:
        """The largest number of steps taken at once."""
        return sys.maxsize

    def take(self, first: int, states: Sequence[NDArray[Any]], own: NDArray[Any]) -> StepsTaken:
        """Take a step for each row of the inputs (steps, m), from one array of states, (n,).

        A step without a result names the number of the first output that it cannot compute.
        """
        made, (x,), u, count = self.made, states, own, len(self.made.program.operations)
        short = made.is_short and u.dtype != object and x.dtype != object
        advance, dtype = _way(short, len(u) * count)
        code, found, done, stop = _code(made, dtype), np.zeros((len(u) + 1, len(x)), dtype), len(u), None
        found[0] = x.astype(dtype)
        for part in slices(len(u), count):
            stopped, after = np.full(part.stop - part.start, -1), slice(part.start + 1, part.stop + 1)
            advance(code, found[part], u[part].astype(dtype, copy=False), found[after], stopped)
            if (stopped >= 0).any():
                step = int(np.argmax(stopped >= 0))
                computed_by = made.program.outputs - made.program.n - made.program.m
                row = int(stopped[step])
                done, stop = part.start + step, Stop(Fault(row, OVERFLOW), str(np.argmax(computed_by >= row)))
                break
        found = found[1 : done + 1].astype(np.int64 if short else object, copy=False)
        return StepsTaken([found], np.ones(done, np.bool_), stop)


def successors(
    made: IntegerProgram, u: NDArray[np.int64], low: NDArray[np.int64], counts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return, for each state in a box of integers, the number of the state that follows it, (states,).

    The input u (m,) is constant, in units of the data. The box has a lowest integer and a number of integers for each
    state, both (n,). A state with a count of 0 is never read; it counts as one integer, and its own value does not
    matter.

    States are numbered like the entries of an array of the shape `counts`. A state that leaves the box, or overflows in
    a format that neither saturates nor wraps, has the successor -1.
    """
    if not made.is_short:
        raise ValueError(f"got words too long for compiled loops: {made.words}; needed products of up to {_FITS} bits")
    shape, count = np.maximum(counts, 1), len(made.program.operations)
    found = np.empty(int(shape.prod()), np.int64)
    advance, dtype = _way(True, len(found) * count)
    code, inputs = _code(made, dtype), u.reshape(1, -1).astype(dtype)
    for part in slices(len(found), count):
        before = np.stack(np.unravel_index(np.arange(part.start, part.stop), shape), axis=1) + low
        after, stopped = np.empty(before.shape, dtype), np.full(len(before), -1)
        advance(code, before.astype(dtype), inputs, after, stopped)
        at = np.where(counts > 0, after.astype(np.int64) - low, 0)
        inside = ((at >= 0) & (at < shape)).all(axis=1) & (stopped < 0)
        at[~inside] = 0
        found[part] = np.where(inside, np.ravel_multi_index(tuple(at.T), tuple(shape)), -1)
    return found


def _way(short: bool, operations: int) -> tuple[Callable[..., None], Any]:
    """Return what takes the next steps, and its type of numbers: Python, or the loop once it is worth its 0.9 s."""
    global _done
    _done += operations
    return (advance, np.int64) if short and _done > _FAST * backends.LOOPS_AFTER else (advance_in_python, object)
