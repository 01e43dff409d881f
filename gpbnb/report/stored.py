"""``python -m gpbnb.report.stored``: list the stored sweeps of all chapters, verify a sample, or recompute them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gpbnb.interrupts import INTERRUPTED, interruptible
from gpbnb.report.gravity_probe_b import horizon, threshold, year
from gpbnb.report.guarantees import certificates, filters, gappa, scalar, survey, table
from gpbnb.report.inversion import experiment as inversion
from gpbnb.report.kalman import ensembles
from gpbnb.report.rolling import experiment as rolling
from gpbnb.report.sweep import Sweep

COMMAND = "python -m gpbnb.report.stored"

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
    """Run the command and return its exit status, 1 if a file is damaged or a value differs from the stored one."""
    parser = _parser()
    given = parser.parse_args(arguments)
    known = {sweep.name: sweep for sweep in SWEEPS}
    if unknown := set(given.names) - set(known):
        parser.error(f"got sweeps {', '.join(sorted(unknown))}; needed some of {', '.join(known)}")
    if given.command == "verify" and given.sample < 1:
        parser.error(f"got --sample {given.sample}; needed at least 1")
    chosen = [known[name] for name in given.names] or list(SWEEPS)
    try:
        return {"list": _list, "verify": _verify, "recompute": _recompute}[given.command](chosen, given)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=COMMAND, description="List, verify or recompute the sweeps stored in the package."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    names = "names of sweeps, such as rolling/drift_rates; default: all"
    listed = commands.add_parser("list", help="name, command and provenance of each stored sweep")
    listed.add_argument("names", nargs="*", help=names)
    check = commands.add_parser("verify", help="compute a sample of each stored sweep again and compare")
    check.add_argument("names", nargs="*", help=names)
    check.add_argument("--sample", type=int, default=1, help="number of cells to compute for each sweep; default: 1")
    check.add_argument("--seed", type=int, default=1, help="seed that selects the cells; default: 1")
    again = commands.add_parser("recompute", help="compute sweeps again, cell by cell, and write their tables")
    again.add_argument("names", nargs="+", help="names of sweeps, such as rolling/drift_rates")
    again.add_argument("--processes", type=int, default=1, help="number of processes; default: 1")
    again.add_argument(
        "--output", type=Path, default=Path(".cache/sweeps"), help="folder for the tables and for saved progress"
    )
    return parser


def _list(sweeps: Sequence[Sweep[Any]], given: argparse.Namespace) -> int:
    for sweep in sweeps:
        print(f"{sweep.name}: {'; '.join(f'{key} {value}' for key, value in sweep.load().provenance.items())}")
    return 0


def _verify(sweeps: Sequence[Sweep[Any]], given: argparse.Namespace) -> int:
    differences = [each for sweep in sweeps for each in sweep.verify(given.sample, given.seed)]
    print(*differences, sep="\n", end="\n" if differences else "")
    print(f"{len(sweeps)} sweeps, {given.sample} cells of each: {len(differences) or 'no'} differences")
    return 1 if differences else 0


def _recompute(sweeps: Sequence[Sweep[Any]], given: argparse.Namespace) -> int:
    faults = []
    try:
        for sweep in sweeps:
            file = sweep.recompute(given.output, given.processes)
            print(f"{file}: {len(sweep.load(file).rows)} rows")
            faults += sweep.faults(file)
    except KeyboardInterrupt:
        print(
            f"interrupted; run the same command again to continue from the progress saved in {given.output}",
            file=sys.stderr,
        )
        return INTERRUPTED
    print(*faults, sep="\n", end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(interruptible(COMMAND, main))
