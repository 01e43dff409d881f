"""The ledger as HTML: each statement on one page, formulas for MathJax, claims; answers.txt has pages and tables."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from markup import Elements

from gpbnb.report import ledger
from gpbnb.report.ledger import Row, load_statements, page
from gpbnb.report.ledger.checking import TOPIC_OF
from gpbnb.report.ledger.corrections import load_corrections
from gpbnb.report.ledger.finding import DISAGREEMENTS, Finding, Verdict, compare
from gpbnb.report.ledger.statements import DOCUMENTS

BOOK = Path(__file__).resolve().parents[2] / "book"
FINDINGS = (
    compare(True, "yes"),
    compare(False, r"$a<b$ & <c>", Verdict.WRONG, "see the chapter *Rounding bounds*; *not* x*y*z, x*y* z"),
    compare(False, "one", Verdict.MISPRINT),
    Finding("", None, Verdict.UNVERIFIABLE, "no data"),
    Finding("$|x|$", True, Verdict.ANSWERED, "here"),
)
STATEMENTS = load_statements()
# It has a correction and is legible.
LEGIBLE = next(each for each in STATEMENTS if each.id == "hung1984.II.s4.example-13-parameters")
CORRECTIONS = load_corrections()
ROWS = tuple(Row(statement, FINDINGS[place % len(FINDINGS)]) for place, statement in enumerate(STATEMENTS))
EVERY_PAGE = "".join(ledger.ledger_page(ROWS, each).html for each in ledger.PAGES)


def test_every_statement_is_on_exactly_one_page():
    assert [[each.name for each in ledger.PAGES if each.holds(s)] for s in STATEMENTS] == [
        [page.address(s).partition(".html")[0]] for s in STATEMENTS
    ]
    ids = [row["id"] for row in Elements(EVERY_PAGE).all("tr") if "id" in row]
    assert sorted(ids) == sorted(statement.id for statement in STATEMENTS)


@pytest.mark.parametrize("each", ledger.PAGES, ids=lambda each: each.name)
def test_a_page_of_the_ledger_is_a_page_of_the_book(each):
    assert each.document in DOCUMENTS
    text = (BOOK / f"{each.name}.md").read_text(encoding="utf-8")
    assert f"# {each.title}\n" in text
    assert f"```{{ledger}} page {each.name}\n" in text
    assert f"  - file: book/{each.name}\n" in (BOOK.parent / "_toc.yml").read_text(encoding="utf-8")


def test_all_formulas_are_marked_and_no_dollar_is_left():
    texts = [
        t for row in ROWS for t in (row.statement.item, row.statement.printed, row.finding.recomputed, row.finding.note)
    ]
    disagreeing = [row.statement for row in ROWS if row.finding.verdict in DISAGREEMENTS]
    corrections = {each: CORRECTIONS[each.id] for each in disagreeing if each.id in CORRECTIONS}
    for statement, correction in corrections.items():
        corrected = correction.applied(statement)
        texts.append(corrected.printed if corrected else correction.reason)
    assert EVERY_PAGE.count('<span class="math notranslate nohighlight">') == sum(t.count("$") // 2 for t in texts)
    assert "$" not in EVERY_PAGE


def test_text_is_escaped_and_a_chapter_named_in_a_note_is_linked():
    statement = replace(LEGIBLE, item="$a<b$ & so", text="$a<b$ & so on", form="")
    html = ledger.ledger_page([Row(statement, FINDINGS[1])], ledger.PAGES[0]).html
    assert r"\(a&lt;b\)</span> &amp; so on" in html
    assert '<a href="rounding.html">Rounding bounds</a>; <em>not</em> x*y*z, x*y* z' in html
    assert re.findall(r'<p class="(\w+)">', html) == ["printed", "corrected", "recomputed", "note"]


def test_select_topic():
    found = ledger.select_topic(ROWS, "rounding")
    assert [row.statement.id for row in found] == [s.id for s in STATEMENTS if TOPIC_OF[s.id] == "rounding"]
    wrong = ledger.select_topic(ROWS, "rounding", Verdict.WRONG, Verdict.MISPRINT)
    assert wrong == tuple(row for row in found if row.outcome in ("wrong", "misprint")) != ()
    with pytest.raises(ValueError, match="topic 'Rounding'; needed one of rounding"):
        ledger.select_topic(ROWS, "Rounding")


def test_every_topic_has_a_chapter_of_its_title():
    assert set(TOPIC_OF.values()) <= set(ledger.CHAPTERS)
    for topic, title in ledger.CHAPTERS.items():
        cells = json.loads((BOOK / f"{topic}.ipynb").read_text(encoding="utf-8"))["cells"]
        assert "".join(cells[0]["source"]).splitlines()[0] == f"# {title}"
