"""Root errors: each wrong statement follows from one of them, and each of them makes a statement wrong."""

import pytest

from gpbnb.report import ledger
from gpbnb.report.ledger import load_roots
from gpbnb.report.ledger.finding import Verdict


@pytest.fixture(scope="module")
def rows():
    return ledger.rows()


def test_each_wrong_statement_follows_from_a_root_error(rows):
    wrong = [row for row in rows if row.finding.verdict is Verdict.WRONG]
    assert [row.statement.id for row in wrong if row.finding.root not in load_roots()] == []


def test_each_root_error_makes_a_statement_wrong(rows):
    wrong = {row.finding.root for row in rows if row.finding.verdict is Verdict.WRONG}
    assert wrong == set(load_roots())
