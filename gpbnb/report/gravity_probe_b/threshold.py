"""Find how many digits a year needs, and with what probability, from many measurement records in each format.

There are two sweeps. The year of the simple model is that of :mod:`gpbnb.report.gravity_probe_b.year`: 3,153,600 steps,
measurements in whole milliarcseconds; record 0 is the one of that module. The other runs the year of
:mod:`gpbnb.report.gravity_probe_b.mission` in each of its settings. The errors are differences between the rounded
filter and the same filter in float64, at every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.search import least_from_which_on
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.filters.simulation import BLOCK, Simulation
from gpbnb.report.gravity_probe_b.mission import SETTINGS, Mission
from gpbnb.report.gravity_probe_b.model import TRUTH, YEAR
from gpbnb.report.gravity_probe_b.year import MODELS, model
from gpbnb.report.stored_table import Column, StoredTable
from gpbnb.report.sweep import Sweep

#: States of the filter, either drift angles and rates or their deviations from the predicted drift.
STATES = ("absolute", "deviation")

#: The forms of the sweep, by the name under which they are stored.
FORMS = {"hung": Form.HUNG, "innovation": Form.INNOVATION}

#: True minus predicted drift rates in mas/yr, from the measured differences 6606.1 - 6601.8 and 39.2 - 37.2.
DEVIATION = (4.3, 2.0)

ANGLES, DECIMALS = 4, 4
"""Number of first states that are compared, two angles and two rates; decimals of measurement matrices in base 10."""
SEED, MISSION_SEED = 1984, 2004


@dataclass(frozen=True)
class SimpleYear:
    """Measurements of the simple model; for deviations, the predicted drift has been subtracted from the truth."""

    states: str
    steps = YEAR

    @property
    def start(self) -> tuple[float, ...]:
        """Return the truth at step 0."""
        return TRUTH if self.states == "absolute" else (*TRUTH[:2], *DEVIATION, *TRUTH[4:])

    def model(self, base: int) -> LinearModel:
        """Return the filter's model as stored in a base."""
        return model(MODELS[0], base)

    def matrices(self, block: int, base: int) -> None:
        """Return None, because the model has the matrices."""

    @cache  # noqa: B019 — both years stay
    def simulation(self, record: int) -> Simulation:
        """Return the measurements of one record."""
        return Simulation(model(MODELS[0], 2), self.start, SEED + record, resolution=1.0)

    def measurements(
        self, record: int, block: int, truth: NDArray[np.float64], H: NDArray[np.float64] | None, steps: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return measurements of a block, (steps, 2), and the truth after them."""
        return self.simulation(record).block(block, truth, steps)


# -- the sweeps ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class YearCell:
    """Several formats of one base for the same records of a year, which share measurements and reference.

    Parameters
    ----------
    setting : a setting of the mission model, or an empty text for the simple model.
    states, base, rounding, form, precisions : the filter and its formats.
    first, count : the first record and the number of records.
    """

    setting: str
    states: str
    base: int
    rounding: str
    form: str
    precisions: tuple[int, ...]
    first: int = 0
    count: int = 100

    def heads(self) -> list[tuple[str, ...]]:
        """Return the first columns of the rows of each format; the simple model has no column for a setting."""
        head = *filter(None, (self.setting,)), self.states, str(self.base), self.rounding, self.form
        return [(*head, str(precision)) for precision in self.precisions]

    @property
    def year(self) -> SimpleYear | Mission:
        """Return the model whose measurements the filters see."""
        if not self.setting:
            return SimpleYear(self.states)
        return replace(SETTINGS[self.setting], deviations=self.states == "deviation")


def _simple_cells() -> tuple[YearCell, ...]:
    absolute, deviation = STATES
    cell = partial(YearCell, "")
    return (
        cell(absolute, 2, "nearest", "hung", (31, 32, 33, 34)),
        cell(deviation, 2, "nearest", "hung", (24, 25, 26, 27)),
        cell(deviation, 10, "nearest", "innovation", (8,), 0, 30),
        cell(absolute, 10, "nearest", "innovation", (10,), 0, 30),
        cell(deviation, 2, "chop", "hung", (30,), 0, 30),
        cell(deviation, 2, "nearest", "hung", (26,), 100, 200),
        cell(absolute, 2, "nearest", "hung", (33,), 100, 200),
        cell(absolute, 2, "chop", "hung", (36,), 0, 30),
        cell(absolute, 10, "nearest", "innovation", (9, 11), 0, 30),
        cell(deviation, 10, "nearest", "innovation", (7, 9), 0, 30),
        cell(absolute, 2, "chop", "hung", (34, 35), 0, 30),
        cell(deviation, 2, "chop", "hung", (29,), 0, 30),
        cell(deviation, 10, "nearest", "innovation", (8,), 30, 270),
        cell(absolute, 2, "nearest", "hung", (28, 29, 30, 35, 36)),
        cell(deviation, 2, "nearest", "hung", (22, 23, 28, 29, 30)),
        cell(deviation, 2, "chop", "hung", (29, 30), 30, 70),
        cell(absolute, 2, "chop", "hung", (34, 35, 36), 30, 70),
        cell(absolute, 10, "nearest", "innovation", (9, 10, 11), 30, 70),
        cell(deviation, 10, "nearest", "innovation", (7, 9), 30, 70),
        cell(absolute, 10, "nearest", "innovation", (8,)),
        cell(deviation, 10, "nearest", "innovation", (10, 11)),
    )


def _mission_cells() -> tuple[YearCell, ...]:
    usual, flown = next(iter(SETTINGS)), "steps and roll as flown"
    others = ("no occultation", "no annual aberration", "a tenth of the readout noise")
    absolute, deviation = STATES
    return (
        YearCell(usual, deviation, 2, "nearest", "hung", (25, 26, 27), 0, 30),
        YearCell(usual, absolute, 2, "nearest", "hung", (32, 33, 34), 0, 30),
        YearCell("white noise only", deviation, 2, "nearest", "hung", (26,), 0, 10),
        YearCell("known roll phase", deviation, 2, "nearest", "hung", (26,), 0, 10),
        YearCell(usual, deviation, 2, "nearest", "hung", (27,), 30, 270),
        YearCell(usual, absolute, 2, "nearest", "hung", (31,), 0, 30),
        YearCell(usual, absolute, 2, "nearest", "hung", (32,), 30, 270),
        *(YearCell(setting, deviation, 2, "nearest", "hung", (26,), 0, 10) for setting in others),
        YearCell(usual, deviation, 2, "nearest", "innovation", (26,), 0, 10),
        YearCell(usual, deviation, 2, "chop", "hung", (30,), 0, 10),
        YearCell(usual, deviation, 10, "nearest", "innovation", (8, 9), 0, 10),
        YearCell(usual, absolute, 10, "nearest", "innovation", (10, 11), 0, 10),
        YearCell(flown, deviation, 2, "nearest", "hung", (26,), 0, 5),
        YearCell(flown, deviation, 2, "nearest", "hung", (27, 28, 29), 0, 10),
        YearCell(usual, deviation, 2, "nearest", "hung", (25, 26), 30, 70),
        YearCell(usual, absolute, 2, "nearest", "hung", (31, 33), 30, 70),
    )


SIMPLE_CELLS, MISSION_CELLS = _simple_cells(), _mission_cells()
"""All cells of each sweep, the most valuable first. If 299 records all pass, they show a probability of 99 %."""


class Lockstep:
    """The filters of a cell, one for each format, and their reference, the innovation form in float64."""

    def __init__(self, cell: YearCell, steps: int | None = None) -> None:
        self.cell, self.year, self.steps = cell, cell.year, steps or cell.year.steps
        model, count = self.year.model(cell.base), cell.count
        self.truth = np.tile(np.array(self.year.start), (count, 1))
        self.reference = Run(model, FloatFormat(2, 53), Form.INNOVATION, (), records=count)
        formats = (FloatFormat(cell.base, t, Rounding(cell.rounding)) for t in cell.precisions)
        self.runs = [Run(model, fmt, FORMS[cell.form], (), records=count) for fmt in formats]
        self.largest, self.end = (np.zeros((len(self.runs), ANGLES, count)) for _ in range(2))

    def advance(self, block: int) -> None:
        """Take one block of measurements."""
        H, length = self.year.matrices(block, 2), min(BLOCK, self.steps - block * BLOCK)
        z = np.empty((length, self.reference.model.m, self.cell.count))
        for i, truth in enumerate(self.truth):
            z[:, :, i], self.truth[i] = self.year.measurements(self.cell.first + i, block, truth, H, length)
        if self.cell.base != 2:
            H = self.year.matrices(block, self.cell.base)
        if H is not None:
            for run in (self.reference, *self.runs):
                run.use_measurement_matrices(H, DECIMALS)
        true = self.reference.carry(z, ANGLES)
        for run, largest, end in zip(self.runs, self.largest, self.end, strict=True):
            computed = run.carry(z, ANGLES)
            raise_largest(largest, computed - true)
            end[:] = computed[-1] - true[-1]


def raise_largest(largest: NDArray[np.float64], errors: NDArray[np.float64]) -> None:
    """Raise the largest errors (states, records) to those of some steps; NaN counts as infinite."""
    np.maximum(largest, np.nan_to_num(np.abs(errors), nan=np.inf, posinf=np.inf).max(axis=0), out=largest)


def compute(cell: YearCell, steps: int | None = None) -> dict[str, Any]:
    """Run the years of a cell; return the largest errors and those at the end, by format, state and record."""
    years = Lockstep(cell, steps)
    for block in tqdm(range(-(-years.steps // BLOCK)), repr(cell), disable=None):
        years.advance(block)
    return {"largest": years.largest.tolist(), "end": years.end.tolist()}


def rows(cell: YearCell, result: dict[str, Any]) -> list[tuple[str, ...]]:
    """List, for each format and record, the largest error of the year and the error at its end."""
    lines = []
    for head, largest, end in zip(cell.heads(), np.array(result["largest"]), np.abs(result["end"]), strict=True):
        numbers = np.stack([largest[:2].max(0), largest[2:].max(0), end[:2].max(0), end[2:].max(0)], axis=1)
        numbers = np.nan_to_num(numbers, nan=np.inf)  # the filter stopped
        lines += [
            (*head, str(cell.first + i), *(f"{value:.6g}" for value in line)) for i, line in enumerate(numbers.tolist())
        ]
    return lines


def sample(cell: YearCell, rng: np.random.Generator) -> list[tuple[str, ...]]:
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
MISSION_COLUMNS = (Column("setting", "text", choices=tuple(SETTINGS)), *COLUMNS)


def _sweep(name: str, columns: tuple[Column, ...], cells: tuple[YearCell, ...], seed: int) -> Sweep[YearCell]:
    name, key = f"gravity_probe_b/{name}", len(columns) - 4
    return Sweep(name, columns, key, lambda: cells, compute, seed, rows=rows, sample=sample)


SWEEP = _sweep("threshold", COLUMNS, SIMPLE_CELLS, SEED)
MISSION_SWEEP = _sweep("mission", MISSION_COLUMNS, MISSION_CELLS, MISSION_SEED)


# -- shares, confidence, and the precision needed ----------------------------------------------------


class Share(NamedTuple):
    """Largest errors of a year in one format over many records, in mas and mas/yr, and how many meet the tolerance."""

    setting: str
    states: str
    form: str
    fmt: FloatFormat
    errors: NDArray[np.float64]
    within: int

    @property
    def records(self) -> int:
        """Number of records."""
        return len(self.errors)


def shares(table: StoredTable) -> tuple[Share, ...]:
    """Return, for each format, the share of records that stay within 1 mas and 1 mas/yr throughout the year.

    Parameters
    ----------
    table : table with the columns of ``COLUMNS``, and possibly a column `setting` before them.
    """
    groups: dict[tuple[str, ...], list[float]] = {}
    for row in table.records():
        key = (row.get("setting", "simple"), row["states"], row["form"], row["base"], row["precision"], row["rounding"])
        groups.setdefault(key, []).append(max(float(row["drift"]), float(row["rate"])))
    found = []
    for (setting, states, form, base, precision, rounding), group in groups.items():
        errors = np.array(group)
        within = int((errors <= 1).sum())
        fmt = FloatFormat(int(base), int(precision), Rounding(rounding))
        found.append(Share(setting, states, form, fmt, errors, within))
    return tuple(sorted(found, key=_order))


def _order(share: Share) -> tuple[object, ...]:
    fmt = share.fmt
    return share.setting, share.states, fmt.base, fmt.rounding.value, share.form, fmt.precision


def needed(found: Sequence[Share], probability: float = 0.99) -> int | MaybeNone:
    """Find the smallest precision from which on, in every format that was run, so many records meet the tolerance.

    Parameters
    ----------
    found : shares for formats of one base, rounding, form and choice of states.
    """
    kinds = {(each.setting, each.states, each.form, each.fmt.base, each.fmt.rounding) for each in found}
    if len(kinds) != 1:
        raise ValueError(f"got formats of {len(kinds)} kinds; needed formats of one kind")
    return least_from_which_on({each.fmt.precision: each.within >= probability * each.records for each in found})
