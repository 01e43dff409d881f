"""The ledger as HTML: rows under their ids, math for MathJax, options that count right, links that name rows."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from gpbnb import ledger
from gpbnb.ledger import Row, load_statements, page
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.statements import DOCUMENTS, Statement

BOOK = Path(__file__).resolve().parents[2] / "book"
FINDINGS = (
    compare(True, "yes"),
    compare(False, r"$a<b$ & <c>", Verdict.WRONG, "see the chapter *Rounding bounds*; *not* x*y*z, x*y* z"),
    compare(False, "one", Verdict.MISPRINT),
    unverifiable("", "no data"),
    answer(True, "$|x|$", "here"),
)
INVENTORY = load_statements()
ROWS = tuple(Row(entry, FINDINGS[place % len(FINDINGS)]) for place, entry in enumerate(INVENTORY))
UNCHECKED = Row(Statement("savage2016.x", "savage2016", "-", "-", "x", "claim", "a"), None)


class Tags(HTMLParser):
    """Reads HTML whose tags must nest; keeps each start tag with its attributes, and the texts of cells."""

    def __init__(self, html):
        super().__init__()
        self.open, self.tags, self.cells = [], [], []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in ("br", "input"):
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "td" in self.open or "th" in self.open:
            self.cells[-1] += data

    def all(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


def test_every_entry_is_a_row_under_its_id():
    found = Tags(ledger.searchable(ROWS).html)
    rows = [attrs for attrs in found.all("tr") if "id" in attrs]
    assert sorted(attrs["id"] for attrs in rows) == sorted(entry.id for entry in INVENTORY)
    by_id = {row.statement.id: row for row in ROWS}
    owner = ledger.topics()
    for attrs in rows:
        row = by_id[attrs["id"]]
        assert attrs["data-kind"] == row.statement.kind
        assert attrs["data-verdict"] == row.outcome
        assert attrs["data-chapter"] == owner.get(row.statement.id, "")


def test_tables_are_the_chapters_of_the_documents_with_their_rows():
    html = ledger.searchable(ROWS).html
    parts = list(dict.fromkeys((entry.document, entry.chapter) for entry in INVENTORY))
    tables = Tags(html).all("table")
    assert [(t["data-document"], t["data-part"]) for t in tables] == parts
    for (document, chapter), table in zip(parts, re.findall(r"<table.*?</table>", html, re.S), strict=True):
        ids = re.findall(r'<tr id="([^"]+)"', table)
        expected = [e.id for e in INVENTORY if (e.document, e.chapter) == (document, chapter)]
        assert sorted(ids) == sorted(expected)
        place = document if chapter == "-" else f"{document}, ch. {chapter}"
        caption = f"{place}: {len(ids)} {'entries' if len(ids) > 1 else 'entry'}"
        assert re.search(r"<caption>(.*?)</caption>", table)[1] == caption
        assert re.findall(r'<th scope="row"><a href="#([^"]+)">', table) == ids
        cells = Tags(table).cells
        assert len(cells) == 3 * (len(ids) + 1)


def test_a_table_of_one_row_says_so():
    assert "<caption>savage2016: 1 entry</caption>" in ledger.searchable([UNCHECKED]).html


def test_printed_and_recomputed_reach_the_cells_as_math_and_prose():
    row = Row(Statement("hung1984.II.x", "hung1984", "II", "6", "eq (x)", "equation", r"$a<b$ & so on"), FINDINGS[1])
    *_, item, verdict, found = Tags(ledger.searchable([row]).html).cells
    assert item == "eq (x)II.6, equation"
    assert verdict == "wrong"
    assert found == r"\(a<b\) & so on\(a<b\) & <c>see the chapter Rounding bounds; not x*y*z, x*y* z"
    html = ledger.searchable([row]).html
    assert re.findall(r'<p class="(\w+)">', html) == ["printed", "recomputed", "note"]
    assert '<a href="rounding.html">Rounding bounds</a>; <em>not</em> x*y*z, x*y* z' in html
    assert html.count('<span class="math notranslate nohighlight">') == 2


def test_all_math_of_the_ledger_is_marked_and_no_dollar_left():
    html = ledger.searchable(ROWS).html
    texts = [
        t for row in ROWS for t in (row.statement.item, row.statement.printed, row.finding.recomputed, row.finding.note)
    ]
    assert html.count('<span class="math notranslate nohighlight">') == sum(t.count("$") // 2 for t in texts)
    assert "$" not in html


def test_a_row_without_a_check_is_shown_as_such():
    html = ledger.searchable([UNCHECKED]).html
    assert 'data-verdict="no check" data-chapter=""' in html
    assert Tags(html).cells[-2:] == ["no check", "a"]


def test_the_options_of_each_filter_count_its_rows():
    html = ledger.searchable(ROWS).html
    owner = ledger.topics()
    values = {
        "verdict": [row.outcome for row in ROWS],
        "kind": [row.statement.kind for row in ROWS],
        "chapter": [owner[row.statement.id] for row in ROWS if row.statement.id in owner],
        "document": [v for e in INVENTORY for v in (e.document, f"{e.document} {e.chapter}")],
    }
    for name, expected in values.items():
        select = re.search(rf'<select name="{name}".*?</select>', html, re.S)[0]
        options = re.findall(r'<option value="([^"]+)">[^<]*\((\d+)\)</option>', select)
        assert sorted(options) == sorted((v, str(expected.count(v))) for v in set(expected))
        assert select.count('<option value="">all</option>') == 1


def test_the_form_waits_for_the_script_and_every_control_has_a_label():
    html = ledger.searchable(ROWS).html
    form = re.search(r"<form.*?</form>", html, re.S)[0]
    assert re.match(r"<form [^>]*hidden>", form)
    labels = re.findall(r"<label>(.*?)</label>", form, re.S)
    assert len(labels) == 5
    assert all(re.match(r"\w[\w ]* <(input|select) ", label) for label in labels)
    assert 'aria-live="polite"' in form


def test_brief_and_links_lead_to_rows_of_the_complete_ledger():
    some = ROWS[3:9]
    targets = [f"errata.html#{row.statement.id}" for row in some]
    brief = Tags(ledger.brief(some).html)
    assert [a["href"] for a in brief.all("a") if a["href"].startswith("errata")] == targets
    links = ledger.links(some)
    assert [a["href"] for a in Tags(links.html).all("a")] == targets
    parts = dict.fromkeys((row.statement.document, row.statement.chapter) for row in some)
    assert re.findall(r"<li>(.*?): <a", links.html) == [f"{document}, ch. {chapter}" for document, chapter in parts]
    assert re.findall(r"<li>(.*?): <a", ledger.links([UNCHECKED]).html) == ["savage2016"]
    assert brief.cells[:3] == ["Item", "Verdict", "Printed, recomputed, and note"]
    assert re.search(r"<br>(.*?)</th>", ledger.brief(some[:1]).html)[1] == "hung1984, I"
    eq20 = next(row for row in ROWS if row.statement.id == "hung1984.II.eq20")
    assert re.search(r"<br>(.*?)</th>", ledger.brief([eq20]).html)[1] == "hung1984, II.6"
    undone = ledger.brief(some, left_undone=True)
    assert Tags(undone.html).cells[2] == "Left undone, and our answer"
    assert 'class="ledger-table ledger-undone"' in undone.html
    assert repr(undone).startswith("<6 entries: ")


def test_the_chapter_of_the_check_is_linked_once():
    owner = ledger.topics()
    row = next(r for r in ROWS if owner.get(r.statement.id) == "rounding" and r.outcome == "wrong")
    assert ledger.brief([row]).html.count('href="rounding.html"') == 1
    other = next(r for r in ROWS if owner.get(r.statement.id) == "rounding" and r.outcome == "verified")
    assert ledger.brief([other]).html.count('href="rounding.html"') == 1


@pytest.mark.parametrize("verdict", Verdict)
def test_told_tells_where_print_and_recomputation_differ_and_of_nothing_else(verdict):
    agrees = {Verdict.VERIFIED: True, Verdict.ANSWERED: True, Verdict.UNVERIFIABLE: None, Verdict.GIVEN: None}.get(
        verdict, False
    )
    row = Row(INVENTORY[0], Finding("found", agrees, verdict, "a note"))
    if agrees is False and verdict is not Verdict.OPEN:
        assert ledger.told([row], row.statement.id) == (row,)
    else:
        with pytest.raises(ValueError, match=f"is {verdict.value}, no error"):
            ledger.told([row], row.statement.id)


def test_told_refuses_what_is_no_error():
    by_outcome = {row.outcome: row.statement.id for row in ROWS}
    picked = ledger.told(ROWS, by_outcome["misprint"], by_outcome["wrong"])
    assert [row.outcome for row in picked] == ["misprint", "wrong"]
    with pytest.raises(ValueError, match="verified, no error; change the text"):
        ledger.told(ROWS, by_outcome["verified"])
    with pytest.raises(ValueError, match="missing, no error"):
        ledger.told([UNCHECKED], UNCHECKED.statement.id)
    with pytest.raises(KeyError, match=r"no row 'hung1984\.none' among"):
        ledger.told(ROWS, "hung1984.none")


def test_of_topic():
    owner = ledger.topics()
    found = ledger.of_topic(ROWS, "rounding")
    assert [row.statement.id for row in found] == [e.id for e in INVENTORY if owner.get(e.id) == "rounding"]
    wrong = ledger.of_topic(ROWS, "rounding", "wrong", "misprint")
    assert {row.outcome for row in wrong} == {"wrong", "misprint"}
    assert set(wrong) <= set(found)
    with pytest.raises(ValueError, match="no topic 'Rounding'; here are: rounding"):
        ledger.of_topic(ROWS, "Rounding")
    with pytest.raises(ValueError, match="no verdict 'Wrong'; here are: verified"):
        ledger.of_topic(ROWS, "rounding", "Wrong")


def test_of_kind_and_of_ids_run_the_checks_of_those_alone(monkeypatch):
    asked = []

    def examine(entries):
        asked.extend(entry.id for entry in entries)
        return tuple(Row(entry, FINDINGS[0]) for entry in entries)

    monkeypatch.setattr(page, "examine", examine)
    expected = [entry.id for entry in INVENTORY if entry.kind == "open"]
    assert sorted(row.statement.id for row in ledger.of_kind("open")) == sorted(expected) == sorted(asked)
    ids = ("hung1984.II.eq8", "hung1982.III.eq18")
    assert tuple(row.statement.id for row in ledger.of_ids(*ids)) == ids
    with pytest.raises(ValueError, match="no entry of kind 'opened'; here are: claim"):
        ledger.of_kind("opened")
    with pytest.raises(KeyError, match=r"no entry 'hung1984\.none'"):
        ledger.of_ids("hung1984.none")


def test_entries_of_a_kind_come_in_reading_order(monkeypatch):
    monkeypatch.setattr(page, "load_statements", lambda: INVENTORY[::-1])
    monkeypatch.setattr(page, "examine", lambda entries: tuple(Row(e, FINDINGS[0]) for e in entries))
    claims = ledger.of_kind("claim")
    assert claims == ledger.checking.in_reading_order(claims)
    assert [row.statement for row in claims] != [entry for entry in INVENTORY[::-1] if entry.kind == "claim"]


def test_a_check_that_raises_is_not_passed_over(monkeypatch):
    broken, other = ValueError("broken"), KeyError("other")
    errors = (broken, other, broken, None)

    def examine(entries):
        return tuple(Row(e, None if error else FINDINGS[0], error) for e, error in zip(entries, errors, strict=True))

    monkeypatch.setattr(page, "examine", examine)
    with pytest.raises(ExceptionGroup, match="checks of 3 entries failed") as caught:
        ledger.of_ids("hung1984.II.eq8", "hung1982.III.eq18", "hung1984.II.eq9", "hung1984.II.eq20")
    assert caught.value.exceptions == (broken, other)


@pytest.mark.parametrize("by", ["document", "chapter", "kind"])
def test_counts_add_up(by):
    found = ledger.count_table(ROWS, by)
    head, *body = [found.header, *found.body]
    numbers = [list(map(int, line[1:])) for line in body]
    assert all(sum(line[:-1]) == line[-1] for line in numbers)
    assert [sum(column) for column in zip(*numbers[:-1], strict=True)] == numbers[-1]
    assert numbers[-1][-1] == len(ROWS)
    assert head[0] == by.capitalize()
    for outcome, number in zip(head[1:-1], numbers[-1], strict=False):
        assert number == sum(row.outcome == outcome for row in ROWS)
    if by == "document":
        assert [line[0] for line in body] == [*DOCUMENTS, "all"]


def test_counts_by_something_else_are_refused():
    with pytest.raises(ValueError, match="by='verdict'; take one of document, chapter, kind"):
        ledger.count_table(ROWS, "verdict")


def test_titles_of_chapters_are_those_of_the_book():
    for topic, title in ledger.CHAPTERS.items():
        path = BOOK / f"{topic}.ipynb"
        if path.exists():
            cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
            assert "".join(cells[0]["source"]).startswith(f"# {title}\n"), path.name


def test_every_topic_has_a_chapter():
    assert set(ledger.topics().values()) <= set(ledger.CHAPTERS)


def test_powers_of_ten_in_prose_are_written_as_such():
    row = Row(Statement("hung1984.II.x", "hung1984", "II", "6", "eq (x)", "equation", "1.5e-08 and $1e-8$, 2e3x"), None)
    assert r"1.5&nbsp;×&nbsp;10<sup>−8</sup> and <span" in ledger.searchable([row]).html
    assert r"\(1e-8\)</span>, 2e3x" in ledger.searchable([row]).html
