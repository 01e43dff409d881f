"""gpbnb.report.integration.theory: closed forms against mpmath, quadrature, recursions and each other."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from gpbnb.report.integration import theory

FIRST = theory.first_order(1.7, 3.0)
RINGING = theory.resonant(1.3, 3.0, 0.2)

MU = np.concatenate(
    [
        10.0 ** np.random.default_rng(1).uniform(-300, 300, 300),
        10.0 ** np.random.default_rng(2).uniform(-3, 3, 500),
        np.linspace(3.9, 4.1, 100),  # where the continued fraction ends
        [1e-300, 1e300, 4.0, np.nextafter(4.0, 5.0), 1e-154, 1e154],
    ]
)
MOST_ULP = {"walk": 1.5, "q22": 4.0}
"""Of few roundings each."""


def off(name, mu):
    """Error of the closed form or of an entry of the discretization, in units in the last place of float64."""
    found = float(theory.walk_factor(mu) if name == "walk" else theory.integral_variance(mu))
    with mpmath.workdps(60 + 3 * max(0, math.ceil(-math.log10(mu)))):
        m = mpmath.mpf(mu)
        phi = mpmath.exp(-m)
        walk = (1 + phi) / (1 - phi) - 2 / m
        exact = {
            "walk": lambda: walk,
            "q22": lambda: (2 * m - 3 + 4 * phi - phi**2) / m**2,
        }[name]()
        unit = np.spacing(max(float(exact), np.finfo(float).tiny))
        return float(abs(mpmath.mpf(found) - exact) / mpmath.mpf(float(unit)))


@pytest.mark.parametrize("name", MOST_ULP)
def test_right_to_a_few_units_in_the_last_place_everywhere(name):
    assert max(off(name, mu) for mu in MU.tolist()) <= MOST_ULP[name]


@pytest.mark.parametrize("f_c", [0.3, 5.0, 200.0])
@pytest.mark.parametrize("process", [FIRST, RINGING], ids=["first order", "resonant"])
def test_a_step_keeps_the_steady_state_and_has_the_errors_of_fine_steps(process, f_c):
    """Ten steps of a tenth: the integral over the whole is the sum of theirs, in mean and covariance."""
    m, parts = len(process.drift), 10
    step, fine = theory.exact_step(process, f_c), theory.exact_step(process, f_c * parts)
    assert step.a[:m] @ step.a[:m].T + (step.b @ step.b.T)[:m, :m] / process.sigma**2 == pytest.approx(np.eye(m))
    move, added = np.zeros((m + 1, m + 1)), fine.b @ fine.b.T  # of z and of the integral
    half = 0.5 / f_c / parts
    change = np.eye(m + 1)
    change[m], change[m, m] = 0, -1
    change[m, 0] = half
    move[:m, :m], move[m, :m], move[m, m] = fine.a[:m], half * (fine.a[0] + np.eye(m)[0]) - fine.a[m], 1
    added = change @ added @ change.T
    total, covariance = np.eye(m + 1), np.zeros((m + 1, m + 1))
    for _ in range(parts):
        total, covariance = move @ total, move @ covariance @ move.T + added
    change[m, 0] = 0.5 / f_c
    a = change @ total[:, :m]
    a[m, 0] += 0.5 / f_c
    unit = np.array([1.0] * m + [1 / f_c])
    # In float64 the differences cancel to μ³: what is left is good to 1e-16 of the terms.
    assert (step.a - a) / unit[:, np.newaxis] == pytest.approx(0, abs=1e-13)
    assert (step.b @ step.b.T - change @ covariance @ change.T) / np.outer(unit, unit) == pytest.approx(0, abs=3e-13)


@pytest.mark.parametrize("mu", [1e-6, 0.1, 1.0, 30.0, 1e4])
def test_recursion_and_closed_form(mu):
    n = np.arange(200)
    closed = theory.error_variance(n, mu)
    assert theory.error_variance_recursion(199, mu) == pytest.approx(closed, rel=1e-12, abs=0)
    assert closed[0] == 0
    # The rate is between half of the steady one and all of it.
    rate = np.diff(closed) / float(theory.walk_factor(mu))
    assert np.all(rate < 1 + 1e-12)
    assert np.all(rate > 0.5)


@pytest.mark.parametrize("mu", [0.01, 1.0, 50.0])
def test_the_random_walk_takes_over_where_it_says(mu):
    for share in (0.001, 0.05):
        n = theory.settling_cycles(mu, share)
        away = abs(float(theory.error_variance(n, mu)) / (n * float(theory.walk_factor(mu))) - 1)
        assert away <= share * (1 + 1e-9)
        if n > 1:
            assert away == pytest.approx(share, rel=1e-6)


@pytest.mark.parametrize("process", [FIRST, RINGING], ids=["first order", "resonant"])
def test_folding_is_the_sum_of_the_spectrum(process):
    """The rest of the sum falls as the square of the frequency or faster."""
    k = np.arange(1, 200_001)
    assert theory.walk_rate(process, 2.0) == pytest.approx(
        2 * float(np.sum(process.psd(2 * np.pi * k * 2.0))), rel=1e-4
    )
