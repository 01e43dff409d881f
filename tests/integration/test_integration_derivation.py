"""gpbnb.report.integration.derivation: every step holds, and means what the numbers of the theory do."""

from __future__ import annotations

import numpy as np
import pytest
import steps
import sympy as sp

from gpbnb.report.integration import derivation, theory
from gpbnb.report.integration.derivation import MU, OMEGA, TAU, TIME, P, T

DERIVATIONS = steps.Derivations(
    derivation.transition,
    derivation.discretization,
    derivation.covariances,
    derivation.continuous,
    derivation.steady_state,
    derivation.independent,
    derivation.transient,
    derivation.small_mu,
    derivation.least,
    derivation.derivatives,
)
VALUES = {OMEGA: 3, T: sp.Rational(2, 5), P: sp.Rational(289, 100), MU: sp.Rational(6, 5)}


#: Where what comes out is already written as it is printed.
ALIKE = ("(18), $P_{31", "(18), $P_{32", "(21), ", "the variance starts at zero")

NAMES = {
    "transition": {
        r"equation (6) with $I$ added, first row: $\phi_{11}$": "exp(-omega*T)",
        r"second row: $\phi_{21}$ of (7) and (9)": "(1 - exp(-omega*T))/omega",
        r"(9): $\phi_{21}$ by $\phi_{11}$": "(1 - exp(-omega*T))/omega",
    },
    "discretization": {
        "$q_{11}$": "P*(1 - exp(-2*omega*T))",
        "$q_{12}$": "P*(1 - exp(-omega*T))**2/omega",
        "$q_{22}$": "P*(2*omega*T - 3 + 4*exp(-omega*T) - exp(-2*omega*T))/omega**2",
        "$q_{22}$ from positive terms: the parts uncorrelated and correlated with $q_1$": (
            "P*(2*omega*T - 3 + 4*exp(-omega*T) - exp(-2*omega*T))/omega**2"
        ),
    },
    "covariances": {
        "(18), $P_{31_n}=E(x_{3n}x_{1n})$": "phi_11*P_31 + P_11n*T/2 + phi_11*P_11*T/2",
        r"(18), $P_{32_n}$, with $\frac12$ in its last term": (
            "P_32 + phi_21*P_31 + P_12n*T/2 + P_12*T/2 + phi_21*P_11*T/2"
        ),
        "(18), $P_{33_n}$": "P_33 + (1 + phi_11)*P_31*T + P_11n*T**2/4 + (1/4 + phi_11/2)*P_11*T**2",
    },
    "continuous": {
        r"(21), $\dot P_{11}$": "N_P11 - 2*omega*P_11",
        r"(21), $\dot P_{12}$": "P_11 - omega*P_12",
        r"(21), $\dot P_{22}$": "2*P_12",
        "(22) is solved by $P_{12}$ of (23)": "P",
        "(22) is solved by $P_{22}$ of (23)": "2*P*(1 - exp(-omega*t))/omega",
        "both start at zero": "0",
        r"(25) with the missing $1/\omega$": "2*P/omega*(T - (1 - exp(-omega*T))*exp(-omega*t)/omega)",
    },
    "steady_state": {
        "(31) solves (30)": "P*T/2*(1 + exp(-omega*T))/(1 - exp(-omega*T))",
        r"(32), $\Delta P_{32}$": "2*P*T/omega",
        r"(32), $\Delta P_{33}$": "P*T**2*(1 + exp(-omega*T))/(1 - exp(-omega*T))",
        "(33)": "P*T*(1 + exp(-omega*T))/(1 - exp(-omega*T)) - 2*P/omega",
        "(34) with the missing $T$ in its second member": ("T*(1 + exp(-omega*T))/(1 - exp(-omega*T)) - 2/omega"),
        r"(35), squared, in units of $P\,T$": "(1 + exp(-mu))/(1 - exp(-mu)) - 2/mu",
        "a Langevin function": "(exp(mu/2) + exp(-mu/2))/(exp(mu/2) - exp(-mu/2)) - 2/mu",
    },
    "independent": {
        "$r_0$: variance of the trapezoid, of the integral, and their covariance": (
            "P*T**2*(1 + exp(-omega*T))/2 + 2*P*(omega*T - 1 + exp(-omega*T))/omega**2 - 2*P*T*(1 - "
            "exp(-omega*T))/omega"
        ),
        "$gT$: expected error of the next cycle for a sample of size 1": (
            "(1 + exp(-omega*T))/2 - (1 - exp(-omega*T))/(omega*T)"
        ),
        r"the sum $r_0 + 2r_1/(1-e^{-\omega T})$ equals (35)": (
            "P*T**2*((1 + exp(-omega*T))/(1 - exp(-omega*T)) - 2/(omega*T))"
        ),
    },
    "transient": {
        r"$c_n = E(e_nx_{1n})$ in units of $\sigma_x^2T$: its recursion": "L*(1 - varphi**(n + 1))/2",
        r"$P_{n+1}$ from $P_n$, in units of $\sigma_x^2T^2$": "(n + 1)*L - L**2*(1 - varphi**(n + 1))/2",
        "the variance starts at zero": "0",
        r"the same from $n\,r_0 + 2\sum_{k<n}(n-k)\,r_1\varphi^{k-1}$, summed": ("n*L - L**2*(1 - varphi**n)/2"),
        r"that sum, by induction over $n$: one more cycle adds $r_0 + 2r_1(1-\varphi^n)/(1-\varphi)$": (
            "r_0 + 2*r_1*(1 - varphi**k)/(1 - varphi)"
        ),
    },
    "small_mu": {
        "(36): the omitted terms are of higher order": "0",
        r"(37), numerator: the cubic term is $\frac1{12}\mu^3$, not $\frac16\mu^3$ as printed": (
            "2 - mu + mu**2/2 - mu**3/6"
        ),
        "(37), result": "1/6",
        "the next term": "-1/360",
        "(38) to (39)": "sqrt(omega/6)/f_c*sigma_x",
    },
    "least": {
        r"row $i$ between the ends: $\sum_j\varphi^{|i-j|}w_j$": "1",
        "the first row, and the last": "1",
        r"the sum of $w$, with $\tanh\frac\mu2=\frac{1-\varphi}{1+\varphi}$": "1 + n*(1 - varphi)/(1 + varphi)",
        "expected integral over a cycle between two samples of size 1": "2*(1 - exp(-mu))/(mu*(1 + exp(-mu)))",
        "variance of that integral, given the samples": (
            "2*(1 - exp(-mu))/(mu*(1 + exp(-mu)))*((1 + exp(-mu))/(1 - exp(-mu)) - 2/mu)"
        ),
        r"$1-h=L\tanh\frac\mu2$": "1 - 2*(1 - exp(-mu))/(mu*(1 + exp(-mu)))",
        "the least variance": "n*L - L**2*n*(1 - varphi)/(1 + varphi + n*(1 - varphi))",
    },
    "derivatives": {
        "exact for each polynomial of degree 5": "c_0 + c_1/2 + c_2/3 + c_3/4 + c_4/5 + c_5/6",
        r"contribution of a sample to the cycles before and after it, at $\theta=\omega T$": "1 - theta**2/60",
        "share of the variance that remains after 3 lags": "3/10",
        "share of the variance that remains after 4 lags": "2/15",
        "share of the variance that remains after 5 lags": "3/25",
    },
}
"""What each step derives, beside its name; see `steps.check_names`."""


@pytest.mark.parametrize("name", DERIVATIONS)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check_each(DERIVATIONS[name], NAMES[name], ALIKE)


def test_what_is_derived_twice_is_derived_from_something_else():
    _, by_integral, by_division = DERIVATIONS["transition"].steps
    assert by_integral.left.has(sp.Integral)
    assert not by_division.left.has(sp.Integral)
    *_, of_the_kernel, of_positive_terms = DERIVATIONS["discretization"].steps
    assert of_the_kernel.left.has(sp.Integral)
    assert not of_positive_terms.left.has(sp.Integral)
    *_, of_a_cycle, langevin = DERIVATIONS["steady_state"].steps
    assert of_a_cycle.left.has(T)
    assert langevin.left == derivation.walk()


def test_there_are_as_many_steps_as_the_chapter_shows():
    assert steps.lengths(DERIVATIONS) == {
        "transition": 3,
        "discretization": 4,
        "covariances": 3,
        "continuous": 7,
        "steady_state": 7,
        "independent": 3,
        "transient": 5,
        "small_mu": 5,
        "least": 7,
        "derivatives": 5,
    }


def test_noise_in_numbers():
    one = theory.discretize(1.2)
    expected = 2.89 * np.array([[one.q11, one.q12 * 0.4], [one.q12 * 0.4, one.q22 * 0.16]], dtype=float)
    assert np.array(derivation.noise().subs(VALUES)).astype(float) == pytest.approx(expected, rel=1e-12)
    turned = np.array(derivation.noise("reversed").subs(VALUES)).astype(float)
    assert turned == pytest.approx(expected, rel=1e-12)
    printed = np.array(derivation.noise("printed").subs({**VALUES, TIME: 1})).astype(float)
    assert printed[0, 0] == pytest.approx(expected[0, 0] * np.exp(-6), rel=1e-12)


def test_an_unknown_kernel_is_refused():
    with pytest.raises(ValueError, match="got kernel 'left'; needed one of right, reversed, printed"):
        derivation.noise("left")


def test_noise_at_a_point_is_the_integral():
    q = derivation.noise()
    density = 2 * OMEGA * P * sp.exp(-2 * OMEGA * TAU)
    assert sp.simplify(sp.integrate(density, (TAU, 0, T)) - q[0, 0]) == 0


def test_the_integral_equation_as_printed_lacks_the_identity():
    assert derivation.transition_residual(identity=True) == sp.zeros(2)
    assert derivation.transition_residual(identity=False) == sp.eye(2)


def test_expected_values():
    x1, q1, p11 = derivation.X1, derivation.Q1, derivation.P11
    assert derivation.expected(x1 * q1) == 0
    assert derivation.expected(3 * x1**2) == 3 * p11
    after = derivation.after()
    assert sp.expand(derivation.expected(after[0] ** 2) - derivation.P11N) == 0
    assert sp.expand(derivation.expected(after[0] * after[1]) - derivation.P12N) == 0
    assert sp.expand(derivation.expected(after[1] ** 2) - derivation.P22N) == 0


def test_the_walk_is_that_of_the_theory():
    assert float(derivation.walk().subs(MU, sp.Rational(6, 5))) == pytest.approx(float(theory.walk_factor(1.2)))


def test_the_expansion_is_the_series():
    coefficients = derivation.expansion(9)
    assert all(c == 0 for c in coefficients[1::2])
    ours = [sp.Rational(c.numerator, c.denominator) for c in theory.series(5)]
    assert coefficients[::2] == ours


def test_slips():
    slips = derivation.misprints()
    mu, period = sp.Rational(3, 10), sp.Rational(1, 50)
    found = {place: float(rate.subs({MU: mu, T: period})) for place, rate in slips.items()}
    right = float(theory.walk_factor(0.3))
    assert found["(25)"] == pytest.approx(right)
    # Without P22 the rate lacks 2/μ, and with the full last term of P32 twice half of φ21.
    assert found["(12)"] == pytest.approx(right - 2 / 0.3)
    assert found["(18)"] == pytest.approx(right - (1 - np.exp(-0.3)) / 0.3)
    coth = 1 / np.tanh(0.15)
    assert found["(34)"] == pytest.approx(coth * 50 - 2 / 0.3)
    assert found["(37)"] == pytest.approx(0.3 / 6 - 0.3**2 / 6)
    # With T = 1 the slip of (34) does not show.
    assert float(slips["(34)"].subs({MU: mu, T: 1})) == pytest.approx(right)


def test_the_right_numerator_gives_no_even_term():
    assert derivation.printed_37(sp.Rational(1, 12)) == MU / 6
    assert sp.expand(derivation.printed_37(sp.Rational(1, 6)) - MU / 6 + MU**2 / 6) == 0


def test_the_slip_of_18_is_the_half():
    with_half, without = derivation.printed_18(half=True), derivation.printed_18(half=False)
    assert with_half[0] == without[0]
    assert with_half[2] == without[2]
    assert sp.expand(without[1] - with_half[1] - derivation.PHI21 * derivation.P11 * T / 2) == 0
