"""gpbnb.report.budget.theory: equal errors, and factors of averaging."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpbnb.report.budget import theory

SEEDED = settings(derandomize=True, deadline=None, database=None)


def test_the_printed_example():
    assert theory.equal_error(1, 44) == pytest.approx(44**-0.5, rel=1e-15)
    assert theory.root_sum_square([0.15] * 44) < 1 < theory.root_sum_square([0.16] * 44)
    assert theory.equal_sources(1.253, 0.15) == pytest.approx((1.253 / 0.15) ** 2)


# -- averages -------------------------------------------------------------------------------------


@settings(SEEDED)
@given(st.integers(1, 10**7))
def test_whole_cycles_leave_nothing(cycles):
    assert theory.cycles_factor(cycles) == 0


@settings(SEEDED)
@given(st.floats(0.01, 1e4))
def test_cycles_factor_is_that_of_sinc(cycles):
    # numpy's sinc takes the sine of a large number: its error is an ulp of that number
    assert theory.cycles_factor(cycles) == pytest.approx(abs(np.sinc(cycles)), rel=1e-12, abs=1e-15)
    assert theory.cycles_factor(cycles) <= min(1, 1 / (math.pi * cycles)) * (1 + 1e-15)
    assert theory.cycles_factor(0) == 1


@pytest.mark.parametrize("h", [1e-12, 1e-5, 0.1, 0.49, 0.5, 2.0, 40.0, 1e6])
def test_correlated_factor_against_many_digits(h):
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(60):
        x = mpmath.mpf(h)
        exact = mpmath.sqrt(2 * (x - 1 + mpmath.exp(-x))) / x
    # expm1 cancels to a fifth at worst
    assert theory.correlated_factor(h, 1.0) == pytest.approx(float(exact), rel=4e-15)
