"""The checks of hung1984, ch. II, and hung1982, ch. III, sections 12 and 13: the Kalman filter."""

from gpbnb.report.ledger.checks.kalman import bounds, example, model, remarks, steps
from gpbnb.report.ledger.checks.kalman.registry import CHECKS

__all__ = ["CHECKS", "bounds", "example", "model", "remarks", "steps"]
