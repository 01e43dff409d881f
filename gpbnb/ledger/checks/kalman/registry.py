"""The checks of hung1984, ch. II, and hung1982, ch. III, sections 12 and 13, and what they share."""

from __future__ import annotations

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.ledger.registry import Checks
from gpbnb.ledger.statements import Statement

CHECKS = Checks()

CHAPTER = "chapter *Kalman bound*"
FOUR = FloatFormat(10, 4)


def claims(printed: Statement, label: str, meanings: dict[str, bool]) -> bool:
    """Whether a claim in words is right.

    Parameters
    ----------
    meanings : each phrase that the document could use, and whether it would be right.

    Raises
    ------
    KeyError : the document uses another phrase.
    """
    return meanings[printed.says(label)]
