"""ledger.checks.budget: the state of the ledger of ch. I and II, and that each check can come out otherwise."""

from __future__ import annotations

from datetime import date
from types import SimpleNamespace

import faults
import numpy as np
import pytest

from gpbnb.report.budget import derivation, experiment, theory
from gpbnb.report.ledger.checks import budget
from gpbnb.report.ledger.finding import Verdict

INVENTORY = faults.INVENTORY
# What ch. III of 1984 left open is decided by the checks of another topic.
ENTRIES = [e for e in INVENTORY if e.id in budget.CHECKS and e.id != "hung1984.I.1-f-study"]
CACHING = (budget,)
BY_ID = {entry.id: entry for entry in INVENTORY}


def judged(key):
    return budget.CHECKS.run(BY_ID[key])


def test_findings_have_their_notes_and_numbers(rows):
    found = {row.statement.id: row.finding for row in rows}
    assert "0.1508" in found["hung1982.II.44-sources"].recomputed
    assert "25.3%" in found["hung1982.II.rss-total"].recomputed
    assert "0.755" in found["hung1982.II.rss-reduction"].recomputed
    assert "beta1, gamma1" in found["hung1982.II.classification-by-form"].recomputed
    # April 1980, 18 February 1981, 24 June 1981
    previous = found["hung1982.I.previous-contract"].recomputed
    assert "10 months after the award and 4 months before the period" in previous
    assert "14 months and 8 days" in found["hung1982.I.report-period"].recomputed


#: For each check that agrees, changes of the code under which it must not.
DISAGREE = [
    ("hung1984.I.report-period", budget, "span", lambda start, end: (14, 0)),
    ("hung1982.I.previous-contract", budget, "quote", lambda key: "18 February 1981, NAS8-33850"),
    ("hung1982.I.previous-contract", budget, "quote", lambda key: "18 February 1982, NAS8-33849"),
    ("hung1984.I.refinement", budget, "where", lambda document, item: "III"),
    ("hung1984.I.second-task", budget, "where", lambda document, item: "II"),
    ("hung1982.II.two-ways", budget, "load_statements", lambda: ()),
    ("hung1982.II.classification-by-statistics", budget, "Kind", list(budget.Kind)[:2]),
    ("hung1982.II.deterministic-compensated", budget, "compensated", lambda part: 1e-9),
    ("hung1982.II.random-variable-reduction", theory, "cycles_factor", lambda cycles: 0.5),
    (
        "hung1982.II.bias-reduction",
        theory,
        "cycles_factor",
        lambda cycles, true=theory.cycles_factor: true(cycles) or 1e-9,
    ),
    ("hung1982.II.random-variable-reduction", experiment, "turning_mean", lambda cycles: 0.5),
    ("hung1982.II.random-process-reduction", theory, "correlated_factor", lambda time, tau: 0.3),
    ("hung1982.II.random-process-reduction", experiment, "correlated_means", lambda *given: np.ones(9)),
    ("hung1982.II.scale-factor-identification", budget, "identifiable", lambda amplitude: False),
    ("hung1982.II.noise-filtering", theory, "white_factor", lambda readings: 0.5),
    ("hung1982.II.noise-filtering", budget, "filtered_noise", lambda: (0.06, 0.05, 2000)),
    ("hung1982.II.44-sources", theory, "equal_error", lambda total, count: total / count),
]


@pytest.mark.parametrize(("key", "target", "attribute", "value"), DISAGREE)
def test_what_agrees_could_disagree(patch, key, target, attribute, value):
    assert judged(key).agrees is True
    faults.forget(budget)
    if attribute == "Kind":
        members = {kind.name: kind for kind in budget.Kind}
        value = type("Two", (), {"__iter__": lambda self, two=tuple(value): iter(two), **members})()
    patch.setattr(target, attribute, value)
    assert judged(key).agrees is False


#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("hung1982.II.classification-by-form", budget, "without_form", list),
]


@pytest.mark.parametrize(("key", "target", "attribute", "value"), AGREE)
def test_what_disagrees_could_agree(patch, key, target, attribute, value):
    assert judged(key).agrees is False
    patch.setattr(target, attribute, value)
    assert judged(key).agrees is True


def test_averages_that_remove_some_errors_keep_a_constant_that_does_not_roll(patch):
    faults.breaks(derivation, "averages", 1)(patch)
    assert judged("hung1982.II.bias-reduction").agrees is False


def test_spans_of_dates():
    assert budget.span(date(1981, 6, 24), date(1982, 8, 31)) == (14, 7)
    assert budget.span(date(2000, 1, 15), date(2000, 3, 14)) == (1, 28)
    assert budget.span(date(1999, 12, 1), date(2000, 1, 1)) == (1, 0)


def test_a_filter_of_white_noise_is_a_mean():
    """After N readings the error of a constant is 1/√N of that of one reading, to four standard errors."""
    left, expected, trials = budget.filtered_noise()
    assert expected == pytest.approx(0.05)
    assert abs(left / expected - 1) < 4 / (2 * trials) ** 0.5


def test_a_scale_factor_needs_a_signal():
    assert budget.identifiable(1e-4)
    assert not budget.identifiable(0.0)


@pytest.mark.parametrize("outcome", [Verdict.ANSWERED, Verdict.OPEN])
def test_the_studies_left_open_are_decided_where_they_are_done(patch, outcome):
    finding = SimpleNamespace(verdict=outcome)
    patch.setattr(budget.rolling, "CHECKS", SimpleNamespace(run=lambda entry: finding))
    assert judged("hung1984.I.1-f-study").verdict is outcome
