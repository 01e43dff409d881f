"""The nonlinear examples, and the collapse of a variance in single precision, in integers of Python."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY32, FloatFormat, emulate
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.nonlinear_run import simulated
from gpbnb.filters.run import Run
from gpbnb.report.display import style
from gpbnb.report.wordlengths import figures, study
from gpbnb.wordlength import nonlinear_examples as examples
from tests.step_functions import Native

COLLAPSE = 1791
"""The step that the book names."""

# -- the height channel, in integers ------------------------------------------------------------------------------


class Digits:
    """Numbers m 2**e in some bits, ties away from zero; nothing is taken from the package."""

    def __init__(self, bits):
        self.bits = bits

    def rounded(self, m, e):
        lost = abs(m).bit_length() - self.bits
        if lost <= 0:
            return m, e
        size = (abs(m) + (1 << (lost - 1))) >> lost
        return (size if m > 0 else -size), e + lost

    def of(self, number):
        m, denominator = float(number).as_integer_ratio()
        return self.rounded(m, 1 - denominator.bit_length())

    def add(self, a, b, sign=1):
        if not a[0] or not b[0]:
            return a if not b[0] else (sign * b[0], b[1])
        e = min(a[1], b[1])
        return self.rounded((a[0] << (a[1] - e)) + sign * (b[0] << (b[1] - e)), e)

    def times(self, a, b):
        return self.rounded(a[0] * b[0], a[1] + b[1])

    def over(self, a, b):
        shift = 2 * self.bits + 4
        quotient, rest = divmod(abs(a[0]) << shift, abs(b[0]))
        sign = 1 if (a[0] < 0) == (b[0] < 0) else -1
        return self.rounded(sign * (2 * quotient + bool(rest)), a[1] - b[1] - shift - 1)

    def product(self, A, B):
        columns = list(zip(*B, strict=True))
        return [[self.row(row, column) for column in columns] for row in A]

    def row(self, row, column):
        """A sum from left to right; terms of zero change nothing."""
        total = (0, 0)
        for a, b in zip(row, column, strict=True):
            if a[0] and b[0]:
                total = self.add(total, self.times(a, b))
        return total

    def sum(self, A, B, sign=1):
        return [[self.add(a, b, sign) for a, b in zip(*rows, strict=True)] for rows in zip(A, B, strict=True)]

    def inverse(self, A):
        """Elimination without exchanges; pivots last."""
        n, A, C = len(A), [row[:] for row in A], eye(len(A))
        for k in range(n):
            for i in range(k + 1, n):
                f = self.over(A[i][k], A[k][k])
                A[i] = [
                    self.add(a, self.times(f, b), -1) if j > k else a
                    for j, (a, b) in enumerate(zip(A[i], A[k], strict=True))
                ]
                C[i] = [self.add(c, self.times(f, d), -1) for c, d in zip(C[i], C[k], strict=True)]
        for k in range(n - 1, -1, -1):
            for i in range(k + 1, n):
                C[k] = [self.add(c, self.times(A[k][i], d), -1) for c, d in zip(C[k], C[i], strict=True)]
            C[k] = [self.over(c, A[k][k]) for c in C[k]]
        return C, [A[k][k] for k in range(n)]


def eye(n):
    return [[(int(i == j), 0) for j in range(n)] for i in range(n)]


def transposed(A):
    return [list(row) for row in zip(*A, strict=True)]


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


def covariances(bits, steps):
    """Yield the covariance after each step, and whether its variances and all pivots are positive."""
    digits = Digits(bits)
    Phi, Q, P, R = ([[digits.of(a) for a in row] for row in each.tolist()] for each in channel())
    H = [[(int(j == i + 4), 0) for j in range(7)] for i in range(2)]
    for k in range(steps):
        P = digits.sum(digits.product(digits.product(Phi, P), transposed(Phi)), Q)
        pivots = []
        if k % 5 == 0:
            VH = digits.product(P, transposed(H))
            inverse, pivots = digits.inverse(digits.sum(digits.product(H, VH), R))
            K = digits.product(VH, inverse)
            P = digits.product(digits.sum(eye(7), digits.product(K, H), -1), P)
        yield P, all(m > 0 for m, _ in [*(P[i][i] for i in range(7)), *pivots])


@pytest.mark.parametrize(("bits", "collapse"), [(24, COLLAPSE), (53, None)])
def test_the_collapse_is_that_of_plain_integers(bits, collapse):
    steps = 1800
    run = Run(examples.height_channel(), FloatFormat(2, bits), "innovation", (1, 700, 1790, 1791))
    run.take(np.zeros((steps, 2)))
    assert run.indefinite == collapse
    P = dict(zip((1, 700, 1790, 1791), run.checkpoints().P.tolist(), strict=True))
    lost = None
    for step, (plain, positive) in enumerate(covariances(bits, 1791), start=1):
        if step in P:
            assert P[step] == [[Fraction(m) * Fraction(2) ** e for m, e in row] for row in plain]
        lost = lost or (None if positive else step)
    assert lost == collapse


def test_a_curve_of_variances_ends_where_the_run_does():
    curve, lost = study.variances(examples.height_channel(), FloatFormat(2, 24), 4, 1800)
    assert lost == COLLAPSE
    assert [k for k, _ in curve] == list(range(18, 1801, 18))
    plain = {k: P[4][4] for k, (P, _) in enumerate(covariances(24, 180), start=1)}
    assert [value for k, value in curve[:10]] == [math.ldexp(*plain[k]) for k, _ in curve[:10]]
    blocks = BlockFormats.uniform(FloatFormat(2, 24)).with_block("covariance", FloatFormat(2, 53))
    assert study.variances(examples.height_channel(), blocks, 4, 1800)[1] is None


def test_the_figure_of_variances_shows_each_curve():
    curves = {"binary32": [(10, 2.0), (20, 1.0), (30, -1.0)], "binary64": [(10, 2.0), (20, 1.5), (30, 1.25)]}
    _, (ax,) = style.figure()
    artists = figures.variances(curves, 2, ax)
    lines = {tuple(map(tuple, each.get_xydata())) for each in ax.get_lines() if len(each.get_xdata()) == 3}
    assert lines == {tuple((k / 2, value) for k, value in curve) for curve in curves.values()}
    assert len({each.get_color() for each in ax.get_lines() if len(each.get_xdata()) == 3}) == 2
    assert {each.get_text() for each in ax.texts} >= set(curves)
    assert set(ax.get_lines()) <= set(artists)
    assert ax.get_xlabel() == "time (s)"


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


def test_the_beacon_is_tracked_behind_the_instrument():
    model = examples.beacon()
    z = simulated(model, 40, seed=1)
    assert np.ptp(z[:, 1]) > 6  # the bearing jumps by a whole turn
    x = np.array([300.0, -400.0, 5.0, 6.0])
    given = FloatFormat(2, 53).array(x)
    assert examples.tracked_motion(given).to_float().tolist() == [305, -394, 5, 6]
    assert examples.tracked_sight(given).to_float().tolist() == [500, math.atan2(-400, 300)]
    found = emulate(model, z, FloatFormat(2, 40), "Joseph")
    distance = np.hypot(*found.reference.x[-1, :2].astype(float))
    assert abs(distance - z[-1, 0]) < 0.1
    assert found.state_norm.max() < 1e-4


def test_the_clipped_controller_is_clipped():
    controller = examples.clipped_controller()
    u = np.concatenate([np.ones(30), np.random.default_rng(2).uniform(-1, 1, 400)])
    found = controller.states(BINARY32, u).to_float()
    x, native = np.float32([0]), Native(np.float32)
    for k, each in enumerate(native.array(u)):
        x, y = examples.clipped_step(native, x, each.reshape(1))
        x = np.atleast_1d(x)
        assert found[k].tolist() == [x[0], y]
    assert np.abs(found).max(axis=0).tolist() == [1, 1]
