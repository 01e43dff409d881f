"""One command for all stored sweeps: list them, verify a sample of each, or compute some of them again."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from gpbnb.sweeps.sweep import Sweep

INTERRUPTED = 130


@contextlib.contextmanager
def pool(processes: int) -> Iterator[Executor | None]:
    """Give an executor of several processes, or None for this process alone."""
    if processes < 2:
        yield None
        return
    # A forked process may inherit locks held by threads of this one.
    with ProcessPoolExecutor(processes, get_context("spawn")) as executor:
        yield executor


def verify(sweeps: Sequence[Sweep[Any]], count: int, seed: int, progress: bool = False) -> list[str]:
    """Read every sweep, recompute a sample of its cells, and describe each difference."""
    found = []
    for sweep in sweeps:
        for cell, stored, computed in sweep.verify(count, seed, progress):
            found.append(f"{sweep.name}, {cell}: stored {stored or 'nothing'}, computed {computed}")
    return found


def run(sweeps: Sequence[Sweep[Any]], program: str, arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status, 1 if a file is damaged or a value differs from the stored one.

    Parameters
    ----------
    program : how to call the command, for its help.
    arguments : arguments of the command line; by default those of this process.
    """
    parser = _parser(program)
    given = parser.parse_args(arguments)
    known = {sweep.name: sweep for sweep in sweeps}
    if unknown := set(given.names) - set(known):
        parser.error(f"got sweeps {', '.join(sorted(unknown))}; needed some of {', '.join(known)}")
    chosen = [known[name] for name in given.names] or list(sweeps)
    try:
        if given.command == "list":
            return _list(chosen)
        if given.command == "recompute":
            return _recompute(chosen, given)
        if given.sample < 1:
            parser.error(f"got --sample {given.sample}; needed at least 1")
        differences = verify(chosen, given.sample, given.seed, progress=True)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    for each in differences:
        print(each)
    print(f"{len(chosen)} sweeps, {given.sample} cells of each: {len(differences) or 'no'} differences")
    return 1 if differences else 0


def _parser(program: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program, description="List, verify or recompute the sweeps stored in the package."
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
    again.add_argument("--cells", type=int, help="compute only this many cells")
    again.add_argument(
        "--only", nargs="+", default=[], metavar="WORD", help="compute only cells with one of these words; keep others"
    )
    again.add_argument("--store", action="store_true", help="write the finished cells without computing more")
    again.add_argument("--processes", type=int, default=1, help="number of processes; default: 1")
    again.add_argument(
        "--output", type=Path, default=Path(".cache/sweeps"), help="folder for the tables and for saved progress"
    )
    return parser


def _list(sweeps: Sequence[Sweep[Any]]) -> int:
    for sweep in sweeps:
        print(f"{sweep.name}: {'; '.join(f'{key} {value}' for key, value in sweep.load().provenance.items())}")
    return 0


def _recompute(sweeps: Sequence[Sweep[Any]], given: argparse.Namespace) -> int:
    faults = []
    try:
        with pool(given.processes) as executor:
            for sweep in sweeps:
                file = sweep.recompute(given.output, executor, count=given.cells, only=given.only, store=given.store)
                print(f"{file}: {len(sweep.load(file).rows)} rows")
                faults += sweep.faults(file)
    except KeyboardInterrupt:
        print(
            f"interrupted; run the same command again to continue from the progress saved in {given.output}",
            file=sys.stderr,
        )
        return INTERRUPTED
    for each in faults:
        print(each)
    return 1 if faults else 0
