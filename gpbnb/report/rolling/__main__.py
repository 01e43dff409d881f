"""``python -m gpbnb.report.rolling``: repeat the simulated years of all gyros, and write ``drift_rates.csv``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gpbnb.report.rolling.stored import SWEEP


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    parser = argparse.ArgumentParser(
        prog=SWEEP.command, description="Simulate the drift rates of all gyros, about 40 s of processor time."
    )
    parser.add_argument(
        "--output", type=Path, default=Path(".cache/drift_rates"), help="folder for drift_rates.csv and saved progress"
    )
    given = parser.parse_args(arguments)
    file = given.output / SWEEP.file.name
    SWEEP.store(SWEEP.run(given.output), file=file)
    print(file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
