"""The contraction bound over steps that a run has taken."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.tags import DoubleDouble
from gpbnb.filters.contraction import (
    Contraction,
    contraction_step,
    covariance_error_bound,
    evaluation_errors,
    gain_error_bound,
    state_error_bound,
)
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.bounded import residuals, symmetric_parts, whole_gain
from gpbnb.filters.kernels.step import NEXT_CHECKPOINT, advance

Array = NDArray[np.float64]

_UNIT = 2.0**-100  # of double-double


def advance_bound(
    form: Form,
    exact_model: tuple[NDArray[Any], ...],
    plain: tuple[Array, ...],
    z: Array,
    first: int,
    x: Array,
    P: Array,
    gains: Array,
    UR: Array,
    bound: Contraction,
    checkpoint_steps: NDArray[np.int64],
    at: int,
    bounds: tuple[Array, Array, Array],
) -> Contraction:
    """Take the contraction bound over steps that a run has taken; returns it, and saves it at checkpoint steps.

    Each step is repeated in double-double from where the run stood: its residuals enter the bound.

    Parameters
    ----------
    form : the form of the run.
    exact_model, plain : the stored model in double-double, as ``Run.matrices``, and Phi, H, Q, R in float64.
    z : (steps, m, 1, 2), the measurements.
    first : how many steps were taken before these.
    x, P : (steps + 1, n, 1, 2) and (steps + 1, n, n, 2), states and covariances, or factors, before and after each.
    gains : (steps, n, m, 2), as the run computed them.
    UR : (k, m, m, 2), the factors of R as the run computed them.
    bound : before the first of these steps.
    checkpoint_steps, at : all steps to be saved, and which of them is next.
    bounds : of state (c, n), gain (c, n, m) and covariance (c, n, n), written at the checkpoint steps.

    Raises
    ------
    OverflowError : a step cannot be repeated; what was saved of the steps before it holds.
    """
    covariances = np.empty_like(P)
    symmetric_parts(int(form), P, covariances)
    xe, Ke, Pe, Se = _repeated(exact_model, z, first, x, covariances)
    steps, n, m = len(xe), x.shape[1], z.shape[1]
    y, q, T = np.empty((steps, m)), np.empty((steps, n)), np.empty((steps, n, n))
    after = x[: steps + 1], covariances[: steps + 1]
    residuals(exact_model, z[:steps], first, *after, (xe, Pe), (y, q, T))
    before, measured, K, S, size = (
        np.ascontiguousarray(each) for each in (x[..., 0, 0], z[..., 0, 0], Ke[..., 0], Se[..., 0], covariances[..., 0])
    )
    if form == Form.UD:
        diagonal = np.diagonal(size, axis1=1, axis2=2)
        size = np.sqrt(np.abs(diagonal[:, :, np.newaxis] * diagonal[:, np.newaxis, :])) * (1 + 2.0**-50)
    bounds_x, bounds_K, bounds_P = bounds
    for i, k in enumerate(range(first, first + steps)):
        phi, h, Q, R = (each[k % len(each)] for each in plain)
        dq, dT, dK, dy = evaluation_errors(phi, h, Q, R, before[i], size[i], measured[i], K[i], S[i], _UNIT)
        bound = contraction_step(bound, phi, h, Q, R, K[i], S[i], y[i], q[i], T[i], dq, dT, dK, dy)
        if at < len(checkpoint_steps) and checkpoint_steps[at] == k + 1:
            used = np.empty_like(gains[i])
            whole_gain(int(form), gains[i], exact_model[2][k % len(exact_model[2])], UR[k % len(UR)], used)
            bounds_x[at], bounds_P[at] = state_error_bound(bound), covariance_error_bound(bound)
            bounds_K[at] = gain_error_bound(bound, K[i], np.ascontiguousarray(used[..., 0]), dK)
            at += 1
    if steps < len(z):
        raise OverflowError(f"got a step {first + steps + 1} beyond double-double; needed one within it")
    return bound


def _repeated(exact_model: tuple[NDArray[Any], ...], z: Array, first: int, x: Array, P: Array) -> tuple[Any, ...]:
    """Estimates, gains, covariances and innovation covariances of steps repeated in double-double, as far as that goes.

    Each step begins where the run stood.
    """
    steps, n, m = len(z), x.shape[1], z.shape[1]
    after = np.empty((steps, n, 1, 2)), np.empty((steps, n, m, 2)), np.empty((steps, n, n, 2))
    S, notes, every = np.empty((steps, m, m, 2)), np.zeros(4, dtype=np.int64), np.arange(1, steps + 1) + first
    tag, form = DoubleDouble(), int(Form.INNOVATION)
    with contextlib.suppress(OverflowError, ZeroDivisionError):
        repeated, kept = (x[:-1], P[:-1], S), (every, *after)
        advance(tag, form, exact_model, z, first, x[0].copy(), P[0].copy(), repeated, kept, notes)
    done = int(notes[NEXT_CHECKPOINT])
    return tuple(each[:done] for each in (*after, S))
