"""What each statement that disagrees should say, read from ``corrections.csv``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from gpbnb.report.ledger.statements import Statement, rows_of, statement


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

    def applied(self, statement: Statement) -> Statement | None:
        """Return the statement as it should read, or None if no text can correct it."""
        return replace(statement, form=self.form, text=self.text or statement.text) if self.form else None


@cache
def load_corrections() -> dict[str, Correction]:
    """Read the corrections: statement id → correction."""
    return {row["id"]: Correction(**row) for row in rows_of("corrections.csv")}


def intended(key: str) -> Statement:
    """Return a statement as it should read: corrected, where text can correct it."""
    printed = statement(key)
    return (load_corrections()[key].applied(printed) or printed) if key in load_corrections() else printed
