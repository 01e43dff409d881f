"""Run the year of :mod:`.mission` in several formats, with one modelling choice changed at a time.

``python -m gpbnb.report.gravity_probe_b.mission_runs`` computes the sweep and continues where it was interrupted.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.lockstep import REFERENCE, Lockstep, error_rows, run_lockstep
from gpbnb.filters.parallel import Records
from gpbnb.filters.simulation import BLOCK
from gpbnb.report.gravity_probe_b.mission import STATES as MISSION_STATES
from gpbnb.report.gravity_probe_b.mission import Mission
from gpbnb.report.gravity_probe_b.threshold import COLUMNS as ERROR_COLUMNS
from gpbnb.report.gravity_probe_b.threshold import FORMS, STATES
from gpbnb.sweeps import Column, Sweep
from gpbnb.sweeps.command import run_command

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
SHOWN = 300
"""Number of records for the candidate formats. If 299 records all pass, they show a probability of 99 %."""
SEED = 2004
_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Cell:
    """Several formats of one base for the same records of one setting."""

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
        """Return the first columns of this cell's first row."""
        return (*self.heads()[0], str(self.first))

    def heads(self) -> list[tuple[str, ...]]:
        """Return the first columns of the rows of each format."""
        head = self.setting, self.states, str(self.base), self.rounding, self.form
        return [(*head, str(precision)) for precision in self.precisions]

    @property
    def mission(self) -> Mission:
        """Return the model of this cell."""
        return replace(SETTINGS[self.setting], deviations=self.states == "deviation")


def _cells() -> tuple[Cell, ...]:
    usual, flown = next(iter(SETTINGS)), "steps and roll as flown"
    others = ("no occultation", "no annual aberration", "a tenth of the readout noise")
    absolute, deviation = STATES
    cells = [
        Cell(usual, deviation, 2, "nearest", "hung", (25, 26, 27)),
        Cell(usual, absolute, 2, "nearest", "hung", (32, 33, 34)),
        Cell("white noise only", deviation, 2, "nearest", "hung", (26,), 0, 10),
        Cell("known roll phase", deviation, 2, "nearest", "hung", (26,), 0, 10),
        Cell(usual, deviation, 2, "nearest", "hung", (27,), RECORDS, SHOWN - RECORDS),
        Cell(usual, absolute, 2, "nearest", "hung", (31,)),
        Cell(usual, absolute, 2, "nearest", "hung", (32,), RECORDS, SHOWN - RECORDS),
        *(Cell(setting, deviation, 2, "nearest", "hung", (26,), 0, 10) for setting in others),
        Cell(usual, deviation, 2, "nearest", "innovation", (26,), 0, 10),
        Cell(usual, deviation, 2, "chop", "hung", (30,), 0, 10),
        Cell(usual, deviation, 10, "nearest", "innovation", (8, 9), 0, 10),
        Cell(usual, absolute, 10, "nearest", "innovation", (10, 11), 0, 10),
        Cell(flown, deviation, 2, "nearest", "hung", (26,), 0, 5),
        Cell(flown, deviation, 2, "nearest", "hung", (27, 28, 29), 0, 10),
        Cell(usual, deviation, 2, "nearest", "hung", (25, 26), RECORDS, 70),
        Cell(usual, absolute, 2, "nearest", "hung", (31, 33), RECORDS, 70),
    ]
    return tuple(cells)


#: All cells, the most valuable first.
CELLS = _cells()


def lockstep(cell: Cell, steps: int | None = None) -> Lockstep:
    """Create all filters of a cell, before their first step."""
    formats = [FloatFormat(cell.base, t, Rounding(cell.rounding)) for t in cell.precisions]
    records = range(cell.first, cell.first + cell.count)
    mission = cell.mission
    return Lockstep(repr(cell), mission, formats, FORMS[cell.form], records, steps or mission.steps)


def compute(cell: Cell, directory: Path | None = None, steps: int | None = None) -> dict[str, Any]:
    """Run the years of a cell, and save progress in a directory if one is given."""
    return run_lockstep(lockstep(cell, steps), directory)


def rows(cell: Cell, result: dict[str, Any]) -> list[tuple[str, ...]]:
    """List, for each format and record, the largest error of the year and the error at its end."""
    return error_rows(cell.heads(), cell.first, result)


def sample(cell: Cell, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Compute only the row of one format and record."""
    precision, record = int(rng.choice(cell.precisions)), cell.first + int(rng.integers(cell.count))
    one = replace(cell, precisions=(precision,), first=record, count=1)
    return rows(one, compute(one))


class RollPhase(NamedTuple):
    """How well the filter knows the roll-phase offset after some days: error and standard deviation, arcseconds."""

    days: float
    error: float
    deviation: float


def roll_phase_after(blocks: int, record: int = 0) -> RollPhase:
    """Run the mission model in float64 with deviation states, and return its knowledge of the roll phase.

    Parameters
    ----------
    blocks : number of blocks of 4096 steps.
    record : number of the record.
    """
    mission = Mission(deviations=True)
    run = Records(mission.model(2), REFERENCE, Form.INNOVATION, 1)
    truth = np.array(mission.start)
    for block in range(blocks):
        H = mission.matrices(block, 2)
        z, truth = mission.measurements(record, block, truth, H, BLOCK)
        run.use_measurement_matrices(H)
        run.carry(z[:, :, np.newaxis], 1)
    state = [name for name, _ in MISSION_STATES].index("roll-phase offset δ")
    arcseconds = math.degrees(1e-3) * 3600  # of a milliradian
    return RollPhase(
        blocks * BLOCK * mission.interval / 86400,
        abs(float(run.x[state, 0]) - truth[state]) * arcseconds,
        math.sqrt(float(run.P[state, state])) * arcseconds,
    )


COLUMNS = (Column("setting", "text", choices=tuple(SETTINGS)), *ERROR_COLUMNS)

SWEEP: Sweep[Cell] = Sweep(
    name="kalman/mission",
    file=_HERE / "mission.csv",
    columns=COLUMNS,
    key=7,
    cells=lambda: CELLS,
    compute=compute,
    rows=rows,
    command="python -m gpbnb.report.gravity_probe_b.mission_runs",
    seed=SEED,
    sample=sample,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return run_command(SWEEP, "A year of the mission model.", Path(".cache/mission"), arguments)


if __name__ == "__main__":
    sys.exit(main())
