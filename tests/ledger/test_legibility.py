"""Author or scan: the rule, and the data to which it is applied."""

import pytest

from gpbnb.report import ledger
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.legibility import load_legibility

DAMAGES = load_legibility()


@pytest.fixture(scope="module")
def rows():
    return {row.statement.id: row for row in ledger.rows()}


def test_each_damage_belongs_to_a_statement_and_each_witness_is_right(rows):
    assert set(DAMAGES) <= set(rows)
    for damage in DAMAGES.values():
        if damage.witness and damage.witness != damage.id:
            assert rows[damage.witness].finding.verdict in (Verdict.VERIFIED, Verdict.GIVEN), damage.id


def test_the_scan_is_charged_exactly_where_there_is_a_witness(rows):
    charged_to_scan = {key for key, row in rows.items() if row.finding.verdict is Verdict.OCR}
    assert charged_to_scan == {damage.id for damage in DAMAGES.values() if damage.witness}
