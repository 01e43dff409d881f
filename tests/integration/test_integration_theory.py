"""gpbnb.report.integration.theory: closed forms against mpmath, quadrature, recursions and each other."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy import integrate

from gpbnb.report.integration import theory

FIRST = theory.first_order(1.7, 3.0)
RINGING = theory.resonant(1.3, 3.0, 0.2)
# -- the stable evaluation ------------------------------------------------------------------------

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


def test_langevin_is_the_function_of_that_name():
    x = np.array([0.1, 1.0, 2.0, 3.0, 30.0, 800.0])
    assert theory.langevin(x) == pytest.approx(1 / np.tanh(x) - 1 / x, rel=2e-14)
    slope = (theory.langevin(x + 1e-5) - theory.langevin(x - 1e-5)) / 2e-5
    value = theory.langevin(x)
    assert slope == pytest.approx(1 - value**2 - 2 * value / x, abs=1e-9)
    assert theory.langevin(np.array([[1.0], [2.0]])).shape == (2, 1)
    assert theory.langevin(0.7).shape == ()


# -- (35) and (39) --------------------------------------------------------------------------------


def test_the_approximation_is_the_small_limit_and_too_large():
    mu = np.geomspace(1e-3, 1e3, 50)
    ratio = theory.approximation_ratio(mu)
    assert np.all(np.diff(ratio) > 0)
    assert ratio[0] - 1 == pytest.approx(1e-6 / 120, rel=1e-3)
    for excess in (1e-6, 0.01, 0.1, 2.0):
        assert theory.approximation_ratio(theory.validity(excess)) - 1 == pytest.approx(excess, rel=1e-6)


def test_exponents_go_from_those_of_the_abstract_to_others():
    width, rate = theory.exponents([1e-3, 1e4])
    # xL'/2L = 1/2 - μ²/120 + …, and 1/μ beyond; differences have errors of 1e-12 or so.
    assert width == pytest.approx([0.5, 1e-4], abs=1e-6)
    assert rate == pytest.approx(-0.5 - width, abs=1e-15)
    mu, h = 2.0, 1e-5
    by_rate = math.log(theory.random_walk(1, mu, math.exp(h)) / theory.random_walk(1, mu, math.exp(-h))) / (2 * h)
    assert float(theory.exponents(mu)[1]) == pytest.approx(by_rate, abs=1e-8)


@pytest.mark.parametrize("limit", [1e-6, 0.01, 0.3, 50.0])
def test_the_required_rate_meets_the_limit(limit):
    rate = theory.required_rate(2.0, 30.0, limit)
    assert theory.random_walk(2.0, 30.0, rate) == pytest.approx(limit, rel=1e-9)


# -- the discretization ---------------------------------------------------------------------------


def test_the_variance_is_the_integral_that_it_stands_for():
    omega, sigma, period = 3.0, 1.7, 0.4
    second = integrate.quad(lambda s: ((1 - math.exp(-omega * s)) / omega) ** 2, 0, period)[0]
    found = float(theory.integral_variance(omega * period)) * sigma**2 * period**2
    assert found == pytest.approx(2 * omega * sigma**2 * second, rel=1e-12)


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


# -- the build-up ---------------------------------------------------------------------------------


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


@pytest.mark.parametrize("mu", [0.5, 5.0])
def test_the_documents_recursion_mended_and_as_printed(mu):
    exact = theory.error_variance(np.arange(31), mu)
    assert theory.savage_recursion(30, mu) == pytest.approx(exact, abs=1e-10)
    for slips in ({"p32_weight": 1.0}, {"p22_slip": True}):
        assert abs(theory.savage_recursion(30, mu, **slips)[1] / exact[1] - 1) > 0.2
    # (25) is harmless in the end, (18) is not.
    harmless, harmful = (
        np.diff(theory.savage_recursion(30, mu, **slips))[-1] for slips in ({"p22_slip": True}, {"p32_weight": 1.0})
    )
    assert harmless == pytest.approx(np.diff(exact)[-1], abs=1e-5)
    assert abs(harmful - np.diff(exact)[-1]) > 0.1


@pytest.mark.parametrize("mu", [0.01, 1.0, 50.0])
def test_the_random_walk_takes_over_where_it_says(mu):
    for share in (0.001, 0.05):
        n = theory.settling_cycles(mu, share)
        away = abs(float(theory.error_variance(n, mu)) / (n * float(theory.walk_factor(mu))) - 1)
        assert away <= share * (1 + 1e-9)
        if n > 1:
            assert away == pytest.approx(share, rel=1e-6)


# -- other inputs ---------------------------------------------------------------------------------


@pytest.mark.parametrize("process", [FIRST, RINGING], ids=["first order", "resonant"])
def test_folding_is_the_sum_of_the_spectrum(process):
    """The rest of the sum falls as the square of the frequency or faster."""
    k = np.arange(1, 200_001)
    assert theory.walk_rate(process, 2.0) == pytest.approx(
        2 * float(np.sum(process.psd(2 * np.pi * k * 2.0))), rel=1e-4
    )
