"""The ledger as HTML: each statement on one page, formulas for MathJax, filters that count right, working links."""

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
from gpbnb.report.ledger.html import typeset
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


def test_rows_carry_what_the_filters_need():
    rows = {attrs["id"]: attrs for attrs in Elements(EVERY_PAGE).all("tr") if "id" in attrs}
    for row in ROWS:
        attrs = rows[row.statement.id]
        assert attrs["data-kind"] == row.statement.kind
        assert attrs["data-verdict"] == row.outcome
        assert attrs["data-chapter"] == TOPIC_OF[row.statement.id]


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


def test_the_options_of_each_filter_count_its_rows():
    for each in ledger.PAGES:
        inside = [row for row in ROWS if each.holds(row.statement)]
        values = {
            "verdict": [row.outcome for row in inside],
            "kind": [row.statement.kind for row in inside],
            "chapter": [TOPIC_OF[row.statement.id] for row in inside],
        }
        html = ledger.ledger_page(ROWS, each).html
        for name, expected in values.items():
            select = re.search(rf'<select name="{name}".*?</select>', html, re.DOTALL)[0]
            options = re.findall(r'<option value="([^"]+)">[^<]*\((\d+)\)</option>', select)
            assert sorted(options) == sorted((v, str(expected.count(v))) for v in set(expected))
            assert select.count('<option value="">all</option>') == 1


def test_the_error_table_lists_disagreements_with_the_most_serious_first():
    table = ledger.error_table(ROWS)
    found = re.findall(r'class="verdict verdict-([\w-]+)"', table.html)
    assert found == sorted(found, key=["wrong", "misprint"].index)
    links = [a["href"] for a in Elements(table.html).all("a") if a["href"].startswith("ledger")]
    by_address = {page.address(row.statement): row for row in ROWS}
    disagreeing = [row for row in ROWS if row.finding.verdict in (Verdict.WRONG, Verdict.MISPRINT)]
    assert len(disagreeing) > 250
    assert sorted(by_address[link].statement.id for link in links) == sorted(row.statement.id for row in disagreeing)


def test_the_error_table_has_a_row_for_each_root_error_with_all_its_statements():
    root = next(iter(ledger.load_roots()))
    shared = [Row(s, compare(False, "1", Verdict.WRONG, f"note {i}", root=root)) for i, s in enumerate(STATEMENTS[:3])]
    alone = Row(STATEMENTS[3], compare(False, "1", Verdict.MISPRINT, "a note of its own"))
    html = ledger.error_table([alone, *shared]).html
    lines = re.findall(r"<tr><th scope=\"row\">(.*?)</tr>", html, re.DOTALL)
    assert len(lines) == 2
    assert f"errata.html#root-{root}" in lines[0]
    assert all(page.address(row.statement) in lines[0] and f"note {i}" in lines[0] for i, row in enumerate(shared))
    assert "a note of its own" in lines[1]
    assert "<details>" not in lines[1]


def test_of_equally_serious_errors_the_one_with_more_statements_comes_first():
    notes = ["one", "three", "three", "two", "three", "two"]
    rows = [Row(s, compare(False, "1", Verdict.WRONG, note)) for s, note in zip(STATEMENTS, notes, strict=False)]
    rows.append(Row(STATEMENTS[6], compare(False, "1", Verdict.MISPRINT, "last")))
    html = ledger.error_table(rows).html
    assert re.findall(r'<tr><th scope="row">(\w+)<', html) == ["three", "two", "one", "last"]


def test_root_errors_begin_with_the_one_that_spoils_most():
    first, second, third = list(ledger.load_roots())[:3]
    roots = [first, second, second, second, third, third]
    rows = [Row(s, compare(False, "1", Verdict.WRONG, root=r)) for s, r in zip(STATEMENTS, roots, strict=False)]
    shown = [a["id"] for a in Elements(ledger.root_table(rows).html).all("tr") if "id" in a]
    assert shown == [f"root-{each}" for each in (second, third, first)]


@pytest.mark.parametrize(
    ("finding", "shown", "collapsed"),
    [
        (compare(True, "1", note="n"), ["printed"], ["recomputed", "note"]),
        (Finding("", None, Verdict.GIVEN, "n"), ["printed"], ["note"]),
        (compare(False, "1", Verdict.MISPRINT, "n"), ["printed", "corrected"], ["recomputed", "note"]),
        (compare(False, "1", Verdict.WRONG, "n"), ["printed", "corrected", "recomputed", "note"], []),
        (Finding("1", None, Verdict.UNVERIFIABLE, "n"), ["printed", "recomputed", "note"], []),
    ],
    ids=lambda each: each.verdict.value if isinstance(each, Finding) else None,
)
def test_what_most_readers_skip_is_collapsed(finding, shown, collapsed):
    before, _, after = ledger.ledger_page([Row(LEGIBLE, finding)], ledger.PAGES[0]).html.partition("<details>")
    assert [re.findall(r'<p class="(\w+)">', text) for text in (before, after)] == [shown, collapsed]


@pytest.mark.parametrize(("undone", "shown"), [(False, ["note"]), (True, ["printed", "recomputed", "note"])])
def test_a_note_comes_first_unless_the_documents_left_the_work_undone(undone, shown):
    html = ledger.note_table([Row(LEGIBLE, Finding("1", None, Verdict.UNVERIFIABLE, "n"))], undone).html
    before = html.partition("<summary>Evidence")[0]
    assert re.findall(r'<p class="(\w+)">', before) == shown
    assert ("ledger-undone" in html) is undone


WRONG = compare(False, "1", Verdict.WRONG, "n")


def test_the_corrected_form_stands_below_the_printed_one():
    printed = next(each for each in STATEMENTS if each.id == "hung1984.II.eq92")
    html = ledger.ledger_page([Row(printed, WRONG)], next(each for each in ledger.PAGES if each.holds(printed))).html
    assert r'<p class="printed"><span class="math notranslate nohighlight">\(\delta b=\tilde b+\Delta b=' in html
    assert r'<p class="corrected"><span class="math notranslate nohighlight">\(\delta b=\tilde b+L\Delta b=' in html


def test_where_no_text_is_right_the_reason_is_shown():
    printed = next(each for each in STATEMENTS if each.id == "hung1984.II.s11-4.table-1")
    html = ledger.error_table([Row(printed, WRONG)]).html
    assert f'<p class="uncorrected">{CORRECTIONS[printed.id].reason}</p>' in html


def test_quotation_marks_stay_and_what_would_be_markup_does_not():
    shown = typeset('"less" than it\'s, $a<b$ & more <b>')
    assert shown == (
        '"less" than it\'s, <span class="math notranslate nohighlight">\\(a&lt;b\\)</span> &amp; more &lt;b&gt;'
    )


def test_every_verdict_that_a_claim_can_have_has_an_outcome():
    outcomes = {}
    for verdict in (Verdict.VERIFIED, Verdict.UNVERIFIABLE, *DISAGREEMENTS):
        agrees = {Verdict.VERIFIED: True, Verdict.UNVERIFIABLE: None}.get(verdict, False)
        rows = [Row(statement, Finding("1", agrees, verdict, "why")) for statement in STATEMENTS]
        html = ledger.claim_table(rows).html
        found = re.findall(r'class="verdict [\w-]+">([^<]+)<', html)
        assert len(found) == len(page.CLAIMS)
        outcomes[verdict] = found[0]
        assert set(found) == {found[0]}
    assert outcomes == {
        Verdict.VERIFIED: "replicated",
        Verdict.MISPRINT: "replicated after correcting a misprint",
        Verdict.OCR: "replicated after correcting the scan",
        Verdict.INCONSISTENT: "corrected",
        Verdict.WRONG: "refuted",
        Verdict.NOT_REPRODUCED: "not reproducible",
        Verdict.UNVERIFIABLE: "not reproducible",
    }
    assert Elements(html).cells[:3] == ["Claim", "Outcome", "What follows"]


@pytest.mark.parametrize("by", ["document", "chapter", "kind"])
def test_counts_add_up(by):
    found = ledger.count_table(ROWS, by)
    head, *body = [found.header, *found.body]
    numbers = [list(map(int, line[1:])) for line in body]
    assert all(sum(line[:-1]) == line[-1] for line in numbers)
    assert [sum(column) for column in zip(*numbers[:-1], strict=True)] == numbers[-1]
    assert numbers[-1][-1] == len(ROWS)
    assert (head[0], head[-1]) == (by.capitalize(), "statements")
    assert found.title == f"Counts of {len(ROWS)} statements by {by}"
    for outcome, number in zip(head[1:-1], numbers[-1], strict=False):
        assert number == sum(row.outcome == outcome for row in ROWS)
    if by == "document":
        assert [line[0] for line in body] == [*DOCUMENTS, "all"]


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
