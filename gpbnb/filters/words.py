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

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.kernels.integer_steps import WordCode, WordStore, advance, advance_in_python
from gpbnb.arithmetic.kernels.selection import MODES
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.filters.named import naming
from gpbnb.filters.program import AT_LEAST, MULTIPLY, Program
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.system import LinearSystem, system_inputs
from gpbnb.interrupts import slices

_POLICIES = ("raise", "saturate", "wrap")
_FITS = 62
"""Bits of a product, or of a number of the data, without its sign, up to which compiled loops run."""
_LONGEST_SUM = 63
"""Bits of a sum without its sign up to which compiled loops run."""
_FAST = 6
"""Operations that Python does on its integers in the time of one operation of exact arithmetic on arrays."""
_done = 0


@dataclass(frozen=True)
class WordFormats:
    """Number formats for data, coefficients and sums in a fixed-point processor.

    Parameters
    ----------
    data : format of inputs, states, outputs, and of each result that is stored.
    coefficients : format of all coefficients; or a number of significant bits, where each coefficient has its own
        binary point. By default the format of the data.
    sums : format of the accumulator, with at least as many fraction bits as the data; by default there is no
        accumulator, and each product and each sum is stored in the format of the data.

    Raises
    ------
    TypeError : a format that is not fixed point, or bits that are not a whole number.
    ValueError : a number of bits below 1; stochastic rounding; sums with fewer fraction bits than the data.

    Examples
    --------
    Coefficients in Q14, data in Q15, sums of 32 bits with one rounding when they are stored:

    >>> from gpbnb import FixedFormat
    >>> words = WordFormats(data=FixedFormat(0, 15), coefficients=FixedFormat(1, 14), sums=FixedFormat(2, 29))
    >>> words.gap
    14
    """

    data: FixedFormat
    coefficients: FixedFormat | int | None = None
    sums: FixedFormat | None = None

    def __post_init__(self) -> None:
        if isinstance(self.coefficients, int) and not isinstance(self.coefficients, bool):
            if self.coefficients < 1:
                raise ValueError(f"got {self.coefficients} bits for coefficients; needed at least 1")
        elif self.coefficients is not None and not isinstance(self.coefficients, FixedFormat):
            raise TypeError(f"got coefficients {self.coefficients!r}; needed a FixedFormat or a number of bits")
        for name, fmt in (("data", self.data), ("sums", self.sums)):
            if fmt is None and name == "sums":
                continue
            if not isinstance(fmt, FixedFormat):
                raise TypeError(f"got {name} {fmt!r}; needed a FixedFormat")
            if fmt.rounding is Rounding.STOCHASTIC:
                raise ValueError(f"got stochastic rounding for the {name}; needed another rounding for integers")
        if self.sums is not None and self.sums.fraction_bits < self.data.fraction_bits:
            raise ValueError(
                f"got sums with {self.sums.fraction_bits} fraction bits and data with {self.data.fraction_bits}; "
                "needed at least as many for the sums"
            )

    @property
    def accumulator(self) -> FixedFormat:
        """The format in which products and sums are computed; the format of the data if there is no accumulator."""
        return self.data if self.sums is None else self.sums

    @property
    def gap(self) -> int:
        """Number of fraction bits that a sum loses when it is stored."""
        return self.accumulator.fraction_bits - self.data.fraction_bits

    def __str__(self) -> str:
        def named(fmt: FixedFormat) -> str:
            return f"{1 + fmt.precision} bits with {fmt.fraction_bits} after the point"

        text = f"data of {named(self.data)}"
        if isinstance(self.coefficients, FixedFormat):
            text += f", coefficients of {named(self.coefficients)}"
        elif self.coefficients is not None:
            text += f", coefficients of {digits_text(self.coefficients, kind='significant')}"
        return text + (f", sums of {named(self.sums)}" if self.sums is not None else "")


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
    """Store the coefficients of a filter in words; a coefficient of 1 or -1 is exact, as nothing is multiplied."""
    program, limits = made.program, made.limits_in(words.data)
    stored = np.empty(len(made.coefficients), dtype=object)
    for i, value in enumerate(made.coefficients):
        fmt = words.data if i in limits else words.coefficients if words.coefficients is not None else words.data
        if abs(value) == 1 and i not in limits:
            stored[i] = value
            continue
        try:
            value = limits.get(i, value)
            stored[i] = FloatFormat(2, fmt).round(value) if isinstance(fmt, int) else fmt.strict.round(value)
        except OverflowError:
            name = program.coefficient_names[i] if program.coefficient_names else f"coefficient {i}"
            text = arithmetic(fmt) if isinstance(fmt, FixedFormat) else digits_text(fmt, kind="significant")
            raise OverflowError(
                f"got {name} = {float(value):.6g}, beyond the range of {text}; needed coefficients with more integer "
                "bits, or a number of significant bits, as in WordFormats(data, 15)"
            ) from None
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


class IntegerRun(NamedTuple):
    """States of a run on integers, and its outputs."""

    states: NDArray[Any]  # (steps, n), integers in units of the data after each step, outputs last
    unit: Fraction

    def outputs(self, p: int) -> NDArray[np.float64]:
        """Return the last p states as sums of two float64, (steps, p, 2)."""
        integers, unit = self.states[:, len(self.states[0]) - p :], float(self.unit)
        high = integers.astype(np.float64)
        if integers.dtype == object:
            low = np.vectorize(lambda n, h: float(int(n) - int(h)), otypes=[float])(integers, high)
        else:
            low = (integers - high.astype(np.int64)).astype(np.float64)
        return np.stack([high * unit, low * unit], axis=-1)


def run_words(given: LinearSystem | LinearFilter, u: Any, words: WordFormats) -> IntegerRun:
    """Run a filter, which starts from zeros, or a system, from its own x0, on integers.

    Inputs (steps, m) are rounded into the format of the data.
    """
    if isinstance(given, LinearSystem):
        start = np.concatenate([given.x0, exact([0] * given.p)])
        u, given = system_inputs(given, u), given.as_filter()
    else:
        start = exact([0] * given.program.n)
    made = integer_program(given, words)
    data = words.data
    return IntegerRun(run_integers(made, integers_of(u, data), first_integers(start, data)), data.unit)


def first_integers(x0: Any, fmt: FixedFormat) -> NDArray[Any]:
    """Round a first state as :func:`integers_of` does."""
    with naming("x0"):
        return integers_of(np.asarray(x0)[None], fmt.strict)[0]


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


def run_integers(made: IntegerProgram, u: NDArray[Any], x: NDArray[Any]) -> NDArray[Any]:
    """Run a program on integers; return the states after each step, (steps, n).

    Inputs (steps, m) and first state (n,) are in units of the data.
    """
    short, count = made.is_short and u.dtype != object and x.dtype != object, len(made.program.operations)
    advance, dtype = _way(short, len(u) * count)
    code, states = _code(made, dtype), np.zeros((len(u) + 1, made.program.n), dtype)
    states[0] = x.astype(dtype)
    for part in slices(len(u), count):
        stopped, after = np.full(part.stop - part.start, -1), slice(part.start + 1, part.stop + 1)
        advance(code, states[part], u[part].astype(dtype, copy=False), states[after], stopped)
        if (stopped >= 0).any():
            step = int(np.argmax(stopped >= 0))
            operation = int(stopped[step])
            kind = "a product" if code.operations[operation, 0] == MULTIPLY else "a sum"
            raise OverflowError(
                f"overflow in {kind}, operation {operation + 1} of {count}, at step {part.start + step + 1}"
            )
    return states[1:].astype(np.int64 if short else object, copy=False)


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
