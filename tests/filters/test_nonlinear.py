"""gpbnb.filters.nonlinear: runs against plain loops over fractions, digit for digit."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import (
    FloatFormat,
    Form,
    LinearModel,
    NonlinearModel,
)
from gpbnb.filters.nonlinear_run import NonlinearRun, nonlinear_reference, simulated, true_states
from tests.step_functions import tracked_motion, tracked_sight

# -- linear functions -------------------------------------------------------------------------------------------------

PHI, SEEN = [["1", "0.1"], ["-0.1", "0.9"]], [["1", "0.3"], ["0.2", "1"]]
NOISE = {"Q": [[0, 0], [0, "0.01"]], "R": [["0.5", "0.1"], ["0.1", 1]], "x0": [0, 1], "P0": [[1, 0], [0, 1]]}
RECORD = np.random.default_rng(0).standard_normal((60, 2))


def linear():
    return LinearModel(PHI, SEEN, **NOISE)


def by_functions(**options):
    def f(x):
        return x.format.array(PHI) @ x

    def h(x):
        return x.format.array(SEEN) @ x

    return NonlinearModel(f, None, h, None, **NOISE, **options)


def test_the_reference_is_that_of_the_linear_filter():
    difference = (true_states(by_functions(), RECORD) - true_states(linear(), RECORD)).sum(axis=2)
    assert np.abs(difference).max() < 1e-28  # double-double, with 32 digits


def test_the_reference_agrees_with_one_in_more_digits():
    """The same program in 1200 bits, read as fractions: a tenth of the digits are enough to agree to 2**-104."""
    noises = (np.diag([0, 0, 2.0**-10, 2.0**-10]), [["1e-4", 0], [0, "1e-8"]])
    start = ([-2000, 600, 0, -30], np.diag([10**6, 10**6, 100, 100]))
    model = NonlinearModel(tracked_motion, None, tracked_sight, None, *noises, *start, angles=[1])
    z = simulated(model, 8, seed=3)
    run = NonlinearRun(model, FloatFormat(2, 1200), Form.INNOVATION, [8])
    run.take(z[:8])
    found = nonlinear_reference(model, z[:8]).x[-1].to_fractions()
    assert max(abs(a - b) for a, b in zip(run.checkpoints().x[0], found, strict=True)) < Fraction(1, 2**200)


# -- angles, missing measurements, normalization ----------------------------------------------------------------------


def heading(**options):
    def same(x):
        return x

    return NonlinearModel(same, None, same, None, [[0]], [["0.01"]], ["3.1"], [["0.01"]], **options)


def test_an_angle_wraps_across_pi():
    z = [["-3.1"], ["-3.14"], ["3.1"]]
    values = [
        NonlinearRun(heading(**options), FloatFormat(2, 24)).states(z)[0, 0, 0] for options in ({}, {"angles": [0]})
    ]
    # half of the way from 3.1 to -3.1, directly and across pi; binary32 has 7 digits
    assert values == pytest.approx([0, 3.1 + (np.pi - 3.1)], abs=1e-6)
    wrapped = heading(residual=lambda z, y: (z - y + 3) % z.format.array("6.25") - 3)
    assert NonlinearRun(wrapped, FloatFormat(2, 24)).states(z)[0, 0, 0] == pytest.approx(3.125, abs=1e-6)


# -- questions --------------------------------------------------------------------------------------------------------
