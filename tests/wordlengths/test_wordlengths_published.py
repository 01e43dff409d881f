"""gpbnb.report.wordlengths.published: the filters beside their own projects' code in float64, and printed numbers."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import sympy
from ahrs.filters import EKF
from filterpy.kalman import ExtendedKalmanFilter

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.nonlinear_run import NonlinearRun
from gpbnb.report.wordlengths import published

DOUBLE = FloatFormat(2, 53)
LANDMARKS = [(5, 10), (10, 5), (15, 15)]
MORE = [*LANDMARKS, (20, 5)]
"""Landmarks as the chapter of labbe2020 gives them."""


def states(model, z):
    """All estimates of a run in 53 bits, (steps, n), and its last covariance."""
    run = NonlinearRun(model, DOUBLE, Form.INNOVATION, range(1, len(z) + 1))
    run.take(z)
    assert run.stopped is None, run.reason
    return run.checkpoints().x.astype(float), run.P.to_float()


# -- a robot among landmarks, by FilterPy -----------------------------------------------------------------------------


@cache
def motion():
    """The arc of a bicycle as a function of x, y, heading, speed, steering angle and time, and its two Jacobians."""
    x, y, heading, v, a, t = symbols = sympy.symbols("x y h v a t")
    turn, r = v * t / sympy.Rational(1, 2) * sympy.tan(a), sympy.Rational(1, 2) / sympy.tan(a)
    after = sympy.Matrix(
        [
            x - r * sympy.sin(heading) + r * sympy.sin(heading + turn),
            y + r * sympy.cos(heading) - r * sympy.cos(heading + turn),
            heading + turn,
        ]
    )
    found = (after, after.jacobian([x, y, heading]), after.jacobian([v, a]))
    return [sympy.lambdify(symbols, each, "numpy") for each in found]


def moved(x, t):
    return np.asarray(motion()[0](*x.ravel(), 1.1, 0.01, t), dtype=float)


def sight(x, landmark):
    east, north = landmark[0] - x[0, 0], landmark[1] - x[1, 0]
    return np.array([[np.hypot(east, north)], [np.arctan2(north, east) - x[2, 0]]])


def slopes(x, landmark):
    east, north = landmark[0] - x[0, 0], landmark[1] - x[1, 0]
    square = east**2 + north**2
    r = np.sqrt(square)
    return np.array([[-east / r, -north / r, 0], [north / square, -east / square, -1]])


def wrapped(a, b):
    y = a - b
    y[1] = (y[1] + np.pi) % (2 * np.pi) - np.pi
    return y


def by_filterpy(landmarks, z):
    """Run FilterPy's filter as labbe2020 does; return the estimates after each landmark, and the last covariance."""
    ekf = ExtendedKalmanFilter(3, 2, 2)
    ekf.x, ekf.P, ekf.R = np.array([[2, 6, 0.3]]).T, np.diag([0.1] * 3), np.diag([0.3**2, 0.1**2])
    noise, found, seen = np.diag([0.1 * 1.1**2, np.radians(1) ** 2]), [], iter(z)
    for _ in range(20):
        F, V = (each(*ekf.x.ravel(), 1.1, 0.01, 1.0) for each in motion()[1:])
        ekf.x, ekf.P = moved(ekf.x, 1.0), F @ ekf.P @ F.T + V @ noise @ V.T
        for each in landmarks:
            one = next(seen).reshape(2, 1)
            ekf.update(one, slopes, sight, args=(each,), hx_args=(each,), residual=wrapped)
            found.append(ekf.x.ravel())
    return np.array(found), ekf.P


def sights(landmarks, seed):
    """Measurements along the path of labbe2020, which advances by tenths of a second."""
    rng, x, found = np.random.default_rng(seed), np.array([[2, 6, 0.3]]).T, []
    for tenth in range(191):
        x = moved(x, 0.1)
        found += [sight(x, each).ravel() for each in landmarks if tenth % 10 == 0]
    return np.array(found) + rng.standard_normal((len(found), 2)) * [0.3, 0.1]


@pytest.mark.parametrize("landmarks", [LANDMARKS, MORE])
def test_the_robot_is_that_of_filterpy(landmarks):
    model, z = published.robot(landmarks, seed=3)
    assert np.abs(z - sights(landmarks, 3)).max() < 1e-12  # 191 moves over 20 m, each rounded in other places
    x, P = states(model, z)
    expected, covariance = by_filterpy(landmarks, z)
    # Rounding errors of two runs in 53 bits; the radius of the arc, 50 m, cancels in each second.
    assert np.abs(x[:, :3] - expected).max() < 1e-12
    assert np.abs(P[:3, :3] - covariance).max() < 1e-13
    assert not x[:, 3:].any()  # nothing measures the errors of a step before they act


@pytest.mark.parametrize(
    ("landmarks", "printed"),
    [
        (LANDMARKS, [0.0244, 0.042, 0.00223]),
        (MORE, [0.0201, 0.0204, 0.00153]),
    ],
    ids=["3 landmarks", "4 landmarks"],
)
def test_the_variances_are_those_that_the_chapter_prints(landmarks, printed):
    """labbe2020 prints the last variances of one run with unknown noise, so the runs with our noise enclose them."""
    runs = np.array([by_filterpy(landmarks, sights(landmarks, seed))[1].diagonal() for seed in range(40)])
    half = np.array([5e-5 if each > 0.01 else 5e-6 if each > 0.001 else 5e-7 for each in printed])  # half a digit
    assert np.all(runs.min(axis=0) - half <= printed)
    assert np.all(printed <= runs.max(axis=0) + half)
    assert np.all(np.ptp(runs, axis=0) < 0.25 * np.array(printed))  # or the enclosure would say nothing


# -- the attitude of a sensor, by AHRS --------------------------------------------------------------------------------


def test_the_attitude_is_that_of_ahrs():
    model, z = published.attitude()
    x, P = states(model, z)
    record = np.loadtxt(published.RECORD, delimiter=",", skiprows=1)
    judge = EKF(magnetic_ref=[8 / 17, 0.0, -15 / 17])
    judge.mag = record[:, 7:10]  # it then takes six measurements
    q, found = np.array([1.0, 0, 0, 0]), []
    for before, row in pairwise(record):
        q = judge.update(q, np.radians(row[1:4]), row[4:7], row[7:10], dt=row[0] - before[0])
        found.append(q)
    assert len(found) == len(z) == 100
    # Rounding errors of two runs in 53 bits, whose estimates have length one.
    assert np.abs(x[:, :4] - found).max() < 1e-14
    assert np.abs(P[:4, :4] - judge.P).max() < 1e-14
    assert not x[:, 4:].any()  # nothing measures the errors of a step before they act
    assert np.abs(x[:, :4] - x[0, :4]).max() > 0.1  # the sensor turned


def test_the_jacobian_of_directions_is_that_of_ahrs():
    model, _ = published.attitude(1)
    judge = EKF(magnetic_ref=[8 / 17, 0.0, -15 / 17])
    judge.mag = np.zeros((1, 3))
    q = np.array([0.5, -0.75, 0.25, 0.625])  # not of length one
    x = DOUBLE.array([*q, 0, 0, 0])
    directions, H = model.measured(x, DOUBLE.array([0, 0, 0, 0]))
    assert np.abs(directions.to_float() - judge.h(q)).max() < 1e-15
    assert np.abs(H.to_float()[:, :4] - judge.dhdq(q)).max() < 1e-15
    assert not H.to_float()[:, 4:].any()
