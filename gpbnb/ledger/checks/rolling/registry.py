"""The checks of hung1984, ch. III, and what they share."""

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.ledger.html import chapter
from gpbnb.ledger.registry import Checks

CHECKS = Checks()
CHAPTER = chapter("rolling")
SIX, TEN = FloatFormat(10, 6), FloatFormat(10, 10)
PRINTED = Rounding.documented()
"""Ways in which the report may have cut a number."""
ALLOWED = 0.15
"""Share of a single error in mas that hung1982, ch. II, gives in the text on its Figure II-2."""
ONE_DIMENSION = "roll-errors-in-one-dimension"
"""The root error of judging roll errors by one of two signals."""


def entry(place: str) -> str:
    """Id of a statement of the chapter."""
    return f"hung1984.III.{place}"
