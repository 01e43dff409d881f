"""``python -m gpbnb.report.stored``: list the stored sweeps of all chapters, verify a sample, or recompute them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from gpbnb.interrupts import interruptible
from gpbnb.report.gravity_probe_b import horizon, threshold, year
from gpbnb.report.guarantees import certificates, filters, gappa, scalar, survey, table
from gpbnb.report.inversion import experiment as inversion
from gpbnb.report.kalman import ensembles
from gpbnb.report.rolling import experiment as rolling
from gpbnb.sweeps import Sweep
from gpbnb.sweeps.command import run

SWEEPS: tuple[Sweep[Any], ...] = (
    year.SWEEP,
    year.BOUND_SWEEP,
    threshold.SWEEP,
    threshold.MISSION_SWEEP,
    horizon.SWEEP,
    ensembles.SWEEP,
    filters.SWEEP,
    scalar.SWEEP,
    survey.SWEEP,
    table.SWEEP,
    certificates.SWEEP,
    gappa.SWEEP,
    *(inversion.stored_sweep(name) for name in inversion.SWEEPS),
    rolling.SWEEP,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    return run(SWEEPS, "python -m gpbnb.report.stored", arguments)


if __name__ == "__main__":
    sys.exit(interruptible("python -m gpbnb.report.stored", main))
