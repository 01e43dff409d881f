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


@pytest.mark.parametrize("fmt", [FloatFormat(2, 24), FloatFormat(10, 8), FloatFormat(16, 8, CHOP), FloatFormat(3, 15)])
def test_errors_fall_and_grow_with_the_rate_as_the_closed_forms_say(fmt):
    omega, duration = 100.0, 1000.0
    slow, fast = 2000.0, 8000.0
    first, second = (precision.two_errors(1.0, omega, f, duration, fmt) for f in (slow, fast))
    assert first.discretization / second.discretization == pytest.approx(4, rel=1e-4)
    if fmt.rounding is CHOP:
        expected = precision.mean_chopping(fmt) * slow * math.sqrt(2 * duration**3 / (3 * omega))
        assert first.rounding == pytest.approx(expected, rel=2e-3)  # a = 1.3e-3: 3a/8 of it leaks
        assert second.rounding / first.rounding == pytest.approx(4, rel=5e-3)
    else:
        variance = precision.mean_square_rounding(fmt) * duration**2 * slow / omega
        # The spacing averaged over a normal accumulator is near, not at, that of evenly spread logarithms.
        assert first.rounding**2 == pytest.approx(variance, rel=0.2 if fmt.base < 10 else 0.6)
        assert second.rounding / first.rounding == pytest.approx(2, rel=0.05)
    scaled = precision.two_errors(fmt.base**3, omega, slow, duration, fmt)
    assert scaled.rounding == pytest.approx(fmt.base**3 * first.rounding, rel=1e-9)
    assert scaled.total == pytest.approx(math.hypot(scaled.discretization, scaled.rounding))


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


def test_the_stall_rate_is_where_increments_are_half_a_spacing():
    fmt, omega, duration = FloatFormat(2, 16), 64.0, 50.0
    spacing = math.sqrt(12 * precision.mean_square_rounding(fmt) * 2 * duration / omega)
    assert 1 / precision.stall_rate(omega, duration, fmt) == pytest.approx(spacing / 2)


def test_both_errors_are_equal_at_the_best_rate_with_chopping():
    """In closed form, for rates far above the bandwidth and a leak far below one."""
    fmt = FloatFormat(2, 40, CHOP)
    found = precision.two_errors(1.0, 1.0, precision.independent_best_rate(1.0, 1e4, fmt), 1e4, fmt)
    assert found.discretization == pytest.approx(found.rounding, rel=1e-3)
