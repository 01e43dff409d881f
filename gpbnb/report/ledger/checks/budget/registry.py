"""The checks of hung1982, ch. I and II, and of hung1984, ch. I."""

from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.registry import Checks

CHECKS = Checks()

CHAPTER = chapter("budget")
