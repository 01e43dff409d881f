"""A check for each printed statement of savage2016."""

from gpbnb.report.ledger.checks.integration import covariance, model, open_items, result
from gpbnb.report.ledger.checks.integration.registry import CHECKS

__all__ = ["CHECKS", "covariance", "model", "open_items", "result"]
