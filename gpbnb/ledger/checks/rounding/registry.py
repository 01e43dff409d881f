"""The register of the checks of this topic."""

from gpbnb.ledger.registry import Checks

CHECKS = Checks()
