"""Run the checks of the printed statements and collect their findings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.statements import Statement

TOPIC_OF = {key: topic for topic, checks in TOPICS.items() for key in checks}
"""The topic that checks each statement, by its id."""


@dataclass(frozen=True)
class Row:
    """A statement and the finding of its check."""

    statement: Statement
    finding: Finding

    @property
    def outcome(self) -> str:
        """The verdict's value."""
        return self.finding.verdict.value


def examine(
    statements: Iterable[Statement], progress: Callable[[Sequence[Statement]], Iterable[Statement]] = iter
) -> tuple[Row, ...]:
    """Run the checks of `statements`, which `progress` passes on one by one; an error names its statement."""
    rows: list[Row] = []
    for statement in progress(tuple(statements)):
        try:
            rows.append(Row(statement, TOPICS[TOPIC_OF[statement.id]].run(statement)))
        except Exception as error:
            error.add_note(f"in the check of {statement.id}")
            raise
    return tuple(rows)


def counts(rows: Iterable[Row]) -> dict[str, int]:
    """Count the outcomes that occur, in the order of `Verdict`."""
    outcomes = [row.outcome for row in rows]
    return {each.value: outcomes.count(each.value) for each in Verdict if each.value in outcomes}


def in_reading_order(rows: Iterable[Row]) -> tuple[Row, ...]:
    """Sort by document and chapter in order of appearance, then by section; rows of a section keep their order."""
    rows = tuple(rows)
    documents = list(dict.fromkeys(row.statement.document for row in rows))
    chapters = list(dict.fromkeys((row.statement.document, row.statement.chapter) for row in rows))

    def key(row: Row) -> tuple[int, int, tuple[int, ...]]:
        entry = row.statement
        numbers = entry.section.split(".")
        section = tuple(int(number) for number in numbers) if all(map(str.isdecimal, numbers)) else ()
        return documents.index(entry.document), chapters.index((entry.document, entry.chapter)), section

    return tuple(sorted(rows, key=key))
