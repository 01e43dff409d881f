"""What is asked of the checks of every topic, and faults to seed beneath them: each check must be able to differ.

A change takes pytest's monkeypatch, which undoes it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace as changed
from types import ModuleType
from typing import Any

import pytest
import sympy as sp

from gpbnb.report import ledger
from gpbnb.report.display.derivation import Derivation
from gpbnb.report.ledger.checking import Row
from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.stored import load_findings

Change = Callable[[pytest.MonkeyPatch], None]

INVENTORY = ledger.load_statements()

# -- what the checks found ------------------------------------------------------------------------


def examined(entries: Iterable[ledger.Statement]) -> tuple[Row, ...]:
    """The stored findings on some entries, which `test_findings` compares with those of the checks."""
    stored = load_findings()
    return tuple(Row(each, stored[each.id]) for each in entries)


def finding(rows: Iterable[Row], key: str) -> Finding:
    """That of an entry."""
    return next(row.finding for row in rows if row.statement.id == key)


def check_texts(rows: Iterable[Row]) -> None:
    """Disagreements have a note, and comparisons a number.

    No note says seven words twice, or those of the result: a text that is joined from other parts than was meant, or in
    another order, repeats some of them or ends in a space.
    """
    rows = tuple(rows)
    for row in rows:
        for text in (row.finding.note, row.finding.recomputed):
            assert text == " ".join(text.split()), row.statement.id
        words = row.finding.note.split()
        runs = [" ".join(words[i : i + 7]) for i in range(len(words) - 6)]
        assert len(set(runs)) == len(runs), row.statement.id
        assert not any(run in row.finding.recomputed for run in runs), row.statement.id
        assert row.finding.note or row.finding.verdict is Verdict.VERIFIED, row.statement.id
        assert row.finding.recomputed or row.finding.agrees is None, row.statement.id


# -- changes --------------------------------------------------------------------------------------


def forget(*modules: ModuleType) -> None:
    """Forget what the functions of some modules remember."""
    for module in modules:
        for value in vars(module).values():
            getattr(value, "cache_clear", lambda: None)()


@contextmanager
def forgetting(monkeypatch: pytest.MonkeyPatch, *modules: ModuleType) -> Iterator[pytest.MonkeyPatch]:
    """Change the code with nothing remembered; undone, and forgotten, afterwards."""
    forget(*modules)
    try:
        yield monkeypatch
    finally:
        monkeypatch.undo()
        forget(*modules)


def replace(place: Any, name: str, value: Any) -> Change:
    """Put another value in the place of an attribute."""
    return lambda patch: patch.setattr(place, name, value)


def all_of(*changes: Change) -> Change:
    """One change after the other."""

    def apply(patch: pytest.MonkeyPatch) -> None:
        for change in changes:
            change(patch)

    return apply


def always(value: Any) -> Callable[..., Any]:
    """A function that returns a value, whatever it is called with."""
    return lambda *_, **__: value


def times(place: Any, name: str, factor: Any) -> Change:
    """Multiply what a function returns."""
    original = getattr(place, name)
    return replace(place, name, lambda *arguments, **named: original(*arguments, **named) * factor)


def plus(place: Any, name: str, amount: Any) -> Change:
    """Add to what a function returns."""
    original = getattr(place, name)
    return replace(place, name, lambda *arguments, **named: original(*arguments, **named) + amount)


def breaks(module: ModuleType, name: str, place: int | None = None) -> Change:
    """Make a step of a derivation wrong, or every step."""
    original = getattr(module, name)

    def broken() -> Derivation:
        steps = list(original().steps)
        for i in range(len(steps)) if place is None else (place,):
            steps[i] = changed(steps[i], right=steps[i].right + sp.Symbol("wrong", positive=True))
        return Derivation(tuple(steps))

    return replace(module, name, broken)
