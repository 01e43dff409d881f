"""The year of :mod:`gpbnb.kalman.mission` in several formats, and how each modelling choice moves its errors.

``python -m gpbnb.kalman.mission_runs`` computes the sweep and continues where it was interrupted.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.kalman.lockstep import Lockstep, error_rows, run_lockstep
from gpbnb.kalman.mission import Mission
from gpbnb.kalman.threshold import COLUMNS as ERROR_COLUMNS
from gpbnb.kalman.threshold import FORMS, STATES
from gpbnb.sweeps import Column, Sweep

#: The settings of the sweep, the model with the report's timing, and with one choice changed.
SETTINGS = {
    "mission": Mission(),
    "no occultation": Mission(occultation=False),
    "no annual aberration": Mission(annual=False),
    "white noise only": Mission(flicker=False),
    "known roll phase": Mission(roll_phase=False),
    "a tenth of the readout noise": Mission(quiet=10.0),
    "steps and roll as flown": Mission(flown=True),
}

RECORDS = 30
SEED = 2004
_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Cell:
    """Some formats of one base, for the same records of one setting."""

    setting: str
    states: str
    base: int
    rounding: str
    form: str
    precisions: tuple[int, ...]
    first: int = 0
    count: int = RECORDS

    @property
    def key(self) -> tuple[str, ...]:
        """The first columns of this cell's first row."""
        return (*self.heads()[0], str(self.first))

    def heads(self) -> list[tuple[str, ...]]:
        """The first columns of the rows of each format."""
        head = self.setting, self.states, str(self.base), self.rounding, self.form
        return [(*head, str(precision)) for precision in self.precisions]

    @property
    def mission(self) -> Mission:
        """The model of this cell."""
        return replace(SETTINGS[self.setting], deviations=self.states == "deviation")


def _cells() -> tuple[Cell, ...]:
    usual, *others, flown = SETTINGS
    absolute, deviation = STATES
    cells = [
        Cell(usual, deviation, 2, "nearest", "hung", (25, 26, 27)),
        Cell(usual, absolute, 2, "nearest", "hung", (32, 33, 34)),
        *(Cell(setting, deviation, 2, "nearest", "hung", (26,), 0, 10) for setting in others),
        Cell(flown, deviation, 2, "nearest", "hung", (26,), 0, 5),
        Cell(usual, deviation, 10, "nearest", "innovation", (8, 9)),
        Cell(usual, absolute, 10, "nearest", "innovation", (10, 11)),
        Cell(usual, deviation, 2, "nearest", "innovation", (26,)),
        Cell(usual, deviation, 2, "chop", "hung", (26, 30)),
        Cell(usual, deviation, 2, "nearest", "hung", (22, 23, 24, 28, 29, 30)),
        Cell(usual, absolute, 2, "nearest", "hung", (28, 29, 30, 31, 35, 36)),
    ]
    return tuple(cells)


#: All cells, the most valuable first.
CELLS = _cells()


def lockstep(cell: Cell, steps: int | None = None) -> Lockstep:
    """All filters of a cell, before their first step."""
    formats = [FloatFormat(cell.base, t, Rounding(cell.rounding)) for t in cell.precisions]
    records = range(cell.first, cell.first + cell.count)
    mission = cell.mission
    return Lockstep(repr(cell), mission, formats, FORMS[cell.form], records, steps or mission.steps)


def compute(cell: Cell, directory: Path | None = None, steps: int | None = None) -> dict[str, Any]:
    """Run the years of a cell, and save them on the way if there is a directory."""
    return run_lockstep(lockstep(cell, steps), directory)


def rows(cell: Cell, result: dict[str, Any]) -> list[tuple[str, ...]]:
    """Rows of the table: for each format and record, largest error of the year and error at its end."""
    return error_rows(cell.heads(), cell.first, result)


def sample(cell: Cell, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """The row of one format and record, computed alone."""
    precision, record = int(rng.choice(cell.precisions)), cell.first + int(rng.integers(cell.count))
    one = replace(cell, precisions=(precision,), first=record, count=1)
    return rows(one, compute(one))


COLUMNS = (Column("setting", "text", choices=tuple(SETTINGS)), *ERROR_COLUMNS)

SWEEP: Sweep[Cell] = Sweep(
    name="kalman/mission",
    file=_HERE / "mission.csv",
    columns=COLUMNS,
    key=7,
    cells=lambda: CELLS,
    compute=compute,
    rows=rows,
    command="python -m gpbnb.kalman.mission_runs",
    seed=SEED,
    sample=sample,
)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog=SWEEP.command, description="A year of the mission model.")
    parser.add_argument("--directory", type=Path, default=Path(".cache/mission"), help="where progress is saved")
    parser.add_argument("--cells", type=int, default=len(CELLS), help="only so many of the cells")
    parser.add_argument("--store", action="store_true", help="write the finished cells, and compute nothing")
    parser.add_argument("--output", type=Path, help="folder for the table; by default where progress is saved")
    given = parser.parse_args(arguments)
    if not given.store:
        try:
            SWEEP.run(given.directory, cells=CELLS[: given.cells])
        except KeyboardInterrupt:
            print(f"interrupted; the same command goes on from what is saved in {given.directory}", file=sys.stderr)
            return 130
    folder = given.output or given.directory
    folder.mkdir(parents=True, exist_ok=True)
    SWEEP.store(SWEEP.finished(given.directory), SWEEP.seconds(given.directory), folder / SWEEP.file.name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
