"""gpbnb.report.budget: equal errors, and factors of averaging against derivations and simulations."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

from gpbnb.report.budget import derivation, experiment, theory


def test_the_printed_example():
    assert theory.equal_error(1, 44) == pytest.approx(44**-0.5, rel=1e-15)
    assert theory.root_sum_square([0.15] * 44) < 1 < theory.root_sum_square([0.16] * 44)
    assert theory.equal_sources(1.253, 0.15) == pytest.approx((1.253 / 0.15) ** 2)


# -- averages -------------------------------------------------------------------------------------


def test_whole_cycles_leave_nothing():
    for cycles in [*range(1, 30), *np.random.default_rng(1).integers(1, 10**7, 70).tolist()]:
        assert theory.cycles_factor(cycles) == 0


def test_cycles_factor_is_that_of_sinc():
    for cycles in [0.01, 0.5, 1.5, 1e4, *10 ** np.random.default_rng(2).uniform(-2, 4, 100)]:
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


def test_the_factors_of_theory_are_those_of_the_derivation():
    constant, _, white, correlated = (step.right for step in derivation.averages())
    c = next(symbol for symbol in constant.free_symbols if symbol.name == "c")
    for cycles in (0.3, 2.25, 17.9):
        assert theory.cycles_factor(cycles) == pytest.approx(abs(float(constant.doit().subs(c, cycles))), rel=1e-12)
    assert theory.white_factor(9) ** 2 == pytest.approx(float(white.subs({derivation.E: 1, derivation.N: 9})))
    for ratio in (0.7, 12.0):
        value = correlated.subs({derivation.T: sp.Float(ratio, 40), derivation.TAU: 1})
        assert theory.correlated_factor(ratio, 1) ** 2 == pytest.approx(float(value), rel=1e-12)


@pytest.mark.parametrize("cycles", [0.01, 0.5, 3.3, 12.0, 80.7])
def test_means_of_turning_constants(cycles):
    # the midpoint rule multiplies the mean by x / sin x, x = pi c / samples
    x = math.pi * cycles / 20000
    assert experiment.turning_mean(cycles) == pytest.approx(
        theory.cycles_factor(cycles) * x / math.sin(x), rel=1e-9, abs=1e-13
    )


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_means_of_correlated_noise(ratio):
    trials = 4000
    means = experiment.correlated_means(ratio, 1.0, trials, np.random.default_rng(11))
    rule = (ratio / experiment.SAMPLES) ** 2 / 24
    assert abs(np.sqrt(np.mean(means**2)) / theory.correlated_factor(ratio, 1) - 1) < 4 / math.sqrt(2 * trials) + rule
