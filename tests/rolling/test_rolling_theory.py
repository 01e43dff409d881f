"""gpbnb.report.rolling.theory: closed forms against quadrature, sums and the printed numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.theory import LEVEL, YEAR

CHOP = Rounding.CHOP


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


def test_a_wandering_roll_rate_has_the_derived_coefficients():
    """A unit step of the rate at u moves the phase by t - u; with resets every P it moves it by P/2 on average."""
    t, u = sp.symbols("t u")
    for reset in (None, 1.0):
        slope = sp.integrate(
            12 * (t - sp.Rational(1, 2)) * t * (t - u if reset is None else sp.Rational(1, 2)), (t, u, 1)
        )
        variance = sp.integrate(sp.expand(slope**2), (u, 0, 1))
        assert theory.rate_walk_error(1.0, 1.0, 1.0, reset) ** 2 == pytest.approx(float(variance), rel=1e-14)
