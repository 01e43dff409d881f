"""Statements that nothing can be computed about, read from ``unjudged.csv``: definitions, given data, missing pages."""

from __future__ import annotations

import csv
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.html import chapter


@cache
def load_unjudged() -> dict[str, dict[str, Finding]]:
    """Read the file of the package: topic → statement id → finding."""
    return read_unjudged(files(__package__) / "unjudged.csv")


def read_unjudged(source: Traversable) -> dict[str, dict[str, Finding]]:
    """Read and validate a file of findings on statements that no check judges.

    Parameters
    ----------
    source : a CSV file with the columns id, topic, verdict, recomputed, note. The verdict is ``given`` or
        ``unverifiable``; `recomputed` is what can still be said. ``<chapter>`` in a note names the topic's chapter.

    Raises
    ------
    KeyError : a topic has no chapter.
    ValueError : a row has another verdict or no note, or an id occurs twice; the message names the id.
    """
    found: dict[str, dict[str, Finding]] = {}
    seen: set[str] = set()
    for row in csv.DictReader(source.read_text(encoding="utf-8").splitlines(), strict=True):
        key = row["id"]
        if key in seen or row["verdict"] not in ("given", "unverifiable"):
            raise ValueError(
                f"got {key!r} with verdict {row['verdict']!r} in {source.name}; needed each id once, with the verdict "
                "given or unverifiable"
            )
        seen.add(key)
        try:
            note = row["note"].replace("<chapter>", chapter(row["topic"]))
            finding = Finding(row["recomputed"], None, Verdict(row["verdict"]), note)
        except ValueError as error:
            raise ValueError(f"{source.name}, {key}: {error}") from error
        found.setdefault(row["topic"], {})[key] = finding
    return found


def always(finding: Finding) -> Callable[[], Finding]:
    """Return the check of a statement that nothing can be computed about."""

    def stated() -> Finding:
        return finding

    return stated
