r"""Filters with constant coefficients in fixed point: how to scale them, and how accurate each fraction bit makes them.

A signal processor computes :math:`Ax + Bz` with integers. Sums are exact. Only products are rounded, each to a
multiple of one unit, whatever its size. So the error has a bound that needs no limit on the measurements,

.. math:: |e_i| \le \tfrac{q}{2} \sum_{l\ge0}\sum_o |(A^l G)_{io}|,

where q is the unit and column o of G holds the effect of the rounding in operation o on the states. The integers behind
the formula are exact, and the infinite sum is enclosed in ball arithmetic.

References
----------
Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.linear import LinearFilter, peak_gain
from gpbnb.filters.model import LinearModel
from gpbnb.filters.program import MULTIPLY, SUBTRACT, Program, innovation_program
from gpbnb.filters.run import log_spaced, reference
from gpbnb.wordlength.system import is_stable

Basis = Literal["emulation", "guarantee"]
LARGEST_FRACTION = 60  # bits


@dataclass(frozen=True, eq=False)
class ScaledFilter:
    """A filter in units that are powers of two, so that one binary point serves all its states.

    Parameters
    ----------
    filter : the filter for scaled states and measurements, with exact coefficients.
    state, measurement : (n,) and (m,), exponents; a state x is stored as x / 2**exponent.
    gain : (n, m), the constant gain in the units of the model; empty if there is none.
    """

    filter: LinearFilter
    state: NDArray[np.int64]
    measurement: NDArray[np.int64]
    gain: NDArray[np.float64]


@dataclass(frozen=True)
class FixedAnswer:
    """The smallest number of fraction bits that meets a tolerance.

    Parameters
    ----------
    fmt : the format; None if no format tried meets the tolerance.
    tried : fraction bits, and largest error or bound / tolerance, infinite if a number overflows.
    why : why the next smaller format was rejected.
    """

    fmt: FixedFormat | None
    basis: Basis
    tried: tuple[tuple[int, float], ...]
    why: str

    def __str__(self) -> str:
        if self.fmt is None:
            return f"no format, by {self.basis}: {self.why}"
        word = 1 + self.fmt.precision
        return f"{self.fmt.fraction_bits} fraction bits in a word of {word} bits, by {self.basis}; {self.why}"


def constant_gain(model: LinearModel, z: Any, margin: float = 2.0) -> ScaledFilter:
    """Return the filter in its steady state, scaled by the ranges that occur in a reference run.

    The gain is that of the last step. In the scaled units, states and measurements times the margin stay
    below 1.

    Parameters
    ----------
    model : a model with constant matrices. z : (steps, m), typical measurements.
    margin : factor by which later numbers may exceed those of this run.

    Raises
    ------
    ValueError : a model whose matrices change.
    """
    model.refuse_inputs("fixed point")
    if model.cycle != 1:
        raise ValueError(f"got {model.name} with a cycle of {model.cycle} steps; needed constant matrices")
    measured = np.asarray(z)
    steps = log_spaced(len(measured), 64)
    run = reference(model, measured, steps)
    largest_state = abs(run.x.astype(np.float64)).max(axis=0)
    largest_seen = np.maximum(abs(measured.astype(np.float64)).max(axis=0), 1e-30)
    state, seen = (_exponents(margin * each) for each in (largest_state, largest_seen))
    gain = run.K[-1]
    Phi, H = model.Phi[0], model.H[0]
    D = np.array([Fraction(2) ** int(k) for k in state], dtype=object)
    E = np.array([Fraction(2) ** int(k) for k in seen], dtype=object)
    parts = (Phi * D / D[:, None], H * D / E[:, None], gain * E / D[:, None])
    coefficients = np.concatenate([np.asarray(part).reshape(-1) for part in parts])
    program = innovation_program(model.n, model.m)
    made = LinearFilter(program, coefficients, f"{model.name}, constant gain")
    return ScaledFilter(made, state, seen, gain.astype(np.float64))


def unscaled(made: LinearFilter) -> ScaledFilter:
    """Return a linear filter in its own units."""
    n, m = made.program.n, made.program.m
    return ScaledFilter(made, np.zeros(n, np.int64), np.zeros(m, np.int64), np.zeros((0, m)))


def integer_bits(given: ScaledFilter, z: Any) -> int:
    """Return the number of integer bits that all intermediate values of a run need, as advice for scaling."""
    return _bits_for(_largest(given, z))


def emulated(
    given: ScaledFilter, z: Any, fmt: FixedFormat, coefficient_bits: int = 15, wide: bool = False
) -> NDArray[np.float64]:
    """Return the error of each state after each step, (steps, n), in the units of the model, due to rounding.

    Parameters
    ----------
    z : (steps, m), measurements in the units of the model; the converter rounds them into the format for both filters.
    coefficient_bits : significant bits of each coefficient; each coefficient has its own binary point.
    wide : whether sums of products are kept exactly in a long accumulator and rounded once.

    Raises
    ------
    OverflowError : a number overflows and the format neither saturates nor wraps; names operation and step.
    """
    coefficients = stored_coefficients(given.filter, coefficient_bits)
    seen = _stored_measurements(given, z, fmt)
    program = given.filter.program
    take = _integer_step(program, coefficients, fmt, wide)
    state, true = [0] * program.n, np.zeros(program.n)
    A, B = _state_space(program, coefficients)
    A, B = A.astype(np.float64), B.astype(np.float64)
    unit, scale = float(fmt.unit), 2.0 ** given.state.astype(float)
    errors = np.empty((len(seen), program.n))
    for k, row in enumerate(seen):
        try:
            state = take(state, row)
        except OverflowError as error:
            raise OverflowError(f"overflow in {error} at step {k + 1}") from None
        true = A @ true + B @ (np.array(row, dtype=np.float64) * unit)
        errors[k] = (np.array(state, dtype=np.float64) * unit - true) * scale
    return errors


def guaranteed(
    given: ScaledFilter, fmt: FixedFormat, coefficient_bits: int = 15, wide: bool = False
) -> NDArray[np.float64]:
    """Bound the error of each state, (n,), in the units of the model, for all time and all measurements.

    The bound holds as long as nothing overflows. For the parameters, see :func:`emulated`.

    Raises
    ------
    ValueError : the filter is not stable.
    """
    return bound_per_unit(given, coefficient_bits, wide) * (largest_rounding(fmt.rounding) * float(fmt.unit))


def largest_rounding(rounding: Rounding) -> float:
    """Return the largest rounding error, in units of the last bit."""
    return 0.5 if rounding in (Rounding.NEAREST, Rounding.EVEN) else 1.0


def bound_per_unit(given: ScaledFilter, coefficient_bits: int = 15, wide: bool = False) -> NDArray[np.float64]:
    """Return the bound of :func:`guaranteed` for rounding errors of at most one; the bound is proportional to them."""
    program = given.filter.program
    coefficients = stored_coefficients(given.filter, coefficient_bits)
    A, _ = _state_space(program, coefficients)
    sums = _peak_sums(A, _effects(program, coefficients, wide))
    return np.asarray(sums * 2.0 ** given.state.astype(float))


def required_fraction_bits(
    given: ScaledFilter,
    z: Any,
    tolerance: Sequence[float] | float,
    basis: Basis = "emulation",
    rounding: Rounding = Rounding.NEAREST,
    coefficient_bits: int = 15,
    wide: bool = False,
) -> FixedAnswer:
    """Find the smallest number of fraction bits with which rounding errors stay within a tolerance.

    As for floating point, a format qualifies only if the next one meets the tolerance, too. The integer bits are those
    that the run needs.

    Parameters
    ----------
    tolerance : for each state, in the units of the model; infinite if the state does not matter.
    basis : "emulation" of these measurements, or "guarantee" for all measurements that do not overflow.
    rounding, coefficient_bits, wide : as for :func:`emulated`.

    Raises
    ------
    ValueError : a tolerance is not above 0, no tolerance is finite, or the basis is neither of the two.
    """
    if basis not in ("emulation", "guarantee"):
        raise ValueError(f'got basis {basis!r}; needed "emulation" or "guarantee"')
    goal = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), (given.filter.program.n,))
    if not (goal > 0).all() or not np.isfinite(goal).any():
        raise ValueError(f"got tolerance {tolerance}; needed errors above 0, one of them finite")
    asked, before = np.isfinite(goal), integer_bits(given, z)
    tried: list[tuple[int, float]] = []
    why = last = ""
    bound: NDArray[np.float64] | None = None
    for fraction in range(max(1, 1 - before), LARGEST_FRACTION):
        fmt = FixedFormat(before, fraction, rounding)
        try:
            if basis == "guarantee":
                if bound is None:
                    bound = bound_per_unit(given, coefficient_bits, wide)
                error = bound * (float(fmt.unit) * largest_rounding(fmt.rounding))
            else:
                error = abs(emulated(given, z, fmt, coefficient_bits, wide)).max(axis=0)
            ratio = float((error[asked] / goal[asked]).max())
            last = f"{fraction} fraction bits give {ratio:.3g} times the tolerance"
        except OverflowError as error_:
            ratio, last = math.inf, f"{fraction} fraction bits are refused: {error_}"
        except ValueError:
            return FixedAnswer(None, basis, tuple(tried), _without_bound(given, coefficient_bits))
        tried.append((fraction, ratio))
        if len(tried) > 1 and ratio <= 1 and tried[-2][1] <= 1:
            return FixedAnswer(FixedFormat(before, fraction - 1, rounding), basis, tuple(tried), why or last)
        if ratio > 1:
            why = last
    return FixedAnswer(None, basis, tuple(tried), f"{why}; {LARGEST_FRACTION - 1} fraction bits are the most tried")


def _without_bound(given: ScaledFilter, coefficient_bits: int) -> str:
    """Return in words why a filter has no bound for all time."""
    program, coefficients = given.filter.program, given.filter.coefficients
    if not is_stable(_state_space(program, coefficients)[0]):
        return "the filter as given is not stable, so that errors of rounding never decay, whatever the word"
    if not is_stable(_state_space(program, stored_coefficients(given.filter, coefficient_bits))[0]):
        stored = f"stored in {coefficient_bits} bits"
        return f"the filter is stable, but not with its coefficients {stored}; raise coefficient_bits"
    return "the filter is stable, but decays too slowly for its peak gain to be enclosed in balls of 8192 bits"


def stored_coefficients(made: LinearFilter, bits: int) -> NDArray[Any]:
    """Round coefficients to `bits` significant bits, to nearest; (c,) Fractions."""
    return FloatFormat(2, bits).array(made.coefficients).to_fractions()


def _exponents(sizes: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the smallest k with size < 2**k for each size; 0 for zero."""
    return np.where(sizes > 0, np.frexp(sizes)[1], 0).astype(np.int64)


def _bits_for(largest: float) -> int:
    return int(_exponents(np.array([largest]))[0])


def _stored_measurements(given: ScaledFilter, z: Any, fmt: FixedFormat) -> list[list[int]]:
    scaled = np.asarray(z, dtype=np.float64) / 2.0 ** given.measurement.astype(float)
    counts = np.floor(scaled / float(fmt.unit) + 0.5)
    low, high = float(fmt.lowest / fmt.unit), float(fmt.largest / fmt.unit)
    return [[int(each) for each in row] for row in np.clip(counts, low, high)]


def _largest(given: ScaledFilter, z: Any) -> float:
    """Return the largest intermediate value of the unrounded filter."""
    program = given.filter.program
    coefficients = given.filter.coefficients.astype(np.float64)
    state, largest = [0.0] * program.n, 0.0
    scaled = np.asarray(z, dtype=np.float64) / 2.0 ** given.measurement.astype(float)
    operations = program.operations.tolist()
    for row in scaled.tolist():
        values = [*state, *row]
        for code, a, b in operations:
            if code == MULTIPLY:
                values.append(coefficients[a] * values[b])
            else:
                values.append(values[a] - values[b] if code == SUBTRACT else values[a] + values[b])
        state = [values[i] for i in program.outputs]
        largest = max(largest, max(map(abs, values)))
    return largest


def _integer_step(
    program: Program, coefficients: NDArray[Any], fmt: FixedFormat, wide: bool
) -> Callable[[list[int], list[int]], list[int]]:
    """Return one step on integers, multiples of the unit; if `wide`, sums are exact and rounded once when used."""
    pairs = [(c.numerator, c.denominator.bit_length() - 1) for c in coefficients]
    extra = max((shift for _, shift in pairs), default=0) if wide else 0
    low, high = (int(each / fmt.unit) for each in (fmt.lowest, fmt.largest))
    operations = program.operations.tolist()
    used = _factors(program)

    def stored(n: int, shift: int, operation: int) -> int:
        m = _shifted(n, shift, fmt.rounding)
        if low <= m <= high:
            return m
        if fmt.overflow == "saturate":
            return high if m > 0 else low
        if fmt.overflow == "wrap":
            return (m - low) % (high - low + 1) + low
        kind = "a product" if operations[operation][0] == MULTIPLY else "a sum"
        raise OverflowError(f"{kind}, operation {operation + 1} of {len(operations)},")

    def take(state: list[int], row: list[int]) -> list[int]:
        # With a long accumulator, values have `extra` more bits until they are used as a factor or as a state.
        values = [n << extra for n in (*state, *row)]
        for o, (code, a, b) in enumerate(operations):
            if code == MULTIPLY:
                n, shift = pairs[a]
                exactly = n * (values[b] >> extra)
                found = exactly << (extra - shift) if wide else stored(exactly, shift, o)
            else:
                found = values[a] - values[b] if code == SUBTRACT else values[a] + values[b]
                if not wide:
                    found = stored(found, 0, o)
            if wide and o in used:
                found = stored(found, extra, o) << extra
            values.append(found)
        return [values[i] >> extra for i in program.outputs]

    return take


def _factors(program: Program) -> frozenset[int]:
    """List the operations whose result becomes a state or a factor, which a long accumulator must store."""
    first = program.n + program.m
    found = {int(b) - first for code, _, b in program.operations if code == MULTIPLY and b >= first}
    return frozenset(found | {int(o) - first for o in program.outputs if o >= first})


def _shifted(n: int, shift: int, rounding: Rounding) -> int:
    """Return ``n / 2**shift``, rounded."""
    if shift <= 0:
        return n << -shift
    m = n >> shift
    rest, unit = n - (m << shift), 1 << shift
    if rest == 0 or rounding is Rounding.DOWN:
        return m
    if rounding is Rounding.NEAREST:
        return m + (2 * rest > unit or (2 * rest == unit and n > 0))
    if rounding is Rounding.EVEN:
        return m + (2 * rest > unit or (2 * rest == unit and m % 2 == 1))
    if rounding is Rounding.ODD:
        return m | 1
    return m + (rounding is Rounding.UP or n < 0)


def _state_space(program: Program, coefficients: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the exact A and B of a step."""
    n, m = program.n, program.m
    rows = [np.array([Fraction(int(i == j)) for j in range(n + m)], dtype=object) for i in range(n + m)]
    for code, a, b in program.operations.tolist():
        if code == MULTIPLY:
            rows.append(coefficients[a] * rows[b])
        else:
            rows.append(rows[a] - rows[b] if code == SUBTRACT else rows[a] + rows[b])
    whole = np.array([rows[i] for i in program.outputs], dtype=object)
    return whole[:, :n], whole[:, n:]


def _peak_sums(A: NDArray[Any], G: NDArray[Any]) -> NDArray[np.float64]:
    """Return upper bounds (n,) of the sums over l and o of ``abs(A**l G)``; enclosures omit zeros."""
    n = len(A)
    identity, sums = exact(np.eye(n, dtype=int)), np.zeros(n)
    reached = (np.linalg.matrix_power((A != 0) + np.eye(n), n) @ (G != 0)) > 0
    for pattern in {tuple(row) for row in reached.tolist() if any(row)}:
        rows, columns = (reached == pattern).all(axis=1), np.array(pattern)
        sums[rows] = peak_gain(A, G[:, columns], identity[rows]).high.sum(axis=1)
    return sums * (1 + 2.0**-40)


def _effects(program: Program, coefficients: NDArray[Any], wide: bool) -> NDArray[Any]:
    """Return the effect of each rounding error on the states after the step, (n, roundings)."""
    n, first = program.n, program.n + program.m
    count = first + len(program.operations)
    effects = [[Fraction(0)] * n for _ in range(count)]
    for i, o in enumerate(program.outputs.tolist()):
        effects[o][i] += 1
    for o in range(len(program.operations) - 1, -1, -1):
        code, a, b = program.operations[o].tolist()
        g = effects[first + o]
        for i in range(n):
            if code == MULTIPLY:
                effects[b][i] += coefficients[a] * g[i]
            else:
                effects[a][i] += g[i]
                effects[b][i] += -g[i] if code == SUBTRACT else g[i]
    columns = [effects[first + o] for o in _rounding(program, coefficients, wide) if any(effects[first + o])]
    return np.array(columns, dtype=object).reshape(-1, n).T


def _rounding(program: Program, coefficients: NDArray[Any], wide: bool) -> list[int]:
    """List the operations whose stored results are rounded because they are not multiples of the unit."""
    first, used = program.n + program.m, _factors(program)
    whole, found = [True] * first, list[int]()
    for o, (code, a, b) in enumerate(program.operations.tolist()):
        exactly = whole[b] and (coefficients[a].denominator == 1 if code == MULTIPLY else whole[a])
        if not exactly and (not wide or o in used):
            found.append(o)
            exactly = True
        whole.append(exactly)
    return found
