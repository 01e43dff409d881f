"""Bounds of systems that limit their values: against runs, against the linear bound, and where none exists."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, LinearSystem, required_precision
from gpbnb.bounds.guarantee import limits
from gpbnb.bounds.limited import _Steps, limited_errors
from gpbnb.bounds.system import output_errors
from gpbnb.wordlength.required import judge

LEAKING = [
    {"Kd": "0.7", "leak": "0.99", "limits": (-1, 1)},
    {"Kd": "0.3", "leak": "0.9", "limits": ("-0.5", "0.7"), "back_calculation": "0.05"},
    {"leak": "0.95", "integral_limits": ("-0.3", "0.3"), "limits": (-1, 1)},
    {"Kd": "-0.4", "leak": "0.8", "integral_limits": ("-0.3", "0.2"), "limits": ("0.1", 1), "back_calculation": "0.1"},
]  # fmt: skip


@pytest.mark.parametrize("given", LEAKING, ids=str)
def test_no_run_is_beyond_its_bound(given):
    """Chopped errors have one sign, so that the bound is within a factor of 20 of some."""
    system, rng = LinearSystem.pid("0.8", "0.1", **given), np.random.default_rng(4)
    shares = []
    for fmt in (FloatFormat(2, 9), FloatFormat(2, 12, "chop"), FloatFormat(10, 4), FixedFormat(4, 9, "down")):
        bound = limited_errors(system, fmt, np.array([1.0]))[0]
        for swing in (1, 5, 40, 5000):  # the last is always positive
            e = np.clip(np.sign(np.sin(np.arange(600) / swing)) + rng.uniform(-0.2, 0.2, 600), -1, 1)[:, None]
            shares.append(np.abs((system.outputs(e, fmt) - system.outputs(e)).sum(axis=-1)).max() / bound)
    assert 1 / 20 < max(shares) <= 1


@pytest.mark.parametrize("fmt", [FloatFormat(2, 9), FloatFormat(2, 12, "chop"), FloatFormat(10, 4)], ids=str)
def test_limits_that_are_never_reached_leave_the_bound_of_the_linear_system(fmt):
    given = {"Kp": "0.8", "Ki": "0.1", "leak": "0.9"}
    (linear,) = output_errors(LinearSystem.pid(**given), fmt, 1.0)
    (limited,) = limited_errors(LinearSystem.pid(**given, limits=(-100, 100)), fmt, np.ones(1))
    assert 1 - 2.0**-19 < limited / linear < 1.1  # a claim of the linear bound is larger by 2**-20


def test_two_numbers_between_limits_differ_by_their_distance():
    """An integral without leak keeps its errors, but limits hold it: y = e/2 + integral, both between -1/4 and 1/4."""
    system = LinearSystem.pid("0.5", "0.1", integral_limits=("-0.25", "0.25"))
    bound = limited_errors(system, FloatFormat(2, 30), np.array([1.0]))[0]
    assert 0.5 <= bound < 0.5 + 1e-6


def test_sizes_have_the_limits_as_given_and_distances_both():
    """In two bits, limits of -0.7 and 0.7 are -0.75 and 0.75."""
    system = LinearSystem.pid("0.5", "0.5", leak="0.5", integral_limits=("-0.7", "0.7"))
    steps = _Steps(system, FloatFormat(2, 2), np.full(1, 8.0))
    assert steps.sizes(np.full(2, 8.0))[0] == pytest.approx(0.7)
    steps.largest_states = np.full(2, 8.0)
    assert steps.errors(np.full(2, 8.0))[0] == pytest.approx(1.5)


def test_an_integral_without_limits_or_leak_has_no_bound_for_ever():
    e = np.ones((10, 1))
    system = LinearSystem.pid("0.5", "0.1", limits=(-1, 1))
    with pytest.raises(ValueError, match="whose states may grow without end; needed limits on them"):
        limited_errors(system, FloatFormat(2, 24), np.ones(1))
    found = judge(system, FloatFormat(2, 24), e, 0.01, basis="bound")
    assert (found.met, found.steps) == (True, 10)
    assert str(found).endswith("proved for this run of 10 steps")
    with pytest.raises(ValueError, match="a linear system with limits, cannot have a probable error; ask"):
        required_precision(system, 10, 0.01, basis="probable", within=limits(measurement=1))


def test_a_guarantee_takes_its_limits_from_the_question():
    system = LinearSystem.pid("0.8", "0.1", leak="0.9", limits=(-1, 1))
    found = required_precision(system, 10, 0.01, basis="guarantee", within=limits(measurement=1))
    assert found.tried == required_precision(system, np.ones((10, 1)), 0.01, basis="bound").tried
