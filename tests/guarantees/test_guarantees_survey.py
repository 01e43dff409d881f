"""The survey of guarantees: rows that come out again, and published filters."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.rational import exact
from gpbnb.report.guarantees import survey
from gpbnb.report.guarantees.published import dynamax_tracking, filterpy_fusion, px4_landing_target


@pytest.mark.parametrize("seed", [8, 9, 26, 27])
def test_a_row_comes_out_again(seed: int) -> None:
    (row,) = (row for row in survey.load() if row.seed == seed)
    assert survey.compute(seed) == row


def test_the_noises_of_dynamax_s_tracking_are_independent() -> None:
    """Its notebook has Q = 0.001 I and an initial covariance of 0.1 I."""
    model, unit = dynamax_tracking(), np.eye(4, dtype=int)
    assert (model.Q[0] == exact(unit) / 1000).all()
    assert (exact(unit) / 10 == model.P0).all()
    assert (model.R[0] == exact(np.eye(2, dtype=int))).all()


def test_noises_of_filterpy_and_px4_are_those_of_their_time_steps() -> None:
    """filterpy: white noise of an intensity of 0.02, R = 2². PX4: an acceleration of variance 10 that lasts a step."""
    model, dt = filterpy_fusion(), Fraction(1, 10)
    assert (model.Q[0] == Fraction(1, 50) * exact([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])).all()
    assert (model.R[0, 0, 0], model.Phi[0, 0, 1]) == (2**2, dt)
    model, dt = px4_landing_target(), Fraction(1, 50)
    assert (model.Q[0] == 10 * exact([[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]])).all()
    assert (model.R[0, 0, 0], model.Phi[0, 0, 1]) == (Fraction(5, 1000), dt)
