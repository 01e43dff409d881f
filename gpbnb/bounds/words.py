r"""The guarantee of a filter in fixed-point words: a bound, and a proof that nothing overflows.

Sums are exact. A product is rounded where the accumulator has fewer fraction bits than it, and a sum where it is
stored, each by at most half a unit, or a unit if not to nearest. These errors do not depend on the size of the numbers,
so the error of a state i has the bound

.. math:: |e_i| \le \sum_g \Big(\sum_{l\ge0} |(A^l G)_{ig}|\Big) h_g

where column g of G holds the effect of roundings on the states after a step, and :math:`h_g` the sum of their largest
errors. Over a number of steps, the sum over l has as many terms. These sums are guessed in float64, and
:mod:`gpbnb.bounds.check` proves the answer.

References
----------
Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020).
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.certificate import of_operations, proved
from gpbnb.bounds.guess import EXCESS, Guess, error_effects, gains, lags_of, loops, positive
from gpbnb.bounds.units import units
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT, Program, exact_functionals, matrices
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.system import LinearSystem, is_stable
from gpbnb.filters.word_formats import WordFormats
from gpbnb.filters.words import IntegerProgram, integer_program


def rounding_limits(made: IntegerProgram) -> NDArray[np.float64]:
    """Return the largest rounding error of each operation, (o,); zero where the result needs no more bits."""
    data, sums = made.words.data, made.words.accumulator
    of_sums, of_data = (float(units(fmt).errors[0]) for fmt in (sums, data))
    bits: list[float] = [data.fraction_bits] * (made.program.n + made.program.m)
    found = np.zeros(len(made.program.operations))
    for o, (code, a, b) in enumerate(made.program.operations.tolist()):
        needed, wide = bits[b], made.program.wide[o]
        if code == MULTIPLY:
            factor = made.coefficients[a]
            needed = needed + math.log2(factor.denominator) - _twos(factor.numerator) if factor else -math.inf
        elif code in (ADD, SUBTRACT):
            needed = max(needed, bits[a])
        for fmt, error in ((sums, of_sums), (data, of_data)):
            if needed > fmt.fraction_bits and (fmt is sums or not wide):
                found[o] += error
                needed = fmt.fraction_bits
        bits.append(needed)
    return found


def _twos(n: int) -> int:
    """Return how often 2 divides a whole number."""
    return (n & -n).bit_length() - 1


def bounded_rounding(made: LinearFilter, words: WordFormats) -> NDArray[np.float64]:
    """Bound the error of each state, (n,), due to rounding, for ever and for all inputs, while nothing overflows."""
    stored = integer_program(made, words)
    A, _ = matrices(made.program, stored.coefficients)
    if not is_stable(A):
        raise ValueError("the system is not stable with its coefficients as stored")
    F, n, m = A.astype(np.float64), made.program.n, made.program.m
    effects = _effects(stored)
    lags = lags_of(F, effects, None)
    sums = gains(F, effects, np.zeros((0, n)), None, lags)
    bound, inputs = positive(sums @ rounding_limits(stored) * EXCESS), np.full(m, np.inf)
    guess = Guess(bound, bound, inputs, np.zeros((n, 3)), lags)
    return proved(guess, lambda each: of_operations(made, words, inputs, each, None)).bound


def _effects(made: IntegerProgram) -> NDArray[np.float64]:
    """Return the effect of an error of each operation on the states after the step, (n, o)."""
    first = made.program.n + made.program.m
    return error_effects(made.program, made.coefficients.astype(np.float64)[:, None])[first:, 0].T


class _Sums(NamedTuple):
    """What does not depend on the unit of the data: sums for certain stored coefficients."""

    state: NDArray[np.float64]  # (n + p, m), from inputs to states and outputs
    rows: NDArray[np.float64]  # (values, n + m), function of states and inputs that each value approximates
    values: NDArray[np.float64]  # (values, m), from inputs to values
    errors: NDArray[np.float64]  # (n + p, m), from inputs to errors
    storing: NDArray[np.float64]  # (n + p, m), from errors of storing inputs to errors
    rounding: NDArray[np.float64]  # (n + p, o), from roundings of operations to errors
    lags: int  # how many earlier steps are summed one by one


class WordSums:
    """Guesses for a linear system in fixed-point words, from rest and for all inputs within limits of their size, (m,).

    Sums are computed once for the same stored coefficients, so that a search over units of the data is fast.
    """

    def __init__(self, system: LinearSystem, largest: NDArray[np.float64], steps: int | None) -> None:
        self._made, self._steps, self._largest = system.as_filter(), steps, largest
        self._known = dict[tuple[Fraction, ...], _Sums]()
        if not self._made.program.is_linear:
            raise ValueError(f"got {self._made.name}, which limits its values; needed a linear system for a bound")

    def guess(self, words: WordFormats) -> Guess:
        """Return what is to be proved of some words; OverflowError if a result may be beyond its format."""
        made = integer_program(self._made, words)
        found = self._sums(made)
        share = float(units(words.data).errors[0])
        inputs = self._largest + share
        if (inputs > float(words.data.largest)).any():
            raise OverflowError(
                f"inputs of up to {self._largest.max():.6g} are beyond the range of {arithmetic(words.data)}"
            )
        limits, state = rounding_limits(made), positive(found.state @ self._largest * EXCESS)
        bound = found.errors @ self._largest + found.storing.sum(axis=1) * share + found.rounding @ limits
        bound = positive(bound * EXCESS)
        self._check_range(found, made, limits, state, inputs, bound)
        return Guess(bound, state, inputs, np.zeros((len(bound), 3)), found.lags)

    def _sums(self, made: IntegerProgram) -> _Sums:
        key = tuple(made.coefficients)
        if key in self._known:
            return self._known[key]
        program, n = made.program, self._made.program.n
        nothing = np.zeros(program.m)
        one = loops(program, made.coefficients, self._made.coefficients, nothing, nothing)
        if self._steps is None and not is_stable(matrices(program, made.coefficients)[0]):
            raise ValueError("the system is stable, but not with its coefficients as stored; needed more of their bits")
        rows = np.array(
            [
                [float(row.get(j, 0)) for j in range(n + program.m)]
                for row in exact_functionals(program, made.coefficients)
            ]
        )
        columns = np.hstack([one.K, _effects(made)])
        lags = max(lags_of(one.A, one.B * self._largest, self._steps), lags_of(one.F, columns, self._steps))
        sums = gains(one.A, one.B, rows[:, :n], self._steps, lags)
        errors = np.zeros((n, program.m))
        if one.of_state.any() or one.of_input.any():
            both = np.block([[one.F, one.of_state], [np.zeros((n, n)), one.A]])
            errors = gains(both, np.vstack([one.of_input, one.B]), np.zeros((0, 2 * n)), self._steps, lags)[:n]
        later = gains(one.F, columns, rows[:0, :n], self._steps, lags)
        values = sums[n:] + np.abs(rows[:, n:])
        found = _Sums(sums[:n], rows, values, errors, later[:, : program.m], later[:, program.m :], lags)
        self._known[key] = found
        return found

    def _check_range(
        self,
        found: _Sums,
        made: IntegerProgram,
        limits: NDArray[np.float64],
        state: NDArray[np.float64],
        inputs: NDArray[np.float64],
        error: NDArray[np.float64],
    ) -> None:
        """Raise OverflowError if a result may be beyond its format; what wraps need not fit before it is stored."""
        program, words = made.program, made.words
        result_of = {int(value): i for i, value in enumerate(program.outputs)}
        first, off = program.n + program.m, [0.0] * (program.n + program.m)
        sizes = np.minimum(found.values @ self._largest, np.abs(found.rows) @ np.concatenate([state, self._largest]))
        moved_by = np.abs(found.rows) @ np.concatenate([error, inputs - self._largest])
        for o, (code, a, b) in enumerate(program.operations.tolist()):
            before = abs(float(made.coefficients[a])) * off[b] if code == MULTIPLY else off[a] + off[b]
            off.append(before + limits[o])
            size = float(sizes[first + o] + moved_by[first + o]) + off[-1]
            if first + o in result_of:
                i = result_of[first + o]
                size = min(size, float(state[i] + error[i]))
            wide = bool(program.wide[o])
            kept = [words.accumulator] if words.accumulator.overflow != "wrap" or not wide else []
            for fmt in kept if wide else [*kept, words.data]:
                if size * EXCESS > float(fmt.largest):
                    raise OverflowError(_beyond(program, o, size, fmt, fmt is words.data))


def _beyond(program: Program, o: int, size: float, fmt: FixedFormat, is_data: bool) -> str:
    what = "a product" if program.operations[o, 0] == MULTIPLY else "a sum"
    where = "the data" if is_data else "the sums"
    return (
        f"{what}, operation {o + 1} of {len(program.operations)}, may reach {size:.6g}, beyond the {fmt.integer_bits} "
        f"integer bits of {where}; {math.frexp(size + float(fmt.unit))[1]} hold it"
    )
