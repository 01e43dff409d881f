"""ledger.checks.integration: every statement of savage2016 has a check, and the verdicts are the known ones."""

from __future__ import annotations

import math

import faults
import pytest
import sympy as sp
from faults import breaks, plus, replace, times

from gpbnb.report import ledger
from gpbnb.report.integration import derivation, experiment, theory
from gpbnb.report.ledger.checks import integration as checks
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.statements import statement

ENTRIES = ledger.select(faults.INVENTORY, "savage2016")
MAIN = "savage2016.main."
CACHING = (checks, derivation, theory)


def finding(rows, key):
    return faults.finding(rows, MAIN + key)


def test_findings_quote_the_computed_numbers(rows):
    # L(0.05) T for T = 0.01; 19.98 T, 0.935 T and 1982 T
    right = (1 / math.tanh(0.05) - 1 / 0.05) * 0.01
    assert f"-0.1998 instead of {right:.4g} per second" in finding(rows, "eq12").note
    assert "-0.00935 instead of 0.0001666 per second" in finding(rows, "eq18-p32").note
    assert "19.82 instead" in finding(rows, "eq34").note
    assert "1.10" in finding(rows, "sabstract.abstract-claim").note
    assert "0.01 and -0.51" in finding(rows, "sabstract.abstract-claim").recomputed
    # Half the logarithmic derivative of coth(μ/2) - 2/μ by μ, at 1; the rate has this and the power -1/2, negative.
    width = (2 - 0.5 / math.sinh(0.5) ** 2) / (1 / math.tanh(0.5) - 2) / 2
    at_one = f"{width:.2f} and {-0.5 - width:.2f} at $\\mu=1$"
    assert at_one in finding(rows, "sabstract.abstract-claim").recomputed
    assert "0.0102 °/√s" in finding(rows, "sanalysis.numerical-example").recomputed
    assert "9.6 times" in finding(rows, "sanalysis.complete-set").note
    # (2/ω)[T - (1/ω)(1 - exp(-ωT))], and without 1/ω, from the first cycle on
    first, missing = (2 / 10 * (0.01 - w * (1 - math.exp(-0.1))) for w in (1 / 10, 1))
    assert f"is {missing:.3g} as printed, not {first:.3g}" in finding(rows, "eq25").note
    # 2∫exp(-2τ)dτ from 5 to 6, and from 0 to 1
    printed, right = math.exp(-10) - math.exp(-12), 1 - math.exp(-2)
    assert f"to {printed:.2g} of" in finding(rows, "eq6-q-n").recomputed
    assert f"where it is {right:.2g}" in finding(rows, "eq6-q-n").recomputed


# -- each check depends on the computation ---------------------------------------------------------


def changed_steady(patch):
    """A rate with a term that does not die away."""
    original = derivation.steady_changes

    def other(half=True):
        d32, d33, d22 = original(half)
        return d32, d33 + derivation.TIME, d22

    patch.setattr(derivation, "steady_changes", other)


def more_noise(patch):
    """A cycle that adds noise of its own to the digital integral."""
    original = checks.extended

    def other(case):
        step, added = original(case)
        return step, added + sp.eye(3)

    patch.setattr(checks, "extended", other)


DEPENDS = [
    ("sabstract.random-walk", times(theory, "walk_rate", 1.001)),
    ("sabstract.random-walk", times(theory, "trapezoid_variance", 1.001)),
    ("sanalysis.aim", changed_steady),
    ("eq2", replace(theory, "TRAPEZOID", (0, 1))),
    ("eq7", times(derivation, "transition_matrix", 2)),
    ("sanalysis.uncorrelated-q", times(derivation, "transition_matrix", 2)),
    ("eq18-p33", more_noise),
    ("sanalysis.steady-start", times(derivation, "p12", 2)),
    ("eq33", times(checks, "walk_rate", 2)),
    ("sanalysis.35-exact", breaks(derivation, "independent")),
    ("sanalysis.35-exact", times(theory.Process, "psd", 1.001)),
    ("sanalysis.large-n", times(theory, "error_variance", 1.1)),
    ("sanalysis.unit-of-35", replace(theory, "random_walk", lambda sigma, omega, f: sigma * omega / f)),
    ("eq38", times(theory, "approximation_ratio", 1.001)),
    ("eq38", replace(theory, "approximation_ratio", lambda mu: 1 + mu**2 / 120 * (1 + (mu > 0.05)))),
    ("sanalysis.small-mu", times(theory, "approximation_ratio", 1.001)),
    ("sanalysis.transient", breaks(derivation, "transient", 1)),
    ("sanalysis.transient", plus(theory, "error_variance_recursion", 0.1)),
    ("sanalysis.transient", replace(experiment.IntegrationErrors, "deviations", lambda self, variance: [5.0])),
    ("sanalysis.numerical-example", times(theory, "walk_rate", 1.001)),
    ("sanalysis.numerical-example", times(theory, "required_rate", 1.001)),
]


@pytest.mark.parametrize(("key", "change"), DEPENDS)
def test_a_check_depends_on_the_computation(rows, patch, key, change):
    assert finding(rows, key).agrees is True
    change(patch)
    assert checks.CHECKS.run(statement(MAIN + key)).agrees is False


def test_the_abstract_is_right_if_the_exponents_are_those_of_small_mu(patch):
    patch.setattr(theory, "exponents", lambda mu: (0 * mu + 0.5, 0 * mu - 1))
    assert checks.CHECKS.run(statement(MAIN + "sabstract.abstract-claim")).verdict is Verdict.VERIFIED


def test_the_walk_is_that_of_the_derivation():
    mu = derivation.MU
    for case in checks.cases():
        expected = derivation.walk().subs(mu, case.omega * case.period) * case.steady * case.period
        assert abs(sp.N(checks.walk_rate(case) - expected, 40)) < 1e-38
