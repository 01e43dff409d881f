"""The checks of the printed statements, one module per topic of the book, with a file of rows each."""

from collections.abc import Mapping

from gpbnb.report.ledger.checks import budget, geometry, integration, inversion, kalman, rolling, rounding
from gpbnb.report.ledger.judge import Checks

TOPICS: Mapping[str, Checks] = {
    "rounding": rounding.CHECKS,
    "inversion": inversion.CHECKS,
    "kalman": kalman.CHECKS,
    "rolling": rolling.CHECKS,
    "integration": integration.CHECKS,
    "budget": budget.CHECKS,
    "geometry": geometry.CHECKS,
}
"""The checks of each topic, in the order of the chapters."""
