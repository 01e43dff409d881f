"""``python -m gpbnb.report.inversion``: recompute the long sweeps of the chapter into a folder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gpbnb.report.inversion import experiment, stored


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb.report.inversion",
        description="Recompute the long sweeps of the chapter, and write them to a folder.",
    )
    parser.add_argument(
        "sweeps", nargs="*", default=list(experiment.SWEEPS), help="sweeps to compute: variants, random; default: both"
    )
    parser.add_argument("--folder", type=Path, default=Path(".cache/inversion"), help="folder for the results")
    parser.add_argument("--first", type=int, help="compute only this many cells")
    parser.add_argument("--directory", type=Path, default=Path(".cache/inversion"), help="folder for saved progress")
    given = parser.parse_args(arguments)
    if unknown := set(given.sweeps) - set(experiment.SWEEPS):
        parser.error(f"got sweeps {', '.join(sorted(unknown))}; needed one of {', '.join(experiment.SWEEPS)}")
    for name in given.sweeps:
        sweep = stored.sweep(name)
        results = sweep.run(given.directory / name, cells=sweep.cells()[: given.first])
        given.folder.mkdir(parents=True, exist_ok=True)
        file = given.folder / f"{name}.csv"
        sweep.store(results, file=file)
        print(f"{file}: {sweep.load(file).records()[-1]['trials']} inversions")
    return 0


if __name__ == "__main__":
    sys.exit(main())
