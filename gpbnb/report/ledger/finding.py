"""The result of checking one printed statement.

The verdict follows from whether the recomputation agrees with the printed statement, through :func:`compare`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """The judgement of a printed statement.

    VERIFIED : correct as printed, to first order in the unit roundoff if the document says so.
    MISPRINT : a slip on which nothing later depends.
    WRONG : an error on which a later result or a conclusion depends.
    INCONSISTENT : contradicts another place in the documents.
    NOT_REPRODUCED : a number that no interpretation we tried yields, although no derivation proves it wrong.
    OCR : the scan is wrong, not the author.
    UNVERIFIABLE : the underlying data or picture is not in the documents; the note names what is missing.
    GIVEN : a definition, given data or a heading, which cannot be checked.
    OPEN : left undone in the documents and here.
    ANSWERED : left undone in the documents and done here; the note says where.
    """

    VERIFIED = "verified"
    MISPRINT = "misprint"
    WRONG = "wrong"
    INCONSISTENT = "inconsistent"
    NOT_REPRODUCED = "not reproduced"
    OCR = "ocr"
    UNVERIFIABLE = "unverifiable"
    GIVEN = "given"
    OPEN = "open"
    ANSWERED = "answered"


_AGREES: dict[Verdict, tuple[bool | None, ...]] = {
    Verdict.VERIFIED: (True,),
    Verdict.MISPRINT: (False,),
    Verdict.WRONG: (False,),
    Verdict.INCONSISTENT: (False,),
    Verdict.NOT_REPRODUCED: (False,),
    Verdict.OCR: (False,),
    Verdict.UNVERIFIABLE: (None,),
    Verdict.GIVEN: (None,),
    Verdict.OPEN: (False, None),
    Verdict.ANSWERED: (True,),
}
DISAGREEMENTS = (Verdict.WRONG, Verdict.INCONSISTENT, Verdict.NOT_REPRODUCED, Verdict.MISPRINT, Verdict.OCR)
"""Verdicts on statements that do not agree with the recomputation, the most serious first."""
_NEEDS_NOTE = {
    Verdict.UNVERIFIABLE: "which data are missing",
    Verdict.GIVEN: "what it defines or gives",
    Verdict.ANSWERED: "where it is answered",
}


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Parameters
    ----------
    recomputed : the project's result; prose with math between single dollar signs.
    agrees : whether print and recomputation agree; None if there is nothing to compare.
    verdict : the judgement of the statement; it must fit `agrees`.
    note : reason or place, in the same markup. Required for `UNVERIFIABLE`, `GIVEN` and `ANSWERED`.
    root : id of the root error in ``roots.csv`` that makes the statement disagree; empty if it agrees.
    """

    recomputed: str
    agrees: bool | None
    verdict: Verdict
    note: str = ""
    root: str = ""

    def __post_init__(self) -> None:
        for name, text in (("recomputed", self.recomputed), ("note", self.note)):
            if text.count("$") % 2 or "$$" in text:
                raise ValueError(f"got {name}={text!r} with an unpaired or doubled dollar sign; needed math as $...$")
        verdict = self.verdict.value
        if self.agrees not in _AGREES[self.verdict]:
            needed = " or ".join(str(value) for value in _AGREES[self.verdict])
            raise ValueError(f"got verdict {verdict!r} with agrees={self.agrees}; needed {needed}")
        if self.root and self.verdict not in DISAGREEMENTS:
            raise ValueError(f"got verdict {verdict!r} with the root error {self.root!r}; needed no root error")
        if self.agrees is not None and not self.recomputed.strip():
            raise ValueError(f"got agrees={self.agrees} with a blank recomputed text; needed what was computed")
        if self.verdict in _NEEDS_NOTE and not self.note.strip():
            raise ValueError(
                f"got verdict {verdict!r} without a note; needed one that says {_NEEDS_NOTE[self.verdict]}"
            )


def compare(
    agrees: bool,
    recomputed: str,
    otherwise: Verdict = Verdict.WRONG,
    note: str = "",
    otherwise_note: str | None = None,
    root: str = "",
) -> Finding:
    """Return the finding on a statement: verified, or what a disagreement is called, with its note and root error."""
    if agrees:
        return Finding(recomputed, True, Verdict.VERIFIED, note)
    return Finding(recomputed, False, otherwise, note if otherwise_note is None else otherwise_note, root)
