"""geometry.experiment: a simulated year with exact rotations agrees with the analysis, within third order."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.report.geometry import experiment, theory
from gpbnb.report.geometry.theory import Misalignments
from gpbnb.report.measurement import ARCSEC

SIZE = 20 * ARCSEC
STEP = 7200.0  # long steps in long rolls: as many rolls as the tests have time for
PERIOD = 5 * 7200.0
ANGLES = [f"{name}{axis}" for name in ("alpha", "beta", "gamma") for axis in (1, 2, 3)]
PAIRS = ("beta1", "alpha2"), ("gamma1", "alpha2"), ("gamma1", "alpha3"), ("beta2", "gamma3")
CASES = {
    "no angle": Misalignments(),
    **{name: Misalignments().with_angle(name, SIZE) for name in ANGLES},
    **{f"{a} and {b}": Misalignments().with_angle(a, SIZE).with_angle(b, SIZE) for a, b in PAIRS},
}


def third_order(case):
    """Bound of what the analysis leaves out: at most 30 third-order products with coefficients up to one (sympy)."""
    largest = max(abs(v) for name, value in vars(case).items() for v in value)
    return 30 * largest**3


def test_the_spin_axis_is_turned_by_both_angles_at_once():
    """Half a right angle each, the second about the axis that the first has left where it was."""
    axis = experiment.spin_axis(Misalignments(drift=(np.pi / 4, np.pi / 4)), [0, 1])
    assert axis == pytest.approx(np.array([[1, 0, 0], [0.5, -(0.5**0.5), 0.5]]))


def ramp_leak(rate):
    """The error of the mean of a roll's five samples due to an offset in the spacecraft that grows at a rate."""
    k = np.arange(5)
    return rate * PERIOD / 5 * abs(np.mean(k * np.exp(2j * np.pi * k / 5)))


def test_a_year_agrees_with_the_analysis():
    for name in CASES:
        case = CASES[name]
        result, analysed = experiment.year(case, PERIOD, STEP), theory.effect(case)
        assert np.hypot(*np.subtract(result.drift, analysed.drift)) <= third_order(case)
        assert np.hypot(*np.subtract(result.angle, analysed.angle)) <= third_order(case)
        # the drift itself turns within a roll, too
        assert result.line == pytest.approx(
            analysed.line, abs=ramp_leak(theory.GEODETIC / theory.YEAR) * 2 + 1e-3 * SIZE
        )


def test_any_misalignments():
    for values in np.random.default_rng(9).uniform(-1e-4, 1e-4, (15, 9)):
        case = Misalignments(tuple(values[:3]), tuple(values[3:6]), tuple(values[6:]))
        result = experiment.year(case, PERIOD, STEP)
        assert np.hypot(*np.subtract(result.drift, theory.effect(case).drift)) <= 30 * 1e-12 + 1e-15
        assert np.hypot(*np.subtract(result.angle, theory.effect(case).angle)) <= 30 * 1e-12 + 1e-15


def test_the_line_fit_to_samples_keeps_what_the_fit_to_means_drops():
    case, rolls = Misalignments().with_angle("gamma3", SIZE), int(theory.YEAR / PERIOD)
    k = np.arange(5 * rolls)
    time = k * STEP / theory.YEAR
    samples = experiment.difference(case, time, 2 * np.pi / 5 * (k % 5))
    sampled = np.hypot(*(np.polyfit(time, samples, 1)[0] - case.drift))
    leak = theory.line_fit_leak(SIZE, rolls) / (rolls * PERIOD / theory.YEAR)
    assert sampled == pytest.approx(leak / (5 / np.pi * np.sin(np.pi / 5)), rel=1e-3)  # of five samples a roll
    assert np.hypot(*experiment.year(case, PERIOD, STEP).drift) <= third_order(case) < sampled / 1e3


def test_rolls_that_are_no_whole_number_of_samples():
    case = Misalignments().with_angle("gamma2", SIZE)
    result = experiment.year(case, 77.5 * 100, 1000.0)
    assert np.hypot(*result.drift) <= third_order(case)
    assert result.line == pytest.approx(SIZE, rel=1e-3)


def test_an_angle_about_the_roll_axis_turns_the_drift():
    sizes, drift = np.array([1, 30, 1000]) * ARCSEC, (theory.GEODETIC, theory.MOTIONAL)
    errors = experiment.small_angle_errors("alpha1", sizes, drift)
    assert errors == pytest.approx(sizes * np.hypot(*drift), rel=1e-4)  # up to the square of the largest angle
