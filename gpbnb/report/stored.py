"""``python -m gpbnb.report.stored verify``: recompute a sample of every stored sweep on this machine and compare."""

from __future__ import annotations

import sys
from typing import Any

from gpbnb.report.gravity_probe_b import mission, threshold, year
from gpbnb.report.guarantees import filters, scalar
from gpbnb.report.inversion import stored as inversion
from gpbnb.report.kalman.stored import ENSEMBLES
from gpbnb.report.rolling import stored as rolling
from gpbnb.sweeps import Sweep
from gpbnb.sweeps.stored import run

SWEEPS: tuple[Sweep[Any], ...] = (
    year.SWEEP,
    ENSEMBLES,
    threshold.SWEEP,
    mission.SWEEP,
    filters.SWEEP,
    scalar.SWEEP,
    *inversion.stored(),
    rolling.SWEEP,
)

if __name__ == "__main__":
    sys.exit(run(SWEEPS))
