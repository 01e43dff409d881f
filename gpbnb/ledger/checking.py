"""Bring the entries of the inventory and the checks of the topics together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import NamedTuple

from gpbnb.ledger.finding import Check, Checks, Finding, Verdict
from gpbnb.ledger.statements import Entry, load_inventory, select

TOPICS = (
    "gpbnb.ledger.checks.rounding",
    "gpbnb.ledger.checks.inversion",
    "gpbnb.ledger.checks.kalman",
    "gpbnb.ledger.checks.rolling",
    "gpbnb.ledger.checks.integration",
    "gpbnb.ledger.checks.budget",
    "gpbnb.ledger.checks.geometry",
)
"""The modules that hold checks, each as ``CHECKS``; imported when checks are run."""

MISSING = "missing"
FAILED = "failed"


@dataclass(frozen=True)
class Row:
    """An entry and what its check found: nothing where there is no check, or where the check raised `error`."""

    entry: Entry
    finding: Finding | None
    error: Exception | None = None

    @property
    def outcome(self) -> str:
        """The verdict's value; ``missing`` without a check, ``failed`` where the check raised."""
        if self.finding is not None:
            return self.finding.verdict.value
        return MISSING if self.error is None else FAILED


class Place(NamedTuple):
    """A section of a document."""

    document: str
    chapter: str
    section: str


def load_checks(entries: Iterable[Entry], topics: Sequence[str] | None = None) -> dict[str, Checks]:
    """Import the topics and find who checks what.

    Parameters
    ----------
    entries : the whole inventory.
    topics : names of modules; `TOPICS` by default.

    Returns
    -------
    checks : id of an entry → the registry that has its check.

    Raises
    ------
    ImportError : a topic cannot be imported or has no ``CHECKS``.
    ValueError : a check belongs to no entry, or two topics check the same one.
    """
    known = {entry.id for entry in entries}
    found: dict[str, Checks] = {}
    owner: dict[str, str] = {}
    for topic in TOPICS if topics is None else topics:
        try:
            checks = import_module(topic).CHECKS
        except Exception as error:
            raise ImportError(
                f"the checks of topic {topic!r} cannot be loaded ({type(error).__name__}: {error}); "
                f"`import {topic}` must work and define CHECKS"
            ) from error
        for key in checks:
            if key not in known:
                raise ValueError(f"{topic} checks {key!r}, which the inventory lacks; correct the id or add the entry")
            if key in owner:
                raise ValueError(f"{key!r} is checked by {owner[key]} and by {topic}; an entry has one check: drop one")
            owner[key] = topic
            found[key] = checks
    return found


def examine(
    entries: Iterable[Entry],
    checks: dict[str, Checks],
    progress: Callable[[Sequence[Entry]], Iterable[Entry]] = iter,
) -> tuple[Row, ...]:
    """Run the checks of `entries`; one that raises leaves its error in the row and the others undisturbed.

    Parameters
    ----------
    entries : which to check.
    checks : from `load_checks`.
    progress : passes the entries on, one by one, and may show how far they are.

    Returns
    -------
    rows : in the order of `entries`. A function that checks several of them is called once.
    """
    results: dict[Check, Finding | Exception] = {}
    rows: list[Row] = []
    for entry in progress(tuple(entries)):
        if entry.id not in checks:
            rows.append(Row(entry, None))
            continue
        registry = checks[entry.id]
        check = registry[entry.id]
        if check not in results:
            try:
                results[check] = registry.run(entry.id)
            except Exception as error:
                results[check] = error
        result = results[check]
        rows.append(Row(entry, result) if isinstance(result, Finding) else Row(entry, None, result))
    return tuple(rows)


def rows(
    entries: Iterable[Entry] | None = None,
    document: str | None = None,
    chapter: str | None = None,
    sections: str | Iterable[str | int] | None = None,
    topics: Sequence[str] | None = None,
) -> tuple[Row, ...]:
    """Check a part of the ledger.

    Parameters
    ----------
    entries : the whole inventory, that of the package by default.
    document, chapter, sections : the part, as in `select`; all by default. Only its checks are run.
    topics : names of modules that hold checks; `TOPICS` by default.

    Returns
    -------
    rows : one an entry, in the order of the inventory; its finding is None where there is no check.

    Raises
    ------
    ExceptionGroup : checks raised; each error carries a note with its id.
    ImportError, ValueError : see `load_checks`; ValueError also for an empty selection.
    """
    inventory = load_inventory() if entries is None else tuple(entries)
    chosen = select(inventory, document, chapter, sections)
    examined = examine(chosen, load_checks(inventory, topics))
    errors: list[Exception] = []
    for row in examined:
        if row.error is not None:
            row.error.add_note(f"in the check of {row.entry.id}")
            if row.error not in errors:
                errors.append(row.error)
    if errors:
        raise ExceptionGroup(f"checks of {sum(row.error is not None for row in examined)} entries failed", errors)
    return examined


def counts(rows: Iterable[Row]) -> dict[str, int]:
    """Count the outcomes that occur, in the order of `Verdict`, then ``failed`` and ``missing``."""
    outcomes = [row.outcome for row in rows]
    order = [*(verdict.value for verdict in Verdict), FAILED, MISSING]
    return {outcome: outcomes.count(outcome) for outcome in order if outcome in outcomes}


def summary(rows: Iterable[Row]) -> dict[Place, dict[str, int]]:
    """Count the outcomes section by section, in reading order."""
    sections: dict[Place, list[Row]] = {}
    for row in in_reading_order(rows):
        place = Place(row.entry.document, row.entry.chapter, row.entry.section)
        sections.setdefault(place, []).append(row)
    return {place: counts(inside) for place, inside in sections.items()}


def in_reading_order(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Sort by document and chapter as they come and by section number; rows of a section keep their order."""
    rows = tuple(rows)
    documents = list(dict.fromkeys(row.entry.document for row in rows))
    chapters = list(dict.fromkeys((row.entry.document, row.entry.chapter) for row in rows))

    def key(row: Row) -> tuple[int, int, tuple[int, ...]]:
        entry = row.entry
        numbers = entry.section.split(".")
        section = tuple(int(number) for number in numbers) if all(map(str.isdecimal, numbers)) else ()
        return documents.index(entry.document), chapters.index((entry.document, entry.chapter)), section

    return tuple(sorted(rows, key=key))
