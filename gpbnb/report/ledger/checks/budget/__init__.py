"""The checks of hung1982, ch. I and II, and of hung1984, ch. I: descriptions, error sources and budget."""

from gpbnb.report.ledger.checks.budget import general, sources, title
from gpbnb.report.ledger.checks.budget.registry import CHECKS

__all__ = ["CHECKS", "general", "sources", "title"]
