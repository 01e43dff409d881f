"""Run the checks of the printed statements and collect their findings."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.caching import PACKAGE
from gpbnb.report.ledger import cache
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.registry import Check, Checks, takes_statement
from gpbnb.report.ledger.statements import Statement, load_statements, select

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


def owners(statements: Iterable[Statement], topics: Mapping[str, Checks] = TOPICS) -> dict[str, str]:
    """Find the topic whose checks judge each statement.

    Parameters
    ----------
    statements : all statements.
    topics : the checks of each topic.

    Returns
    -------
    owners : statement id → name of the topic.

    Raises
    ------
    ValueError : a check belongs to no statement, or two topics check the same one.
    """
    known = {statement.id for statement in statements}
    found: dict[str, str] = {}
    for topic, checks in topics.items():
        for key in checks:
            if key not in known:
                raise ValueError(
                    f"got a check of {key!r} in {topic}; needed an id from statements.csv; correct the id "
                    "or add the statement"
                )
            if key in found:
                raise ValueError(
                    f"got checks of {key!r} in {found[key]} and in {topic}; needed one check per statement; remove one"
                )
            found[key] = topic
    return found


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
    rows : in the order of `statements`. A check that judges several statements at once runs only once.
    """
    results: dict[Check, Finding | Exception] = {}
    rows: list[Row] = []
    for statement in progress(tuple(statements)):
        checks = next((checks for checks in topics.values() if statement.id in checks), None)
        if checks is None:
            rows.append(Row(statement, None))
            continue
        check = checks[statement.id]
        result = results.get(check)
        if result is None:
            try:
                result = checks.run(statement)
            except Exception as error:
                result = error
            if not takes_statement(check):
                results[check] = result
        rows.append(Row(statement, result) if isinstance(result, Finding) else Row(statement, None, result))
    return tuple(rows)


def examine_once(
    statements: Iterable[Statement],
    topics: Mapping[str, Checks] = TOPICS,
    progress: Callable[[Sequence[Statement]], Iterable[Statement]] = iter,
) -> tuple[Row, ...]:
    """Run :func:`examine`, but reuse each finding until a source or datum on which it depends changes.

    Checks that are not part of the package run every time.
    """
    chosen = tuple(statements)
    by_module: dict[Path | None, list[Statement]] = {}
    for statement in chosen:
        by_module.setdefault(_module(statement, topics), []).append(statement)
    found: dict[Statement, Row] = {}
    for module, inside in by_module.items():
        if module is not None:
            found |= _known(inside, cache.known(module))
    # One count of all checks to run, although each module's checks run by themselves.
    shown = iter(progress([each for inside in by_module.values() for each in inside if each not in found]))

    def counted(some: Sequence[Statement]) -> Iterable[Statement]:
        for each in some:
            next(shown, None)
            yield each

    for module, inside in by_module.items():
        missing = [each for each in inside if each not in found]
        if module is None:
            found |= {row.statement: row for row in examine(missing, topics, counted)}
        elif missing:
            with cache.shared(module) as findings:
                found |= _known(missing, findings)  # another process may have run some checks in the meantime
                for row in examine([each for each in missing if each not in found], topics, counted):
                    found[row.statement] = row
                    if row.finding is not None:
                        findings.put(row.statement, row.finding)
    next(shown, None)  # so that it ends
    return tuple(found[statement] for statement in chosen)


def _known(statements: Iterable[Statement], findings: cache.Findings) -> dict[Statement, Row]:
    pairs = ((each, findings.get(each)) for each in statements)
    return {each: Row(each, finding) for each, finding in pairs if finding is not None}


def _module(statement: Statement, topics: Mapping[str, Checks]) -> Path | None:
    """Return the file of the package that contains the check of a statement, if there is one."""
    check = next((checks[statement.id] for checks in topics.values() if statement.id in checks), None)
    if check is None:
        return None
    path = Path(inspect.getfile(inspect.unwrap(check))).resolve()
    return path if path.is_relative_to(PACKAGE) else None


def rows(
    entries: Iterable[Statement] | None = None,
    document: str | None = None,
    chapter: str | None = None,
    sections: str | Iterable[str | int] | None = None,
    topics: Mapping[str, Checks] = TOPICS,
) -> tuple[Row, ...]:
    """Check a part of the ledger.

    Parameters
    ----------
    entries : the whole inventory, by default that of the package.
    document, chapter, sections : the part, as in `select`; all by default. Only the checks of this part run.
    topics : the checks of each topic.

    Returns
    -------
    rows : one row for each entry, in the order of the inventory; the finding is None if there is no check.

    Raises
    ------
    ExceptionGroup : checks raised errors; each error has a note with the id of the statement.
    ValueError : see `owners`; also if the selection is empty.
    """
    inventory = load_statements() if entries is None else tuple(entries)
    chosen = select(inventory, document, chapter, sections)
    owners(inventory, topics)
    examined = examine_once(chosen, topics)
    errors: list[Exception] = []
    for row in examined:
        if row.error is not None:
            row.error.add_note(f"in the check of {row.statement.id}")
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
