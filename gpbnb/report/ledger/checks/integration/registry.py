"""The checks of savage2016, and the ids of its equations."""

from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.registry import Checks

CHECKS = Checks()
CHAPTER = chapter("integration")
MAIN = "savage2016.main."


def eq(*numbers: str) -> tuple[str, ...]:
    """Return the ids of equations."""
    return tuple(f"{MAIN}eq{number}" for number in numbers)
