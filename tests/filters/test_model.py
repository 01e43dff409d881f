"""gpbnb.filters.model: how entries are read, and the model of Gravity Probe B against its geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.report.gravity_probe_b.model import STATES, YEAR, gravity_probe_b

GOOD = {
    "Phi": [["0.9", "0.1"], [0, "0.8"]],
    "H": [[1, 0]],
    "Q": [["0.01", 0], [0, "0.02"]],
    "R": [["0.5"]],
    "x0": [1, 2],
    "P0": [[1, "0.5"], ["0.5", 1]],
}


def test_the_gp_b_model_has_the_periods_of_roll_and_orbit():
    assert YEAR == 365 * 24 * 3600 // 10
    model = gravity_probe_b()
    assert (model.n, model.m, model.cycle) == (10, 2, 2340)
    assert len(STATES) == 10
    # 60 steps of a roll, 585 of an orbit: the smallest common multiple
    assert math.lcm(60, 585) == 2340
    for k in (0, 7, 77, 2339):
        assert model.H[k][:, :9].tolist() == model.H[(k + 60) % 2340][:, :9].tolist()
    # cos a cos b + sin a sin b = cos(a - b), of orbit and roll, from directions to six decimals
    for k in range(2340):
        angle = 2 * math.pi * 10 * (k + 1) * (1 / 5850 - 1 / 600)
        assert float(model.H[k, 0, 9]) == pytest.approx(5.2 * math.cos(angle), abs=5.2 * 2e-6)


def test_the_gp_b_model_is_that_of_the_geometry_to_first_order():
    """(1) and (2) of hung1982, ch. IV, multiplied out with small angles in place of the model's own formula."""
    model, rng = gravity_probe_b(), np.random.default_rng(4)
    size = 1e-6  # products of two angles are below 1e-11

    def small(angles):
        one, two, three = angles
        return np.array([[1, three, -two], [-three, 1, one], [two, -one, 1]])

    for k in (0, 11, 500):
        alpha, beta, gamma, psi = size * rng.standard_normal((4, 3))
        angle = 2 * math.pi * 10 * (k + 1) / 600
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
        telescope = small(beta) @ turn @ small(alpha) @ [1, 0, 0]
        gyro = small(gamma) @ small(beta) @ turn @ small(psi + alpha) @ [1, 0, 0]
        state = np.array([psi[1], psi[2], 0, 0, alpha[1], alpha[2], beta[1], gamma[1], 0, 0])
        shown = model.H[k].astype(float) @ state
        # six decimals of the directions, and the second order
        assert np.abs(shown - [gyro[2], telescope[2]]).max() < 4 * 1e-6 * size * 4 + 20 * size**2


# -- names of forms -------------------------------------------------------------------------------------------------
