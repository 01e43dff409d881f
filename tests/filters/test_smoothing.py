"""The smoother: its digits are those of plain loops over Fractions, and its algebra is that of exact least squares."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from small_filter import measurements, model

from gpbnb import FixedIntervalSmoother, FloatFormat, LinearModel, required_precision
from gpbnb.arithmetic.algebra import EXACT
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.forms import Form
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.filters.steps import StepModel, filtered, smoothed


def cyclic():
    """Three states and two measurements; Phi, H and Q are cycles of 2, and R of 3."""
    given = model()
    turned_over = given.Phi[0][::-1, ::-1]
    return model(Phi=[given.Phi[0], turned_over], Q=[given.Q[0], given.Q[0] * Fraction(3, 2)])


def least_squares(given, z, present):
    """The smoothed states and covariances from all equations at once: the minimum of a quadratic form, exactly.

    The unknowns are x_0 … x_N; P0, Q and R weigh the prior, the transitions and the measurements that are present.
    """
    n, steps = given.n, len(z)
    size = n * (steps + 1)
    N, b = exact(np.zeros((size, size), dtype=int)), exact(np.zeros(size, dtype=int))

    def weigh(rows, right, covariance):
        weight = solved(covariance, exact(np.eye(len(covariance), dtype=int)))
        N[:] += rows.T @ weight @ rows
        b[:] += rows.T @ weight @ right

    def zeros(count):
        return exact(np.zeros((count, size), dtype=int))

    identity = exact(np.eye(n, dtype=int))
    first = zeros(n)
    first[:, :n] = identity
    weigh(first, given.x0, given.P0)
    for k in range(steps):
        here, after = slice(k * n, (k + 1) * n), slice((k + 1) * n, (k + 2) * n)
        step = zeros(n)
        step[:, here], step[:, after] = -given.Phi[k % len(given.Phi)], identity
        weigh(step, exact(np.zeros(n, dtype=int)), given.Q[k % len(given.Q)])
        if (seen := np.flatnonzero(present[k])).size:
            rows = zeros(len(seen))
            rows[:, after] = given.H[k % len(given.H)][seen]
            weigh(rows, exact(z[k][seen]), given.R[k % len(given.R)][np.ix_(seen, seen)])
    covariance = solved(N, exact(np.eye(size, dtype=int)))
    x = covariance @ b
    return x.reshape(-1, n)[1:], [covariance[k * n : (k + 1) * n, k * n : (k + 1) * n] for k in range(1, steps + 1)]


def solved(a, b):
    """Gauss-Jordan elimination over Fractions; the matrices are definite."""
    a, b = a.copy(), b.copy()
    for k in range(len(a)):
        b[k], a[k] = b[k] / a[k, k], a[k] / a[k, k]
        for i in range(len(a)):
            if i != k and a[i, k]:
                b[i], a[i] = b[i] - a[i, k] * b[k], a[i] - a[i, k] * a[k]
    return b


def smoothed_exactly(form, models, x, P, z):
    """Smoothed estimates (n, 1) and covariances without rounding."""
    passed = []
    for step, measured in zip(models, z, strict=True):
        x, P, ahead, V = filtered(EXACT, form, step, x, P, measured)
        passed.append((x, P, ahead, V))
    found = [(x, P)]
    for step, before, (_, _, ahead, V) in zip(models[:0:-1], passed[-2::-1], passed[:0:-1], strict=True):
        found.append(smoothed(EXACT, step.Phi, before[:2], ahead, V, *found[-1]))
    return found[::-1]


def gaps():
    """The record with a whole step and single measurements missing."""
    z = measurements()
    z[1], z[3, 0], z[4, 1] = math.nan, math.nan, math.nan
    return z


@pytest.mark.parametrize("z", [measurements(), gaps(), gaps()[:1]], ids=["full", "gaps", "one step"])
def test_the_algebra_is_that_of_exact_least_squares(z):
    given = cyclic()
    x, P = least_squares(given, z, ~np.isnan(z))
    read = FixedIntervalSmoother(given, z)
    for form in (Form.INNOVATION, Form.JOSEPH):
        models = [
            StepModel(*(c[k % len(c)] for c in (read.model.Phi, read.model.H, read.model.Q, read.model.R)))
            for k in range(len(z))
        ]
        found = smoothed_exactly(form, models, given.x0[:, None], given.P0, read.z[:, :, None])
        assert [x[:, 0].tolist() for x, _ in found] == x.tolist()
        assert [P.tolist() for _, P in found] == [each.tolist() for each in P]
    root = FixedIntervalSmoother(given, z, "square root").run(FloatFormat(2, 300))
    S = root.P.to_fractions()
    assert np.abs(root.x.to_fractions() - x).max() < Fraction(1, 2**280)  # 300 bits lose fewer than 20
    assert np.abs(np.array([each @ each.T for each in S]) - np.array(P)).max() < Fraction(1, 2**280)
    assert all(each[i, j] == 0 for each in S for i in range(3) for j in range(i))


def tracked():
    """A target in random acceleration whose position is measured each second, and whose prior says almost nothing."""
    q = Fraction(1, 10**4)
    return LinearModel(
        [[1, 1], [0, 1]], [[1, 0]], [[q / 3, q / 2], [q / 2, q]], [["0.01"]], [0, 0], [[10**6, 0], [0, 10**6]]
    )


def exact_track(given, steps):
    """The smoothed estimates without rounding, (steps, n)."""
    models = [StepModel(given.Phi[0], given.H[0], given.Q[0], given.R[0])] * steps
    z = exact(simulated_measurements(given, steps))[:, :, None]
    found = smoothed_exactly(Form.INNOVATION, models, given.x0[:, None], given.P0, z)
    return np.array([x[:, 0] for x, _ in found])


@pytest.mark.parametrize(("form", "bits"), [("innovation", 31), ("Joseph", 29)])
def test_the_search_is_right_by_the_exact_smoother(form, bits):
    """The answer meets 0.01, one bit less does not; the true estimates are exact."""
    given, steps = tracked(), 20
    z = simulated_measurements(given, steps)
    read = FixedIntervalSmoother(given, z, form)
    found = required_precision(read, steps, 0.01)
    assert found.digits == bits
    assert "operation by operation" not in str(found)
    true = exact_track(given, steps)
    for digits, ratio in dict(found.tried).items():
        try:
            error = np.abs(read(FloatFormat(2, digits)).to_fractions() - true).max()
        except ZeroDivisionError:
            assert ratio == math.inf
        else:
            assert ratio == pytest.approx(float(error) / 0.01, rel=1e-9)  # the search compares with 237 bits
    assert dict(found.tried)[bits] <= 1 < dict(found.tried)[bits - 1]
