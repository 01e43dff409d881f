r"""Kalman filters with a constant gain in fixed point, in units that are powers of two.

A signal processor computes with integers. Sums are exact. Only products are rounded, or sums when they are stored, each
to a multiple of one unit, whatever its size; see :mod:`gpbnb.filters.words`. So the error has a bound that needs no
limit on the measurements; see :mod:`gpbnb.bounds.words`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.arithmetic.search import Outcome, Search
from gpbnb.bounds.words import bounded_rounding, largest_rounding
from gpbnb.filters.model import LinearModel
from gpbnb.filters.program import innovation_program, matrices
from gpbnb.filters.run import log_spaced, reference
from gpbnb.filters.system import LinearFilter
from gpbnb.filters.words import WordFormats, integer_program, integers_of, largest_values, run_integers
from gpbnb.wordlength.answer import Basis, Requirement, evidence, joined, share_text
from gpbnb.wordlength.fixed import COEFFICIENT_BITS, LARGEST_FRACTION, bits_for, exact_sums
from gpbnb.wordlength.strategy import largest_ratio, tolerances_of


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


def constant_gain(model: LinearModel, z: Any, margin: float = 2.0) -> ScaledFilter:
    """Return the filter in its steady state, scaled by the ranges that occur in a reference run.

    The gain is that of the last step. In the scaled units, states and measurements times the margin stay
    below 1.

    Parameters
    ----------
    model : a model with constant matrices.
    z : (steps, m), typical measurements.
    margin : factor by which later numbers may exceed those of this run.
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


def integer_bits(given: ScaledFilter, z: Any) -> int:
    """Return the number of integer bits that all intermediate values of a run need, as advice for scaling."""
    scaled = np.asarray(z, dtype=np.float64) / 2.0 ** given.measurement.astype(float)
    return bits_for(float(largest_values(given.filter, scaled).max()))


def emulated(
    given: ScaledFilter, z: Any, fmt: FixedFormat, coefficient_bits: int = COEFFICIENT_BITS, wide: bool = False
) -> NDArray[np.float64]:
    """Return the error of each state after each step, (steps, n), in the units of the model, due to rounding.

    Parameters
    ----------
    z : (steps, m), measurements in the units of the model; the converter rounds them into the format for both filters.
    coefficient_bits : significant bits of each coefficient; each coefficient has its own binary point.
    wide : whether sums of products are kept exactly in a long accumulator and rounded once.
    """
    made = integer_program(given.filter, _words(given.filter, fmt, coefficient_bits, wide))
    program, unit = given.filter.program, float(fmt.unit)
    scaled = np.asarray(z, dtype=np.float64) / 2.0 ** given.measurement.astype(float)
    seen = integers_of(scaled, replace(fmt, rounding=Rounding.NEAREST, overflow="saturate"))
    states = run_integers(made, seen, np.zeros(program.n, np.int64)).astype(np.float64) * unit
    A, B = (each.astype(np.float64) for each in matrices(program, made.coefficients))
    true, errors = np.zeros(program.n), np.empty(states.shape)
    for k, row in enumerate(seen.astype(np.float64) * unit):
        true = A @ true + B @ row
        errors[k] = states[k] - true
    return errors * 2.0 ** given.state.astype(float)


def bound_per_unit(
    given: ScaledFilter, coefficient_bits: int = COEFFICIENT_BITS, wide: bool = False
) -> NDArray[np.float64]:
    """Bound the error of each state, (n,), in the units of the model, for ever, if no rounding errs by more than one.

    The bound is proportional to the largest error of a rounding. It holds for all measurements, as long as nothing
    overflows. For the parameters, see :func:`emulated`.
    """
    ones = FixedFormat(1, 0, Rounding.DOWN)
    found = bounded_rounding(given.filter, _words(given.filter, ones, coefficient_bits, wide))
    return np.asarray(found * 2.0 ** given.state.astype(float))


def required_bits(
    given: ScaledFilter, z: Any, tolerance: Any, basis: Basis = "emulation", rounding: Rounding = Rounding.NEAREST
) -> Requirement:
    """Find the fewest fraction bits with which errors of rounding the states stay within a tolerance.

    Parameters
    ----------
    z : (steps, m), measurements.
    tolerance : largest acceptable error of each state in its unit; infinite if its accuracy does not matter.
    basis : "emulation" of these measurements; or "guarantee", for all measurements that do not overflow.
    """
    goal, like = (
        tolerances_of(tolerance, given.filter.program.n, "states"),
        FixedFormat(integer_bits(given, z), LARGEST_FRACTION, rounding),
    )
    bound = bound_per_unit(given) if basis == "guarantee" else None

    def error(fmt: FixedFormat) -> Outcome:
        if bound is not None:
            return Outcome(largest_ratio(bound * (float(fmt.unit) * largest_rounding(rounding)), goal))
        try:
            return Outcome(largest_ratio(abs(emulated(given, z, fmt)).max(axis=0), goal))
        except OverflowError as fault:
            return Outcome(math.inf, str(fault), True)

    found = Search(error, like, (), largest=LARGEST_FRACTION - 1, least=max(0, 1 - like.integer_bits))
    if found.fmt is None:
        raise ArithmeticError(
            f"got {given.filter.name}, and no format that meets {tolerance}; needed a larger tolerance"
        )
    bits, ratios = found.fmt.fraction_bits, dict(found.tried)
    known, _ = evidence(basis, len(z))
    below = f"{digits_text(bits - 1, kind='fraction')} give {ratios[bits - 1]:.3g} times the tolerance"
    subject = f"{digits_text(bits, kind='fraction')} in a word of {1 + found.fmt.precision} bits"
    text = joined(f"{subject}: {share_text(ratios[bits])}, {known}", [below])
    steps = len(z) if basis == "emulation" else None
    return Requirement(found.fmt, ratios[bits], basis, steps, found.tried, text, below)


def _words(made: LinearFilter, fmt: FixedFormat, coefficient_bits: int, wide: bool) -> WordFormats:
    """Return formats for coefficients with a binary point each, and with `wide` for sums without roundings."""
    return exact_sums(made, fmt, coefficient_bits) if wide else WordFormats(fmt, coefficient_bits)


def _exponents(sizes: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the smallest k with size < 2**k for each size; 0 for zero."""
    return np.where(sizes > 0, np.frexp(sizes)[1], 0).astype(np.int64)
