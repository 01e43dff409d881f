"""A check for each printed statement of hung1984, ch. III."""

from gpbnb.ledger.checks.rolling import frequency, material, noise, phase, process, setting
from gpbnb.ledger.checks.rolling.material import expected_squares
from gpbnb.ledger.checks.rolling.registry import ALLOWED, CHECKS

__all__ = ["ALLOWED", "CHECKS", "expected_squares", "frequency", "material", "noise", "phase", "process", "setting"]
