"""What became of a printed statement, and how a topic's checks are collected.

A check recomputes one statement of a document and returns a :class:`Finding`. The verdict follows from whether
recomputation and print agree, through :func:`compare`, :func:`answer` or :func:`unverifiable`; no check states it
by hand.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TypeVar


class Verdict(Enum):
    """What became of a printed statement.

    VERIFIED : right as printed, to first order where the document says so.
    TYPO : a slip without consequence.
    WRONG : an error with consequence.
    INCONSISTENT : contradicts another place of the documents.
    OCR : the scan is wrong, not the author.
    UNVERIFIABLE : its data is not in the documents.
    OPEN : left undone in the documents, and here.
    ANSWERED : left undone there, done here; the note says where.
    """

    VERIFIED = "verified"
    TYPO = "typo"
    WRONG = "wrong"
    INCONSISTENT = "inconsistent"
    OCR = "ocr"
    UNVERIFIABLE = "unverifiable"
    OPEN = "open"
    ANSWERED = "answered"


_AGREES: dict[Verdict, tuple[bool | None, ...]] = {
    Verdict.VERIFIED: (True,),
    Verdict.TYPO: (False,),
    Verdict.WRONG: (False,),
    Verdict.INCONSISTENT: (False,),
    Verdict.OCR: (False,),
    Verdict.UNVERIFIABLE: (None,),
    Verdict.OPEN: (False, None),
    Verdict.ANSWERED: (True,),
}
_DIFFERS = (Verdict.TYPO, Verdict.WRONG, Verdict.INCONSISTENT, Verdict.OCR)
_NEEDS_NOTE = {
    Verdict.UNVERIFIABLE: "which data is missing",
    Verdict.ANSWERED: "where it is answered",
}


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Parameters
    ----------
    recomputed : what the project gets; prose with math between single dollar signs.
    agrees : whether print and recomputation agree; None where there is nothing to compare.
    verdict : what became of the statement; not free, it must fit `agrees`.
    note : why, or where; same markup. Needed for `UNVERIFIABLE` and `ANSWERED`.

    Raises
    ------
    TypeError : a field is not of its type; a NumPy or SymPy truth value is not a bool.
    ValueError : `verdict` does not fit `agrees`, a needed text is blank, or a text has an unpaired dollar sign.
    """

    recomputed: str
    agrees: bool | None
    verdict: Verdict
    note: str = ""

    def __post_init__(self) -> None:
        for name, text in (("recomputed", self.recomputed), ("note", self.note)):
            if not isinstance(text, str):
                raise TypeError(f"{name}={text!r} is a {type(text).__name__}; a str is needed: format it")
            if text.count("$") % 2 or "$$" in text:
                raise ValueError(f"{name}={text!r} has an unpaired or doubled dollar sign; write math as $...$")
        if not isinstance(self.verdict, Verdict):
            raise TypeError(f"verdict={self.verdict!r} is a {type(self.verdict).__name__}; take one of {list(Verdict)}")
        if self.agrees is not None and not isinstance(self.agrees, bool):
            raise TypeError(
                f"agrees={self.agrees!r} is a {type(self.agrees).__name__}; a bool or None is needed: use bool(...)"
            )
        if self.agrees not in _AGREES[self.verdict]:
            needed = " or ".join(str(value) for value in _AGREES[self.verdict])
            raise ValueError(
                f"verdict {self.verdict.value!r} came with agrees={self.agrees}; it needs {needed}: "
                "let compare(), answer() or unverifiable() choose the verdict"
            )
        if self.agrees is not None and not self.recomputed.strip():
            raise ValueError(f"agrees={self.agrees} came with a blank recomputed; say what was computed")
        if self.verdict in _NEEDS_NOTE and not self.note.strip():
            raise ValueError(
                f"verdict {self.verdict.value!r} came without a note; say there {_NEEDS_NOTE[self.verdict]}"
            )


def compare(
    agrees: bool,
    recomputed: str,
    otherwise: Verdict = Verdict.WRONG,
    note: str = "",
    otherwise_note: str | None = None,
) -> Finding:
    """Judge a printed statement by comparison with what was recomputed.

    Parameters
    ----------
    agrees : outcome of the comparison.
    recomputed : what was computed.
    otherwise : the verdict where `agrees` is False: TYPO, WRONG, INCONSISTENT or OCR.
    note : goes with either outcome.
    otherwise_note : replaces `note` where `agrees` is False.

    Returns
    -------
    finding : verified where `agrees`, else `otherwise`.

    Raises
    ------
    TypeError : `agrees` is not a bool.
    ValueError : `otherwise` is not one of the four.
    """
    if otherwise not in _DIFFERS:
        came = otherwise.value if isinstance(otherwise, Verdict) else otherwise
        raise ValueError(f"otherwise={came!r}; a disagreement is one of {', '.join(v.value for v in _DIFFERS)}")
    _require_bool("agrees", agrees)
    if agrees:
        return Finding(recomputed, True, Verdict.VERIFIED, note)
    return Finding(recomputed, False, otherwise, note if otherwise_note is None else otherwise_note)


def answer(holds: bool, recomputed: str, note: str) -> Finding:
    """Judge what the documents left undone by the check of the answer given here.

    Parameters
    ----------
    holds : whether the answer passes its own check.
    recomputed : the answer.
    note : where it stands.

    Returns
    -------
    finding : answered where `holds`, else open.

    Raises
    ------
    TypeError : `holds` is not a bool.
    ValueError : `note` is blank.
    """
    _require_bool("holds", holds)
    answered = Finding(recomputed, True, Verdict.ANSWERED, note)
    return answered if holds else Finding(recomputed, False, Verdict.OPEN, note)


def unverifiable(recomputed: str, note: str) -> Finding:
    """Record that a statement rests on data that is not in the documents.

    Parameters
    ----------
    recomputed : what can still be said; may be empty.
    note : which data is missing.

    Raises
    ------
    ValueError : `note` is blank.
    """
    return Finding(recomputed, None, Verdict.UNVERIFIABLE, note)


def _require_bool(name: str, value: object) -> None:
    if not isinstance(value, bool):
        raise TypeError(f"{name}={value!r} is a {type(value).__name__}; a bool is needed: use bool(...)")


def both(place: str) -> tuple[str, str]:
    """Ids of an entry that both reports have, in ch. II of hung1984 and in ch. III of hung1982."""
    return f"hung1984.II.{place}", f"hung1982.III.{place}"


Check = Callable[[], Finding]
_C = TypeVar("_C", bound=Check)


class Checks(Mapping[str, Check]):
    """The checks of one topic, by the ids of their ledger entries.

    Examples
    --------
    >>> CHECKS = Checks()
    >>> @CHECKS.add("hung1984.II.eq14", "hung1982.III.eq14")
    ... def chopping_unit() -> Finding:
    ...     ratio = 10**-3 / (10**-3 / 2)
    ...     return compare(ratio == 2, f"{ratio:g}")
    >>> CHECKS.run("hung1984.II.eq14").verdict
    <Verdict.VERIFIED: 'verified'>
    """

    def __init__(self) -> None:
        self._checks: dict[str, Check] = {}

    def add(self, *ids: str) -> Callable[[_C], _C]:
        """Register the decorated function as the check of each of `ids`.

        Raises
        ------
        TypeError : an id is not a str, there is none (``@CHECKS.add`` without parentheses gives this too), or the
            function takes arguments.
        ValueError : an id is blank or has its check already.
        """
        if not ids:
            raise TypeError('add() came without an id; write @CHECKS.add("document.chapter.item")')
        for key in ids:
            if not isinstance(key, str):
                raise TypeError(f'{key!r} is not an id; write @CHECKS.add("document.chapter.item")')
            if not key.strip():
                raise ValueError("an id is blank; give the id of a ledger entry")

        def register(check: _C) -> _C:
            if inspect.signature(check).parameters:
                raise TypeError(f"{_name(check)} takes arguments; a check is called without any")
            new: dict[str, Check] = {}
            for key in ids:
                other = new.get(key) or self._checks.get(key)
                if other is not None:
                    raise ValueError(
                        f"{key!r} is checked by {_name(other)} and by {_name(check)}; an entry has one check: drop one"
                    )
                new[key] = check
            self._checks.update(new)
            return check

        return register

    def run(self, key: str) -> Finding:
        """Run the check of the entry `key`.

        Raises
        ------
        KeyError : there is no check of that id.
        TypeError : the check returned something else than a Finding.
        """
        check = self[key]
        finding = check()
        if not isinstance(finding, Finding):
            raise TypeError(
                f"the check of {key!r}, {_name(check)}, returned {finding!r}; a Finding is needed: "
                "return compare(...), answer(...) or unverifiable(...)"
            )
        return finding

    def __getitem__(self, key: str) -> Check:
        try:
            return self._checks[key]
        except KeyError:
            raise KeyError(f"no check of {key!r} here; list(checks) gives the {len(self)} ids that have one") from None

    def __contains__(self, key: object) -> bool:
        return key in self._checks

    def __iter__(self) -> Iterator[str]:
        return iter(self._checks)

    def __len__(self) -> int:
        return len(self._checks)

    def __repr__(self) -> str:
        return f"Checks({len(self)} ids)"


def _name(check: Callable[..., object]) -> str:
    return f"{check.__module__}.{check.__qualname__}"
