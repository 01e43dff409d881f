"""The page of evidence counts what the stored results contain."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from gpbnb.report import evidence
from gpbnb.report.evidence import Checked

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"


def test_compared_operations_are_counted_in_both_kinds_of_tables(tmp_path):
    file = tmp_path / "operations.md"
    file.write_text("| base | all | different |\n| --- | --- | --- |\n| 2 | 1,200 | 0 |\n| 10 | 34 | 5 |\n\nNotes.\n")
    assert evidence.operations(file) == Checked(1234, 5)
    file = tmp_path / "operations.csv"
    file.write_text("fmt,compared,different\nbinary16,7,0\nbinary32,8,1\n")
    assert evidence.operations(file) == Checked(15, 1)
    file.write_text("fmt,compared\nbinary16,7\n")
    with pytest.raises(ValueError, match="needed the columns 'compared' and 'different'"):
        evidence.operations(file)


def test_the_two_tables_of_the_processors_agree():
    with (RESULTS / "processors.csv").open(newline="") as stream:
        compared = sum(int(row["compared"]) for row in csv.DictReader(stream))
    shown = [line.strip("|").split("|")[1:-1] for line in (RESULTS / "processors.md").read_text().splitlines()[2:8]]
    assert evidence.operations(RESULTS / "processors.csv").cases == compared
    assert compared == sum(int(cell.replace(",", "") or 0) for row in shown for cell in map(str.strip, row))


def test_builds_of_generated_code_are_counted(tmp_path):
    file = tmp_path / "code.md"
    head = "| format | combinations | builds | different |\n| --- | --- | --- | --- |\n"
    file.write_text(head + "| int16 | 400 | 1,997 | 3 |\n| words | 2 | 10 | 0 |\n")
    assert evidence.compiled(file) == Checked(2010, 3)
    file.write_text("| format | steps |\n| --- | --- |\n| int16 | 1 |\n")
    with pytest.raises(ValueError, match="needed the columns 'builds' and 'different'"):
        evidence.compiled(file)


def test_a_run_beyond_its_bound_is_wrong(monkeypatch):
    row = evidence.survey.load()[0]
    monkeypatch.setattr(
        evidence.filters, "load", lambda: (evidence.filters.SWEEP.load().tuples(evidence.filters.FilterRow)[0],)
    )
    monkeypatch.setattr(evidence.survey, "load", lambda: (row, row._replace(constant="1.001")))
    kalman = evidence.filters.load()[0]
    assert evidence.attacks() == Checked(kalman.runs + 2 * row.runs, 1)
    monkeypatch.setattr(evidence.filters, "load", lambda: (kalman._replace(chosen="1.001"),))
    assert evidence.attacks().wrong == 2


def test_a_worst_error_beyond_its_bound_is_wrong(monkeypatch):
    rows = [row for row in evidence.scalar.load() if row.result == "compared"][:3]
    monkeypatch.setattr(evidence.scalar, "load", lambda: (*rows[:2], rows[2]._replace(ratio="1.01")))
    assert evidence.true_errors() == Checked(3, 1)
