"""The register of the checks of hung1982, ch. IV, and their common names."""

from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.registry import Checks
from gpbnb.report.measurement import ARCSEC

CHECKS = Checks()
CHAPTER = chapter("geometry")
MINUTE = 60 * ARCSEC
"""An arc minute in radians."""
