"""Entries meet checks: each has one check, rows, and their counts."""

import importlib
import re

import pytest

from gpbnb.report.ledger import Row, examine, load_statements, select
from gpbnb.report.ledger.checking import TOPICS, in_reading_order
from gpbnb.report.ledger.finding import Verdict, compare
from gpbnb.report.ledger.statements import Statement

INVENTORY = load_statements()


def entry(number, section="2", document="hung1984", chapter="II"):
    return Statement(
        f"{document}.{chapter}.eq{number}", document, chapter, section, f"eq ({number})", "equation", "$a$"
    )


def test_each_statement_has_one_check():
    assert sorted(key for checks in TOPICS.values() for key in checks) == sorted(entry.id for entry in INVENTORY)


def test_each_topic_has_the_checks_of_its_own_module():
    assert list(TOPICS) == ["rounding", "inversion", "kalman", "rolling", "integration", "budget", "geometry"]
    for name, checks in TOPICS.items():
        assert checks is importlib.import_module(f"gpbnb.report.ledger.checks.{name}").CHECKS


def test_an_error_names_the_statement_whose_check_raised_it(monkeypatch):
    monkeypatch.setattr(TOPICS["kalman"], "run", lambda statement: 1 / 0)
    with pytest.raises(ZeroDivisionError) as raised:
        examine(select(INVENTORY, "hung1984", "II", "12"))
    assert re.fullmatch(r"in the check of hung1984\.II\..+", *raised.value.__notes__)


def made(verdict, number, section="2", **place):
    finding = compare(verdict is Verdict.VERIFIED, "1", verdict)
    return Row(entry(number, section, **place), finding)


def test_reading_order_sorts_sections_by_number_and_keeps_the_rest():
    some = [
        made(Verdict.WRONG, 1, "10"),
        made(Verdict.WRONG, 2, "9.2"),
        made(Verdict.WRONG, 3, "2", document="hung1982", chapter="III"),
        made(Verdict.WRONG, 4, "9.10"),
        made(Verdict.WRONG, 5, "9.2"),
        made(Verdict.WRONG, 6, "3", chapter="I"),
        made(Verdict.WRONG, 7, "reference", document="savage2016", chapter="-"),
        made(Verdict.WRONG, 8, "abstract", document="savage2016", chapter="-"),
        made(Verdict.WRONG, 9, "2.appendix", document="hung1982", chapter="III"),
    ]
    order = [row.statement.item for row in in_reading_order(iter(some))]
    assert order == [f"eq ({n})" for n in (2, 5, 4, 1, 6, 9, 3, 7, 8)]
