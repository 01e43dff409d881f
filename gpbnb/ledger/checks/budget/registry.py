"""The checks of hung1982, ch. I and II, and of hung1984, ch. I."""

from gpbnb.ledger.html import chapter
from gpbnb.ledger.registry import Checks

CHECKS = Checks()

CHAPTER = chapter("budget")
