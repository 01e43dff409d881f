"""How many digits a year needs, with what probability: hundreds of measurement records in each number format.

``python -m gpbnb.kalman.threshold`` computes the sweep and goes on where it was interrupted. The year is that of
:mod:`gpbnb.kalman.year`: 3,153,600 steps, the simple model, measurements in whole milliarcseconds. Record 0 is the
one of that module. The errors are differences between the rounded filter and the same filter in float64, at every
step.
"""

from __future__ import annotations

import argparse
import sys
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.kalman.forms import Form
from gpbnb.kalman.gravity_probe_b import TRUTH, YEAR
from gpbnb.kalman.kernels.records import update_largest
from gpbnb.kalman.records import Records
from gpbnb.kalman.simulation import BLOCK, Simulation
from gpbnb.kalman.year_cases import MODELS, model
from gpbnb.sweeps import Column, Sweep

#: What the filter estimates: drift angles and rates themselves, or their deviations from the predicted drift.
STATES = ("absolute", "deviation")

#: The forms of the sweep, by the name under which they are stored.
FORMS = {"hung": Form.HUNG, "innovation": Form.INNOVATION}

#: True drift rates less the predicted ones, mas/yr: 6606.1 - 6601.8 and 39.2 - 37.2, the measured differences.
DEVIATION = (4.3, 2.0)

#: The reference: the innovation form in float64.
REFERENCE = FloatFormat(2, 53)

SEED = 1984
RECORDS = 100
_HERE = Path(__file__).parent
_ANGLES = 4  # two drift angles, two rates
_SAVED_EACH = 16  # blocks


@dataclass(frozen=True)
class Cell:
    """Some formats of one base, for the same records: they share measurements and reference."""

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
        return (*self._head(self.precisions[0]), str(self.first))

    def _head(self, precision: int) -> tuple[str, ...]:
        return self.states, str(self.base), self.rounding, self.form, str(precision)

    def heads(self) -> list[tuple[str, ...]]:
        """The first columns of the rows of each format."""
        return [self._head(precision) for precision in self.precisions]


def _cells() -> tuple[Cell, ...]:
    absolute, deviation = STATES
    cells = [
        Cell(absolute, 2, "nearest", "hung", (31, 32, 33, 34)),
        Cell(deviation, 2, "nearest", "hung", (24, 25, 26, 27)),
        Cell(deviation, 10, "nearest", "innovation", (8, 9)),
        Cell(absolute, 10, "nearest", "innovation", (10, 11)),
        Cell(deviation, 2, "nearest", "hung", (25, 26), 100, 200),
        Cell(absolute, 2, "nearest", "hung", (33, 34), 100, 200),
        Cell(absolute, 2, "nearest", "hung", (28, 29, 30, 35, 36)),
        Cell(deviation, 2, "nearest", "hung", (22, 23, 28, 29, 30)),
        Cell(absolute, 2, "chop", "hung", (34, 36, 38)),
        Cell(deviation, 2, "chop", "hung", (28, 30, 32)),
        Cell(absolute, 2, "nearest", "innovation", (32, 33, 34)),
        Cell(deviation, 2, "nearest", "innovation", (24, 25, 26)),
        Cell(absolute, 10, "nearest", "innovation", (8, 9)),
        Cell(deviation, 10, "nearest", "innovation", (10, 11)),
        Cell(absolute, 10, "nearest", "hung", (10, 11)),
        Cell(deviation, 10, "nearest", "hung", (8, 9)),
    ]
    return tuple(cells)


#: All cells, the most valuable first.
CELLS = _cells()


def simulation(states: str, record: int) -> Simulation:
    """Measurements of one record; for deviations, the predicted drift has been subtracted from the truth."""
    if states not in STATES:
        raise ValueError(f"got states {states!r}; needed one of {', '.join(STATES)}")
    start = TRUTH if states == "absolute" else (*TRUTH[:2], *DEVIATION, *TRUTH[4:])
    return Simulation(model(MODELS[0], 2), start, SEED + record, resolution=1.0)


class Years:
    """Years of a cell on their way, in lockstep: measurements and reference are computed once for all formats.

    Parameters
    ----------
    steps : fewer than a year for a trial.
    """

    def __init__(self, cell: Cell, steps: int = YEAR) -> None:
        self.cell, self.steps, self.block = cell, steps, 0
        told = model(MODELS[0], cell.base)
        self.sources = [simulation(cell.states, record) for record in range(cell.first, cell.first + cell.count)]
        self.truth = np.array([source.start for source in self.sources])
        self.reference = Records(told, REFERENCE, Form.INNOVATION, cell.count)
        self.runs = [
            Records(told, FloatFormat(cell.base, t, Rounding(cell.rounding)), FORMS[cell.form], cell.count)
            for t in cell.precisions
        ]
        count = len(cell.precisions)
        self.largest = np.zeros((count, _ANGLES, cell.count))
        self.end = np.zeros((count, _ANGLES, cell.count))
        self.seconds = np.zeros(count + 2)  # of the measurements, the reference and each format

    @property
    def finished(self) -> bool:
        return self.block * BLOCK >= self.steps

    def go_on(self) -> None:
        """Take one block of measurements."""
        start = time.process_time()
        done = self.block * BLOCK
        length = min(BLOCK, self.steps - done)
        z = np.empty((length, self.reference.model.m, self.cell.count))
        for i, source in enumerate(self.sources):
            z[:, :, i], self.truth[i] = source.block(self.block, self.truth[i], length)
        start = self._timed(0, start)
        true = self.reference.carry(z, _ANGLES)
        start = self._timed(1, start)
        for i, run in enumerate(self.runs):
            computed = run.carry(z, _ANGLES)
            update_largest(computed, true, self.largest[i])
            self.end[i] = computed[-1] - true[-1]
            start = self._timed(i + 2, start)
        self.block += 1

    def _timed(self, place: int, start: float) -> float:
        now = time.process_time()
        self.seconds[place] += now - start
        return now

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {"truth": self.truth, "largest": self.largest, "end": self.end, "seconds": self.seconds}
        for i, run in enumerate((self.reference, *self.runs)):
            arrays |= {f"{name}_{i}": getattr(run, name) for name in ("x", "P", "notes")}
        return arrays

    def save(self, file: Path) -> None:
        """Write all of it, or nothing."""
        draft = file.with_suffix(".draft.npz")
        told = {"cell": np.array(repr(self.cell)), "block": np.array(self.block), "steps": np.array(self.steps)}
        np.savez(draft, allow_pickle=False, **self._arrays(), **told)
        draft.replace(file)

    def restore(self, file: Path) -> None:
        """Go back to where a cell was saved, if it was."""
        if not file.exists():
            return
        with np.load(file) as saved:
            if str(saved["cell"]) == repr(self.cell) and int(saved["steps"]) == self.steps:
                for name, array in self._arrays().items():
                    array[...] = saved[name]
                self.block = int(saved["block"])

    def result(self) -> dict[str, Any]:
        """Largest errors of the year and errors at its end, of each format and record."""
        return {
            "largest": self.largest.tolist(),
            "end": self.end.tolist(),
            "indefinite": [run.indefinite or 0 for run in self.runs],
            "seconds": self.seconds.tolist(),
        }


def compute(cell: Cell, directory: Path | None = None, steps: int = YEAR) -> dict[str, Any]:
    """Run the years of a cell, and save them on the way if there is a directory."""
    file = None if directory is None else directory / f"{hash_of(cell):08x}.npz"
    years = Years(cell, steps)
    if file is not None:
        years.restore(file)
    total = -(-steps // BLOCK)
    name = f"{cell.states} {cell.base} {cell.form} {cell.precisions}"
    for number in tqdm(range(years.block, total), desc=name, initial=years.block, total=total, disable=file is None):
        years.go_on()
        if file is not None and number % _SAVED_EACH == _SAVED_EACH - 1:
            years.save(file)
    if file is not None:
        file.unlink(missing_ok=True)
    return years.result()


def hash_of(cell: Cell) -> int:
    """The same number for the same cell in every process."""
    return zlib.crc32(repr(cell).encode())


def rows(cell: Cell, result: dict[str, Any]) -> list[tuple[str, ...]]:
    """Rows of the table: for each format and record, largest error of the year and error at its end."""
    lines = []
    for head, largest, end in zip(cell.heads(), np.array(result["largest"]), np.array(result["end"]), strict=True):
        # NaN or infinity: the filter stopped.
        numbers = np.nan_to_num(
            np.stack([largest[:2].max(0), largest[2:].max(0), np.abs(end[:2]).max(0), np.abs(end[2:]).max(0)], axis=1),
            nan=np.inf,
        )
        lines += [
            (*head, str(cell.first + i), *(f"{value:.6g}" for value in line)) for i, line in enumerate(numbers.tolist())
        ]
    return lines


def sample(cell: Cell, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """The row of one format and record, computed alone."""
    precision, record = int(rng.choice(cell.precisions)), cell.first + int(rng.integers(cell.count))
    one = replace(cell, precisions=(precision,), first=record, count=1)
    return rows(one, compute(one))


COLUMNS = (
    Column("states", "text", choices=STATES),
    Column("base", "integer", 2, 16),
    Column("rounding", "text", choices=tuple(rounding.value for rounding in Rounding)),
    Column("form", "text", choices=tuple(FORMS)),
    Column("precision", "integer", 1, 53),
    Column("record", "integer", 0, 9999),
    *(Column(name, low=0) for name in ("drift", "rate", "drift_end", "rate_end")),
)

SWEEP: Sweep[Cell] = Sweep(
    name="kalman/threshold",
    file=_HERE / "threshold.csv",
    columns=COLUMNS,
    key=6,
    cells=lambda: CELLS,
    compute=compute,
    rows=rows,
    command="python -m gpbnb.kalman.threshold",
    seed=SEED,
    sample=sample,
)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog=SWEEP.command, description="A year for hundreds of measurement records.")
    parser.add_argument("--directory", type=Path, default=Path(".cache/threshold"), help="where progress is saved")
    parser.add_argument("--cells", type=int, default=len(CELLS), help="only so many of the cells")
    parser.add_argument("--store", action="store_true", help="store the finished cells, and compute nothing")
    given = parser.parse_args(arguments)
    if not given.store:
        try:
            SWEEP.run(given.directory, cells=CELLS[: given.cells])
        except KeyboardInterrupt:
            print(f"interrupted; the same command goes on from what is saved in {given.directory}", file=sys.stderr)
            return 130
    SWEEP.store(SWEEP.finished(given.directory), SWEEP.seconds(given.directory))
    return 0


if __name__ == "__main__":
    sys.exit(main())
