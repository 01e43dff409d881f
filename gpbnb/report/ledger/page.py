"""The evidence pages of the book: the ledger page by page, short tables of errors, root errors, and counts."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

from gpbnb.report.display.tables import MOST_ROWS, Table
from gpbnb.report.ledger.checking import TOPIC_OF, Row, counts, in_reading_order
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.corrections import load_corrections
from gpbnb.report.ledger.finding import DISAGREEMENTS, Finding, Verdict
from gpbnb.report.ledger.html import CHAPTERS, Html, badge, chapter_link, typeset
from gpbnb.report.ledger.legibility import load_legibility
from gpbnb.report.ledger.render import describe, outcome_name, section_name
from gpbnb.report.ledger.roots import by_root, load_roots
from gpbnb.report.ledger.statements import Statement, rows_of


@dataclass(frozen=True)
class LedgerPage:
    """A page of the book with a part of the ledger.

    Parameters
    ----------
    name : file name of the page, without its ending.
    title : title of the page.
    document : short name of the document.
    sections : regular expression of the chapter and section, as in ``II.11.2``, of the statements on the page.
    """

    name: str
    title: str
    document: str
    sections: str

    def holds(self, statement: Statement) -> bool:
        """Whether a statement is on this page."""
        place = section_name(statement.chapter, statement.section)
        return statement.document == self.document and re.fullmatch(self.sections, place) is not None


PAGES = tuple(LedgerPage(**each) for each in rows_of("pages.csv"))
"""The pages of the complete ledger; each statement is on exactly one of them."""


class Claim(NamedTuple):
    """A principal claim in words, and what follows from its verdict for someone who relies on it."""

    id: str
    text: str
    consequence: str


CLAIMS = {each["id"]: Claim(**each) for each in rows_of("claims.csv")}
"""The principal claims of the documents, by statement id."""

_REPLICATION = {
    Verdict.VERIFIED: "replicated",
    Verdict.MISPRINT: "replicated after correcting a misprint",
    Verdict.OCR: "replicated after correcting the scan",
    Verdict.INCONSISTENT: "corrected",
    Verdict.WRONG: "refuted",
    Verdict.NOT_REPRODUCED: "not reproducible",
    Verdict.UNVERIFIABLE: "not reproducible",
}


_SHOWN = {Verdict.VERIFIED.value: 1, Verdict.GIVEN.value: 1, Verdict.MISPRINT.value: 2}
"""How many texts of its evidence a verdict shows; others are collapsed, as most readers look for other verdicts."""


def address(statement: Statement) -> str:
    """Return the link to a statement in the complete ledger."""
    page = next(page for page in PAGES if page.holds(statement))
    return f"{page.name}.html#{escape(statement.id)}"


def select_topic(rows: Iterable[Row], topic: str, *verdicts: Verdict) -> tuple[Row, ...]:
    """Pick the rows that a topic checks, with some verdicts; with all verdicts by default.

    Raises
    ------
    ValueError : no such topic.
    """
    if topic not in TOPICS:
        raise ValueError(f"got topic {topic!r}; needed one of {', '.join(TOPICS)}")
    return tuple(
        row for row in rows if row.statement.id in TOPICS[topic] and (not verdicts or row.finding.verdict in verdicts)
    )


def count_table(rows: Iterable[Row], by: str) -> Table:
    """Count `rows` in a table with a row per document, chapter of this book or kind, and a column per verdict.

    Parameters
    ----------
    rows : the rows to count.
    by : ``document``, ``chapter`` (of this book) or ``kind``.

    Raises
    ------
    ValueError : `by` has another value.
    """
    rows = in_reading_order(rows)
    groups: dict[str, Callable[[Row], str]] = {
        "document": lambda row: row.statement.document,
        "chapter": lambda row: CHAPTERS[TOPIC_OF[row.statement.id]],
        "kind": lambda row: row.statement.kind,
    }
    if by not in groups:
        raise ValueError(f"got by={by!r}; needed one of {', '.join(groups)}")
    total = counts(rows)
    inside: dict[str, list[Row]] = {}
    for row in rows:
        inside.setdefault(groups[by](row), []).append(row)
    body = [
        (name, *(str(counts(some).get(outcome, 0)) for outcome in total), str(len(some)))
        for name, some in inside.items()
    ]
    body.append(("all", *map(str, total.values()), str(len(rows))))
    header = (by.capitalize(), *map(outcome_name, total), "statements")
    return Table(f"Counts of {len(rows)} statements by {by}", header, tuple(body))


def ledger_page(rows: Iterable[Row], page: LedgerPage) -> Html:
    """Lay out one page of the complete ledger: a form with filters, and a row per statement.

    The form is hidden until the page's script, ``ledger.js``, shows it and responds to it.
    """
    rows = in_reading_order(row for row in rows if page.holds(row.statement))
    lines = [_entry(row) for row in rows]
    caption = f"<caption>{escape(page.document)}: {len(rows)} statements</caption>\n"
    table = _table(("Statement", "Verdict", "Evidence"), lines, caption)
    html = f'<div class="ledger">\n{_form(rows)}\n{table}</div>'
    return Html(f"Ledger of {len(rows)} statements: {describe(counts(rows)) or 'none'}", html)


def error_table(rows: Iterable[Row]) -> Html:
    """Tabulate the errors behind the statements that disagree, the most serious first, with the statements affected.

    Statements with the same root error share a row, in which their notes are collapsed; so do those with the same note.
    """
    found = [row for row in in_reading_order(rows) if row.finding.verdict in DISAGREEMENTS]
    groups: dict[str, list[Row]] = {}
    for row in found:
        groups.setdefault(row.finding.root or row.finding.note or row.statement.id, []).append(row)
    ordered = sorted(groups.values(), key=lambda group: (_seriousness(group[0]), -len(group)))
    header = ("Error", "Verdict", "Statements affected")
    table = _wrapped(header, [_error(group) for group in ordered], "ledger-errors")
    return _folded(f"{len(found)} statements that disagree", table, len(ordered))


def note_table(rows: Iterable[Row], left_undone: bool = False) -> Html:
    """Tabulate some rows in reading order: place, verdict, note, and the printed text collapsed.

    Parameters
    ----------
    rows : the rows to show.
    left_undone : show every text, labelled as work that the documents leave undone, and every note, labelled as the
        answer of this book.
    """
    rows = in_reading_order(rows)
    lines = [
        f'<tr><th scope="row">{_link(row)}{_chapter(row)}</th><td>{badge(outcome_name(row.outcome))}</td>'
        f"{_evidence(row, note_first=not left_undone)}</tr>"
        for row in rows
    ]
    classes = "ledger-undone" if left_undone else ""
    return _folded(f"{len(rows)} statements", _wrapped(("Statement", "Verdict", "Evidence"), lines, classes), len(rows))


def root_table(rows: Iterable[Row]) -> Html:
    """Tabulate the root errors, by the number of statements affected: the mistake, the reason, the statements."""
    roots = load_roots()
    found = sorted(by_root(rows).items(), key=lambda item: -len(item[1]))
    lines = []
    for key, spoiled in found:
        places = ", ".join(map(_link, in_reading_order(spoiled)))
        lines.append(
            f'<tr id="root-{escape(key)}"><th scope="row">{typeset(roots[key].title)}</th><td>{len(spoiled)}</td>'
            f'<td><p>{typeset(roots[key].explanation)}</p><p class="spoils">{places}</p></td></tr>'
        )
    return Html(
        f"{len(found)} root errors",
        _wrapped(("Root error", "Statements", "Explanation and affected statements"), lines, "ledger-roots"),
    )


def claim_outcomes(rows: Iterable[Row]) -> dict[str, str]:
    """Return the outcome of each principal claim, such as "refuted", by statement id."""
    by_id = {row.statement.id: row for row in rows}
    found = {key: by_id[key] for key in CLAIMS}
    return {key: _REPLICATION[row.finding.verdict] for key, row in found.items()}


def claim_table(rows: Iterable[Row]) -> Html:
    """Tabulate the principal claims of the documents in words, their outcomes, and what follows from these."""
    by_id = {row.statement.id: row for row in rows}
    lines = []
    for key, outcome in claim_outcomes(by_id.values()).items():
        row, claim = by_id[key], CLAIMS[key]
        printed = f"<details><summary>As printed</summary><p>{typeset(row.statement.printed)}</p></details>"
        lines.append(
            f'<tr><th scope="row">{escape(claim.text)}<br>{_link(row)}</th><td>{badge(outcome)}</td>'
            f"<td><p>{escape(claim.consequence)} {chapter_link(TOPIC_OF[key])}</p>{printed}</td></tr>"
        )
    return Html(f"{len(lines)} claims", _wrapped(("Claim", "Outcome", "What follows"), lines, "ledger-claims"))


def _link(row: Row) -> str:
    statement = row.statement
    place = section_name(statement.chapter, statement.section)
    link = f'<a href="{address(statement)}">{typeset(statement.item)}</a>'
    return f"{link} <small>{statement.document}, {escape(place)}</small>"


def _seriousness(row: Row) -> int:
    return DISAGREEMENTS.index(row.finding.verdict)


def _error(group: Sequence[Row]) -> str:
    """One error: what is wrong, what is right, the verdicts, and links to the statements of each document."""
    notes = [typeset(row.finding.note or row.finding.recomputed) for row in group]
    finding = group[0].finding
    text = _root_link(finding) if finding.root else notes[0]
    if finding.root:
        listed = "".join(
            f"<li>{_link(row)}: {note}{_paragraphs(_correction(row))}</li>"
            for row, note in zip(group, notes, strict=True)
        )
        text += f"<details><summary>In detail</summary><ul>{listed}</ul></details>"
    else:
        text += _paragraphs(dict.fromkeys(paragraph for row in group for paragraph in _correction(row)))
    places: dict[str, list[str]] = {}
    for row in group:
        link = f'<a href="{address(row.statement)}">{typeset(row.statement.item)}</a>'
        places.setdefault(row.statement.document, []).append(link)
    affected = "".join(f"<p>{document[-4:]}: {', '.join(links)}</p>" for document, links in places.items())
    badges = " ".join(
        badge(outcome_name(outcome))
        for outcome in dict.fromkeys(row.outcome for row in sorted(group, key=_seriousness))
    )
    return f'<tr><th scope="row">{text}</th><td>{badges}</td><td>{affected}</td></tr>'


def _entry(row: Row) -> str:
    statement = row.statement
    section = section_name(statement.chapter, statement.section)
    outcome = escape(outcome_name(row.outcome))
    return (
        f'<tr id="{escape(statement.id)}" data-kind="{statement.kind}" data-verdict="{outcome}" '
        f'data-chapter="{TOPIC_OF[statement.id]}"><th scope="row"><a href="#{escape(statement.id)}">'
        f"{typeset(statement.item)}</a><br>{escape(section)}, {statement.kind}{_chapter(row)}</th>"
        f"<td>{badge(outcome_name(row.outcome))}</td>"
        f"{_evidence(row)}</tr>"
    )


def _chapter(row: Row) -> str:
    return f"<br>{chapter_link(TOPIC_OF[row.statement.id])}"


def _evidence(row: Row, note_first: bool = False) -> str:
    found, note, root = typeset(row.finding.recomputed), typeset(row.finding.note), _root(row.finding)
    scan = _scan(row.statement)
    named = [
        ("printed", typeset(row.statement.printed)),
        *scan,
        *_correction(row),
        ("recomputed", found),
        ("note", note),
    ]
    shown = _SHOWN.get(row.outcome, len(named))
    if scan and row.finding.verdict in DISAGREEMENTS:
        shown += 1
    if note_first and note:
        named.insert(0, named.pop())
        shown = 1
    hidden = _paragraphs(named[shown:])
    evidence = f"<details><summary>Evidence</summary>{hidden}</details>" if hidden else ""
    return f"<td>{_paragraphs(named[:shown])}{root}{evidence}</td>"


def _scan(statement: Statement) -> list[tuple[str, str]]:
    """The characters of the scan where it is damaged, as the class and text of a paragraph."""
    damage = load_legibility().get(statement.id)
    return [("scan", f"<code>{escape(damage.scan).replace('$', '&#36;')}</code>")] if damage else []


def _correction(row: Row) -> list[tuple[str, str]]:
    """What a row that disagrees should say, or why no text can correct it, as the class and text of a paragraph."""
    correction = load_corrections().get(row.statement.id)
    if correction is None or row.finding.verdict not in DISAGREEMENTS:
        return []
    corrected = correction.applied(row.statement)
    return [("corrected", typeset(corrected.printed)) if corrected else ("uncorrected", typeset(correction.reason))]


def _paragraphs(named: Iterable[tuple[str, str]]) -> str:
    return "".join(f'<p class="{name}">{text}</p>' for name, text in named if text)


def _root(finding: Finding) -> str:
    return f'<p class="root">{_root_link(finding)}</p>' if finding.root else ""


def _root_link(finding: Finding) -> str:
    return f'<a href="errata.html#root-{escape(finding.root)}">{typeset(load_roots()[finding.root].title)}</a>'


def _folded(title: str, table: str, count: int) -> Html:
    """Fold a table of many rows below its title, as tables of notebooks are."""
    if count > MOST_ROWS:
        table = f'<details class="long-table"><summary>{escape(title)}</summary>\n{table}\n</details>'
    return Html(title, table)


def _wrapped(header: Sequence[str], lines: Sequence[str], classes: str = "") -> str:
    return f'<div class="ledger">\n{_table(header, lines, classes=classes)}</div>'


def _table(header: Sequence[str], lines: Sequence[str], caption: str = "", classes: str = "") -> str:
    head = "".join(f'<th scope="col">{name}</th>' for name in header)
    return (
        f'<table class="{f"ledger-table {classes}".strip()}">\n{caption}<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{chr(10).join(lines)}\n</tbody>\n</table>\n"
    )


def _form(rows: Sequence[Row]) -> str:
    def options(values: Iterable[str], name: Callable[[str], str] = str) -> str:
        values = [value for value in values if value]
        every = "".join(
            f'<option value="{escape(v)}">{escape(name(v))} ({values.count(v)})</option>' for v in dict.fromkeys(values)
        )
        return f'<option value="">all</option>{every}'

    in_order = [outcome_name(outcome) for outcome in counts(rows) for row in rows if row.outcome == outcome]
    selects = {
        "verdict": ("Verdict", options(in_order)),
        "kind": ("Kind", options(sorted(row.statement.kind for row in rows))),
        "chapter": (
            "Chapter of this book",
            options((TOPIC_OF[r.statement.id] for r in rows), lambda t: CHAPTERS[t]),
        ),
    }
    labels = "".join(
        f'<label>{label} <select name="{name}" autocomplete="off">{choice}</select></label>\n'
        for name, (label, choice) in selects.items()
    )
    return (
        '<form class="ledger-form" role="search" aria-label="The ledger" hidden>\n'
        '<label>Search <input type="search" name="words" autocomplete="off" spellcheck="false"></label>\n'
        f'{labels}<button type="button">Show all</button>\n'
        '<output role="status" aria-live="polite"></output>\n</form>'
    )
