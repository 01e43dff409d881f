"""The corrections, and what they correct."""

import csv
from importlib.resources import files

import pytest

from gpbnb.report.ledger import corrections, load_statements
from gpbnb.report.ledger.corrections import Correction, intended, load_corrections
from gpbnb.report.ledger.statements import Statement, statement


def test_a_correction_replaces_the_form_and_where_it_must_the_text():
    printed = Statement("hung1984.II.x", "hung1984", "II", "1", "x", "equation", "{{1}} [the scan is torn]", "a == b")
    assert Correction(printed.id, "a == c").applied(printed).printed == "$a=c$ [the scan is torn]"
    assert Correction(printed.id, "a == c", "{{1}}").applied(printed).printed == "$a=c$"
    assert Correction(printed.id, reason="nobody knows").applied(printed) is None


def test_each_row_has_another_form_or_a_reason():
    rows = list(csv.DictReader((files(corrections.__package__) / "corrections.csv").read_text().splitlines()))
    assert len({row["id"] for row in rows}) == len(rows)
    for row in rows:
        assert bool(row["form"]) != bool(row["reason"]), row["id"]
        assert row["form"] or not row["text"], row["id"]
        assert row["form"] != statement(row["id"]).form, row["id"]


def test_what_was_intended_is_the_correction_or_else_the_print():
    assert intended("hung1984.II.eq81").form.endswith("*epsilon")
    assert intended("hung1984.II.eq82") == statement("hung1984.II.eq82")
    unknown = next(key for key, correction in load_corrections().items() if correction.reason)
    assert intended(unknown) == statement(unknown)
    with pytest.raises(KeyError, match="needed the id of a statement"):
        intended("hung1984.II.eq126")


def test_a_corrected_statement_reads_otherwise():
    by_id = {statement.id: statement for statement in load_statements()}
    corrected = [correction.applied(by_id[key]) for key, correction in load_corrections().items()]
    assert [each.id for each in corrected if each is not None and each.printed == by_id[each.id].printed] == []
