"""gpbnb.report.kalman.smallest: filters of one and two states that violate the bounds of the report."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.kalman import smallest

FORMATS = [
    FloatFormat(b, t, rounding)
    for b in (2, 3, 10, 16)
    for t in (2, 4, 9, 17)
    for rounding in Rounding.documented()
    if b**t > 40
]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_the_smallest_filter_breaks_the_bounds_by_the_derived_factors_in_every_format(fmt):
    case, beta = smallest.scalar(fmt), fmt.unit_roundoff
    x, K, P = smallest.rounded_step(fmt, case)
    assert (x[0], K[0, 0], P[0, 0]) == (0, 1, 0)
    x, K, P = smallest.rounded_step(fmt, case, second=True)
    assert (x[0], K[0, 0], P[0, 0]) == (1, 0, 0)
    first, second = smallest.ratios(fmt, case), smallest.ratios(fmt, case, second=True)
    assert first.covariance == second.covariance == float(1 / (6 * beta))
    assert second.gain == float(1 / (9 * beta))
    assert first.state == float(1 / (16 * beta))
    assert second.state == float(1 / (16 * beta * case.R[0, 0]))
    assert first.gain < 1


def test_more_steps_and_more_states():
    four = FloatFormat(10, 4)
    later = smallest.ratios(four, smallest.scalar(four), steps=2)
    assert later.gain == float(1 / (9 * four.unit_roundoff))
    assert smallest.ratios(four, smallest.scalar(four), steps=3).state == float(1 / (48 * four.unit_roundoff))
    # (4n + 2m + 3) β = 13 β, and the first entry of the gain is lost.
    assert smallest.ratios(four, smallest.correlated()).gain == float(1 / (13 * four.unit_roundoff))


def test_nothing_is_broken_where_nothing_cancels():
    four = FloatFormat(10, 4)
    for second in (False, True):
        assert max(smallest.ratios(four, smallest.scalar(four, r=9), second)) < 1


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("fmt", [FloatFormat(10, 2), FloatFormat(2, 6)], ids=str)
def test_the_largest_violating_noise_is_the_largest(fmt, second):
    found = smallest.largest_violating_noise(fmt, second)
    numbers = {Fraction(d, fmt.base ** (fmt.precision - 1 + e)) for e in range(3) for d in range(1, 100)}
    for name, largest in found.items():
        assert largest <= 1
        assert getattr(smallest.ratios(fmt, smallest.scalar(fmt, largest), second), name) > 1
        for r in numbers:
            if largest < r <= 1 and fmt.round(r) == r:
                assert getattr(smallest.ratios(fmt, smallest.scalar(fmt, r), second), name) <= 1


@pytest.mark.parametrize("fmt", [FloatFormat(2, 24), FloatFormat(2, 10, "chop")], ids=str)
def test_random_steps_are_counted_as_exact_ratios_say(fmt):
    steps = 400
    numbers = smallest.random_numbers(fmt, steps, np.random.default_rng(125))
    Phi, H, x, z, P, Q, R = (exact(each.to_fractions()) for each in numbers)
    assert min([*P, *Q, *R]) > 0
    assert min(x) < 0 < max(x)
    one = fmt.array(np.ones(steps))
    rounded = [each.to_fractions() for each in smallest.scalar_step(one, *numbers)]
    covariance = state = 0
    for i in range(steps):
        case = smallest.FilterCase(
            *(exact(each) for each in ([[Phi[i]]], [[H[i]]], [[Q[i]]], [[R[i]]], [x[i]], [[P[i]]], [z[i]]))
        )
        slow = smallest.rounded_step(fmt, case)
        assert [each.item() for each in slow] == [each[i] for each in rounded]
        ratios = smallest.ratios(fmt, case)
        covariance += ratios.covariance > 1
        state += ratios.state > 1
    found = smallest.random_steps(fmt, steps, np.random.default_rng(125))
    assert found == (steps, covariance, state)
    assert covariance > 0


def test_random_steps_violate_the_bound_of_the_state_seldom():
    found = smallest.random_steps(FloatFormat(2, 24), 200_000, np.random.default_rng(125))
    assert found.steps == 200_000
    assert 0.15 < found.covariance / found.steps < 0.25
    assert 0.005 < found.state / found.steps < 0.01


def test_a_measurement_far_from_zero_saves_the_bound():
    """With K rounded to one, |R(1 - z)| exceeds β(16|R + z| + 4|z|) for z below R(1 - 16β)/(R + 20β) alone."""
    four = FloatFormat(10, 4)
    R, beta = smallest.scalar(four).R[0, 0], four.unit_roundoff
    edge = R * (1 - 16 * beta) / (R + 20 * beta)
    for factor, fails in ((Fraction(9, 10), True), (Fraction(11, 10), False)):
        case = smallest.scalar(four, z=four.round(edge * factor))
        assert (smallest.ratios(four, case).state > 1) == fails


def test_steps_in_too_fine_a_format_are_refused():
    with pytest.raises(ValueError, match="needed a unit roundoff of at least 2\\*\\*-30"):
        smallest.random_steps(FloatFormat(2, 40), 10, np.random.default_rng(1))
