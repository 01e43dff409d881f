"""Write the ledger out: CSV, JSON, plain text, and Markdown tables for notebooks."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable

from gpbnb.report.display.tables import Table, one_line
from gpbnb.report.ledger.checking import Row, counts, in_reading_order
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.statements import Statement

COLUMNS = ("id", "document", "kind", "printed", "recomputed", "agrees", "verdict", "note")
_AGREES = {True: "true", False: "false", None: ""}
OUTCOMES = {Verdict.OCR.value: "scan error"}
"""Outcomes that readers see under another name."""


def to_csv(rows: Iterable[Row]) -> str:
    """Write `rows` as RFC 4180 CSV with the columns `COLUMNS`; `agrees` is true, false or empty."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for record in map(_record, rows):
        writer.writerow([*record[:5], _AGREES[record[5]], *record[6:]])
    return out.getvalue()


def to_json(rows: Iterable[Row]) -> str:
    """Write `rows` as a JSON array of objects with the keys `COLUMNS`."""
    records = [dict(zip(COLUMNS, _record(row), strict=True)) for row in rows]
    return json.dumps(records, ensure_ascii=False, indent=1) + "\n"


def to_text(rows: Iterable[Row]) -> str:
    """Write `rows`, one per line: outcome, id, recomputed result, note."""
    lines = []
    for row in rows:
        cells = (row.statement.id, *filter(None, map(one_line, (row.finding.recomputed, row.finding.note))))
        lines.append(f"{outcome_name(row.outcome):<12}  {'  '.join(cells)}\n")
    return "".join(lines)


def to_markdown(rows: Iterable[Row]) -> str:
    """Write `rows` as the Markdown of `table`."""
    return table(rows).markdown() + "\n"


def _record(row: Row) -> tuple[str, str, str, str, str, bool | None, str, str]:
    entry, finding = row.statement, row.finding
    head = (entry.id, entry.document, entry.kind, entry.printed)
    return (*head, finding.recomputed, finding.agrees, finding.verdict.value, finding.note)


def table(rows: Iterable[Row]) -> Table:
    """Tabulate `rows` in reading order: item, verdict, printed, recomputed, note."""
    rows = in_reading_order(rows)
    body = tuple(
        (
            _place(row.statement),
            outcome_name(row.outcome),
            row.statement.printed,
            row.finding.recomputed,
            row.finding.note,
        )
        for row in rows
    )
    return Table(_title(rows), ("Item", "Verdict", "Printed", "Recomputed", "Note"), body)


def describe(counted: dict[str, int]) -> str:
    """Write `counted` in words, as in ``3 verified, 1 wrong``."""
    return ", ".join(f"{number} {OUTCOMES.get(outcome, outcome)}" for outcome, number in counted.items())


def outcome_name(outcome: str) -> str:
    """Write an outcome in words."""
    return OUTCOMES.get(outcome, outcome)


def _title(rows: tuple[Row, ...]) -> str:
    return f"Ledger of {len(rows)} statements: {describe(counts(rows)) or 'none'}"


def _place(entry: Statement) -> str:
    return f"{entry.document}, {section_name(entry.chapter, entry.section)}: {entry.item}"


def section_name(chapter: str, section: str) -> str:
    """Name a section with its chapter, as in ``II.9.1``; ``-`` if there is neither."""
    return ".".join(part for part in (chapter, section) if part != "-") or "-"


FORMATS = {"csv": to_csv, "markdown": to_markdown, "json": to_json, "text": to_text}
