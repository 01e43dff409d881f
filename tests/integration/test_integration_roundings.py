"""gpbnb.report.integration.precision: errors of t-digit arithmetic against simulated roundings and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.integration import precision

CHOP = Rounding.CHOP


@pytest.mark.parametrize("fmt", [FloatFormat(2, 11), FloatFormat(10, 4), FloatFormat(16, 3)])
def test_roundings_have_the_mean_squares_of_the_theory(fmt):
    """Numbers whose logarithms are spread evenly; 20,000 of them, standard error below 1 %."""
    x = float(fmt.base) ** (2 * (np.arange(20_000) + np.random.default_rng(3).random(20_000)) / 20_000)
    relative = fmt.array(x).to_float() / x - 1
    assert np.mean(relative**2) == pytest.approx(precision.mean_square_rounding(fmt), rel=0.04)
    chopped = FloatFormat(fmt.base, fmt.precision, CHOP)
    assert np.mean(1 - chopped.array(x).to_float() / x) == pytest.approx(precision.mean_chopping(chopped), rel=0.04)


def test_correlated_roundings_add_up_as_they_do():
    """The error of adding p to a multiple of the spacing is the sawtooth of p; p a random walk."""
    rng, n, paths = np.random.default_rng(4), 400, 4000
    for s in (0.1, 0.35, 2.0):
        # Averages of two neighbouring samples have changes with the variance of one half of those two steps apart.
        steps = rng.standard_normal((paths, n + 1)) * s * math.sqrt(2)
        samples = np.cumsum(steps, axis=1) + rng.random((paths, 1)) * 100
        p = (samples[:, 1:] + samples[:, :-1]) / 2
        total = (np.round(p) - p).sum(axis=1)
        observed = np.mean(total**2) / (n / 12)
        # Standard error √(2/4000) = 2.2 %; ends of the run are worth a few correlation times of 400.
        assert observed == pytest.approx(float(precision.correlation_factor(s)), rel=0.12)


@pytest.mark.parametrize("fmt", [FloatFormat(2, 16), FloatFormat(2, 24), FloatFormat(10, 7), FloatFormat(2, 32, CHOP)])
@pytest.mark.parametrize("omega", [10.0, 628.0])
def test_the_best_rate_is_the_best(fmt, omega):
    duration = 600.0
    best = precision.best_rate(omega, duration, fmt)
    assert best < precision.stall_rate(omega, duration, fmt)
    least = precision.two_errors(1.0, omega, best, duration, fmt).total
    for factor in np.geomspace(0.05, 20, 60):
        assert precision.two_errors(1.0, omega, best * factor, duration, fmt).total >= least * (1 - 1e-9)
    # The closed form leaves out that roundings are correlated, which lowers the rate, and averages over mantissas.
    assert 0.6 < best / precision.independent_best_rate(omega, duration, fmt) < 1.3


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize("base", [2, 10])
def test_the_needed_precision_is_the_least_that_suffices(base, rounding):
    for f_c in (100.0, 5000.0):
        for share in (0.1, 1.0):
            t = precision.needed_precision(628.0, f_c, 3600.0, base, rounding, share)
            enough, less = (
                precision.two_errors(1.0, 628.0, f_c, 3600.0, FloatFormat(base, digits, rounding))
                for digits in (t, t - 1)
            )
            assert enough.rounding <= share * enough.discretization
            assert less.rounding > share * less.discretization
