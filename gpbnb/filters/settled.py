"""A Kalman filter with a constant gain, as a linear system whose inputs are the measurements."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.forms import CONSTANT_GAIN, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.program import innovation_program
from gpbnb.filters.run import Run
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.system import LinearSystem

SETTLED = 2.0**-64
"""Largest change of a gain in a step, relative to its largest entry, that counts as settled."""

LONGEST = 100_000
"""Steps after which a gain that still changes counts as not settling."""


def settled_gain(model: LinearModel) -> NDArray[Any]:
    """Return the gain that a filter approaches, (n, m), exact, from a run in double-double."""
    if model.cycle != 1:
        raise ValueError(f"got {model.name}, which changes from step to step; needed a model that never changes")
    model.refuse_inputs("a filter with constant gain")
    run = Run(model, None, Form.INNOVATION, ())
    run.x[:] = 0.0  # an estimate that decays without measurements leaves the range of float64
    zeros, before = np.zeros((1_000, model.m)), np.zeros((model.n, model.m))
    low = np.zeros_like(before)
    for _ in range(LONGEST // len(zeros)):
        K = np.concatenate([found.K for found in run.blocks(zeros)])
        if run.stopped:
            break
        for high, rest in zip(K[..., 0], K[..., 1], strict=True):
            if np.abs((high - before) + (rest - low)).max() <= SETTLED * np.abs(high).max():
                exactly = [Fraction(a) + Fraction(b) for a, b in zip(high.flat, rest.flat, strict=True)]
                return np.array(exactly, dtype=object).reshape(high.shape)
            before, low = high, rest
    raise ValueError(
        f"got {model.name}, whose gain does not settle within {LONGEST} steps; needed a gain that settles, or a form "
        "that computes its covariance"
    )


def settled_filter(model: LinearModel) -> LinearSystem:
    """Return the innovation form of a filter with the gain that it approaches; inputs are the measurements.

    The outputs are the estimates.
    """
    given = np.concatenate([each.ravel() for each in (model.Phi[0], model.H[0], settled_gain(model))])
    made = LinearFilter(innovation_program(model.n, model.m, model.n), given, f"{model.name}, {CONSTANT_GAIN}")
    return replace(
        LinearSystem.from_filter(made, model.x0),
        state_names=model.state_names,
        input_names=model.measurement_names,
        output_names=model.state_names,
    )
