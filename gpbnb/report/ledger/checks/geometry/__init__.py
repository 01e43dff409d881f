"""A check for each printed statement of hung1982, ch. IV, and for those of ch. I on the two precessions."""

from gpbnb.report.ledger.checks.geometry import angles, definitions, equations, frames, precessions
from gpbnb.report.ledger.checks.geometry.registry import CHECKS

__all__ = ["CHECKS", "angles", "definitions", "equations", "frames", "precessions"]
