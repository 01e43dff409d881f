"""The squares of the errata page: one a statement, in order, each with its verdict and its place in the ledger."""

from __future__ import annotations

import re
from collections import Counter

import pytest

from gpbnb.report import ledger
from gpbnb.report.ledger.page import address

SQUARE = re.compile(r'<a class="square square-([\w-]+)" href="([^"]+)" aria-label="([^"]*)"></a>')


def shape(row):
    """The verdict in the class of a square; an error of the scan has a name that readers know."""
    return {"ocr": "scan-error"}.get(row.outcome, row.outcome.replace(" ", "-"))


@pytest.fixture(scope="module")
def rows():
    return ledger.rows()


def test_each_statement_has_one_square_with_its_verdict(rows):
    found = SQUARE.findall(ledger.squares(rows).html)
    assert Counter((link, kind) for kind, link, _ in found) == Counter(
        (address(row.statement), shape(row)) for row in rows
    )
    assert all(words.strip() for *_, words in found)


def test_the_key_counts_every_verdict(rows):
    key = re.findall(r'square-([\w-]+)"></span>[^<]*\((\d+)\)', ledger.squares(rows).html)
    assert {kind: int(count) for kind, count in key} == Counter(map(shape, rows))
