"""What each statement that disagrees should say, read from ``corrections.csv``."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable

from gpbnb.report.ledger.statements import Statement, check_text, load_statements, statement


@dataclass(frozen=True)
class Correction:
    """The correction of one statement, or the reason why no text can correct it.

    Parameters
    ----------
    id : id of the statement.
    form : the corrected form, in the notation of :mod:`gpbnb.report.ledger.formula`; empty if there is only a reason.
    text : the text around the corrected form; empty if the text of the statement stays.
    reason : why no text can correct the statement; empty if there is a form.
    """

    id: str
    form: str = ""
    text: str = ""
    reason: str = ""

    def __post_init__(self) -> None:
        if bool(self.form) == bool(self.reason) or (self.text and not self.form):
            raise ValueError(
                f"got form={self.form!r}, text={self.text!r} and reason={self.reason!r} for {self.id}; "
                "needed a form, perhaps with a text, or else a reason"
            )

    def applied(self, statement: Statement) -> Statement | None:
        """Return the statement as it should read, or None if no text can correct it."""
        return replace(statement, form=self.form, text=self.text or statement.text) if self.form else None


@cache
def load_corrections() -> dict[str, Correction]:
    """Read the corrections of the package: statement id → correction."""
    return read_corrections(files(__package__) / "corrections.csv", {each.id: each for each in load_statements()})


def intended(key: str) -> Statement:
    """Return a statement as it should read: corrected, where text can correct it."""
    printed = statement(key)
    return (load_corrections()[key].applied(printed) or printed) if key in load_corrections() else printed


def read_corrections(source: Traversable, statements: Mapping[str, Statement]) -> dict[str, Correction]:
    """Read and validate a file of corrections.

    Parameters
    ----------
    source : a CSV file with the columns id, form, text, reason.
    statements : the statements that it may correct, by id.
    """
    found: dict[str, Correction] = {}
    for row in csv.DictReader(source.read_text(encoding="utf-8").splitlines(), strict=True):
        correction = Correction(**row)
        if correction.id not in statements or correction.id in found:
            raise ValueError(
                f"got a correction of {correction.id!r} in {source.name}; needed each id once, from statements.csv"
            )
        corrected = correction.applied(statements[correction.id])
        if corrected is not None:
            if corrected.form == statements[correction.id].form:
                raise ValueError(f"got the printed form as the correction of {correction.id!r}; needed another form")
            check_text(corrected)
        found[correction.id] = correction
    return found
