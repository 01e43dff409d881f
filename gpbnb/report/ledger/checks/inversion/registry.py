"""The checks of hung1984, ch. II, and hung1982, ch. III, sections 10-11, by statement."""

from gpbnb.report.ledger.registry import Checks

CHECKS = Checks()
