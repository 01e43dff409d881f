"""The ledger as HTML for the book: plain tables, which the page's script makes searchable, and links to their rows."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby

from gpbnb.display.tables import POWER, Table, one_line
from gpbnb.ledger.checking import Row, counts, examine_once, in_reading_order
from gpbnb.ledger.checks import TOPICS
from gpbnb.ledger.finding import DISAGREEMENTS, Verdict
from gpbnb.ledger.render import OUTCOMES, describe, section_name
from gpbnb.ledger.statements import Statement, load_statements

CHAPTERS = {
    "rounding": "Rounding bounds",
    "inversion": "Matrix inversion",
    "kalman": "Kalman bound",
    "rolling": "Roll and deroll",
    "integration": "Digital integration error",
    "budget": "Error budget",
    "geometry": "Measurement geometry",
}
"""Titles of the chapters, by the topic whose checks they show; the page of a topic has its name."""

LEDGER_PAGE = "errata.html"
EMPHASIS = re.compile(r"(?<![\w*])\*(\w(?:[^*]*\w)?)\*(?![\w*])")
"""What stands between stars in a note."""
_PAGE_OF = {title: topic for topic, title in CHAPTERS.items()}


@dataclass(frozen=True)
class Html:
    """HTML that notebooks show; its short form is plain text.

    Parameters
    ----------
    title : the short form.
    html : the content.
    """

    title: str
    html: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return f"<{self.title}>"


def topics() -> dict[str, str]:
    """Name the topic that checks each entry, as in ``{"hung1984.II.eq20": "rounding"}``."""
    return {key: topic for topic, checks in TOPICS.items() for key in checks}


def of_topic(rows: Iterable[Row], topic: str, *verdicts: str) -> tuple[Row, ...]:
    """Pick the rows that a topic checks, and of these the ones with some verdicts.

    Parameters
    ----------
    rows : where from.
    topic : its name, as in ``rounding``.
    verdicts : values of `Verdict`; all by default.

    Raises
    ------
    ValueError : no such topic, or no such verdict.
    """
    owner = topics()
    if topic not in owner.values():
        raise ValueError(f"no topic {topic!r}; here are: {', '.join(dict.fromkeys(owner.values()))}")
    for verdict in verdicts:
        if verdict not in [known.value for known in Verdict]:
            raise ValueError(f"no verdict {verdict!r}; here are: {', '.join(known.value for known in Verdict)}")
    return tuple(
        row for row in rows if owner.get(row.statement.id) == topic and (not verdicts or row.outcome in verdicts)
    )


def of_kind(kind: str) -> tuple[Row, ...]:
    """Run the checks of all entries of one kind, such as ``open``.

    Raises
    ------
    ExceptionGroup : checks raised.
    ValueError : there is no entry of that kind.
    """
    inventory = load_statements()
    chosen = [entry for entry in inventory if entry.kind == kind]
    if not chosen:
        raise ValueError(f"no entry of kind {kind!r}; here are: {', '.join({e.kind: 0 for e in inventory})}")
    return in_reading_order(_checked(chosen))


def of_ids(*ids: str) -> tuple[Row, ...]:
    """Run the checks of the entries with these ids, in this order.

    Raises
    ------
    ExceptionGroup : checks raised.
    KeyError : the inventory has no such id.
    """
    inventory = load_statements()
    by_id = {entry.id: entry for entry in inventory}
    for key in ids:
        if key not in by_id:
            raise KeyError(f"no entry {key!r} in the inventory; correct the id")
    return _checked([by_id[key] for key in ids])


def _checked(chosen: Sequence[Statement]) -> tuple[Row, ...]:
    found = examine_once(chosen)
    errors = list(dict.fromkeys(row.error for row in found if row.error))
    if errors:
        raise ExceptionGroup(f"checks of {sum(row.error is not None for row in found)} entries failed", errors)
    return found


def count_table(rows: Iterable[Row], by: str) -> Table:
    """Tabulate the counts of `rows`: a line a document, chapter or kind, a column an outcome, and the sums.

    Parameters
    ----------
    rows : what to count.
    by : ``document``, ``chapter`` (of this book) or ``kind``.

    Raises
    ------
    ValueError : `by` is something else.
    """
    rows = in_reading_order(rows)
    owner = topics()
    groups: dict[str, Callable[[Row], str]] = {
        "document": lambda row: row.statement.document,
        "chapter": lambda row: _title(owner.get(row.statement.id, "-")),
        "kind": lambda row: row.statement.kind,
    }
    if by not in groups:
        raise ValueError(f"by={by!r}; take one of {', '.join(groups)}")
    total = counts(rows)
    inside: dict[str, list[Row]] = {}
    for row in rows:
        inside.setdefault(groups[by](row), []).append(row)
    body = [
        (name, *(str(counts(some).get(outcome, 0)) for outcome in total), str(len(some)))
        for name, some in inside.items()
    ]
    body.append(("all", *map(str, total.values()), str(len(rows))))
    header = (by.capitalize(), *map(_label, total), "entries")
    return Table(f"Counts of {len(rows)} entries by {by}", header, tuple(body))


def told(rows: Iterable[Row], *ids: str) -> tuple[Row, ...]:
    """Pick errors by their ids, in the order given; a text about errors breaks when one is none any more.

    Raises
    ------
    KeyError : an id is not among `rows`.
    ValueError : print and recomputation of one of them do not differ.
    """
    by_id = {row.statement.id: row for row in rows}
    picked = []
    for key in ids:
        if key not in by_id:
            raise KeyError(f"no row {key!r} among the {len(by_id)} given; correct the id")
        row = by_id[key]
        if row.finding is None or row.finding.verdict not in DISAGREEMENTS:
            raise ValueError(f"{key} is {row.outcome}, no error; change the text that names it as one")
        picked.append(row)
    return tuple(picked)


def searchable(rows: Iterable[Row]) -> Html:
    """Lay out the ledger: a table a chapter of a document, each row under its entry's id.

    The form above the tables is hidden until the page's script, ``ledger.js``, shows and serves it.
    """
    rows = in_reading_order(rows)
    owner = topics()
    tables = [
        _part(document, chapter, tuple(inside), owner)
        for (document, chapter), inside in groupby(rows, lambda row: (row.statement.document, row.statement.chapter))
    ]
    html = f'<div class="ledger">\n{_form(rows, owner)}\n{"".join(tables)}</div>'
    return Html(f"Searchable ledger of {len(rows)} entries: {describe(counts(rows)) or 'none'}", html)


def links(rows: Iterable[Row]) -> Html:
    """List `rows` as links to their places in the complete ledger."""
    rows = in_reading_order(rows)
    parts = []
    for (document, chapter), inside in groupby(rows, lambda row: (row.statement.document, row.statement.chapter)):
        every = ", ".join(f'<a href="{_address(row.statement)}">{_text(row.statement.item)}</a>' for row in inside)
        parts.append(f"<li>{escape(_document(document, chapter))}: {every}</li>")
    return Html(
        f"Links to {len(rows)} entries: {describe(counts(rows)) or 'none'}",
        f'<ul class="ledger-links">\n{chr(10).join(parts)}\n</ul>',
    )


def brief(rows: Iterable[Row], left_undone: bool = False) -> Html:
    """Tabulate some rows, in their order, with links to their places in the complete ledger.

    Parameters
    ----------
    rows : which.
    left_undone : whether to call the columns as for what the documents leave undone.
    """
    rows = tuple(rows)
    owner = topics()
    lines = []
    for row in rows:
        entry = row.statement
        place = section_name(entry.chapter, entry.section)
        item = f'<a href="{_address(entry)}">{_text(entry.item)}</a><br>{entry.document}, {escape(place)}'
        lines.append(_line("<tr>", item, row, owner))
    content = _table("ledger-table ledger-undone" if left_undone else "ledger-table", "", lines, left_undone)
    return Html(f"{len(rows)} entries: {describe(counts(rows)) or 'none'}", f'<div class="ledger">\n{content}</div>')


def _part(document: str, chapter: str, rows: Sequence[Row], owner: dict[str, str]) -> str:
    lines = []
    for row in rows:
        entry = row.statement
        start = (
            f'<tr id="{escape(entry.id)}" data-kind="{entry.kind}" data-verdict="{escape(_outcome(row))}" '
            f'data-chapter="{owner.get(entry.id, "")}">'
        )
        section = section_name(entry.chapter, entry.section)
        item = f'<a href="#{escape(entry.id)}">{_text(entry.item)}</a><br>{escape(section)}, {entry.kind}'
        lines.append(_line(start, item, row, owner))
    number = f"{len(rows)} {'entry' if len(rows) == 1 else 'entries'}"
    caption = f"<caption>{escape(_document(document, chapter))}: {number}</caption>\n"
    return _table(f'ledger-table" data-document="{document}" data-part="{escape(chapter)}', caption, lines)


def _table(classes: str, caption: str, lines: Sequence[str], left_undone: bool = False) -> str:
    content = "Left undone, and our answer" if left_undone else "Printed, recomputed, and note"
    head = "".join(f'<th scope="col">{name}</th>' for name in ("Item", "Verdict", content))
    return (
        f'<table class="{classes}">\n{caption}<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{chr(10).join(lines)}\n</tbody>\n</table>\n"
    )


def _line(start: str, item: str, row: Row, owner: dict[str, str]) -> str:
    """Write a row; what was printed, what was recomputed, and the note, with the chapter, share a wide cell."""
    found, note = (_text(row.finding.recomputed), _text(row.finding.note)) if row.finding else ("", "")
    topic = owner.get(row.statement.id, "")
    link = _chapter_link(CHAPTERS[topic]) if topic in CHAPTERS else ""
    if link not in note:
        note = f"{note} [{link}]" if note else f"[{link}]"
    named = (("printed", _text(row.statement.printed)), ("recomputed", found), ("note", note))
    content = "".join(f'<p class="{name}">{text}</p>' for name, text in named if text)
    return f'{start}<th scope="row">{item}</th><td>{escape(_outcome(row))}</td><td>{content}</td></tr>'


def _form(rows: Sequence[Row], owner: dict[str, str]) -> str:
    def options(values: Sequence[str], name: Callable[[str], str] = str) -> str:
        there = {value: values.count(value) for value in values if value}
        every = "".join(f'<option value="{escape(v)}">{escape(name(v))} ({n})</option>' for v, n in there.items())
        return f'<option value="">all</option>{every}'

    parts = [f"{row.statement.document} {row.statement.chapter}" for row in rows]
    documents = options([row.statement.document for row in rows])
    chapters = options(parts, lambda part: _document(*part.split(" ", 1)))
    selects = {
        "document": ("Document", documents + chapters.removeprefix('<option value="">all</option>')),
        "verdict": ("Verdict", options([o for o in map(_label, counts(rows)) for row in rows if _outcome(row) == o])),
        "kind": ("Kind", options(sorted(row.statement.kind for row in rows))),
        "chapter": ("Chapter of this book", options([owner.get(row.statement.id, "") for row in rows], _title)),
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


def _document(document: str, chapter: str) -> str:
    return document if chapter == "-" else f"{document}, ch. {chapter}"


def _address(entry: Statement) -> str:
    return f"{LEDGER_PAGE}#{escape(entry.id)}"


def _title(topic: str) -> str:
    return CHAPTERS.get(topic, topic)


def _label(outcome: str) -> str:
    return OUTCOMES.get(outcome, outcome)


def _outcome(row: Row) -> str:
    return _label(row.outcome)


def _chapter_link(title: str) -> str:
    return f'<a href="{_PAGE_OF[title]}.html">{title}</a>'


def _text(text: str) -> str:
    r"""Turn prose with math between dollar signs into HTML; a chapter's title between stars becomes a link."""
    parts = one_line(text).split("$")
    prose = [POWER.sub(_power, escape(part, quote=False)) for part in parts[::2]]
    parts[::2] = [EMPHASIS.sub(_emphasis, part) for part in prose]
    parts[1::2] = [
        rf'<span class="math notranslate nohighlight">\({escape(math, quote=False)}\)</span>' for math in parts[1::2]
    ]
    return "".join(parts)


def _power(match: re.Match[str]) -> str:
    exponent = str(int(match[2])).replace("-", "−")
    return f"{match[1]}&nbsp;×&nbsp;10<sup>{exponent}</sup>"


def _emphasis(match: re.Match[str]) -> str:
    return _chapter_link(match[1]) if match[1] in _PAGE_OF else f"<em>{match[1]}</em>"
