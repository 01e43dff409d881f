"""The register of the checks of hung1984, ch. III, and their common names.

One standard holds for the whole chapter. Equations (1) to (4) and section 4, which says so, consider a one-dimensional
signal: what they state is judged for one signal. All other statements are about the experiment and are judged for its
pair of signals, (5) to (8). There, strength and signal-to-noise ratio mean those of each signal in its own channel.
"""

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.registry import Checks

CHECKS = Checks()
CHAPTER = chapter("rolling")
SIX, TEN = FloatFormat(10, 6), FloatFormat(10, 10)
PRINTED = Rounding.documented()
"""Ways in which the report may have rounded a number."""
ALLOWED = 0.15
"""Error of a single source in mas, from the text on Figure II-2 in hung1982, ch. II."""
ONE_DIMENSION = "roll-errors-in-one-dimension"
"""The root error of judging a roll error of the experiment by only one of its two signals."""


def entry(place: str) -> str:
    """Return the id of a statement of the chapter."""
    return f"hung1984.III.{place}"
