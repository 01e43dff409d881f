"""measurement: rotations against scipy, and the measurement matrix against the chain of printed matrices."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gpbnb.report import measurement as m

EPS = np.finfo(float).eps


def drawn(count, *shapes):
    """Draw angles, a phase for each empty shape; one in five is zero, next to it, or at the end of its range."""
    rng = np.random.default_rng(20261129)
    for _ in range(count):
        found = []
        for shape in shapes:
            most = 1.5 if shape else 400.0
            ends = rng.choice([0.0, -0.0, 5e-324, 1e-8, most, -most], shape)
            found.append(np.where(rng.random(shape) < 0.2, ends, rng.uniform(-most, most, shape)))
        yield found


# -- rotations ------------------------------------------------------------------------------------


def test_rotation_is_that_of_scipy():
    for (angles,) in drawn(100, 3):
        # scipy turns vectors, about axes that turn along (capitals); we turn the frame: the transpose
        oracle = Rotation.from_euler("ZYX", angles[::-1])
        # three products of two 3x3 matrices with entries up to one, and sine and cosine: under 10 roundings an entry
        assert np.abs(m.rotation(angles) - oracle.as_matrix().T).max() <= 10 * EPS


def test_angles_of_undoes_rotation():
    for (angles,) in drawn(100, 3):
        # up to 1.5 the second angle stays 0.07 from the pole, where the others are found 14 times less sharply
        assert np.abs(m.angles_of(m.rotation(angles)) - angles).max() <= 14 * 10 * EPS


def test_deroll_undoes_roll():
    for inertial, phase in drawn(100, (4, 2), ()):
        rolled = (m.roll(phase)[1:, 1:] @ inertial.T).T
        assert np.allclose(m.deroll(rolled, phase), inertial, atol=8 * EPS, rtol=0)


# -- the chains of frames -------------------------------------------------------------------------


def test_chains_are_the_products_of_their_matrices():
    for alpha, beta, gamma, phase in drawn(100, 3, 3, 3, ()):
        chain = m.rotation(beta) @ m.roll(phase) @ m.rotation(alpha)
        assert np.allclose(m.star_in_telescope(alpha, beta, phase), chain[:, 0], atol=200 * EPS, rtol=0)
        spin = m.spin_in_readout(alpha, beta, gamma, phase)
        assert np.allclose(spin, (m.rotation(gamma) @ chain)[:, 0], atol=1000 * EPS, rtol=0)


# -- the measurement matrix -----------------------------------------------------------------------

ANGLES = {"phi": 0, "alpha": 0, "beta": 0, "gamma": 0}


def small_rotation(angles):
    """As printed in (1) to (4)."""
    a1, a2, a3 = angles
    return np.array([[1, a3, -a2], [-a3, 1, a1], [a2, -a1, 1]])


def readings(signal, phase, values, theta):
    """The report's own chain with its small-angle matrices, plus bias and scale factor; independent of H."""
    turns = {name: np.zeros(3) for name in ANGLES}
    for name, value in values.items():
        if name[:-1] in turns:
            turns[name[:-1]][int(name[-1]) - 1] = value
    star = turns["alpha"]
    spin = theta + turns["phi"] + turns["alpha"]
    roll, B, G = m.roll(phase), small_rotation(turns["beta"]), small_rotation(turns["gamma"])
    telescope = (B @ roll @ small_rotation(star)[:, 0])[1:]
    gyro = (G @ B @ roll @ small_rotation(spin)[:, 0])[1:] * (1 + values.get("scale", 0))
    gyro += np.array([values.get("bias_y", 0), values.get("bias_z", 0)])
    return gyro if signal == "gyro" else telescope


def rows_at(phase, states, theta, **options):
    return m.measurement_rows(np.cos(phase), np.sin(phase), states, theta=theta, **options).astype(float)


@pytest.mark.parametrize("state", m.STATES)
def test_each_column_is_the_derivative_of_the_printed_chain(state):
    for (theta, phases), signal in itertools.product(drawn(20, 3, 1), ("gyro", "telescope")):
        phase = float(5 * phases[0])
        H = rows_at(phase, [state], theta, signal=signal, derolled=False)
        up, down = (readings(signal, phase, {state: s}, theta) for s in (1.0, -1.0))
        assert np.allclose(H[:, 0], (up - down) / 2, atol=40 * EPS, rtol=0)


def test_derolled_is_deroll_of_the_other():
    for (theta, phase), signal in itertools.product(drawn(100, 3, ()), ("gyro", "telescope")):
        body, inertial = (rows_at(phase, m.STATES, theta, signal=signal, derolled=flag) for flag in (False, True))
        assert np.allclose(m.deroll(body.T, phase).T, inertial, atol=10 * EPS, rtol=0)


def test_against_the_exact_chain():
    """The linear form differs from exact rotations by products of two angles only."""
    rng = np.random.default_rng(4)
    h, phase = 1e-5, np.linspace(0, 2 * np.pi, 9)
    alpha, beta, gamma, phi = rng.uniform(-h, h, (4, 3))
    alpha[0] = phi[0] = 0
    states = ("phi2", "phi3", "alpha2", "alpha3", "beta2", "beta3", "gamma2", "gamma3")
    x = np.array([phi[1], phi[2], alpha[1], alpha[2], beta[1], beta[2], gamma[1], gamma[2]])
    linear = m.measurement_matrix(phase, states) @ x
    exact = m.deroll(m.spin_in_readout(m.theta_of(phi, alpha), beta, gamma, phase)[:, 1:], phase)
    # twelve angles of at most h: no more than their 66 products and 12 halved squares, most of them absent
    assert h**2 / 10 < np.abs(linear - exact).max() < 10 * h**2


@pytest.mark.parametrize("signal", ["gyro", "telescope"])
@pytest.mark.parametrize("derolled", [True, False])
def test_rows_of_fractions_are_exact_and_those_of_floats_the_matrix(signal, derolled):
    C, S = Fraction(5, 13), Fraction(-12, 13)
    theta = [0, Fraction(1, 3), Fraction(2, 7)]
    options = {"signal": signal, "derolled": derolled}
    exact = m.measurement_rows(C, S, m.STATES, theta=theta, **options)
    phase, nominal = math.atan2(S, C), np.array(theta, float)
    assert exact.dtype == object
    assert all(isinstance(entry, int | Fraction) for entry in exact.flat)
    assert np.allclose(exact.astype(float), rows_at(phase, m.STATES, nominal, **options), atol=10 * EPS, rtol=0)
    if signal == "gyro" and derolled:
        floats = m.measurement_matrix(phase, m.STATES, nominal_theta=nominal)
        assert np.allclose(exact.astype(float), floats, atol=10 * EPS, rtol=0)
