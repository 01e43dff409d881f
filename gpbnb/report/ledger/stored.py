"""The findings on all statements, stored in ``findings.csv``.

``make findings`` runs every check and writes the table; a test runs the checks again and compares.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from gpbnb.report.ledger.checking import Row, examine
from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.statements import load_statements, rows_of, select

FILE = Path(__file__).with_name("findings.csv")
COLUMNS = ("id", "recomputed", "agrees", "verdict", "note", "root")
_AGREES = {"true": True, "false": False, "": None}


@cache
def load_findings() -> dict[str, Finding]:
    """Read ``findings.csv``: statement id → finding."""
    return {
        row["id"]: Finding(row["recomputed"], _AGREES[row["agrees"]], Verdict(row["verdict"]), row["note"], row["root"])
        for row in rows_of("findings.csv")
    }


def rows(
    document: str | None = None, chapter: str | None = None, sections: str | Iterable[str | int] | None = None
) -> tuple[Row, ...]:
    """Return the stored findings on a part of the ledger; no check runs.

    Parameters
    ----------
    document, chapter, sections : the part, as in `select`; all by default.

    Returns
    -------
    rows : one row for each statement, in the order of the inventory.
    """
    found = load_findings()
    return tuple(Row(each, found[each.id]) for each in select(load_statements(), document, chapter, sections))


def to_table(rows: Iterable[Row]) -> str:
    """Write rows as ``findings.csv`` stores them."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        found = row.finding
        agrees = next(text for text, value in _AGREES.items() if value is found.agrees)
        writer.writerow((row.statement.id, found.recomputed, agrees, found.verdict.value, found.note, found.root))
    return out.getvalue()


def write_findings() -> None:
    """Run every check and store the findings."""
    FILE.write_text(to_table(examine(load_statements())), encoding="utf-8", newline="")
