r"""Limit cycles and dead bands of filters in fixed point: found by an exhaustive search, or bounded.

With a constant input, a stable filter without rounding comes to rest at :math:`x^* = (I - A)^{-1}Bu`. With rounding it
ends in a cycle of states: at rest beside :math:`x^*`, in a *dead band* in which small differences are rounded away, or
in an oscillation. Every such cycle is nothing but rounding error, so it stays within the bound of
:func:`gpbnb.bounds.system.bounded_rounding` around :math:`x^*`, as long as nothing overflows. This box holds finitely
many states. If they are not too many, each is tried.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import format_named
from gpbnb.arithmetic.rational import exact, rationals
from gpbnb.bounds.system import bounded_rounding
from gpbnb.filters.program import ADD, SUBTRACT, Program, matrices
from gpbnb.filters.system import is_stable
from gpbnb.filters.word_formats import WordFormats
from gpbnb.filters.words import WordSteps, integer_program, integers_of, successors
from gpbnb.wordlength.asked import admitted
from gpbnb.wordlength.models import ModelSource

MOST_STATES = 2**24
"""Largest number of states that a search tries."""


@dataclass(frozen=True, eq=False)
class LimitCycle:
    """States that follow each other for ever with a constant input."""

    states: NDArray[np.int64]  # (period, n), integers in units of the data
    outputs: NDArray[np.int64]  # (period, p), likewise

    @property
    def period(self) -> int:
        """Number of steps after which the states are the same again."""
        return len(self.states)


@dataclass(frozen=True, eq=False)
class LimitCycles:
    """How a filter in fixed point ends with a constant input.

    Parameters
    ----------
    cycles : all cycles, the longest first; None if they were not searched.
    bound : (p,), largest distance of an output from that of the filter without rounding, in units of the data.
    rest : (p,), the exact outputs of the filter at rest without rounding, in units of the data.
    searched : number of states that were tried; 0 if there are too many.
    """

    cycles: tuple[LimitCycle, ...] | MaybeNone
    bound: NDArray[np.float64]
    rest: NDArray[Any]
    searched: int

    @property
    def largest(self) -> NDArray[np.float64]:
        """Largest distance of an output on a cycle from the output at rest, (p,), in units of the data; the dead band.

        Without a search, this property is the bound.
        """
        if self.cycles is None:
            return self.bound
        off = [np.abs(cycle.outputs - self.rest).max(axis=0).astype(np.float64) for cycle in self.cycles]
        return np.asarray(np.max(off, axis=0)) if off else np.zeros(len(self.rest))

    def __str__(self) -> str:
        most = ", ".join(f"{each:.6g}" for each in self.largest)
        if self.cycles is None:
            return f"outputs stay within {most} units of rest; too many states to try each"
        oscillations = sum(cycle.period > 1 for cycle in self.cycles)
        points = len(self.cycles) - oscillations
        return (
            f"{points} point{'s' * (points != 1)} of rest and {oscillations} oscillation{'s' * (oscillations != 1)}; "
            f"outputs stay within {most} units of rest, by a search of {self.searched} states"
        )

    __repr__ = __str__


def limit_cycles(
    system: ModelSource,
    fmt: WordFormats | FixedFormat | str,
    u: Any = 0,
    *,
    everywhere: bool = False,
) -> LimitCycles:
    """Find every limit cycle in which a fixed-point filter can end when its input is constant.

    If there are more than :data:`MOST_STATES` states to try, only the bound is returned.

    Parameters
    ----------
    system : a stable linear system, in any structure.
    fmt : the format of all numbers, or :class:`gpbnb.WordFormats` for data, coefficients and sums.
    u : the input, one number or (m,).
    everywhere : whether to try every state that the word can store. By default, the search tries only the states within
        the error bound around the state of rest, which no cycle without an overflow can leave. Cycles with an overflow,
        in a format that saturates or wraps, are found only if this is True.

    Raises
    ------
    ValueError : a model that cannot be searched; an input of another size; a system that is not stable as stored.
    TypeError : `fmt` is neither a fixed-point format nor :class:`gpbnb.WordFormats`.
    OverflowError : a coefficient or an input beyond the range of its format.

    Examples
    --------
    An integer smoother that rounds down, with the constant input 512, can come to rest at any of four outputs:

    >>> from gpbnb import FixedFormat, LinearSystem, WordFormats
    >>> words = WordFormats(FixedFormat(15, 0, "down"), FixedFormat(3, 12))
    >>> found = limit_cycles(LinearSystem.smoother("1097/4096"), words, 512)
    >>> sorted(int(cycle.outputs[0, 0]) for cycle in found.cycles)
    [509, 510, 511, 512]
    """
    given, named = admitted(system, "be searched for limit cycles"), format_named(fmt)
    words = WordFormats(named) if isinstance(named, FixedFormat) else named
    if not isinstance(words, WordFormats):
        raise TypeError(f"got words {words!r}; needed WordFormats, such as WordFormats(FixedFormat(0, 15))")
    n, m = given.n, given.m
    made, data = integer_program(given.as_filter(), words), words.data
    value = np.asarray(u, dtype=object)
    if value.shape not in ((), (1,), (m,)):
        raise ValueError(f"got an input of shape {value.shape}; needed one number, or {m}")
    inputs = integers_of(exact(np.broadcast_to(value, (1, m))), data)[0]
    A, B = matrices(made.program, made.coefficients)
    if not is_stable(A[:n, :n]):
        raise ValueError(
            f"got a filter that is not stable as stored in {words}; needed a stable one, which comes to rest"
        )
    error = bounded_rounding(given.as_filter(), words) / float(data.unit) * (1 + 2.0**-40)
    solved = rationals(exact(np.eye(len(A), dtype=int)) - A).solve(rationals((B @ exact(inputs)).reshape(-1, 1)))
    rest = np.array([Fraction(int(each.p), int(each.q)) for each in solved.entries()], dtype=object)
    if everywhere:
        ends = [(int(data.lowest / data.unit), int(data.largest / data.unit))] * len(A)
    else:
        ends = [(math.ceil(x - Fraction(r)), math.floor(x + Fraction(r))) for x, r in zip(rest, error, strict=True)]
    low = np.array([first for first, _ in ends], np.int64)
    counts = np.array([last - first + 1 for first, last in ends], np.int64)
    counts[~_read(made.program)] = 0
    total = math.prod(max(int(each), 1) for each in counts)
    if total > MOST_STATES:
        return LimitCycles(None, error[n:], rest[n:], 0)
    cycles = list[LimitCycle]()
    for numbers in _cycles(successors(made, inputs.astype(np.int64), low, counts)):
        first = np.array(np.unravel_index(numbers[0], np.maximum(counts, 1))) + low
        (states,), *_ = WordSteps(made).take(0, [first], np.tile(inputs, (len(numbers), 1)))
        cycles.append(LimitCycle(states[:, :n], states[:, n:]))
    return LimitCycles(tuple(sorted(cycles, key=lambda each: -each.period)), error[n:], rest[n:], total)


def _read(program: Program) -> NDArray[np.bool_]:
    """Return whether a step reads each state, (n,)."""
    sums = np.isin(program.operations[:, 0], (ADD, SUBTRACT))
    values = np.concatenate([program.operations[:, 2], program.operations[sums, 1]])
    return np.isin(np.arange(program.n), np.concatenate([values, program.outputs]))


def _cycles(following: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the numbers of the states on each cycle of a map, -1 where a state leaves it."""
    left, found = set(_on_cycles(following).tolist()), list[NDArray[np.int64]]()
    while left:
        numbers = [next(iter(left))]
        while (after := int(following[numbers[-1]])) != numbers[0]:
            numbers.append(after)
        left.difference_update(numbers)
        found.append(np.array(numbers))
    return found


def _on_cycles(following: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers of the states on cycles: what is left once states without a predecessor are left out."""
    predecessors = np.bincount(following[following >= 0], minlength=len(following))
    out = np.flatnonzero(predecessors == 0)
    while len(out):
        after = following[out]
        after, times = np.unique(after[after >= 0], return_counts=True)
        predecessors[after] -= times
        out = after[predecessors[after] == 0]
    return np.flatnonzero(predecessors)
