"""The stored findings are those that the checks compute."""

from __future__ import annotations

import pytest

from gpbnb.report.ledger import TOPICS, Row, examine, load_statements, rows
from gpbnb.report.ledger.finding import Verdict
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


def test_disagreements_have_a_note_and_comparisons_a_number():
    """No note says seven words twice, or those of the result, as one that is joined from wrong parts does."""
    for row in rows():
        note, recomputed = row.finding.note, row.finding.recomputed
        for text in (note, recomputed):
            assert text == " ".join(text.split()), row.statement.id
        words = note.split()
        runs = [" ".join(words[i : i + 7]) for i in range(len(words) - 6)]
        assert len(set(runs)) == len(runs), row.statement.id
        assert not any(run in recomputed for run in runs), row.statement.id
        assert note or row.finding.verdict is Verdict.VERIFIED, row.statement.id
        assert recomputed or row.finding.agrees is None, row.statement.id


def test_a_part_of_the_ledger_has_the_rows_of_that_part():
    part = rows(document="hung1984", chapter="II", sections=(2, 9))
    assert part == tuple(row for row in rows() if row in part) != ()
    assert {(row.statement.document, row.statement.chapter) for row in part} == {("hung1984", "II")}
    assert {row.statement.section.split(".")[0] for row in part} == {"2", "9"}


def test_twins_of_the_two_reports_with_one_form_have_the_same_verdict():
    verdicts = {row.statement.id: (row.statement.form, row.finding.verdict) for row in rows() if row.statement.form}
    twins = [(verdicts[key], verdicts.get(key.replace("hung1984.II.", "hung1982.III."))) for key in verdicts]
    same = [(one[1], other[1]) for one, other in twins if other is not None and other is not one and other[0] == one[0]]
    assert len(same) > 80
    assert all(one is other for one, other in same)
