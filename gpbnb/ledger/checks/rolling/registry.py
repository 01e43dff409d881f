"""The register of the checks of hung1984, ch. III, and their common names."""

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.ledger.html import chapter
from gpbnb.ledger.registry import Checks

CHECKS = Checks()
CHAPTER = chapter("rolling")
SIX, TEN = FloatFormat(10, 6), FloatFormat(10, 10)
PRINTED = Rounding.documented()
"""Ways in which the report may have rounded a number."""
ALLOWED = 0.15
"""Error of a single source in mas, from the text on Figure II-2 in hung1982, ch. II."""
ONE_DIMENSION = "roll-errors-in-one-dimension"
"""The root error of judging roll errors by only one of the two signals."""


def entry(place: str) -> str:
    """Return the id of a statement of the chapter."""
    return f"hung1984.III.{place}"
