"""The result of checking one printed statement.

The verdict follows from whether the recomputation agrees with the printed statement, through :func:`compare` or, for an
item that the documents leave undone, :func:`answer`.
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
            if not isinstance(text, str):
                raise TypeError(f"got {name}={text!r} of type {type(text).__name__}; needed a str; format the value")
            if text.count("$") % 2 or "$$" in text:
                raise ValueError(f"got {name}={text!r} with an unpaired or doubled dollar sign; needed math as $...$")
        if not isinstance(self.verdict, Verdict):
            raise TypeError(
                f"got verdict={self.verdict!r} of type {type(self.verdict).__name__}; needed one of {list(Verdict)}"
            )
        if self.agrees is not None and not isinstance(self.agrees, bool):
            raise TypeError(
                f"got agrees={self.agrees!r} of type {type(self.agrees).__name__}; needed a bool or None; use bool(...)"
            )
        if self.agrees not in _AGREES[self.verdict]:
            needed = " or ".join(str(value) for value in _AGREES[self.verdict])
            raise ValueError(
                f"got verdict {self.verdict.value!r} with agrees={self.agrees}; needed {needed}; let "
                "compare() or answer() choose the verdict"
            )
        if self.root and self.verdict not in DISAGREEMENTS:
            raise ValueError(
                f"got verdict {self.verdict.value!r} with the root error {self.root!r}; needed no root "
                "error for this verdict; omit root"
            )
        if self.agrees is not None and not self.recomputed.strip():
            raise ValueError(
                f"got agrees={self.agrees} with a blank recomputed text; needed a text that says what was computed"
            )
        if self.verdict in _NEEDS_NOTE and not self.note.strip():
            raise ValueError(
                f"got verdict {self.verdict.value!r} without a note; needed a note that says "
                f"{_NEEDS_NOTE[self.verdict]}"
            )


def compare(
    agrees: bool,
    recomputed: str,
    otherwise: Verdict = Verdict.WRONG,
    note: str = "",
    otherwise_note: str | None = None,
    root: str = "",
) -> Finding:
    """Judge a printed statement by comparison with what was recomputed.

    Parameters
    ----------
    agrees : outcome of the comparison.
    recomputed : what was computed.
    otherwise : the verdict if `agrees` is False, one of `DISAGREEMENTS`.
    note : note for either outcome.
    otherwise_note : replaces `note` if `agrees` is False.
    root : id of the root error, used if `agrees` is False.

    Returns
    -------
    finding : verified if `agrees`, otherwise `otherwise`.
    """
    if otherwise not in DISAGREEMENTS:
        came = otherwise.value if isinstance(otherwise, Verdict) else otherwise
        raise ValueError(f"got otherwise={came!r}; needed one of {', '.join(v.value for v in DISAGREEMENTS)}")
    _require_bool("agrees", agrees)
    if agrees:
        return Finding(recomputed, True, Verdict.VERIFIED, note)
    return Finding(recomputed, False, otherwise, note if otherwise_note is None else otherwise_note, root)


def answer(holds: bool, recomputed: str, note: str) -> Finding:
    """Judge an item that the documents leave undone, by checking the answer given here.

    Parameters
    ----------
    holds : whether the answer passes its own check.
    recomputed : the answer.
    note : where the answer is.

    Returns
    -------
    finding : answered if `holds`, otherwise open.
    """
    _require_bool("holds", holds)
    answered = Finding(recomputed, True, Verdict.ANSWERED, note)
    return answered if holds else Finding(recomputed, False, Verdict.OPEN, note)


def _require_bool(name: str, value: object) -> None:
    if not isinstance(value, bool):
        raise TypeError(f"got {name}={value!r} of type {type(value).__name__}; needed a bool; use bool(...)")
