"""Stochastic rounding of a filter."""

from __future__ import annotations

import numpy as np

from gpbnb import FloatFormat, LinearModel
from gpbnb.arithmetic.kernels import tags
from gpbnb.filters.run import Run, Sums


def test_no_random_number_is_drawn_twice_in_a_run():
    """Factors, gain and estimate draw from one sequence; shared numbers would correlate their roundings."""
    tracker = LinearModel(
        [["1", "0.1"], ["0", "0.9"]], np.eye(2), [["0.3", 0], [0, "0.2"]], [["0.7", "0.3"], ["0.3", "1.1"]], [0, 0],
        [["0.6", "0.1"], ["0.1", "0.6"]],
    )  # fmt: skip
    run = Run(tracker, FloatFormat(2, 9, "stochastic"), "UD", ())
    state = tags.random_state(run.tag)
    opened = int(state[1])
    assert opened > 2**63  # arrays draw the first half
    run.take(np.full((20, 2), 0.3))
    once = int(state[1])
    run.take(np.full((20, 2), 0.7))
    assert int(state[1]) - once == once - opened > 0


def test_random_sums_are_drawn_step_by_step():
    """No covariance is taken for a repeated one, and steps taken at once have the digits of steps taken alone."""
    model = LinearModel([["0.9"]], [[1]], [["0.01"]], [[1]], [0], [[1]])
    z = np.ones((100, 1))
    sums = Sums(fmt=FloatFormat(2, 12, "stochastic"))
    together, alone = (Run(model, FloatFormat(2, 12), "innovation", range(1, 101), sums) for _ in range(2))
    together.take(z)
    for k in range(len(z)):
        alone.take(z[k : k + 1])
    assert len(np.unique(together.C[50:])) > 2
    for one, other in ((together.X, alone.X), (together.C, alone.C)):
        assert (one == other).all()
