"""gpbnb.report.rolling.theory: closed forms against quadrature, sums and the printed numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy import integrate, signal

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rolling import derivation, theory
from gpbnb.report.rolling.theory import DRIFTS, LEVEL, YEAR

CHOP = Rounding.CHOP


# -- roll and deroll --------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [1e-9, 0.01, math.radians(1), -2.0])
def test_the_cost_of_a_phase_error_is_that_of_the_matrices(phase):
    off = theory.rotation(0.3 + phase).T @ theory.rotation(0.3) - np.eye(2)
    assert theory.phase_error_cost(DRIFTS, phase) == pytest.approx(off @ np.array(DRIFTS), abs=2e-12)


@pytest.mark.parametrize("error", [1e-3, 1.0, 6000.0])
def test_the_largest_phase_has_that_cost(error):
    phase = theory.largest_phase(DRIFTS, error)
    assert math.hypot(*theory.phase_error_cost(DRIFTS, phase)) == pytest.approx(error, rel=1e-12)


def test_fitted_drifts_of_constant_and_linear_phases():
    constant = theory.fitted_drift(DRIFTS, lambda t: np.full(t.shape, 0.2))
    assert constant - np.array(DRIFTS) == pytest.approx(theory.phase_error_cost(DRIFTS, 0.2), rel=1e-11)
    small = 1e-9 / YEAR
    assert theory.off_tuned_drift(6600.0, small) == pytest.approx(6600e-9, rel=1e-9)
    for rate in (3e-8, 5e-7):  # up to 16 rad

        def integrand(x, part, rate=rate):
            return 12 * (x - 0.5) * x * part(rate * YEAR * x)

        expected = [integrate.quad(integrand, 0, 1, args=(part,), epsabs=1e-12)[0] for part in (math.cos, math.sin)]
        assert theory.fitted_drift((1.0, 0.0), lambda t, r=rate: r * t) == pytest.approx(expected, abs=1e-10)


def test_the_derivation_derolls_by_the_inverse_of_the_roll():
    phi = sp.Symbol("phi", real=True)
    roll = sp.Matrix([[sp.cos(phi), sp.sin(phi)], [-sp.sin(phi), sp.cos(phi)]])
    assert sp.simplify(derivation.deroll(phi) * roll) == sp.eye(2)


# -- registers -----------------------------------------------------------------------------------------


def test_the_roll_rate_is_exact_to_55_digits():
    with mpmath.workdps(70):
        exact = 2 * mpmath.pi / 600
        error = abs(mpmath.mpf(theory.roll_rate(600.0).numerator) / theory.roll_rate(600.0).denominator / exact - 1)
    assert error < mpmath.mpf(10) ** -55


def test_the_worst_error_of_the_rate_bounds_the_error_of_each_rate_of_its_binade():
    for fmt in [FloatFormat(b, t, r) for b in (2, 3, 10, 16) for t in (3, 6, 10) for r in Rounding.documented()]:
        for period in [600.0, 77.5, 0.3]:
            worst = theory.worst_rate_error(period, fmt)
            rate = theory.roll_rate(period)
            assert abs(fmt.round(rate) - rate) <= worst
            _, _, e = fmt.split(rate)
            unit = Fraction(fmt.base) ** (e - fmt.precision)
            assert worst == (unit if fmt.rounding is CHOP else unit / 2)


def test_the_printed_sample_calculations():
    six, ten = (float(theory.worst_rate_error(600.0, FloatFormat(10, t))) for t in (6, 10))
    assert six == pytest.approx(0.5e-7, rel=1e-15, abs=0)
    assert ten == pytest.approx(0.5e-11, rel=1e-15, abs=0)
    assert theory.off_tuned_loss(six) == pytest.approx(1 - math.cos(0.5e-7 * YEAR), rel=1e-12)
    assert theory.off_tuned_loss(ten) == pytest.approx(1.234e-8, rel=0.01)  # printed for 40,000 years, not 39,848
    assert theory.off_tuned_drift(6600.0, ten) == pytest.approx(6600 * ten * YEAR, rel=1e-7)


# -- spectra ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cycles", [0.0, 1e-6, 0.3, 1.0, 7.5, 40.25])
def test_the_density_of_a_ramp_is_that_of_its_transform(cycles):
    w = 2 * math.pi * cycles
    with mpmath.workdps(30):
        value = complex(mpmath.quad(lambda x: x * mpmath.expj(-w * x), mpmath.linspace(0, 1, 2 + int(2 * cycles))))
    expected = 2 * abs(value) ** 2 * YEAR**3 * (40.0 / YEAR) ** 2
    assert float(theory.ramp_density(40.0, YEAR, cycles / YEAR)) == pytest.approx(expected, rel=1e-9)


def test_the_density_of_samples_is_that_of_the_response():
    h, f = theory.impulse_response(2**20), 0.2
    response = abs(np.sum(h * np.exp(-2j * np.pi * f * np.arange(len(h))))) ** 2
    expected = 2 * math.pi * LEVEL * 10 * response
    # The response is cut off where it is 1/sqrt(pi n); the alternating rest is of that size.
    assert float(theory.flicker_density(LEVEL, f / 10, 10.0)) == pytest.approx(expected, rel=2e-3)
    assert float(theory.flicker_density(LEVEL, 1e-9, 10.0)) == pytest.approx(LEVEL / 1e-9, rel=1e-12)


# -- sums of noise -----------------------------------------------------------------------------------------


def exact_error(samples, period=None):
    """Standard error of a drift fitted to sampled noise that starts at rest, from the variance of the sum."""
    a = theory.slope_weights(samples)
    if period is None:
        return math.sqrt(theory.variance_of_sum(a, LEVEL)) * YEAR
    phase = theory.roll_phase(np.arange(samples), period)
    return math.sqrt(sum(theory.variance_of_sum(a * f(phase), LEVEL) for f in (np.cos, np.sin))) * YEAR


def test_without_rolling_the_closed_forms_are_reached():
    n = 30000
    exact = exact_error(n)
    assert exact == pytest.approx(theory.drift_error_unrolled(LEVEL, n * 10.0, at_rest=True), rel=1e-3)
    # Noise that is much older than the record: the record is its last part.
    age = 400 * 500
    a = np.concatenate([np.zeros(age), theory.slope_weights(500)])
    old = math.sqrt(theory.variance_of_sum(a, LEVEL)) * YEAR
    assert old == pytest.approx(theory.drift_error_unrolled(LEVEL, 5000.0), rel=5e-3)
    assert theory.drift_error_unrolled(LEVEL) / theory.drift_error_unrolled(LEVEL, at_rest=True) == pytest.approx(
        3 / 8**0.5
    )


@pytest.mark.parametrize(("period", "samples"), [(600.0, 6000), (77.5, 7750), (100.0, 1000)])
def test_with_rolling_the_closed_form_is_reached_after_many_turns(period, samples):
    exact = exact_error(samples, period)
    closed = theory.drift_error_rolled(LEVEL, period, samples * 10.0, 10.0)
    # Slow noise leaks into the fit as log(n) over the number of turns.
    assert exact == pytest.approx(closed, rel=math.log(samples) / (samples * 10 / period))


# -- filters -------------------------------------------------------------------------------------------------


def lag_of(weights):
    return np.arange(len(weights)) @ weights * theory.INTERVAL


def bandwidth_of(weights):
    return np.sum(weights**2) / (2 * theory.INTERVAL)


@pytest.mark.parametrize("tau", [50.0, 700.0])
def test_a_single_pole_is_the_recursion(tau):
    weights = theory.single_pole(tau)
    impulse = np.zeros(50)
    impulse[0] = 1
    a = 1 - math.exp(-10 / tau)
    assert weights[:50] == pytest.approx(signal.lfilter([a], [1, a - 1], impulse), rel=1e-12)
    assert np.sum(weights) == pytest.approx(1, abs=2e-16 * len(weights) + 1e-15)
    assert lag_of(weights) == pytest.approx(10 * (1 - a) / a, rel=1e-12)
    assert bandwidth_of(weights) == pytest.approx(a / (2 - a) / 20, rel=1e-12)


def test_a_moving_average_over_whole_turns_stops_the_roll_frequency_and_its_double():
    weights = theory.moving_average(775.0)
    assert len(weights) == 78 or len(weights) == 77
    weights = theory.moving_average(600.0)
    for turns in (1, 2):
        assert abs(np.sum(weights * np.exp(2j * np.pi * turns * np.arange(60) / 60))) < 1e-14
    assert lag_of(weights) == pytest.approx(295.0)
    assert bandwidth_of(weights) == pytest.approx(1 / 1200)


@pytest.mark.parametrize("drift", [40.0, 6600.0])
def test_the_best_bandwidth_is_the_best(drift):
    density = theory.FLOWN_DENSITY
    best = theory.best_bandwidth(drift, density)
    least = float(theory.filtered_error(drift, density, best))
    around = theory.filtered_error(drift, density, best * np.geomspace(0.1, 10, 201))
    assert np.argmin(around) == 100
    assert least == pytest.approx(0.75 * (drift / YEAR * density) ** (2 / 3), rel=1e-12)
    assert density * best == pytest.approx(2 / 3 * least)
    for weights in (theory.single_pole(1 / (4 * best)), theory.moving_average(1 / (2 * best))):
        lag, width = lag_of(weights), bandwidth_of(weights)
        # Sampled filters differ from continuous ones by half an interval.
        assert (drift / YEAR * lag) ** 2 + density * width == pytest.approx(least, rel=10 * best * 4)
    assert float(theory.signal_to_noise(drift, YEAR, least)) == pytest.approx(drift**2 / 3 / least)


# -- roll rate ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reset", [None, 25])
def test_a_wandering_rate_is_the_sum_over_its_steps(reset):
    n, step, q, k = 2000, 50.0, 1e-20, 6600.0
    weights = theory.slope_weights(n, step) * k * step * (np.arange(n) + 0.5)
    total = 0.0
    for i in range(0, n):
        rate = np.zeros(n)
        rate[i:] = math.sqrt(q * step)
        begin = np.concatenate([[0.0], np.cumsum(rate)[:-1]]) * step
        phase = begin + rate * step / 2
        if reset:
            phase = phase - np.repeat(begin[::reset], reset)[:n]
        total += np.sum(weights * phase) ** 2
    expected = theory.rate_walk_error(k, q, n * step, reset and reset * step)
    assert math.sqrt(total) == pytest.approx(expected, rel=2e-3 if reset is None else 0.02)


# -- rotations ------------------------------------------------------------------------------------------------------


def test_a_wandering_roll_rate_has_the_derived_coefficients():
    """A unit step of the rate at u moves the phase by t - u; with resets every P it moves it by P/2 on average."""
    t, u = sp.symbols("t u")
    for reset in (None, 1.0):
        slope = sp.integrate(
            12 * (t - sp.Rational(1, 2)) * t * (t - u if reset is None else sp.Rational(1, 2)), (t, u, 1)
        )
        variance = sp.integrate(sp.expand(slope**2), (u, 0, 1))
        assert theory.rate_walk_error(1.0, 1.0, 1.0, reset) ** 2 == pytest.approx(float(variance), rel=1e-14)
