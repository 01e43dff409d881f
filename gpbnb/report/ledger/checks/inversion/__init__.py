"""The checks of hung1984, ch. II, and hung1982, ch. III, sections 10-11: errors of matrix inversion."""

from gpbnb.report.ledger.checks.inversion import (
    back_substitution,
    first_approach,
    numerical_example,
    resultant,
    triangularization,
)
from gpbnb.report.ledger.checks.inversion.registry import CHECKS

__all__ = [
    "CHECKS",
    "back_substitution",
    "first_approach",
    "numerical_example",
    "resultant",
    "triangularization",
]
