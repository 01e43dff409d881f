"""The register of the checks of this topic."""

from gpbnb.report.ledger.registry import Checks

CHECKS = Checks()
