"""Long runs whose covariance comes back, wide models, and the processor's own arithmetic: the same digits."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, BINARY64
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run

STEPS = 400


def model(n, seed, repeated=False):
    rng = np.random.default_rng([n, seed])
    Phi = np.eye(n) + 0.1 / np.sqrt(n) * rng.standard_normal((n, n))
    Phi /= 1.3 * abs(np.linalg.eigvals(Phi)).max()
    H, A = rng.standard_normal((2, n)), rng.standard_normal((n, n))
    if repeated:
        Phi, H = np.stack([Phi, Phi / 2]), np.stack([H, 2 * H, -H])
    P0 = A @ A.T / n + np.eye(n)
    return LinearModel(
        Phi=Phi, H=H, Q=0.01 * np.eye(n) + 1e-3, R=[[1, 0.1], [0.1, 1]], x0=rng.standard_normal(n), P0=(P0 + P0.T) / 2
    )


def measurements(steps):
    return np.random.default_rng(8).standard_normal((steps, 2))


def step_by_step(given, fmt, form, z, compensated=False):
    """The same run, each step by a call of its own, which cannot know that a covariance came back."""
    run = Run(given, fmt, form, range(1, len(z) + 1), compensated=compensated)
    packed = run.pack_measurements(z if fmt is None else fmt.array(z))
    for each in packed:
        assert sum(len(found.x) for found in run.advance(each[None])) == 1
    return run


@pytest.mark.parametrize("repeated", [False, True])
@pytest.mark.parametrize(
    ("fmt", "form", "compensated"),
    [
        (None, Form.INNOVATION, False),
        (BINARY32, Form.INNOVATION, False),
        (BINARY32, Form.INNOVATION, True),
        (BINARY64, Form.HUNG, False),
        (FloatFormat(2, 12), Form.JOSEPH, True),
        (FloatFormat(10, 5), Form.INNOVATION, False),
        (FloatFormat(2, 12, "stochastic"), Form.INNOVATION, False),
    ],
)
def test_a_covariance_that_comes_back_changes_no_digit(fmt, form, compensated, repeated):
    given, z = model(3, 1, repeated), measurements(STEPS)
    expected = step_by_step(given, fmt, form, z, compensated)
    run = Run(given, fmt, form, range(1, STEPS + 1), compensated=compensated)
    run.take(z if fmt is None else fmt.array(z))
    for name in ("x", "P", "X", "G", "C", "steps", "saved", "indefinite"):
        found, each = getattr(run, name), getattr(expected, name)
        assert np.array_equal(found, each)
    if form is not Form.HUNG and (fmt is None or fmt.rounding.value != "stochastic"):
        # the covariance does come back within the run
        cycle = given.cycle
        assert any(np.array_equal(run.C[-1], earlier) for earlier in run.C[-1 - cycle : 0 : -cycle][:300])
