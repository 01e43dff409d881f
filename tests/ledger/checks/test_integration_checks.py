"""gpbnb.ledger.checks.integration: each entry of the document has a check, and each check can come out otherwise."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace as replaced

import faults
import numpy as np
import pytest
import sympy as sp
from faults import breaks, plus, replace, times

from gpbnb import ledger
from gpbnb.display.derivation import Derivation, Step
from gpbnb.integration import derivation, experiment, theory
from gpbnb.ledger.checks import integration as checks
from gpbnb.ledger.finding import Verdict

ENTRIES = ledger.select(faults.INVENTORY, "savage2016")
FUNCTIONS = faults.functions(checks.CHECKS)
MAIN = checks.MAIN


REMEMBERING = (checks, derivation, theory)


@pytest.fixture(scope="module")
def rows():
    return faults.examined(ENTRIES)


def finding(rows, key):
    return faults.finding(rows, MAIN + key)


def test_every_entry_of_the_document_has_a_check_here():
    assert set(checks.CHECKS) == {entry.id for entry in ENTRIES}
    assert len(ENTRIES) == 69
    numbers = {n for n in range(1, 40) if not any(entry.item.split()[:2] == ["eq", f"({n})"] for entry in ENTRIES)}
    assert numbers == set()


def test_verdicts(rows):
    """The present state: to be changed knowingly."""
    assert Counter(row.outcome for row in rows) == {
        "verified": 53,
        "misprint": 9,
        "wrong": 1,
        "inconsistent": 1,
        "unverifiable": 3,
        "answered": 2,
    }
    places = {v: {row.statement.id.removeprefix(MAIN) for row in rows if row.finding.verdict is v} for v in Verdict}
    assert places[Verdict.MISPRINT] == {
        "eq6-phi",
        "eq6-q-n",
        "eq12",
        "eq14",
        "eq18-p32",
        "eq21",
        "eq25",
        "eq34",
        "eq37",
    }
    assert places[Verdict.WRONG] == {"sanalysis.complete-set"}
    assert places[Verdict.INCONSISTENT] == {"sabstract.abstract-claim"}
    assert places[Verdict.ANSWERED] == {"sanalysis.transient", "sanalysis.numerical-example"}


def test_differences_have_notes(rows):
    faults.check_texts(rows)


def test_findings_quote_the_computed_numbers(rows):
    assert "-19.98 instead of 0.01666" in finding(rows, "eq12").note
    assert "-0.935 instead of 0.01666" in finding(rows, "eq18-p32").note
    assert "1982 instead" in finding(rows, "eq34").note
    assert "1.10" in finding(rows, "sabstract.abstract-claim").note
    assert "0.01 and -0.51" in finding(rows, "sabstract.abstract-claim").recomputed
    assert "0.0102 °/√s" in finding(rows, "sanalysis.numerical-example").recomputed
    assert "9.6 times" in finding(rows, "sanalysis.complete-set").recomputed


def test_findings_are_the_same_again(rows):
    faults.forget(*REMEMBERING)
    faults.check_again(rows, checks.CHECKS, "transient", "exact", "complete_set")


# -- each check can come out otherwise ------------------------------------------------------------


@pytest.fixture
def patch(monkeypatch):
    """Change the code, with nothing remembered; undone, and forgotten, afterwards."""
    with faults.forgetting(monkeypatch, *REMEMBERING):
        yield monkeypatch


def fails(name, place=None):
    return breaks(derivation, name, place)


def changed_after(patch):
    """(10) with another x_3."""
    x1, x2, x3 = derivation.after()
    patch.setattr(derivation, "after", lambda: (x1, x2 + derivation.Q1, x3 + derivation.X1 * derivation.T))


def changed_first(patch):
    """(10) with another x_1."""
    x1, x2, x3 = derivation.after()
    patch.setattr(derivation, "after", lambda: (2 * x1, x2, x3))


def changed_steady(place):
    def apply(patch):
        original = derivation.steady_changes

        def other(half=True):
            found = list(original(half))
            found[place] *= 2
            return tuple(found)

        patch.setattr(derivation, "steady_changes", other)

    return apply


def constant_after(patch):
    """(10) with a constant in x_3."""
    x1, x2, x3 = derivation.after()
    patch.setattr(derivation, "after", lambda: (x1, x2, x3 + derivation.T))


def biased(patch):
    """Simulated errors with a mean of their own standard deviation."""
    original = experiment.simulate

    def other(*arguments):
        run = original(*arguments)
        return replaced(run, errors=run.errors + run.errors.std())

    patch.setattr(experiment, "simulate", other)


def depends_on_time(patch):
    """(32) with a term that does not die away."""
    original = derivation.steady_changes

    def other(half=True):
        d32, d33, d22 = original(half)
        return d32, d33 + derivation.TIME, d22

    patch.setattr(derivation, "steady_changes", other)


def growing(patch):
    """A closed form that each cycle takes farther away."""
    original = theory.error_variance
    patch.setattr(theory, "error_variance", lambda n, mu: original(n, mu) * 1.001)


def other_recursion(patch):
    """(18) with another P31."""
    original = theory.savage_recursion

    def other(*arguments):
        found = original(*arguments)
        return found._replace(p31=found.p31 * 1.001)

    patch.setattr(theory, "savage_recursion", other)


WALK = theory.walk_factor
SMALL = sp.Rational(1, 7)
#: For each check that agrees, changes of the code under which it must not.
DISAGREE = [
    ("walk_type", times(theory, "walk_rate", 1.001)),
    ("walk_type", times(theory, "rule_variance", 1.001)),
    ("aim", depends_on_time),
    ("model", plus(theory.Process, "autocovariance", 0.1)),
    ("band_limited", plus(theory.Process, "autocovariance", 0.1)),
    ("band_limited", times(theory.Process, "psd", 1.001)),
    ("bandwidth", plus(theory.Process, "psd", 0.1)),
    ("integrals", plus(theory.Process, "psd", 0.1)),
    ("integrals", times(derivation, "transition_matrix", 2)),
    ("integrals", changed_after),
    ("integrals", times(theory, "random_walk", 1.001)),
    ("transitions", times(derivation, "transition_matrix", 2)),
    ("transitions", replace(derivation, "noise", lambda kernel="right": sp.eye(2))),
    ("means", constant_after),
    ("means", biased),
    ("rate_of_a_cycle", growing),
    ("density", times(theory.Process, "psd", 1.001)),
    ("density", fails("continuous", 0)),
    ("steady_input", times(derivation, "noise", 2)),
    ("steady_input", plus(derivation, "p22", 1)),
    ("steady_covariances", times(derivation, "p12", 2)),
    ("steady_covariances", other_recursion),
    ("deviations", plus(theory.Process, "autocovariance", 0.1)),
    ("deviations", times(theory, "random_walk", 1.001)),
    ("deviations", times(theory, "error_variance", 1.001)),
    ("trapezoidal", replace(theory, "RULES", {"trapezoidal": theory.RULES["rectangular, old sample"]})),
    ("trapezoidal", replace(experiment.Accumulator, "feed", lambda self, x: None)),
    ("discrete", times(derivation, "p22", 2)),
    ("discrete", times(derivation, "p12", 2)),
    ("transition", times(derivation, "printed_transition", 2)),
    ("transition", fails("transition", 1)),
    ("components", changed_after),
    ("error_variance", plus(theory, "error_variance", 0.1)),
    ("products", changed_after),
    ("mixed_products", changed_first),
    ("uncorrelated", times(derivation, "transition_matrix", 2)),
    ("uncorrelated", replace(theory, "exact_step", lambda process, f: theory.Step(np.ones((3, 2)), np.ones((3, 3))))),
    ("p31", changed_first),
    ("p33", changed_after),
    ("covariance_equation", times(derivation, "printed_transition", 2)),
    ("continuous_solution", fails("continuous", 4)),
    ("p22_at_cycles", times(derivation, "p22", 2)),
    ("p12_at_cycles", times(derivation, "p12", 2)),
    ("p11_at_cycles", times(derivation, "noise", 2)),
    ("steady_p31", fails("steady_state", 0)),
    ("steady_p31", times(derivation, "p12", 2)),
    ("steady_changes", changed_steady(0)),
    ("steady_changes", changed_steady(1)),
    ("steady_changes", changed_steady(2)),
    ("steady_rate", fails("steady_state", 3)),
    ("random_walk", fails("steady_state", 5)),
    ("random_walk", times(theory, "random_walk", 1.001)),
    ("exact", fails("independent")),
    ("exact", times(theory.Process, "psd", 1.001)),
    ("exact", replace(experiment.Sweep, "deviations", lambda self: [5.0])),
    ("large_n", times(theory, "takeover", 0.9)),
    ("units", replace(theory, "random_walk", lambda sigma, omega, f: sigma * omega / f)),
    ("exponential", fails("small_mu", 0)),
    ("approximation", fails("small_mu", 2)),
    ("approximation", fails("small_mu", 3)),
    ("approximation", times(theory, "approximation_ratio", 1.001)),
    ("approximation", times(theory, "printed_random_walk", 1.001)),
    ("transient", fails("transient", 1)),
    ("transient", plus(theory, "error_variance_recursion", 0.1)),
    ("transient", replace(experiment.Simulation, "deviations", lambda self, variance: [5.0])),
    ("numerical_example", times(theory, "walk_rate", 1.001)),
    ("numerical_example", times(theory, "required_rate", 1.001)),
]


@pytest.mark.parametrize(("name", "change"), DISAGREE)
def test_a_check_that_agrees_can_disagree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {True}
    change(patch)
    faults.check_disagrees(FUNCTIONS[name])


def half_is_one(patch):
    """(18) with the factor as printed in the derivation too."""
    original = derivation.printed_18
    patch.setattr(derivation, "printed_18", lambda half: original(True))


def with_slip(place, value):
    def apply(patch):
        found = dict(checks.slips())
        found[place] = value
        patch.setattr(checks, "slips", lambda: found)

    return apply


def capitals(patch):
    """(21) with the letter of the print throughout."""
    found = derivation.continuous()
    letter = {derivation.OMEGA: sp.Symbol("omega_BW")}
    steps = [Step(step.name, step.left.subs(letter), step.right.subs(letter)) for step in found.steps]
    patch.setattr(derivation, "continuous", lambda: Derivation(tuple(steps)))


#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("abstract", replace(theory, "exponents", lambda mu: (0.5 + 0 * mu, -1 + 0 * mu))),
    ("transition_integral", replace(derivation, "transition_residual", lambda identity: sp.zeros(2))),
    ("noise_integral", replace(derivation, "noise", lambda kernel="right": sp.eye(2))),
    ("squared_mean", with_slip("(12)", derivation.walk())),
    ("rate", replace(derivation, "steady_changes", lambda half=True: (sp.S.Zero, sp.S.One, sp.S.Zero))),
    ("p32", half_is_one),
    (
        "p22_recursion",
        replace(
            derivation,
            "p22_change",
            lambda printed: derivation.p22(derivation.TIME + derivation.T) - derivation.p22(derivation.TIME),
        ),
    ),
    ("complete_set", replace(checks, "mended", lambda: (1e-13, 1e-13))),
    ("rate_in_mu", replace(checks, "same", lambda *expressions: True)),
    ("series", replace(checks, "same", lambda *expressions: True)),
    ("covariance_components", capitals),
]


@pytest.mark.parametrize(("name", "change"), AGREE)
def test_a_check_that_disagrees_can_agree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {False}
    change(patch)
    faults.check_agrees(FUNCTIONS[name])


@pytest.mark.parametrize(
    ("name", "change", "verdict"),
    [
        ("transition_integral", replace(derivation, "transition_residual", lambda identity: sp.eye(2)), Verdict.WRONG),
        ("squared_mean", replace(checks, "mended", lambda: (0.1, 0.1)), Verdict.WRONG),
        ("rate", changed_steady(0), Verdict.WRONG),
        ("p32", changed_after, Verdict.WRONG),
        ("p22_recursion", times(derivation, "p22_change", 2), Verdict.WRONG),
        ("covariance_components", fails("continuous", 1), Verdict.WRONG),
        ("covariance_components", fails("continuous", 2), Verdict.WRONG),
        ("series", fails("small_mu", 1), Verdict.WRONG),
        ("abstract", replace(theory, "exponents", lambda mu: (0 * mu, 0 * mu)), Verdict.WRONG),
        ("noise_integral", replace(derivation, "noise", lambda kernel="right": sp.eye(2) * len(kernel)), Verdict.WRONG),
    ],
)
def test_a_slip_is_one_only_if_what_follows_is_right(patch, name, change, verdict):
    change(patch)
    assert FUNCTIONS[name]().verdict is verdict


def test_expansions_are_compared():
    assert checks.same((derivation.MU + 1) ** 2, derivation.MU**2 + 2 * derivation.MU + 1)
    assert not checks.same(derivation.MU, derivation.MU + SMALL)
    assert not checks.same(sp.eye(2), sp.eye(2), sp.zeros(2))
    assert checks.same(sp.coth(derivation.MU / 2), (1 + sp.exp(-derivation.MU)) / (1 - sp.exp(-derivation.MU)))


def test_every_check_is_among_those_that_can_come_out_otherwise():
    tried = {name for name, *_ in (*DISAGREE, *AGREE)}
    assert set(FUNCTIONS) - tried == {"date", "reference", "figure"}  # nothing to compare
