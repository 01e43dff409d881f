"""gpbnb.report.kalman.smallest: filters of one and two states that violate the bounds of the report."""

from __future__ import annotations

from fractions import Fraction

import pytest
from printed_ratios import ratios

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.kalman import report_bounds, smallest

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
    first, second = ratios(fmt, case), ratios(fmt, case, second=True)
    assert first.covariance == second.covariance == float(1 / (6 * beta))
    assert second.gain == float(1 / (9 * beta))
    assert first.state == float(1 / (16 * beta))
    assert second.state == float(1 / (16 * beta * case.R[0, 0]))
    assert first.gain < 1


def test_more_steps_and_more_states():
    four = FloatFormat(10, 4)
    later = ratios(four, smallest.scalar(four), steps=2)
    assert later.gain == float(1 / (9 * four.unit_roundoff))
    assert ratios(four, smallest.scalar(four), steps=3).state == float(1 / (48 * four.unit_roundoff))
    # (4n + 2m + 3) β = 13 β, and the first entry of the gain is lost.
    case, beta = smallest.correlated(), four.unit_roundoff
    found = ratios(four, case)
    assert found.gain == float(1 / (13 * beta))
    K = case.P @ case.H.T / (case.H @ case.P @ case.H.T + case.R)[0, 0]
    error = abs(smallest.rounded_step(four, case)[0] - K @ case.z).max()  # the estimate was zero
    assert found.state == float(error / (beta * sum(report_bounds.coefficients(1, n=2, m=1)) * abs(K @ case.z).max()))


def test_nothing_is_broken_where_nothing_cancels():
    four = FloatFormat(10, 4)
    for second in (False, True):
        assert max(ratios(four, smallest.scalar(four, r=9), second)) < 1


def test_a_measurement_far_from_zero_saves_the_bound():
    """With K rounded to one, |R(1 - z)| exceeds β(16|R + z| + 4|z|) for z below R(1 - 16β)/(R + 20β) alone."""
    four = FloatFormat(10, 4)
    R, beta = smallest.scalar(four).R[0, 0], four.unit_roundoff
    edge = R * (1 - 16 * beta) / (R + 20 * beta)
    for factor, fails in ((Fraction(9, 10), True), (Fraction(11, 10), False)):
        case = smallest.scalar(four, z=four.round(edge * factor))
        assert (ratios(four, case).state > 1) == fails
