"""The stored findings are those that the checks compute."""

from __future__ import annotations

import faults
import pytest

from gpbnb.report.ledger import TOPICS, Row, examine, load_statements, rows
from gpbnb.report.ledger.stored import FILE, load_findings, to_table


@pytest.mark.parametrize("topic", TOPICS)
def test_the_checks_of_a_topic_find_what_is_stored(topic):
    computed = examine([each for each in load_statements() if each.id in TOPICS[topic]])
    stored = load_findings()
    assert len(computed) > 20
    assert [row for row in computed if row != Row(row.statement, stored.get(row.statement.id))] == [], (
        "if the new findings are right, run `make findings`"
    )


def test_every_statement_has_a_stored_finding_and_nothing_else_is_stored():
    assert to_table(rows()) == FILE.read_text(encoding="utf-8")


def test_differences_have_notes():
    faults.check_texts(rows())


def test_a_part_of_the_ledger_has_the_rows_of_that_part():
    part = rows(document="hung1984", chapter="II", sections=(2, 9))
    assert part == tuple(row for row in rows() if row in part) != ()
    assert {(row.statement.document, row.statement.chapter) for row in part} == {("hung1984", "II")}
    assert {row.statement.section.split(".")[0] for row in part} == {"2", "9"}
