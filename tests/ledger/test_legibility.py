"""Author or scan: the rule, and the data to which it is applied."""

import pytest

from gpbnb.report import ledger
from gpbnb.report.ledger import legibility
from gpbnb.report.ledger.finding import DISAGREEMENTS, Finding, Verdict, compare
from gpbnb.report.ledger.legibility import Damage, charged, load_legibility

DAMAGES = load_legibility()


@pytest.fixture(scope="module")
def rows():
    return {row.statement.id: row for row in ledger.rows()}


@pytest.fixture
def damaged(monkeypatch):
    """A statement a with a witness, and a statement b without one."""
    found = {"a": Damage("a", "l", "c"), "b": Damage("b", "l")}
    monkeypatch.setattr(legibility, "load_legibility", lambda: found)


@pytest.mark.parametrize("verdict", DISAGREEMENTS)
def test_a_witness_charges_the_scan(damaged, verdict):
    author = compare(False, "1", verdict, "why", root="product")
    found = charged("a", author)
    assert (found.verdict, found.root) == (Verdict.OCR, "")
    assert (found.recomputed, found.note, found.agrees) == ("1", "why", False)


def test_without_a_witness_the_author_stays_charged(damaged):
    author = compare(False, "1", Verdict.WRONG, "why")
    assert charged("b", author) is author


def test_a_statement_that_is_right_needs_nobody_to_charge(damaged):
    for right in (compare(True, "1"), Finding("", None, Verdict.GIVEN, "a definition")):
        assert charged("a", right) is right


def test_each_damage_belongs_to_a_statement_and_each_witness_is_right(rows):
    assert set(DAMAGES) <= set(rows)
    for damage in DAMAGES.values():
        if damage.witness and damage.witness != damage.id:
            assert rows[damage.witness].finding.verdict in (Verdict.VERIFIED, Verdict.GIVEN), damage.id


def test_the_scan_is_charged_exactly_where_there_is_a_witness(rows):
    charged_to_scan = {key for key, row in rows.items() if row.finding.verdict is Verdict.OCR}
    assert charged_to_scan == {damage.id for damage in DAMAGES.values() if damage.witness}
