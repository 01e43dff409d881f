"""What the repository keeps of a campaign with seeded faults."""

from __future__ import annotations

import csv
from pathlib import Path

from tests.mutants.record import FIELDS, read, record

MUTANTS = Path(__file__).parent / "mutants"


def table(name):
    return list(csv.DictReader((MUTANTS / name).read_text(encoding="utf-8").splitlines()))


def test_each_fault_that_no_test_catches_has_its_reason_and_its_line():
    rows = table("survivors.csv")
    assert {row["outcome"] for row in rows} <= {"equivalent", "survived", "no test", "caught by a stored picture"}
    assert [row for row in rows if row["outcome"] in ("equivalent", "survived") and not row["reason"]] == []
    assert {row["module"] for row in rows} <= {row["module"] for row in table("modules.csv")}


def test_the_counts_of_a_module_add_up():
    rows = table("modules.csv")
    parts = ("caught", "caught by a stored picture", "equivalent", "survived", "no test")
    for row in rows:
        assert int(row["mutants"]) == sum(int(row[part]) for part in parts) > 0, row["module"]
    assert len(rows) > 150
    assert sum(int(row["caught"]) for row in rows) / sum(int(row["mutants"]) for row in rows) > 0.85


def test_a_campaign_keeps_counts_of_other_modules_and_reasons(tmp_path):
    def row(module, outcome, line="1"):
        return dict.fromkeys(FIELDS, "") | {"module": module, "outcome": outcome, "line": line, "occurrence": "0"}

    files = tmp_path / "survivors.csv", tmp_path / "modules.csv"
    one, two = "gpbnb/clock.py", "gpbnb/names.py"
    record([row(one, "caught"), row(one, "survived", "2"), row(two, "timeout")], {one, two}, *files)
    record([row(one, "caught"), row(one, "caught", "2")], {one}, *files)
    assert read(files[0]) == []
    assert [(each["module"], each["mutants"], each["caught"]) for each in read(files[1])] == [
        (one, "2", "2"),
        (two, "1", "1"),
    ]
