"""The page of evidence counts what the stored results contain."""

from __future__ import annotations

from pathlib import Path

from gpbnb.report import evidence
from gpbnb.report.evidence import Checked


def test_compared_operations_are_counted(tmp_path):
    file = tmp_path / "operations.md"
    file.write_text("| base | all | different |\n| --- | --- | --- |\n| 2 | 1,200 | 0 |\n| 10 | 34 | 5 |\n\nNotes.\n")
    assert evidence.operations(file) == Checked(1234, 5)
    file.write_text("| compiler | builds | different |\n| --- | --- | --- |\n| gcc | 1,200 | 3 |\n")
    assert evidence.compiled(file) == Checked(1203, 3)


def test_a_run_beyond_its_bound_is_wrong(monkeypatch):
    row = evidence.survey.load()[0]
    kalman = evidence.filters.load()[0]
    monkeypatch.setattr(evidence.filters, "load", lambda: (kalman,))
    monkeypatch.setattr(evidence.survey, "load", lambda: (row._replace(constant="1"), row._replace(constant="1.001")))
    assert evidence.attacks() == Checked(kalman.runs + 2 * row.runs, 1)
    monkeypatch.setattr(evidence.filters, "load", lambda: (kalman._replace(chosen="1.001"),))
    assert evidence.attacks().wrong == 2
    known = next(row for row in evidence.scalar.load() if row.result == "compared")
    found = (known._replace(ratio="1"), known._replace(ratio="1.001"), known._replace(result="failed", ratio="2"))
    monkeypatch.setattr(evidence.scalar, "load", lambda: found)
    assert evidence.true_errors() == Checked(2, 1)


def test_nothing_that_the_page_counts_disagrees():
    page = Path(__file__).resolve().parents[1] / "book" / "trust.ipynb"
    assert "In all rows: disagreements = 0." in page.read_text(encoding="utf-8")
