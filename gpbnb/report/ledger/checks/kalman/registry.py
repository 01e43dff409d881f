"""The checks of hung1984, ch. II, and hung1982, ch. III, sections 12 and 13, and their common names."""

from __future__ import annotations

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.ledger.registry import Checks

CHECKS = Checks()

FOUR = FloatFormat(10, 4)
