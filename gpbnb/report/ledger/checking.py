"""Run the checks of the printed statements and collect their findings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.judge import Checks
from gpbnb.report.ledger.statements import Statement

MISSING = "missing"
FAILED = "failed"


@dataclass(frozen=True)
class Row:
    """An entry and the finding of its check; no finding if there is no check or the check raised `error`."""

    statement: Statement
    finding: Finding | MaybeNone
    error: Exception | None = None

    @property
    def outcome(self) -> str:
        """The verdict's value, ``missing`` without a check, or ``failed`` if the check raised an error."""
        if self.finding is not None:
            return self.finding.verdict.value
        return MISSING if self.error is None else FAILED


def examine(
    statements: Iterable[Statement],
    topics: Mapping[str, Checks] = TOPICS,
    progress: Callable[[Sequence[Statement]], Iterable[Statement]] = iter,
) -> tuple[Row, ...]:
    """Run the checks of `statements`; if a check raises, its row records the error and the other checks still run.

    Parameters
    ----------
    statements : the statements to check.
    topics : the checks of each topic.
    progress : iterator that passes the statements on one by one, and may show progress.

    Returns
    -------
    rows : in the order of `statements`.
    """
    rows: list[Row] = []
    for statement in progress(tuple(statements)):
        checks = next((checks for checks in topics.values() if statement.id in checks), None)
        try:
            rows.append(Row(statement, checks.run(statement) if checks else None))
        except Exception as error:
            rows.append(Row(statement, None, error))
    return tuple(rows)


def counts(rows: Iterable[Row]) -> dict[str, int]:
    """Count the outcomes that occur, in the order of `Verdict`, then ``failed`` and ``missing``."""
    outcomes = [row.outcome for row in rows]
    order = [*(verdict.value for verdict in Verdict), FAILED, MISSING]
    return {outcome: outcomes.count(outcome) for outcome in order if outcome in outcomes}


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
