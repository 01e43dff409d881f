"""gpbnb.report.rolling.experiment: simulations against closed forms, within their standard errors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.report.ledger.checks import rolling as material
from gpbnb.report.rolling import experiment, theory
from gpbnb.report.rolling.experiment import SWEEP, record
from gpbnb.report.rolling.theory import DRIFTS, LEVEL, YEAR


def rng(seed=0):
    return np.random.default_rng(seed)


# -- through roll and deroll ----------------------------------------------------------------------------


def test_the_stages_are_those_of_5_to_7():
    found = experiment.derolled_record(DRIFTS, 30.0, 77.5, rng(1), 200, 10.0)
    for n in (0, 3, 77, 199):
        r = theory.rotation(2 * math.pi * n * 10 / 77.5)
        s = np.array(DRIFTS) * (n * 10 / YEAR)
        noise = np.array([found["noise"][n].real, found["noise"][n].imag])
        for name, expected in (
            ("signal", s),
            ("rolled", r @ s),
            ("measured", r @ s + noise),
            ("derolled", s + r.T @ noise),
        ):
            assert [found[name][n].real, found[name][n].imag] == pytest.approx(list(expected), abs=1e-11)
    assert np.std(found["noise"].real) > 5
    assert not np.array_equal(found["noise"].real, found["noise"].imag)


@pytest.mark.parametrize("angle", [1e-4, math.radians(1), 0.4])
def test_a_phase_error_costs_what_theory_says(angle):
    found = experiment.clean_drift_error(DRIFTS, lambda t: np.full(t.shape, angle))
    assert found == pytest.approx(theory.phase_error_cost(DRIFTS, angle), rel=1e-8)


@pytest.mark.parametrize("digits", [6, 8, 10])
def test_an_off_tuned_deroll_costs_what_theory_says(digits):
    exact = theory.roll_rate(600.0)
    rate = float(round(exact, digits + 1) - exact)  # the first digit is the second decimal
    found = experiment.clean_drift_error((6600.0, 0.0), lambda t: rate * t)
    expected = theory.fitted_drift((6600.0, 0.0), lambda t: rate * t) - np.array([6600.0, 0.0])
    # The sum over samples 100 s apart differs from the integral by about their number to the minus one.
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-7)


# -- spectra --------------------------------------------------------------------------------------------


def test_the_spectra_of_drift_and_noise():
    found = material.spectra()
    frequency = np.arange(1, len(found.ramp) + 1) / found.duration
    drift = theory.ramp_density(DRIFTS[1] * YEAR / found.duration, found.duration, frequency)
    assert found.ramp[:3] == pytest.approx(drift[:3], rel=0.02)
    # Means of 4 gyros' two readouts over independent frequencies.
    roll, count = float(theory.flicker_density(theory.LEVEL, 1 / theory.PERIOD)), len(found.base_noise)
    assert len(found.line_noise) == 2 * count == 50
    assert np.mean(found.line_noise) == pytest.approx(roll, rel=4 / math.sqrt(16 * count))
    assert np.mean(found.base_noise) == pytest.approx(roll, rel=4 / math.sqrt(8 * count))
    banded = experiment.in_bands(frequency, found.noise, 8, frequency[0] * 0.99, 0.05, 40)
    noise = theory.flicker_density(theory.LEVEL, banded.frequency, theory.INTERVAL)
    assert np.max(abs(banded.density / noise - 1) / banded.error) < 4.5


# -- drift rates --------------------------------------------------------------------------------------------


def test_drift_rates_are_those_of_whole_records():
    """The slow way: all in one array, fitted by np.polyfit."""
    n, interval = 3000, 10.0
    study = experiment.drift_rates([None, 77.5], 2, rng(4), n)
    pairs = record(LEVEL, n, 4, rng(4))
    t = np.arange(n) * interval
    for g in range(2):
        noise = pairs[:, 2 * g] + 1j * pairs[:, 2 * g + 1]
        for p, period in enumerate((None, 77.5)):
            turn = 1 if period is None else np.exp(1j * theory.roll_phase(np.arange(n), period))
            z = complex(*DRIFTS) * t / YEAR
            back = (z / turn + noise) * turn
            fitted = [np.polyfit(t, part, 1)[0] * YEAR for part in (back.real, back.imag)]
            scale = np.max(abs(study.errors))
            assert study.errors[p, g] == pytest.approx(np.array(fitted) - np.array(DRIFTS), abs=1e-8 * scale)


def test_standard_errors_of_short_records_agree_with_the_exact_ones():
    n, gyros = 2400, 400
    study = experiment.drift_rates([None, 600.0, 77.5], gyros, rng(12), n)
    a = theory.slope_weights(n) * YEAR
    turns = [np.exp(1j * (0 * a if p is None else theory.roll_phase(np.arange(n), p))) for p in study.periods]
    exact = [math.sqrt(sum(theory.variance_of_sum(a * part, LEVEL) for part in (z.real, z.imag))) for z in turns]
    assert study.uncertainty() == pytest.approx(1 / 40)
    assert np.max(abs(study.standard_error() / exact - 1)) < 4 * study.uncertainty()
    assert np.max(abs(np.mean(study.errors, axis=(1, 2)))) < 4 * max(exact) / math.sqrt(2 * gyros)


def test_the_stored_survey_agrees_with_theory():
    study = experiment.survey()
    assert study.errors.shape == (5, 128, 2)
    assert experiment.survey_rows(study) == list(SWEEP.load().rows)
    closed = [
        theory.drift_error_unrolled(LEVEL, at_rest=True)
        if p is None
        else theory.drift_error_rolled(LEVEL, p, YEAR, theory.INTERVAL)
        for p in study.periods
    ]
    z = (study.standard_error() / closed - 1) / study.uncertainty()
    assert np.max(abs(z)) < 3.5
    # What rolling buys, from simulation alone.
    gain = study.standard_error()[0] / study.standard_error()[-1]
    expected = theory.drift_error_unrolled(1.0) / theory.drift_error_rolled(1.0, 77.5) * (8 / 9) ** 0.5
    assert gain == pytest.approx(expected, rel=4 * 2**0.5 * study.uncertainty())


@pytest.mark.long  # a year of 3,153,600 samples, derolled with five periods
def test_the_stored_survey_is_computed_again_for_one_gyro_to_the_last_digit():
    study = experiment.drift_rates(experiment.SURVEY_PERIODS, 1, rng(1984))
    assert experiment.survey_rows(study) == list(SWEEP.load().rows[:1])


# -- filters ---------------------------------------------------------------------------------------------------


def test_filtered_drifts_agree_with_lag_and_exact_noise():
    study = material.filter_study()
    assert [len(set(weights)) == 1 for weights in study.filters] == [False] * 3 + [True] * 3
    expected = material.expected_squares()
    assert np.max(abs(study.error - expected) / study.uncertainty) < 4
    assert np.max(study.uncertainty / study.error) < 0.06
    bandwidth = [np.sum(weights**2) / (2 * theory.INTERVAL) for weights in study.filters]
    closed = theory.filtered_error(study.drift, theory.FLOWN_DENSITY, bandwidth)
    at_best = [1, 4]
    assert study.error[at_best] == pytest.approx(closed[at_best], rel=0.08)
    assert np.argmin(study.error[:3]) == 1 == np.argmin(study.error[3:])


# -- roll rate -----------------------------------------------------------------------------------------------------


def test_wandering_roll_rates_agree_with_theory():
    errors = material.walk_errors()
    sizes = np.sqrt(np.mean(errors**2, axis=1))
    for size, reset in zip(sizes, (None, 60000.0), strict=True):
        expected = theory.rate_walk_error(DRIFTS[0], material.WALK, reset=reset)
        assert size == pytest.approx(expected, rel=4 / math.sqrt(2 * errors.shape[1]))
    assert sizes[0] > 300 * sizes[1]


def test_a_fitted_exponent_is_that_of_the_density_before_sampling():
    """Samples of 1/f noise every 10 s have 1/f times x / sin x, x = 10 pi f; so many averages have no bias."""
    f = np.geomspace(1e-3, 0.04, 20)
    sampled = experiment.Spectrum(f, 1 / (f * np.sinc(10 * f)), np.full(20, 1e12))
    assert experiment.fit_slope(sampled).value == pytest.approx(-1, abs=1e-9)
