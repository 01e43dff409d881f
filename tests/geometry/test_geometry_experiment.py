"""geometry.experiment: a simulated year with exact rotations agrees with the analysis, within third order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpbnb.report.geometry import experiment, theory
from gpbnb.report.geometry.theory import Misalignments
from gpbnb.report.measurement import ARCSEC, MAS

SEEDED = settings(derandomize=True, deadline=None, database=None)

SIZE = 20 * ARCSEC
STEP = 7200.0  # long steps in long rolls: as many rolls as the tests have time for
PERIOD = 5 * 7200.0
CASES = experiment.misalignment_cases(SIZE)


def third_order(case):
    """Bound of what the analysis leaves out: at most 30 third-order products with coefficients up to one (sympy)."""
    largest = max(abs(v) for name, value in vars(case).items() for v in value)
    return 30 * largest**3


def ramp_leak(rate):
    """The error of the mean of a roll's five samples due to an offset in the spacecraft that grows at a rate."""
    k = np.arange(5)
    return rate * PERIOD / 5 * abs(np.mean(k * np.exp(2j * np.pi * k / 5)))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("period", [None, PERIOD])
def test_a_year_agrees_with_the_analysis(name, period):
    case = CASES[name]
    result, analysed = experiment.year(case, period, STEP).error, theory.effect(case, period is not None)
    # an angle that grows by SIZE in the year leaves a constant in the mean of a roll
    rate = np.hypot(*case.gamma_rate[1:]) / theory.YEAR
    leak = ramp_leak(rate) if period else 0.0
    assert np.hypot(*np.subtract(result.drift, analysed.drift)) <= third_order(case)
    assert np.hypot(*np.subtract(result.angle, analysed.angle)) <= 1.001 * leak + third_order(case)
    # the drift itself turns within a roll, too
    assert result.line == pytest.approx(analysed.line, abs=ramp_leak(theory.GEODETIC / theory.YEAR) * 2 + 1e-3 * SIZE)


@settings(SEEDED, max_examples=15)
@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9))
def test_any_misalignments(parts):
    values = np.array(parts) * 1e-4
    case = Misalignments(tuple(values[:3]), tuple(values[3:6]), tuple(values[6:]))
    result = experiment.year(case, PERIOD, STEP).error
    assert np.hypot(*np.subtract(result.drift, theory.effect(case, True).drift)) <= 30 * 1e-12 + 1e-15
    assert np.hypot(*np.subtract(result.angle, theory.effect(case, True).angle)) <= 30 * 1e-12 + 1e-15


def test_the_line_fit_to_samples_keeps_what_the_fit_to_means_drops():
    case = Misalignments().with_angle("gamma3", SIZE)
    result = experiment.year(case, PERIOD, STEP)
    rolls = result.block * len(result.time) * STEP / PERIOD
    leak = theory.line_fit_leak(SIZE, rolls, 5) / (rolls * PERIOD / theory.YEAR)
    sampled = np.hypot(*(result.sample_drift - case.drift))
    assert sampled == pytest.approx(leak, rel=1e-3)
    assert np.hypot(*(result.drift - case.drift)) <= third_order(case) < sampled / 1e3


def test_rolls_that_are_no_whole_number_of_samples(capsys):
    result = experiment.year(Misalignments().with_angle("gamma2", SIZE), 77.5 * 100, 1000.0)
    assert capsys.readouterr().err == ""  # no progress unless it is asked for
    assert result.block == 31
    assert len(result.first) == 6 * 31
    assert np.hypot(*result.error.drift) <= third_order(result.case)
    assert result.error.line == pytest.approx(SIZE, rel=1e-3)


@settings(SEEDED, max_examples=25)
@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9), st.sampled_from([3, 24, 25]))
def test_parts_of_a_roll_are_those_of_the_analysis(values, samples):
    alpha, beta, gamma = (tuple(1e-4 * v for v in values[k : k + 3]) for k in (0, 3, 6))
    case = Misalignments(alpha, beta, gamma)
    found = experiment.parts(case, 1.0, samples)
    left = third_order(case)
    # to second order β1 turns the mean of the telescope; β1 and γ1 that of the gyro; the difference is `measured`
    pointing, spin = np.hypot(*alpha[1:]), np.hypot(case.drift[0] + alpha[1], case.drift[1] + alpha[2])
    assert found["telescope"].mean == pytest.approx(abs(beta[0]) * pointing, abs=left)
    assert found["gyro"].mean == pytest.approx(abs(beta[0] + gamma[0]) * spin, abs=left)
    assert found["difference"].mean == pytest.approx(np.hypot(*theory.measured(case, True, 1.0)), abs=left)
    assert found["telescope"].turning == pytest.approx(np.hypot(*beta[1:]), abs=left)
    assert found["gyro"].turning == pytest.approx(np.hypot(*np.add(beta, gamma)[1:]), abs=4e-8)
    assert found["difference"].turning == pytest.approx(np.hypot(*theory.standing(beta, gamma)), abs=left)


@pytest.mark.parametrize("name", theory.SINGLE)
def test_small_angle_errors_are_the_loss(name):
    sizes = np.array([1, 30, 1000]) * ARCSEC
    drift = (theory.GEODETIC, theory.MOTIONAL)
    errors = experiment.small_angle_errors(name, sizes, drift)
    # fourth order: the largest angle, 5e-3, against one; and 1e-17 of rounding against errors of 5e-15
    assert np.allclose(errors, theory.small_angle_loss(name, sizes, drift), rtol=6e-3, atol=0)
    assert np.allclose(errors[:2], theory.small_angle_loss(name, sizes[:2], drift), rtol=1e-4, atol=1e-9 * MAS)
