"""gpbnb.report.budget: derived factors and simulated averages agree with the theory."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy as sp

from gpbnb.report.budget import derivation, experiment, theory


def test_sources_are_counted():
    assert derivation.N.is_integer
    assert derivation.J.is_integer


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
