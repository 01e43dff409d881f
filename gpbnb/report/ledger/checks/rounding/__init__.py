"""Checks of hung1984, ch. II, and hung1982, ch. III, sections 1 to 9: bounds of rounding errors."""

from gpbnb.report.ledger.checks.rounding import (
    introduction,
    matrices,
    one_rounding,
    products,
    representation,
    sentences,
    sums,
)
from gpbnb.report.ledger.checks.rounding.registry import CHECKS

__all__ = ["CHECKS", "introduction", "matrices", "one_rounding", "products", "representation", "sentences", "sums"]
