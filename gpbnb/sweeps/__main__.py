"""``python -m gpbnb.sweeps verify``: recompute a sample of every stored sweep on this machine and compare."""

from __future__ import annotations

import sys

from gpbnb.inversion import stored as inversion
from gpbnb.kalman import stored as kalman
from gpbnb.rolling import stored as rolling
from gpbnb.sweeps.stored import run

SWEEPS = (*kalman.stored(), *inversion.stored(), rolling.SWEEP)

if __name__ == "__main__":
    sys.exit(run(SWEEPS))
