"""The words of each statement are compared with the scanned document, letter for letter, where that is at hand.

``own_words.csv`` lists what is not in a scan as it stands: words that we supply or shorten, letters that we restore.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from gpbnb.report.ledger.formula import Words
from gpbnb.report.ledger.legibility import load_legibility
from gpbnb.report.ledger.statements import DOCUMENTS, Statement, load_statements

OWN_WORDS = Path(__file__).with_name("own_words.csv")
SCANS = next((each for up in Path(__file__).parents if (each := up / "shared" / "seeds").is_dir()), None)
pytestmark = pytest.mark.skipif(SCANS is None, reason="the scanned documents are not here")

APART = re.compile(r"\{\{\d+\}\}|\$[^$]*\$|\.\.\.|\[[^\]]*\]|[;:,…]")
"""What stands between two quotations: formulas, gaps, our own remarks, and marks that a list of quotations needs."""


def letters(text: str) -> str:
    joined = re.sub(r"(\w)-\s*\n\s*(\w)", r"\1\2", text.lower())
    return re.sub(r"[^a-z0-9]+", "", re.sub(r"\\[a-z]+", " ", joined))


def quotations(statement: Statement) -> list[str]:
    """The words between two formulas; a phrase that a check judges stands where it is printed."""
    text = statement.text
    for number, part in enumerate(statement.parts, 1):
        if isinstance(part, Words):
            text = text.replace(f"{{{{{number}}}}}", part.printed)
    return [each.strip() for each in APART.split(text) if len(letters(each)) > 5]


@cache
def scan(document: str) -> str:
    assert SCANS is not None
    (path,) = SCANS.glob(f"{DOCUMENTS.index(document):03d}_*.txt")
    return letters(path.read_text(encoding="utf-8"))


def test_each_quotation_is_in_its_document():
    missing = Counter(
        (row.id, words)
        for row in load_statements()
        for words in quotations(row)
        if letters(words) not in scan(row.document)
    )
    with OWN_WORDS.open(encoding="utf-8", newline="") as lines:
        listed = Counter((row["id"], row["words"]) for row in csv.DictReader(lines))
    assert sorted(missing - listed) == [], "not in the document, nor in own_words.csv"
    assert sorted(listed - missing) == [], "in own_words.csv, but in the document or in no statement"


def test_each_damage_quotes_the_characters_of_the_scan():
    damages = [(key, part) for key, damage in load_legibility().items() for part in damage.scan.split("; ")]
    missing = [each for each in damages if letters(each[1]) not in scan(each[0].partition(".")[0])]
    assert [key for key, _ in missing] == ["hung1984.II.s11-3.claim-e-defined"]  # says that a letter is missing


def test_each_statement_is_filed_where_its_id_says():
    for row in load_statements():
        if number := re.search(r"\.eq(\d+[a-z]?)$", row.id):
            assert row.item == f"eq ({number[1]})", row.id
        if section := re.search(r"\.s(\d[\d-]*)\.", row.id):
            assert row.section == section[1].replace("-", "."), row.id
        assert row.id.split(".")[0] == row.document
