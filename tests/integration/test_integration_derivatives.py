"""gpbnb.report.integration.derivatives: the least error of weighted samples, and rules that use derivatives."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from scipy import integrate

from gpbnb.report.integration import derivation, theory

FIRST = theory.first_order(1.7, 3.0)
RINGING = theory.resonant(1.3, 3.0, 0.2)
LAGGED = theory.lags(1.1, 4.0, 3)
TRAPEZOIDAL = theory.RULES["trapezoidal"]


def parts(process, f_c, n):
    """Covariance of n + 1 samples, their covariances with the integral, and its variance, by quadrature."""
    period, r = 1 / f_c, process.autocovariance
    times = np.arange(n + 1) * period
    cumulative = [integrate.quad(r, 0, t, epsabs=1e-13)[0] for t in times]
    mixed = np.array([cumulative[i] + cumulative[n - i] for i in range(n + 1)])
    variance = 2 * integrate.quad(lambda s: (times[-1] - s) * r(s), 0, times[-1], epsabs=1e-13)[0]
    return r(times[:, None] - times) * period**2, mixed * period, variance


def least(process, f_c, n):
    """The least variance of weights that sum to n, by Lagrange's rule."""
    covariance, mixed, variance = parts(process, f_c, n)
    ones = np.ones(n + 1)
    alone, even = np.linalg.solve(covariance, mixed), np.linalg.solve(covariance, ones)
    return variance - mixed @ alone + (n - alone.sum()) ** 2 / even.sum()


@pytest.mark.parametrize("mu", [0.3, 1.5, 20.0])
def test_the_least_variance_is_that_of_the_best_weights(mu):
    process = theory.first_order(1.0, mu)
    for n in (1, 2, 3, 17, 60):
        assert theory.least_variance(n, mu) == pytest.approx(least(process, 1.0, n), rel=1e-8)
        over = float(theory.error_variance(n, mu) - theory.least_variance(n, mu))
        assert over + 1e-12 >= 0
        assert over < float(theory.walk_factor(mu)) ** 2 / 2
    assert theory.least_variance(0, mu) == 0


def test_random_weights_that_do_not_repeat_are_no_better():
    rng = np.random.default_rng(37)
    for process, f_c in ((FIRST, 6.0), (RINGING, 4.0), (LAGGED, 2.0)):
        covariance, mixed, variance = parts(process, f_c, 30)
        best = least(process, f_c, 30)
        for scale in (0.01, 0.1, 1.0):
            weights = 1 + scale * rng.standard_normal(31)
            weights[[0, -1]] -= 0.5
            weights += (30 - weights.sum()) / 31
            assert weights @ covariance @ weights - 2 * weights @ mixed + variance > best


@pytest.mark.parametrize(
    ("process", "f_c"), [(FIRST, 6.0), (FIRST, 0.5), (RINGING, 4.0), (RINGING, 1.0), (LAGGED, 2.0)]
)
def test_the_least_variance_grows_as_fast_as_that_of_the_trapezoidal_rule(process, f_c):
    """Whatever the input: the least falls behind by an amount that stays, while both grow."""
    rate = theory.walk_rate(process, f_c) / f_c
    behind = [n * rate - least(process, f_c, n) for n in (20, 40, 80)]
    # The rest falls with 1/n.
    assert behind[2] - behind[1] == pytest.approx((behind[1] - behind[0]) / 2, rel=0.15)
    assert abs(behind[2] - behind[1]) < 0.02 * 40 * rate
    assert least(process, f_c, 80) <= theory.rule_variance(process, f_c, TRAPEZOIDAL, 80)[-1]


# -- inputs with derivatives ----------------------------------------------------------------------


@pytest.mark.parametrize("count", range(1, 10))
def test_lags_have_one_pole(count):
    process = theory.lags(1.3, 2.0, count)
    assert np.poly(process.drift) == pytest.approx(np.poly([-2.0] * count), rel=1e-9)
    assert process.name == f"{count} lags"


def test_one_lag_is_the_first_order_input():
    one, first = theory.lags(1.7, 3.0, 1), FIRST
    assert one.drift == first.drift
    for omega in (0.0, 1.0, 40.0):
        assert one.psd(omega) == pytest.approx(first.psd(omega), rel=1e-14)
    assert one.autocovariance([0.3, -2.0]) == pytest.approx(first.autocovariance([0.3, -2.0]), rel=1e-14)
    for f_c in (0.7, 30.0):
        assert theory.walk_rate(one, f_c) == pytest.approx(theory.walk_rate(first, f_c), rel=1e-8)


def test_spectrum_autocovariance_and_step_of_lags_belong_together():
    r = LAGGED.autocovariance
    for omega in (0.0, 2.0, 10.0):
        transform = 2 * integrate.quad(lambda t, w=omega: r(t) * math.cos(w * t), 0, 20, limit=400)[0]
        assert LAGGED.psd(omega) == pytest.approx(transform, abs=1e-7)
    step = theory.exact_step(LAGGED, 5.0)
    covariance = LAGGED.sigma**2 * np.eye(3)
    for k in range(4):
        assert covariance[0, 0] == pytest.approx(float(r(k / 5.0)), rel=1e-12)
        covariance = step.a[:3] @ covariance


@pytest.mark.parametrize("count", [0, 10])
def test_too_many_lags_are_refused(count):
    with pytest.raises(ValueError, match=f"got {count} lags; needed 1 to 9"):
        theory.lags(1.0, 1.0, count)


# -- rules with derivatives -----------------------------------------------------------------------


@pytest.mark.parametrize("derivatives", range(9))
def test_the_rule_is_exact_up_to_its_degree_and_not_beyond(derivatives):
    rule = theory.hermite(derivatives)
    assert rule.derivatives == derivatives
    for degree in range(2 * derivatives + 3):
        total = Fraction(0)
        for j, w in enumerate(rule.weights):
            slope = math.perm(degree, j)  # of t**degree at 1; at 0 only the j-th power has one
            total += w * ((slope if degree == j else 0) + (-1) ** j * slope)
        assert (total == Fraction(1, degree + 1)) == (degree <= 2 * derivatives + 1)


def test_the_rule_with_two_derivatives():
    assert theory.hermite(2).weights == (Fraction(1, 2), Fraction(1, 10), Fraction(1, 120))
    assert theory.hermite(2).even() == (1, Fraction(1, 60))
    assert theory.hermite(2).name == "two points, 2 derivatives"
    with pytest.raises(ValueError, match="got 9 derivatives; needed 0 to 8"):
        theory.hermite(9)
    with pytest.raises(ValueError, match="needed 1/2 first, so that a constant is integrated correctly"):
        theory.DerivativeRule("wrong", (Fraction(1, 3),))


def variance_by_covariances(rule, n, period, bandwidth):
    """Error variance after n cycles of noise through three lags, from R and its derivatives alone, in closed form."""
    s, t, u = sp.symbols("s t u", positive=True)
    after = (1 + u + u**2 / 3) * sp.exp(-u)  # R(τ) for u = ω|τ|, three times differentiable in the sense needed

    def moment(i, j, a, b):
        """E(x^(i)(a) x^(j)(b)) = (-1)^i R^(i+j)(b - a); R is even."""
        lag, order = b - a, i + j
        sign = (-1) ** i * (1 if lag >= 0 else (-1) ** order)
        return sign * bandwidth**order * sp.diff(after, u, order).subs(u, abs(lag) * bandwidth)

    samples = {}
    for k in range(n):
        for j, w in enumerate(rule.weights):
            weight = sp.Rational(w.numerator, w.denominator) * period ** (j + 1)
            samples[k, j] = samples.get((k, j), 0) + weight
            samples[k + 1, j] = samples.get((k + 1, j), 0) + (-1) ** j * weight
    end = n * period
    total = 2 * sp.integrate((end - s) * after.subs(u, bandwidth * s), (s, 0, end))
    for (k, i), a in samples.items():
        at = k * period
        later = sp.diff(after, u, i).subs(u, bandwidth * t) * bandwidth**i
        total -= 2 * a * sp.integrate((-1) ** i * later, (t, 0, end - at))
        total -= 2 * a * sp.integrate(later, (t, 0, at))
        for (m, j), b in samples.items():
            total += a * b * moment(i, j, at, m * period)
    return float(sp.N(total, 30))


@pytest.mark.parametrize("derivatives", [0, 1, 2])
def test_the_recursion_is_the_sum_of_all_covariances(derivatives):
    rule, period, bandwidth = theory.hermite(derivatives), sp.Rational(1, 2), sp.Integer(4)
    found = theory.derivative_rule_variance(LAGGED, 2.0, rule, 3)
    for n in (1, 3):
        expected = LAGGED.sigma**2 * variance_by_covariances(rule, n, period, bandwidth)
        assert found[n] == pytest.approx(expected, rel=1e-11)
    assert found[0] == 0


@pytest.mark.parametrize(("count", "derivatives"), [(2, 1), (3, 2), (4, 3), (5, 2), (5, 4)])
@pytest.mark.parametrize("mu", [0.8, 3.0])
def test_the_walk_is_that_of_the_recursion(count, derivatives, mu):
    process, rule = theory.lags(1.3, mu, count), theory.hermite(derivatives)
    variance = theory.derivative_rule_variance(process, 1.0, rule, 800)
    # Covariances decay within tens of cycles; the recursion rounds at 1e-16 of σ² = 1.7 for each cycle.
    assert (variance[800] - variance[400]) / 400 == pytest.approx(
        theory.derivative_walk_rate(process, 1.0, rule), rel=1e-8, abs=1e-14
    )


def test_odd_derivatives_do_not_change_the_walk():
    for count in (2, 3, 5):
        process = theory.lags(1.0, 0.7, count)
        rate = theory.derivative_walk_rate(process, 1.0, theory.hermite(1))
        assert rate == pytest.approx(theory.walk_rate(process, 1.0), rel=1e-12)


def test_with_two_derivatives_a_third_to_a_half_of_the_walk_is_left():
    shares = {count: theory.fast_sampling_ratio(theory.hermite(2).even(), count) for count in (3, 4, 5)}
    assert shares == {3: Fraction(3, 10), 4: Fraction(2, 15), 5: Fraction(3, 25)}
    derived = [step.right for step in derivation.derivatives().steps[-3:]]
    assert derived == [sp.Rational(share.numerator, share.denominator) for share in shares.values()]
    for count, share in shares.items():
        slow = theory.lags(1.0, 1e-3, count)
        found = theory.derivative_walk_rate(slow, 1.0, theory.hermite(2)) / theory.walk_rate(slow, 1.0)
        assert found == pytest.approx(float(share), rel=1e-6)


@pytest.mark.parametrize(("derivatives", "count"), [(2, 3), (3, 4), (4, 5)])
def test_sampled_too_slowly_the_derivatives_do_harm(derivatives, count):
    rule = theory.hermite(derivatives)
    mu = theory.largest_useful_mu(rule, count)
    for factor, better in ((0.99, True), (1.01, False)):
        process = theory.lags(1.0, factor * mu, count)
        assert (theory.derivative_walk_rate(process, 1.0, rule) < theory.walk_rate(process, 1.0)) == better


def test_rules_need_derivatives_of_the_input():
    with pytest.raises(ValueError, match="got an input with 1 derivatives; needed 2 for the rule"):
        theory.derivative_walk_rate(theory.lags(1.0, 1.0, 2), 1.0, theory.hermite(2))
    with pytest.raises(ValueError, match="got an input with 0 derivatives; needed 1"):
        theory.derivative_rule_variance(FIRST, 1.0, theory.hermite(1), 3)
    with pytest.raises(ValueError, match="got 2 lags; needed more than 2, one more than derivatives"):
        theory.fast_sampling_ratio(theory.hermite(2).even(), 2)
    with pytest.raises(ValueError, match="needed one that is better for fast sampling after 3 lags"):
        theory.largest_useful_mu(theory.hermite(1), 3)


def test_errors_of_the_derivative_that_cancel_its_use():
    process, f_c, rule = theory.lags(1.3, 0.5, 3), 2.0, theory.hermite(2)
    share = theory.tolerable_derivative_error(process, f_c, rule)
    # R'''' at zero is the variance of the second derivative, σ²ω⁴ for three lags.
    rms = share * 1.3 * 0.5**2
    noise = (rms * f_c**-3 / 60) ** 2 * f_c
    total = theory.derivative_walk_rate(process, f_c, rule) + noise
    assert total == pytest.approx(theory.walk_rate(process, f_c), rel=1e-9)
    with pytest.raises(ValueError, match="got 4 derivatives; needed 2 or 3"):
        theory.tolerable_derivative_error(theory.lags(1.0, 1.0, 5), 1.0, theory.hermite(4))
    with pytest.raises(ValueError, match="needed one that is better than the trapezoidal"):
        theory.tolerable_derivative_error(theory.lags(1.0, 1.0, 3), 0.1, rule)
