"""A check for each printed statement of hung1984, ch. III."""

from gpbnb.report.ledger.checks.rolling import frequency, material, noise, phase, process, setting
from gpbnb.report.ledger.checks.rolling.material import expected_squares
from gpbnb.report.ledger.checks.rolling.registry import ALLOWED, CHECKS

__all__ = ["ALLOWED", "CHECKS", "expected_squares", "frequency", "material", "noise", "phase", "process", "setting"]
