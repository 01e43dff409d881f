"""Verify stored sweeps, for the command ``python -m gpbnb.report.stored``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any

from gpbnb.sweeps.sweep import Sweep


def verify(sweeps: Sequence[Sweep[Any]], count: int, seed: int, progress: bool = False) -> list[str]:
    """Read every sweep, recompute a sample of its cells, and describe each difference.

    Raises
    ------
    DamagedFileError : a file is not as it was written.
    """
    found = []
    for sweep in sweeps:
        for cell, stored, computed in sweep.verify(count, seed, progress):
            found.append(f"{sweep.name}, {cell}: stored {stored or 'nothing'}, computed {computed}")
    return found


def run(sweeps: Sequence[Sweep[Any]], arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status, 1 if a file is damaged or a value differs."""
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb.report.stored", description="List or check the sweeps stored in the package."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="name, command and provenance of each stored sweep")
    check = commands.add_parser("verify", help="compute a sample of each stored sweep again and compare")
    check.add_argument("names", nargs="*", help="names of sweeps, such as kalman/year; default: all")
    check.add_argument("--sample", type=int, default=1, help="number of cells to compute for each sweep; default: 1")
    check.add_argument("--seed", type=int, default=1, help="seed that selects the cells; default: 1")
    given = parser.parse_args(arguments)
    known = {sweep.name: sweep for sweep in sweeps}
    try:
        if given.command == "list":
            for sweep in sweeps:
                table = sweep.load()
                about = "; ".join(f"{key} {value}" for key, value in table.provenance.items())
                print(f"{sweep.name}: {about}")
            return 0
        if unknown := set(given.names) - set(known):
            parser.error(f"got sweeps {', '.join(sorted(unknown))}; needed some of {', '.join(known)}")
        if given.sample < 1:
            parser.error(f"got --sample {given.sample}; needed at least 1")
        chosen = [known[name] for name in given.names] or list(sweeps)
        differences = verify(chosen, given.sample, given.seed, progress=True)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for each in differences:
        print(each)
    print(f"{len(chosen)} sweeps, {given.sample} cells of each: {len(differences) or 'no'} differences")
    return 1 if differences else 0
