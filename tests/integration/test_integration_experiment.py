"""integration.experiment: simulations against exact variances, emulation against exact arithmetic and theory."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.integration import experiment, precision, theory

FIRST = theory.first_order(1.7, 3.0)
CHOP = Rounding.CHOP


def rng(seed):
    return np.random.default_rng(seed)


# -- simulation -----------------------------------------------------------------------------------


def test_samples_have_the_autocovariance():
    x, _ = experiment.simulate(FIRST, 2.0, 4, rng(5), 20_000)
    for lag in range(4):
        observed = float(np.mean(x[0] * x[lag]))
        error = 1.7**2 * math.sqrt(2 / 20_000)  # at most, of a product of two normal numbers
        assert abs(observed - 1.7**2 * math.exp(-3.0 * lag / 2.0)) < 4 * error


def test_the_error_of_a_trapezoid_is_that_beside_a_fine_integral():
    """Samples of a finer simulation, added up, approach the integral: d = trapezoid - integral, path by path.

    A coarse cycle of k fine ones: its trapezoid less the sum of the fine trapezoids less the fine errors.
    """
    k, fine = 8, 16.0
    x, d = experiment.simulate(FIRST, fine, k, rng(6), 20_000)
    integral = (x[:-1] / 2 + x[1:] / 2).sum(axis=0) / fine - d.sum(axis=0)
    coarse = (x[0] + x[-1]) / 2 * k / fine - integral
    (first, last), (one,) = experiment.simulate(FIRST, fine / k, 1, rng(7), 20_000)
    spread = math.sqrt(2 / 20_000)
    assert np.mean(coarse**2) == pytest.approx(np.mean(one**2), rel=4 * math.sqrt(2) * spread)
    assert np.mean(coarse * x[0]) == pytest.approx(np.mean(one * first), abs=8 * spread * np.std(coarse) * 1.7)
    assert np.mean(coarse * x[-1]) == pytest.approx(np.mean(one * last), abs=8 * spread * np.std(coarse) * 1.7)


def test_a_sweep_agrees_with_the_exact_variance_and_tells_39_apart():
    mu = np.array([1e-3, 0.3, 10.0, 100.0])
    found = experiment.sweep(mu, 200, 4000, rng(13))
    exact = [float(theory.error_variance(200, each)) for each in mu.tolist()]
    assert np.abs(experiment.deviations(found, exact)).max() < 4
    away = experiment.deviations(found, 200 * mu / 6)
    assert np.abs(away[:2]).max() < 4
    assert away[2] < -10
    assert away[3] < -30


# -- roundings ------------------------------------------------------------------------------------


def emulated(omega, f_c, duration, fmt, draw, paths):
    """RMS of the discretization error, of the rounding error and of both, with each sample and operation rounded."""
    x, d = experiment.simulate(theory.first_order(1.0, omega), f_c, round(duration * f_c), draw, paths)
    discretization, unrounded = d.sum(axis=0), (x[:-1] + x[1:]).sum(axis=0) / 2 / f_c
    stored = fmt.array(x)
    rounding = (fmt.array(0.5 / f_c) * (stored[:-1] + stored[1:])).sum(axis=0).to_float() - unrounded
    return [math.sqrt(np.mean(each**2)) for each in (discretization, rounding, discretization + rounding)]


#: Rates from where ties matter to where roundings are correlated; all below half of the rate at which additions stall.
@pytest.mark.parametrize("fmt", [FloatFormat(2, 11), FloatFormat(2, 16, CHOP), FloatFormat(16, 5)], ids=str)
@pytest.mark.parametrize("f_c", [32.0, 256.0])
def test_emulated_errors_are_those_of_the_theory(f_c, fmt):
    paths = 400
    found = emulated(64.0, f_c, 16.0, fmt, rng(17), paths)
    error = math.sqrt(6 / paths) / 2  # of an rms, for errors that add up to a random walk
    assert f_c <= precision.stall_rate(64.0, 16.0, fmt) / 2
    expected = precision.two_errors(1.0, 64.0, f_c, 16.0, fmt)
    assert found[0] == pytest.approx(expected.discretization, rel=4 / math.sqrt(2 * paths))
    assert found[1] == pytest.approx(expected.rounding, rel=4 * error)
    assert found[2] == pytest.approx(expected.total, rel=4 * error)


def test_ties_are_seen_at_a_low_rate():
    """Without them the theory would be a third too small: 32 Hz, where the standard error is 4 %."""
    fmt = FloatFormat(2, 24)
    _, rounding, _ = emulated(64.0, 32.0, 16.0, fmt, rng(18), 1000)
    kappa = precision.mean_square_rounding(fmt)
    without = math.sqrt(kappa * 16.0**2 * 32.0 / 64.0 * (1 / math.tanh(1.0)))
    assert rounding > 1.25 * without
    assert rounding == pytest.approx(precision.two_errors(1.0, 64.0, 32.0, 16.0, fmt).rounding, rel=0.16)


def test_beyond_the_stall_rate_the_integral_is_lost():
    fmt = FloatFormat(2, 8)
    rate = 2.0 ** math.ceil(math.log2(8 * precision.stall_rate(64.0, 8.0, fmt)))
    _, rounding, _ = emulated(64.0, rate, 8.0, fmt, rng(21), 40)
    assert rounding > 0.3 * math.sqrt(2 * 8.0 / 64.0)
    assert rounding < precision.two_errors(1.0, 64.0, rate, 8.0, fmt).rounding / 3
