"""Measure what determines a wordlength: the number of steps, the range of the numbers, losses in additions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, rationals, true_inverse
from gpbnb.bounds.inverse import check_relative, smallest_precision
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.contraction import companion_bound
from gpbnb.filters.emulation import compare_runs
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, log_spaced, reference
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
