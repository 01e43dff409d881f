"""``python -m gpbnb.inversion``: compute the long sweeps of the chapter anew and keep their results in the package."""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.inversion import experiment

HERE = Path(__file__).parent


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog="python -m gpbnb.inversion", description=__doc__)
    parser.add_argument("sweeps", nargs="*", default=list(experiment.SWEEPS), help="variants, random; both by default")
    parser.add_argument("--folder", type=Path, default=HERE, help="where to write; by default into the package")
    parser.add_argument("--first", type=int, help="compute only so many cells")
    given = parser.parse_args(arguments)
    if unknown := set(given.sweeps) - set(experiment.SWEEPS):
        parser.error(f"got {', '.join(sorted(unknown))}; needed one of {', '.join(experiment.SWEEPS)}")
    for sweep in given.sweeps:
        cells_of, names = experiment.SWEEPS[sweep]
        origin = provenance(sweep)
        cells = cells_of()[: given.first]
        with tqdm(total=sum(cell.count for cell in cells), desc=sweep, unit="inverse") as bar:
            rows = experiment.sweep_rows(cells, names, bar.update)
        path = given.folder / f"{sweep}.csv"
        with path.open("w", encoding="utf-8", newline="") as file:
            for key, value in origin.items():
                file.write(f"# {key}: {value}\n")
            writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        print(f"{path.name}: {rows[-1]['trials']} inversions")
    return 0


def provenance(sweep: str) -> dict[str, str]:
    """Where a result comes from: command, seed, versions, and the commit if there is one."""
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "numba", "python-flint"))
    found = subprocess.run(
        ["git", "-C", str(HERE), "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True, check=False
    )
    return {
        "command": f"python -m gpbnb.inversion {sweep}",
        "seed": str(experiment.SEED),
        "versions": f"Python {sys.version.split()[0]}, {versions}",
        "commit": found.stdout.strip() or "none",
    }


if __name__ == "__main__":
    sys.exit(main())
