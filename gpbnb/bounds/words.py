r"""The guarantee of a filter in fixed-point words: a bound, and a proof that nothing overflows.

Sums are exact. A product is rounded where the accumulator has fewer fraction bits than it, and a sum where it is
stored, each by at most half a unit, or a unit if not to nearest. These errors do not depend on the size of the numbers,
so the error of a state i has the bound

.. math:: |e_i| \le \sum_g \Big(\sum_{l\ge0} |(A^l G)_{ig}|\Big) h_g

where column g of G holds the effect of roundings on the states after a step, and :math:`h_g` the sum of their largest
errors. A and G are exact, and :func:`gpbnb.bounds.linear.largest_gains` bounds the infinite sums. Over a number of
steps, the sum over l has as many terms.

References
----------
Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020).
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.linear import largest_gains, transfer_gains
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT, Program, exact_functionals, matrices
from gpbnb.filters.system import LinearSystem, is_stable
from gpbnb.filters.words import IntegerProgram, WordFormats, integer_program

_UP = 1 + 2.0**-40
"""Factor that exceeds the effect of float64's roundings on a sum of up to 2**12 terms of one sign."""


def largest_rounding(rounding: Rounding) -> float:
    """Return the largest rounding error, in units of the last bit."""
    return 0.5 if rounding in (Rounding.NEAREST, Rounding.EVEN) else 1.0


def rounding_limits(made: IntegerProgram) -> NDArray[np.float64]:
    """Return the largest rounding error of each operation, (o,); zero where the result needs no more bits."""
    data, sums = made.words.data, made.words.accumulator
    units = [largest_rounding(fmt.rounding) * float(fmt.unit) for fmt in (sums, data)]
    bits: list[float] = [data.fraction_bits] * (made.program.n + made.program.m)
    found = np.zeros(len(made.program.operations))
    for o, (code, a, b) in enumerate(made.program.operations.tolist()):
        needed, wide = bits[b], made.program.wide[o]
        if code == MULTIPLY:
            factor = made.coefficients[a]
            needed = needed + math.log2(factor.denominator) - _twos(factor.numerator) if factor else -math.inf
        elif code in (ADD, SUBTRACT):
            needed = max(needed, bits[a])
        for fmt, error in ((sums, units[0]), (data, units[1])):
            if needed > fmt.fraction_bits and (fmt is sums or not wide):
                found[o] += error
                needed = fmt.fraction_bits
        bits.append(needed)
    return found


def _twos(n: int) -> int:
    """Return how often 2 divides a whole number."""
    return (n & -n).bit_length() - 1


def effects_of_groups(program: Program, coefficients: NDArray[Any]) -> NDArray[Any]:
    """Return the exact effect of an error in each group of operations on the states after the step, (n, groups)."""
    n, first = program.n, program.n + program.m
    effects = [[Fraction(0)] * n for _ in range(first + len(program.operations))]
    for i, o in enumerate(program.outputs.tolist()):
        effects[o][i] += 1
    for o in range(len(program.operations) - 1, -1, -1):
        code, a, b = program.operations[o].tolist()
        for i, g in enumerate(effects[first + o]):
            if g and code == MULTIPLY:
                effects[b][i] += coefficients[a] * g
            elif g:
                effects[a][i] += g
                effects[b][i] += -g if code == SUBTRACT else g
    return np.array([effects[first + root] for root in program.roots], dtype=object).reshape(-1, n).T


def rounding_gains(
    program: Program, coefficients: NDArray[Any], groups: NDArray[np.bool_], steps: int | None = None
) -> NDArray[np.float64]:
    """Return upper bounds (n, groups) of the sums over l of ``abs(A**l G)``, zero for groups that are left out.

    Parameters
    ----------
    groups : (groups,), those to sum.
    steps : number of terms; by default all.

    Raises
    ------
    ValueError : the filter is not stable, or its peak gain cannot be enclosed.
    """
    A, _ = matrices(program, coefficients)
    G = effects_of_groups(program, coefficients)
    n, gains = len(A), np.zeros(G.shape)
    used = groups & (G != 0).any(axis=0)
    identity = exact(np.eye(n, dtype=int))
    reached = ((np.linalg.matrix_power((A != 0) + np.eye(n), n) @ (G != 0)) > 0) & used
    for pattern in {tuple(row) for row in reached.tolist() if any(row)}:  # enclosures do not show which sums are zero
        rows, columns = (reached == pattern).all(axis=1), np.array(pattern)
        gains[np.ix_(rows, columns)] = largest_gains(A, G[:, columns], identity[rows], terms=steps)
    return gains


def _grouped(program: Program, limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Add the limits of operations with the same effect, (groups,)."""
    return np.asarray(np.bincount(program.groups, limits, len(program.roots)), dtype=np.float64)


def bounded_rounding(made: IntegerProgram) -> NDArray[np.float64]:
    """Bound the error of each state, (n,), due to rounding, for ever and for all inputs, as long as nothing overflows.

    Raises
    ------
    ValueError : the filter is not stable, or its peak gain cannot be enclosed.
    """
    grouped = _grouped(made.program, rounding_limits(made))
    gains = rounding_gains(made.program, made.coefficients, grouped > 0)
    return np.asarray(gains @ grouped * _UP)


class _Gains(NamedTuple):
    """What does not depend on the unit of the data: gains of a system with certain stored coefficients.

    Parameters
    ----------
    difference, inputs : (p, m), peak gains of the difference from the system as given, and to the outputs.
    states : (n + p, m), peak gains to states and outputs.
    rows : linear function of (x, u) that each value approximates.
    values : peak gains to stored results that are no states, (m,) by operation.
    rounding : peak gains of the groups of roundings, by those that round.
    """

    difference: NDArray[np.float64]
    inputs: NDArray[np.float64]
    states: NDArray[np.float64]
    rows: list[dict[int, Fraction]]
    values: dict[int, NDArray[np.float64]]
    rounding: dict[bytes, NDArray[np.float64]]


class WordGuarantee:
    """Bounds of the errors of a linear system in fixed-point words, for all inputs within limits.

    Gains are computed once for the same stored coefficients, so that a search over units of the data is fast.

    Parameters
    ----------
    system : a linear system that starts from rest.
    largest : (m,), limits on the size of the inputs.
    steps : number of steps for which the bounds hold; by default all time.

    Raises
    ------
    ValueError : a first state other than zero, or a system that limits its values.
    """

    def __init__(self, system: LinearSystem, largest: Any, steps: int | None = None) -> None:
        self.system, self._made, self._steps = system, system.as_filter(), steps
        self._largest = np.broadcast_to(all_above(largest), (system.m,))
        self._known = dict[tuple[Fraction, ...], _Gains]()
        if any(system.x0):
            raise ValueError(f"got a first state {system.x0.tolist()}; needed x0 = 0 for a bound")
        if not self._made.program.is_linear:
            raise ValueError(f"got {system.name}, which limits its values; needed a linear system for a bound")

    def errors(self, words: WordFormats) -> NDArray[np.float64]:
        """Bound the error of each output, (p,), from the system as given, due to rounding and storing.

        Raises
        ------
        OverflowError : a result may overflow; the message names it, and its largest possible size.
        ValueError : the system as stored is not stable, or its peak gain cannot be enclosed.
        """
        made, n = integer_program(self._made, words), self.system.n
        gains = self._gains(made)
        share = largest_rounding(words.data.rounding) * float(words.data.unit)
        inputs = self._largest + share
        if (inputs > float(words.data.largest)).any():
            raise OverflowError(
                f"inputs of up to {self._largest.max():.6g} are beyond the range of {arithmetic(words.data)}"
            )
        limits = rounding_limits(made)
        grouped = _grouped(made.program, limits)
        rounding = self._rounding(gains, made, grouped) @ grouped * _UP
        self._check_range(gains, made, limits, inputs, rounding)
        storing = np.full(self.system.m, share)
        return np.asarray((rounding[n:] + gains.difference @ self._largest + gains.inputs @ storing) * _UP)

    def _gains(self, made: IntegerProgram) -> _Gains:
        key = tuple(made.coefficients)
        if key not in self._known:
            program, n = made.program, self.system.n
            A, B = matrices(program, made.coefficients)
            stored = A[:n, :n], B[:n], A[n:, :n], B[n:]
            if self._steps is None and not is_stable(stored[0]):
                raise ValueError(
                    "the system is stable, but not with its coefficients as stored; needed more of their bits"
                )
            difference, inputs, states = transfer_gains(self.system, stored, self._steps)
            rows, first = exact_functionals(program, made.coefficients), program.n + program.m
            inner = [
                o for o in range(len(program.operations)) if not program.wide[o] and first + o not in program.outputs
            ]
            values = dict[int, NDArray[np.float64]]()
            if inner:
                row = np.array(
                    [[rows[first + o].get(j, Fraction(0)) for j in range(first)] for o in inner], dtype=object
                )
                terms = None if self._steps is None else self._steps - 1
                found = largest_gains(stored[0], stored[1], row[:, :n], row[:, program.n :], terms)
                values = dict(zip(inner, found, strict=True))
            self._known[key] = _Gains(difference, inputs, np.concatenate([states, inputs]), rows, values, {})
        return self._known[key]

    def _rounding(self, gains: _Gains, made: IntegerProgram, grouped: NDArray[np.float64]) -> NDArray[np.float64]:
        key = (grouped > 0).tobytes()
        if key not in gains.rounding:
            gains.rounding[key] = rounding_gains(made.program, made.coefficients, grouped > 0, self._steps)
        return gains.rounding[key]

    def _check_range(
        self,
        gains: _Gains,
        made: IntegerProgram,
        limits: NDArray[np.float64],
        inputs: NDArray[np.float64],
        error: NDArray[np.float64],
    ) -> None:
        """Raise OverflowError if a result may be beyond its format; what wraps need not fit before it is stored."""
        program, words = made.program, made.words
        peaks = gains.states @ inputs * _UP
        sizes = np.concatenate([peaks, inputs])
        errors = np.concatenate([error, np.zeros(program.m)])
        result_of = {int(value): i for i, value in enumerate(program.outputs)}
        first, off = program.n + program.m, [0.0] * (program.n + program.m)
        for o, (code, a, b) in enumerate(program.operations.tolist()):
            before = abs(float(made.coefficients[a])) * off[b] if code == MULTIPLY else off[a] + off[b]
            off.append((before + limits[o]) * _UP)
            row = gains.rows[first + o]
            if first + o in result_of:
                size = float(peaks[result_of[first + o]])
            elif o in gains.values:
                size = float(gains.values[o] @ inputs)
            else:
                size = sum(abs(float(c)) * float(sizes[j]) for j, c in row.items())
            moved = sum(abs(float(c)) * float(errors[j]) for j, c in row.items()) + off[-1]
            size += min(moved, float(error[result_of[first + o]])) if first + o in result_of else moved
            wide = bool(program.wide[o])
            kept = [words.accumulator] if words.accumulator.overflow != "wrap" or not wide else []
            for fmt in kept if wide else [*kept, words.data]:
                if size * _UP > float(fmt.largest):
                    raise OverflowError(_beyond(program, o, size * _UP, fmt, fmt is words.data))


def _beyond(program: Program, o: int, size: float, fmt: FixedFormat, is_data: bool) -> str:
    what = "a product" if program.operations[o, 0] == MULTIPLY else "a sum"
    where = "the data" if is_data else "the sums"
    return (
        f"{what}, operation {o + 1} of {len(program.operations)}, may reach {size:.6g}, beyond the {fmt.integer_bits} "
        f"integer bits of {where}; {math.frexp(size)[1]} hold it"
    )
