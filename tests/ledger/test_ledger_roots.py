"""Root errors: each wrong statement follows from one of them, and each of them makes a statement wrong."""

import re
from pathlib import Path

import pytest

from gpbnb.report import ledger
from gpbnb.report.ledger import counts, load_roots
from gpbnb.report.ledger.finding import Verdict

ERRATA = Path(__file__).resolve().parents[2] / "book" / "errata.md"


@pytest.fixture(scope="module")
def rows():
    return ledger.rows()


def test_each_wrong_statement_follows_from_a_root_error(rows):
    wrong = [row for row in rows if row.finding.verdict is Verdict.WRONG]
    assert [row.statement.id for row in wrong if row.finding.root not in load_roots()] == []


def test_each_root_error_makes_a_statement_wrong(rows):
    wrong = {row.finding.root for row in rows if row.finding.verdict is Verdict.WRONG}
    assert wrong == set(load_roots())


def test_the_counts_of_the_errata_add_up_to_the_statements(rows):
    """The list at the top of the page has each verdict once, so its counts add up to the number of statements."""
    first, _, _ = ERRATA.read_text(encoding="utf-8").partition("\n## ")
    named = re.findall(r"\{ledger-count\}`([^`]+)`", first)
    verdicts = [name for name in named if name not in ("statements", "roots")]
    found = counts(rows)
    assert sorted(verdicts) == sorted(found)
    assert sum(found[name] for name in verdicts) == len(rows)
