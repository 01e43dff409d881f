r"""Bounds of systems that limit their values, such as controllers with limits against windup.

A limit moves two numbers no further apart: :math:`|\min(a, c) - \min(b, d)| \le \max(|a - b|, |c - d|)`, and what it
takes away differs by no more than :math:`|a - b|` and the difference of the limits. So the largest error of each value
follows from those of its operands, term by term, and a set of errors of the states that maps into itself in one step
holds for ever. Such a set ignores that errors cancel. It exists if the absolute coefficients contract, or if limits
hold each state that keeps its errors: two numbers between the same limits differ by their distance at most. Otherwise
the errors are followed over a number of steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.units import largest_errors, units
from gpbnb.filters.program import AT_LEAST, AT_MOST, MULTIPLY, SUBTRACT
from gpbnb.filters.system import LinearSystem

_UP = 1 + 2.0**-45
"""Factor that exceeds the effect of float64's roundings on a few operations with numbers of one sign."""

_Step = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def limited_errors(
    system: LinearSystem, fmt: FloatFormat | FixedFormat, largest: NDArray[np.float64], count: int | None = None
) -> NDArray[np.float64]:
    """Bound the error of each output, (p,), from the system as given, for all inputs within limits of their size, (m,).

    The system starts from rest, and the bound holds for a number of steps, by default for all time.
    """
    made, steps = system.as_filter(), _Steps(system, fmt, largest)
    n = made.program.n
    if count is not None:
        return _after(steps, count)[system.n :]
    sizes = _invariant(steps.sizes, n)
    if sizes is None:
        raise ValueError(
            f"got {system.name}, whose states may grow without end; needed limits on them, such as integral_limits, or "
            "a leak below 1"
        )
    steps.largest_states = sizes
    errors = _invariant(steps.errors, n)
    if errors is None:
        raise ValueError(
            f"got {system.name}, which keeps its errors of rounding, or whose numbers may exceed the range of "
            f"{arithmetic(fmt)}; needed a leak below 1, limits on the integral, or a larger range"
        )
    return errors[system.n :]


class _Steps:
    """One step of the largest sizes, or of the largest errors, of the states of a system that limits its values."""

    def __init__(self, system: LinearSystem, fmt: FloatFormat | FixedFormat, largest: NDArray[np.float64]) -> None:
        made = system.as_filter()
        self.program, self._fmt, self._aligned = made.program, fmt, units(fmt).aligned
        given, stored = made.coefficients, made.stored(fmt)
        self._given = [above(abs(each)) for each in given]
        self._stored = [above(abs(each)) for each in stored]
        self._off = [above(abs(a - b)) for a, b in zip(given, stored, strict=True)]
        self._exact_given, self._exact_stored = given, stored
        self._inputs, self._storing = largest, largest_errors(fmt, largest)
        #: (n,), largest size of each state of the system without rounding.
        self.largest_states = np.full(made.program.n, math.inf)

    def sizes(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest sizes of the states after a step without rounding, from those before it, (n,)."""
        return np.array([self._sizes(states)[value] for value in self.program.outputs])

    def _sizes(self, states: NDArray[np.float64]) -> list[float]:
        found = [*states.tolist(), *self._inputs.tolist()]
        operations = self.program.operations.tolist()
        for code, a, b in operations:
            if code == MULTIPLY:
                size = self._given[a] * found[b] if self._given[a] else 0.0
            elif code < AT_LEAST:
                size = found[a] + found[b]
            else:
                pair = self._limits(code, a, b)
                size = (
                    found[b] + self._given[a] if pair is None else min(max(map(_size, pair)), found[b] + self._given[a])
                )
            found.append(size * _UP)
        return found

    def errors(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest errors of the states after a step, from those before it, (n,)."""
        sizes = self._sizes(self.largest_states)
        first, operations = self.program.n + self.program.m, self.program.operations.tolist()
        found = [*states.tolist(), *self._storing.tolist()]
        for o, (code, a, b) in enumerate(operations):
            if code == MULTIPLY:
                error = self._off[a] * sizes[b] + (self._stored[a] * found[b] if self._stored[a] else 0.0)
                error += self._rounding(self._stored[a] * (sizes[b] + found[b])) if self._stored[a] else 0.0
            elif code < AT_LEAST:
                error = found[a] + found[b]
                if code == SUBTRACT and (taken := self._taken(a, b)) is not None:
                    error = found[b] + taken
                if self._aligned != math.inf:
                    error += self._rounding(sizes[first + o] + error)
            else:
                pair = self._limits(code, a, b)
                error = max(found[b], self._off[a])
                if pair is not None:
                    stored = self._limits(code, a, b, stored=True) or pair
                    error = min(error, above(max(pair[1], stored[1]) - min(pair[0], stored[0])))
            found.append(error * _UP)
        return np.array([found[value] for value in self.program.outputs])

    def _rounding(self, size: float) -> float:
        return float(largest_errors(self._fmt, np.array([size * _UP]))[0]) if math.isfinite(size) else math.inf

    def _limits(self, code: int, a: int, b: int, stored: bool = False) -> tuple[Fraction, Fraction] | None:
        """Return the lowest and the highest result, if the operand of an upper limit is that of a lower one."""
        at = b - self.program.n - self.program.m
        if code != AT_MOST or at < 0 or self.program.operations[at, 0] != AT_LEAST:
            return None
        coefficients = self._exact_stored if stored else self._exact_given
        return coefficients[self.program.operations[at, 1]], coefficients[a]

    def _taken(self, a: int, b: int) -> float | None:
        """Return the error that limits add to what they take away, if a is the limited value of b."""
        off, first = 0.0, self.program.n + self.program.m
        while a >= first and self.program.operations[a - first, 0] >= AT_LEAST:
            off = max(off, self._off[self.program.operations[a - first, 1]])
            a = int(self.program.operations[a - first, 2])
            if a == b:
                return off
        return None


def _after(steps: _Steps, count: int) -> NDArray[np.float64]:
    """Return the largest errors of the states in any of a number of steps, from the sizes before each step."""
    n = steps.program.n
    sizes, errors, worst = np.zeros(n), np.zeros(n), np.zeros(n)
    for _ in range(count):
        steps.largest_states = sizes
        errors = steps.errors(errors)
        worst, sizes = np.maximum(worst, errors), np.maximum(sizes, steps.sizes(sizes))
    if not np.isfinite(worst).all():
        raise ValueError(f"got numbers that may exceed the range of the format within {count} steps")
    return worst


def _size(value: Fraction) -> float:
    return above(abs(value))


def _invariant(step: _Step, n: int) -> NDArray[np.float64] | None:
    """Return numbers that a step maps to no larger ones; None if none are found.

    The step must be monotone. From zero, numbers grow to the least ones that stay; further ones are guessed from their
    growth, and lowered as long as they stay.
    """
    now = np.zeros(n)
    for round_ in range(200):
        before, now = now, step(now)
        if not np.isfinite(now).all():
            return None
        if (now <= before).all():
            return before
        if round_ < n:
            continue
        for power in range(48):
            guess = now + (now - before) * 2.0**power
            following = step(guess)
            if (following <= guess).all():
                return _lowered(step, guess)
    return None


def _lowered(step: _Step, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    for _ in range(400):
        following = np.minimum(step(numbers), numbers)
        if (following >= numbers * (1 - 2.0**-30)).all():
            break
        numbers = following
    return numbers
