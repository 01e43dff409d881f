"""The nonlinear examples, and the collapse of a variance in single precision, in plain loops."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb import FloatFormat
from gpbnb.filters.run import Run
from gpbnb.report import examples
from tests.oracles import Numbers, floating, transposed, unit

COLLAPSE = 1791
"""The step that the book names."""

# -- the height channel, in plain loops ------------------------------------------------------------------------------


def outer(deviations):
    """Covariance of the quaternion of a heading of 0.7 rad, for deviations of three small angles."""
    c, s = math.cos(0.35), math.sin(0.35)
    turns = [[0, c / 2, s / 2, 0], [0, -s / 2, c / 2, 0], [-s / 2, 0, 0, c / 2]]
    found = [[0.0] * 4 for _ in range(4)]
    for turn, deviation in zip(turns, deviations, strict=True):
        found = [[found[i][j] + (turn[i] * deviation) * (turn[j] * deviation) for j in range(4)] for i in range(4)]
    return found


def channel():
    """Phi, Q, P0 and R of the height channel; the derivative of w w - x x - y y + z z is (2 w, 0, 0, 2 z)."""
    c, s, g, step = math.cos(0.35), math.sin(0.35), 9.80665, 1 / 128
    Phi = np.eye(7)
    Phi[4, 0], Phi[4, 3], Phi[4, 6] = -(2 * c * g) * step, -(2 * s * g) * step, -(c * c + s * s) * step
    Phi[5, 4] = step
    P0, Q = np.diag([0, 0, 0, 0, 0.25, 4, 0.04]), np.diag([0, 0, 0, 0, (0.35 * step) ** 2, 0, (0.003 * step) ** 2])
    P0[:4, :4] += outer([0.05, 0.05, 0.5])
    Q[:4, :4] += outer([0.015 * step] * 3)
    return Phi, Q, P0, np.diag([0.09, 4])


def covariances(fmt, steps):
    """Yield the covariance after each step, and whether its variances and all pivots are positive."""
    Phi, Q, P, R = (fmt.store(each.tolist()) for each in channel())
    H = unit(7)[4:6]
    for k in range(steps):
        P = fmt.plus(fmt.times(Phi, P, transposed(Phi)), Q)
        sound = True
        if k % 5 == 0:
            VH = fmt.times(P, transposed(H))
            S = fmt.plus(fmt.times(H, VH), R)
            sound = fmt.has_positive_pivots(S)
            K = fmt.times(VH, fmt.inverse(S))
            P = fmt.times(fmt.plus(unit(7), fmt.times(K, H), -1), P)
        yield P, sound and all(P[i][i] > 0 for i in range(7))


@pytest.mark.long  # 1,791 steps of a filter of seven states in plain loops
def test_the_collapse_is_that_of_plain_loops():
    """The loops in Python take seconds: the variance is lost after 1,790 steps, not before."""
    run, double = (
        Run(examples.height_channel(), FloatFormat(2, bits), "innovation", (1, 700, COLLAPSE - 1, COLLAPSE))
        for bits in (24, 53)
    )
    for each in (run, double):
        each.take(np.zeros((1800, 2)))
    assert (run.indefinite, double.indefinite) == (COLLAPSE, None)
    P = dict(zip((1, 700, COLLAPSE - 1, COLLAPSE), run.checkpoints().P.tolist(), strict=True))
    lost, fmt = None, Numbers(floating(2, 24, "nearest"))
    for step, (plain, positive) in enumerate(covariances(fmt, COLLAPSE), start=1):
        if step in P:
            assert P[step] == plain
        lost = lost or (None if positive else step)
    assert lost == COLLAPSE


# -- the examples ---------------------------------------------------------------------------------------------------


def test_the_height_channel_is_the_derivative_of_its_equations():
    model = examples.height_channel()
    for found, expected in zip((model.Phi, model.Q, model.P0[None], model.R), channel(), strict=True):
        assert found[0].astype(float).tolist() == expected.tolist()
    assert len(model.H) == 5
    assert not model.H[1:].any()
    assert model.H[0].tolist() == [[0, 0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 0, 1, 0]]
    corrected = examples.height_channel(constrained=True).Phi[0]
    assert corrected[4].tolist() == [0, 0, 0, 0, 1, 0, -1 / 128]
    q = np.array([math.cos(0.35), 0, 0, math.sin(0.35)])
    assert np.abs(np.asarray(model.P0[:4, :4], float) @ q).max() < 1e-16  # no variance along the quaternion
