"""Find how many digits a year needs, and with what probability, from many measurement records in each format.

``python -m gpbnb.report.gravity_probe_b.threshold`` computes the sweep and resumes where it was interrupted. The year
is that of :mod:`gpbnb.report.gravity_probe_b.year`: 3,153,600 steps, the simple model, measurements in whole
milliarcseconds. Record 0 is the one of that module. The errors are differences between the rounded filter and the same
filter in float64, at every step.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.lockstep import Lockstep, error_rows, run_lockstep
from gpbnb.filters.model import LinearModel
from gpbnb.filters.simulation import Simulation
from gpbnb.report.confidence import interval, quantile_limit
from gpbnb.report.gravity_probe_b.model import TRUTH, YEAR
from gpbnb.report.gravity_probe_b.year import MODELS, model
from gpbnb.sweeps import Column, Sweep, Table
from gpbnb.sweeps.command import run_command

#: States of the filter, either drift angles and rates or their deviations from the predicted drift.
STATES = ("absolute", "deviation")

#: The forms of the sweep, by the name under which they are stored.
FORMS = {"hung": Form.HUNG, "innovation": Form.INNOVATION}

#: True minus predicted drift rates in mas/yr, from the measured differences 6606.1 - 6601.8 and 39.2 - 37.2.
DEVIATION = (4.3, 2.0)

SEED = 1984
RECORDS = 100
_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Cell:
    """Several formats of one base for the same records, which share measurements and reference."""

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
        return (*self._head(self.precisions[0]), str(self.first))

    def _head(self, precision: int) -> tuple[str, ...]:
        return self.states, str(self.base), self.rounding, self.form, str(precision)

    def heads(self) -> list[tuple[str, ...]]:
        """Return the first columns of the rows of each format."""
        return [self._head(precision) for precision in self.precisions]


def _cells() -> tuple[Cell, ...]:
    absolute, deviation = STATES
    cells = [
        Cell(absolute, 2, "nearest", "hung", (31, 32, 33, 34)),
        Cell(deviation, 2, "nearest", "hung", (24, 25, 26, 27)),
        Cell(deviation, 10, "nearest", "innovation", (8,), 0, 30),
        Cell(absolute, 10, "nearest", "innovation", (10,), 0, 30),
        Cell(deviation, 2, "chop", "hung", (30,), 0, 30),
        Cell(deviation, 2, "nearest", "hung", (26,), 100, 200),
        Cell(absolute, 2, "nearest", "hung", (33,), 100, 200),
        Cell(absolute, 2, "chop", "hung", (36,), 0, 30),
        Cell(absolute, 10, "nearest", "innovation", (9, 11), 0, 30),
        Cell(deviation, 10, "nearest", "innovation", (7, 9), 0, 30),
        Cell(absolute, 2, "chop", "hung", (34, 35), 0, 30),
        Cell(deviation, 2, "chop", "hung", (29,), 0, 30),
        Cell(deviation, 10, "nearest", "innovation", (8,), 30, 270),
        Cell(absolute, 2, "nearest", "hung", (28, 29, 30, 35, 36)),
        Cell(deviation, 2, "nearest", "hung", (22, 23, 28, 29, 30)),
        Cell(deviation, 2, "chop", "hung", (29, 30), 30, 70),
        Cell(absolute, 2, "chop", "hung", (34, 35, 36), 30, 70),
        Cell(absolute, 10, "nearest", "innovation", (9, 10, 11), 30, 70),
        Cell(deviation, 10, "nearest", "innovation", (7, 9), 30, 70),
        Cell(absolute, 10, "nearest", "innovation", (8,)),
        Cell(deviation, 10, "nearest", "innovation", (10, 11)),
    ]
    return tuple(cells)


#: All cells, the most valuable first.
CELLS = _cells()


@dataclass(frozen=True)
class SimpleYear:
    """Measurements of the simple model; for deviations, the predicted drift has been subtracted from the truth."""

    states: str

    def __post_init__(self) -> None:
        if self.states not in STATES:
            raise ValueError(f"got states {self.states!r}; needed one of {', '.join(STATES)}")

    @property
    def start(self) -> tuple[float, ...]:
        """Return the truth at step 0."""
        return TRUTH if self.states == "absolute" else (*TRUTH[:2], *DEVIATION, *TRUTH[4:])

    def model(self, base: int) -> LinearModel:
        """Return the filter's model as stored in a base."""
        return model(MODELS[0], base)

    def matrices(self, block: int, base: int) -> None:
        """Return None, because the model has the matrices."""

    def simulation(self, record: int) -> Simulation:
        """Return the measurements of one record."""
        return _simulation(self.states, record)

    def measurements(
        self, record: int, block: int, truth: NDArray[np.float64], H: NDArray[np.float64] | None, steps: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return measurements of a block, (steps, 2), and the truth after them."""
        return self.simulation(record).block(block, truth, steps)


@cache
def _simulation(states: str, record: int) -> Simulation:
    return Simulation(model(MODELS[0], 2), SimpleYear(states).start, SEED + record, resolution=1.0)


def lockstep(cell: Cell, steps: int = YEAR) -> Lockstep:
    """Create all filters of a cell, before their first step."""
    formats = [FloatFormat(cell.base, t, Rounding(cell.rounding)) for t in cell.precisions]
    records = range(cell.first, cell.first + cell.count)
    return Lockstep(repr(cell), SimpleYear(cell.states), formats, FORMS[cell.form], records, steps)


def compute(cell: Cell, directory: Path | None = None, steps: int = YEAR) -> dict[str, Any]:
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


COLUMNS = (
    Column("states", "text", choices=STATES),
    Column("base", "integer", 2, 16),
    Column("rounding", "text", choices=tuple(rounding.value for rounding in Rounding.documented())),
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
    command="python -m gpbnb.report.gravity_probe_b.threshold",
    seed=SEED,
    sample=sample,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    return run_command(SWEEP, "A year for hundreds of measurement records.", Path(".cache/threshold"), arguments)


# -- shares, confidence, and the precision needed ----------------------------------------------------


class Share(NamedTuple):
    """Largest errors of a year in one format, over many records; in mas and mas/yr.

    `low` and `high` limit the probability that a record stays within the tolerance. `quantile_limit` is an upper limit
    of the 99 % quantile if the logarithms of the errors are normally distributed. Each limit is one-sided and has a
    confidence of 95 %.
    """

    setting: str
    states: str
    form: str
    fmt: FloatFormat
    errors: NDArray[np.float64]
    within: int
    low: float
    high: float
    quantile_limit: float

    @property
    def records(self) -> int:
        """Number of records."""
        return len(self.errors)

    def quantile(self, probability: float) -> float:
        """Return a quantile of the observed errors."""
        return float(np.quantile(self.errors, probability))


def shares(table: Table, tolerance: float = 1.0) -> tuple[Share, ...]:
    """Return, for each format, the share of records that stay within the tolerance throughout the year.

    Parameters
    ----------
    table : table with the columns of ``COLUMNS``, and possibly a column `setting` before them.
    tolerance : tolerance for the drift angles in mas and their rates in mas/yr, at every step.
    """
    groups: dict[tuple[str, ...], list[float]] = {}
    for row in table.records():
        key = (row.get("setting", "simple"), row["states"], row["form"], row["base"], row["precision"], row["rounding"])
        groups.setdefault(key, []).append(max(float(row["drift"]), float(row["rate"])))
    found = []
    for (setting, states, form, base, precision, rounding), group in groups.items():
        errors = np.array(group)
        within = int((errors <= tolerance).sum())
        fmt = FloatFormat(int(base), int(precision), Rounding(rounding))
        limits = interval(within, len(errors))
        found.append(Share(setting, states, form, fmt, errors, within, *limits, quantile_limit(errors)))
    return tuple(sorted(found, key=_order))


def _order(share: Share) -> tuple[object, ...]:
    fmt = share.fmt
    return share.setting, share.states, fmt.base, fmt.rounding.value, share.form, fmt.precision


class Needed(NamedTuple):
    """The smallest precisions of one base that meet a tolerance with a probability; None if no format does.

    For `observed`, the share of records within the tolerance is at least this probability. For `lognormal`, the upper
    limit of the quantile is within the tolerance. For `shown`, the lower limit of the probability, without an
    assumption about the distribution, is at least this probability; higher precisions may have fewer records but must
    not refute it.
    """

    observed: int | None
    lognormal: int | None
    shown: int | None


def needed(found: Sequence[Share], probability: float = 0.99, tolerance: float = 1.0) -> Needed:
    """Find the smallest precision from which on every format that was run meets the tolerance.

    Parameters
    ----------
    found : shares for formats of one base, rounding, form and choice of states.

    Raises
    ------
    ValueError : no formats, or formats of several kinds.
    """
    kinds = {(each.setting, each.states, each.form, each.fmt.base, each.fmt.rounding) for each in found}
    if len(kinds) != 1:
        raise ValueError(f"got formats of {len(kinds)} kinds; needed formats of one kind")

    def first(meets: Sequence[bool]) -> int | None:
        enough = None
        for share, met in sorted(zip(found, meets, strict=True), key=lambda pair: -pair[0].fmt.precision):
            if not met:
                break
            enough = share.fmt.precision
        return enough

    by_precision = sorted(found, key=lambda each: each.fmt.precision)
    refuted = [each.fmt.precision for each in by_precision if each.within < probability * each.records]
    shown = (each.fmt.precision for each in by_precision if each.low >= probability)
    return Needed(
        first([each.within >= probability * each.records for each in found]),
        first([each.quantile_limit <= tolerance for each in found]),
        next((each for each in shown if each > max(refuted, default=0)), None),
    )


if __name__ == "__main__":
    sys.exit(main())
