"""The squares of the errata page: one a statement, in order, each with its verdict and its place in the ledger."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

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


def test_the_squares_of_a_page_stand_in_its_order(rows):
    links = [link for _, link, _ in SQUARE.findall(ledger.squares(rows).html)]
    for page in ledger.PAGES:
        there = re.findall(r'<tr id="([^"]+)"', ledger.ledger_page(rows, page).html)
        assert [link.partition("#")[2] for link in links if link.startswith(f"{page.name}.html")] == there


def test_the_key_counts_every_verdict(rows):
    key = re.findall(r'square-([\w-]+)"></span>[^<]*\((\d+)\)', ledger.squares(rows).html)
    assert {kind: int(count) for kind, count in key} == Counter(map(shape, rows))


def test_each_root_error_has_the_squares_of_all_that_it_affects(rows):
    groups = ledger.root_squares(rows).html.split('<div class="squares-group">')[1:]
    found = [sorted(link for _, link, _ in SQUARE.findall(group)) for group in groups]
    roots = [sorted(address(row.statement) for row in inside) for inside in ledger.by_root(rows).values()]
    assert sorted(found) == sorted(roots)
    assert [len(each) for each in found] == sorted(map(len, roots), reverse=True)


def test_every_verdict_has_a_look_of_its_own(rows):
    css = (Path(__file__).resolve().parents[2] / "book/_static/ledger.css").read_text(encoding="utf-8")
    for each in set(map(shape, rows)) - {"given"}:  # an empty square
        assert re.search(rf"\.square-{each}\b", css), each
