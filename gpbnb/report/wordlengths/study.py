"""Measure what determines a wordlength: the number of steps, the range of the numbers, losses in additions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic, digits
from gpbnb.arithmetic.rational import column_sum_norm, exact, rationals, true_inverse
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.inverse import check_relative, smallest_precision
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.contraction import companion_bound
from gpbnb.filters.emulation import compare_runs
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, log_spaced, reference
from gpbnb.report.display.tables import Table, short
from gpbnb.report.examples import NORMAL_RANGE
from gpbnb.report.integration.precision import best_rate, needed_precision, stall_rate
from gpbnb.report.kalman import report_bounds

Curve = Sequence[tuple[int, float]]
"""Steps, and a number at each."""


class UpdateStagnation(NamedTuple):
    """Effect of few digits on one state, whose updates may round to nothing.

    Parameters
    ----------
    variance : last computed variance of the state / true variance.
    unchanged : share of the last steps in which the estimate did not change at all.
    error : largest error of the first state, in its unit.
    """

    fmt: FloatFormat
    variance: float
    unchanged: float
    error: float


def variances(
    model: LinearModel,
    fmt: FloatFormat | BlockFormats,
    state: int,
    steps: int,
    form: Form | str = Form.INNOVATION,
) -> tuple[Curve, int | None]:
    """Run the covariance of a filter, and follow the variance of a state.

    Returns
    -------
    curve : step and computed variance of the state, at a hundred steps.
    indefinite : the first step at which a computed variance was not positive, if any.
    """
    every = max(steps // 100, 1)
    run = Run(model, fmt, form, range(every, steps + 1, every))
    run.take(np.zeros((steps, model.m)))
    found = run.checkpoints()
    return [(k, float(P[state, state])) for k, P in zip(found.steps, found.P, strict=True)], run.indefinite


def update_stagnation(
    model: LinearModel,
    z: NDArray[Any],
    state: int,
    formats: Sequence[FloatFormat],
    last: int = 200,
) -> tuple[UpdateStagnation, ...]:
    """Measure how much the updates of a slow state stagnate in several formats.

    Errors are defined as in :func:`gpbnb.survey_records`.

    Parameters
    ----------
    state : index of the state.
    last : number of steps at the end that are examined one by one.
    """
    _check_state(model, state)
    if not 0 < last < len(z):
        raise ValueError(f"got {last} steps to watch of {len(z)}; needed at least 1, and at most all but one")
    checkpoint_steps = tuple(sorted({*log_spaced(len(z), 16), *range(max(len(z) - last, 1), len(z) + 1)}))
    true, found = reference(model, z, checkpoint_steps), []
    for fmt in formats:
        run = Run(model, fmt, Form.INNOVATION, checkpoint_steps)
        run.take(fmt.array(z))
        history, checkpoints = compare_runs(run, true), run.checkpoints()
        variance = float(checkpoints.P[-1, state, state] / true.P[len(checkpoints.P) - 1, state, state])
        unchanged = sum(a == b for a, b in pairwise(checkpoints.x[-last - 1 :, state])) / last
        found.append(UpdateStagnation(fmt, variance, unchanged, float(np.abs(history.state[:, 0]).max())))
    return tuple(found)


def stagnation_table(found: Sequence[UpdateStagnation], tolerance: float) -> Table:
    """Tabulate the effect of few digits on a state that hardly changes."""
    body = tuple(
        (arithmetic(each.fmt), short(each.variance, 3), f"{100 * each.unchanged:.0f} %", short(each.error / tolerance))
        for each in found
    )
    header = ("arithmetic", "variance, computed / true", "steps without a change", "error / tolerance")
    return Table(f"{len(body)} formats", header, body)


def _check_state(model: LinearModel, state: int) -> None:
    if state not in range(model.n):
        raise ValueError(f"got state {state!r}; needed an index from 0 to {model.n - 1}")


def companion_run(
    model: LinearModel, z: NDArray[Any], fmt: FloatFormat, form: Form = Form.INNOVATION
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bound a run by its distance from a companion run in double-double plus the bound of the companion.

    Both use the model and the measurements as the format stores them.

    Returns
    -------
    error, bound : (n,), largest value for each state at the steps of :func:`gpbnb.filters.run.log_spaced`.
    """
    stored, measured, checkpoint_steps = model.rounded(fmt), fmt.array(z), log_spaced(len(z), 16)
    run = Run(model, fmt, form, checkpoint_steps)
    companion = Run(stored, None, Form.INNOVATION, checkpoint_steps, bounded=True)
    run.take(measured)
    companion.take(measured.to_fractions())
    history = compare_runs(run, companion.checkpoints())
    bound = companion_bound(history.state, companion.bounds.state[: len(history.steps)])
    return np.abs(history.state).max(axis=0), bound.max(axis=0)


class InversePrecision(NamedTuple):
    """Bits that the inverse of a matrix needs, and the bits that its condition number suggests."""

    name: str
    condition: float
    scaled: float
    expected: int
    needed: int


def inverse_precision(name: str, matrix: NDArray[Any], tolerance: float) -> InversePrecision:
    r"""Return bits by the rule of thumb :math:`\beta\,\kappa_1(DAD)\le` tolerance, and the bits that are needed.

    D scales by powers of two to a diagonal near 1, as a choice of units would. Elimination makes the same rounding
    errors with and without D. :func:`gpbnb.bounds.inverse.smallest_precision` finds the other number.

    Parameters
    ----------
    matrix : (n, n), exact, symmetric positive definite.
    tolerance : largest error of the inverse, relative to it in norm; above 0.
    """
    matrix = exact(matrix)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise ValueError(f"{name}: got shape {matrix.shape}; needed a square matrix (n, n) with n at least 1")
    check_relative(tolerance)
    try:
        inverse = true_inverse(matrix)
    except np.linalg.LinAlgError as error:
        raise np.linalg.LinAlgError(f"{name}: {error}") from None
    for i, j in np.argwhere(matrix != matrix.T)[:1]:
        raise ValueError(
            f"{name}: got {matrix[i, j]} at [{i}, {j}] and {matrix[j, i]} at [{j}, {i}]; needed a symmetric matrix"
        )
    for (i,) in np.argwhere(matrix.diagonal() <= 0)[:1]:
        raise ValueError(f"{name}: got {matrix[i, i]} at [{i}, {i}]; needed a positive diagonal")
    scale = [Fraction(2) ** -round(math.log2(d) / 2) for d in matrix.diagonal()]
    scaled = matrix * np.multiply.outer(np.array(scale, dtype=object), np.array(scale, dtype=object))
    pairs = ((matrix, inverse), (scaled, true_inverse(scaled)))
    conditions = [column_sum_norm(rationals(a)) * column_sum_norm(b) for a, b in pairs]
    expected = report_bounds.precision_for_coefficient(conditions[1], Fraction(tolerance), 2)
    needed = smallest_precision(matrix, tolerance, 2).fmt.precision
    return InversePrecision(name, float(conditions[0]), float(conditions[1]), expected, needed)


def inverses_table(found: Sequence[InversePrecision]) -> Table:
    """Tabulate the bits that inverses need, by the rule of thumb and in fact."""
    body = tuple(
        (each.name, short(each.condition), short(each.scaled), str(each.expected), str(each.needed)) for each in found
    )
    header = ("matrix", "condition $\\kappa_1$", "$\\kappa_1$, scaled", "bits, rule of thumb", "bits needed")
    return Table(f"{len(body)} inverses", header, body)


class BinaryRange(NamedTuple):
    """Powers of two between which the magnitudes of nonzero numbers lie."""

    name: str
    least: int
    largest: int


def binary_ranges(model: LinearModel, z: NDArray[Any]) -> tuple[BinaryRange, ...]:
    """Return the ranges of a model, and of its estimates, gains and covariances at sixteen steps per decade.

    Numbers that are all zero have no range.
    """
    checkpoints = reference(model, z, log_spaced(len(z), 16))
    given = np.concatenate([getattr(model, letter).ravel() for letter in ("Phi", "H", "Q", "R", "P0")])
    numbers = {"model": given, "estimate": checkpoints.x, "gain": checkpoints.K, "covariance": checkpoints.P}
    result = []
    for name, values in numbers.items():
        powers = [math.frexp(abs(float(value)))[1] - 1 for value in values.ravel() if value]
        if powers:
            result.append(BinaryRange(name, min(powers), max(powers)))
    return tuple(result)


def ranges_table(found: Sequence[BinaryRange]) -> Table:
    """Tabulate the ranges of a filter's numbers, and the standard formats in which they are normal."""
    body = []
    for each in found:
        suitable = [name for name, (low, high) in NORMAL_RANGE.items() if low <= each.least and each.largest <= high]
        body.append((each.name, f"$2^{{{each.least}}}$", f"$2^{{{each.largest}}}$", ", ".join(suitable) or "none"))
    return Table(f"{len(body)} kinds of numbers", ("numbers", "smallest", "largest", "normal in"), tuple(body))


def integrator_table(omega_bw: float, f_c: float, durations: Mapping[str, float], fmt: FloatFormat) -> Table:
    """Tabulate bits at which rounding is a tenth of the discretization error, and the rates that a format allows."""
    body = []
    for name, duration in durations.items():
        needed = [needed_precision(omega_bw, f_c, duration, 2, rounding) for rounding in Rounding.documented()]
        rates = best_rate(omega_bw, duration, fmt), stall_rate(omega_bw, duration, fmt)
        body.append((name, *map(str, needed), *(f"{rate:,.3g}" for rate in rates)))
    kind = digits(fmt)
    header = ("duration", "bits, rounded", "bits, chopped", f"best rate with {kind}, Hz", "increments vanish at, Hz")
    return Table(f"{len(body)} durations", header, tuple(body))
