"""Entries meet checks: each has one check, rows, and their counts."""

import importlib

from gpbnb.report.ledger import Row, counts, examine, load_statements, select
from gpbnb.report.ledger.checking import TOPICS, in_reading_order
from gpbnb.report.ledger.finding import Verdict, compare
from gpbnb.report.ledger.statements import Statement

INVENTORY = load_statements()


def entry(number, section="2", document="hung1984", chapter="II"):
    return Statement(
        f"{document}.{chapter}.eq{number}", document, chapter, section, f"eq ({number})", "equation", "$a$"
    )


def topics(*names):
    return {name: importlib.import_module(name).CHECKS for name in names}


def test_each_statement_has_one_check():
    assert sorted(key for checks in TOPICS.values() for key in checks) == sorted(entry.id for entry in INVENTORY)


def test_each_topic_has_the_checks_of_its_own_module():
    assert list(TOPICS) == ["rounding", "inversion", "kalman", "rolling", "integration", "budget", "geometry"]
    for name, checks in TOPICS.items():
        assert checks is importlib.import_module(f"gpbnb.report.ledger.checks.{name}").CHECKS


def test_one_row_an_entry_in_order(complete):
    found = examine(INVENTORY, topics(complete))
    assert tuple(row.statement for row in found) == INVENTORY
    assert [row.statement.id for row in found if row.finding] == [
        entry.id for entry in INVENTORY if entry.id.startswith("hung1984.I.")
    ]
    assert all(row.error is None for row in found)


def test_only_the_selected_checks_are_run(complete):
    found = examine(select(INVENTORY, "savage2016"), topics(complete))
    assert {row.statement.document for row in found} == {"savage2016"}
    assert {row.outcome for row in found} == {"missing"}
    assert importlib.import_module(complete).CALLS == []


def test_an_iterator_of_entries_will_do(complete):
    some = tuple(entry for entry in INVENTORY if entry.id.startswith("hung1984.I."))
    assert tuple(row.statement for row in examine(iter(some), topics(complete))) == some


def made(verdict, number, section="2", **place):
    agrees = {Verdict.VERIFIED: True, None: None}.get(verdict, False)
    finding = None if verdict is None else compare(agrees, "1", Verdict.MISPRINT if agrees else verdict)
    return Row(entry(number, section, **place), finding)


def test_counts_are_in_the_order_of_the_verdicts():
    some = [made(None, 1), made(Verdict.OCR, 2), made(Verdict.VERIFIED, 3), made(None, 4), made(Verdict.WRONG, 5)]
    some.append(Row(entry(6), None, ValueError("x")))
    expected = {"verified": 1, "wrong": 1, "ocr": 1, "failed": 1, "missing": 2}
    assert counts(some) == expected
    assert list(counts(some)) == list(expected)
    assert counts([]) == {}


def test_reading_order_sorts_sections_by_number_and_keeps_the_rest():
    some = [
        made(None, 1, "10"),
        made(None, 2, "9.2"),
        made(None, 3, "2", document="hung1982", chapter="III"),
        made(None, 4, "9.10"),
        made(None, 5, "9.2"),
        made(None, 6, "3", chapter="I"),
        made(None, 7, "reference", document="savage2016", chapter="-"),
        made(None, 8, "abstract", document="savage2016", chapter="-"),
        made(None, 9, "2.appendix", document="hung1982", chapter="III"),
    ]
    order = [row.statement.item for row in in_reading_order(iter(some))]
    assert order == [f"eq ({n})" for n in (2, 5, 4, 1, 6, 9, 3, 7, 8)]
