"""The command that computes a sweep cell by cell and stores the finished cells."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gpbnb.sweeps.sweep import Sweep

INTERRUPTED = 130


def run_command(sweep: Sweep[Any], description: str, directory: Path, arguments: Sequence[str] | None = None) -> int:
    """Compute the cells of a sweep and write its table, or only write the finished cells; return the exit status.

    Parameters
    ----------
    sweep : what to compute.
    description : text for the help of the command.
    directory : default folder for saved progress.
    arguments : arguments of the command line; by default those of this process.
    """
    cells = sweep.cells()
    parser = argparse.ArgumentParser(prog=sweep.command, description=description)
    parser.add_argument("--directory", type=Path, default=directory, help="folder for saved progress")
    parser.add_argument("--cells", type=int, default=len(cells), help="compute only this many cells")
    parser.add_argument("--store", action="store_true", help="write the finished cells without computing more")
    parser.add_argument("--output", type=Path, help="folder for the table; default: the folder for saved progress")
    given = parser.parse_args(arguments)
    if not given.store:
        try:
            sweep.run(given.directory, cells=cells[: given.cells])
        except KeyboardInterrupt:
            print(
                (f"interrupted; run the same command again to continue from the progress saved in {given.directory}"),
                file=sys.stderr,
            )
            return INTERRUPTED
    folder = given.output or given.directory
    folder.mkdir(parents=True, exist_ok=True)
    sweep.store(sweep.finished(given.directory), sweep.seconds(given.directory), folder / sweep.file.name)
    return 0
