"""No check judges an altered statement right: each check depends on what the document prints."""

import csv
import random
from pathlib import Path

import pytest
from alterations import altered

from gpbnb.ledger.checking import owners
from gpbnb.ledger.checks import TOPICS
from gpbnb.ledger.finding import Verdict
from gpbnb.ledger.registry import takes_statement
from gpbnb.ledger.statements import Statement, load_statements

STATEMENTS = load_statements()
CHECKED = {key: checks for checks in TOPICS.values() for key in checks}
TOPIC = owners(STATEMENTS)
MOST = 5
"""Alterations tried of one statement; which ones depends on its id alone."""


def still_true():
    """Alterations that leave a true statement, with the reason: (id, alteration) → why."""
    with Path(__file__).with_name("still_true.csv").open(newline="", encoding="utf-8") as file:
        return {(row["id"], row["alteration"]): row["why"] for row in csv.DictReader(file)}


STILL_TRUE = still_true()


def some(statement):
    """The exceptions listed, and a fixed random choice among the other alterations."""
    every = dict(altered(statement))
    listed = [name for name in every if (statement.id, name) in STILL_TRUE]
    others = [name for name in every if name not in listed]
    return {name: every[name] for name in listed + random.Random(statement.id).sample(others, min(MOST, len(others)))}


def judged(statement):
    checks = CHECKED[statement.id]
    return checks.run(statement)


# The checks of a topic share what they compute: one process runs them.
WITH_FORM = pytest.mark.parametrize(
    "statement",
    [
        pytest.param(each, id=each.id, marks=pytest.mark.xdist_group(f"alterations of {TOPIC[each.id]}"))
        for each in STATEMENTS
        if each.form and takes_statement(CHECKED[each.id][each.id])
    ],
)


@WITH_FORM
def test_no_altered_statement_is_judged_right(statement):
    right = []
    for name, other in some(statement).items():
        try:
            verdict = judged(other).verdict
        except (ArithmeticError, LookupError, TypeError, ValueError):
            continue  # the altered statement makes no sense to the check
        if (verdict is Verdict.VERIFIED) != ((statement.id, name) in STILL_TRUE):
            right.append((name, other.form, verdict.value))
    assert right == []


@WITH_FORM
def test_a_statement_has_enough_alterations(statement):
    words_alone = all("|" in part.text for part in statement.parts)
    enough = len(dict(altered(statement))) >= (1 if words_alone else 3)
    assert enough or judged(statement).verdict is Verdict.GIVEN


def test_each_exception_is_an_alteration_with_its_reason():
    by_id = {statement.id: statement for statement in STATEMENTS}
    for (key, name), why in STILL_TRUE.items():
        assert why
        assert name in dict(altered(by_id[key])), (key, name)


def sample(form):
    return Statement("hung1984.II.x", "hung1984", "II", "1", "x", "equation", "{{1}}", form)


def test_alterations_change_each_part():
    forms = {other.form for _, other in altered(sample("x[k] <= -2*a**3 + b; total: 1.25 mas; verb: grows | shrinks"))}
    for expected in (
        "x[k + 1] <= -2 * a ** 3 + b",
        "x[k] >= -2 * a ** 3 + b",
        "x[k] <= -3 * a ** 3 + b",
        "x[k] <= -2 * a ** (3 + 1) + b",
        "x[k] <= -2 * a ** 3 - b",
        "x[k] <= -2 * a ** 3",
        "x[k] <= 2 * (-2 * a ** 3 + b)",
    ):
        assert any(form.startswith(f"{expected};") for form in forms), expected
    assert any("total: 1.26 mas" in form for form in forms)
    assert any("verb: shrinks | grows" in form for form in forms)
