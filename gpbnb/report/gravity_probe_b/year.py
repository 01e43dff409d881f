"""A year of Gravity Probe B, 3,153,600 steps, in many formats and forms.

In one base, all formats use the same numbers. The model is stored once, in 14 bits or 4 decimal digits, and
measurements are whole milliarcseconds. So one reference serves all formats, and errors come only from the arithmetic.

The results are stored next to this file, in ``year.csv`` and ``bounds.csv``; :func:`load` and :func:`bounds` read them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.emulation import History, emulate
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, log_spaced, reference
from gpbnb.filters.simulation import Simulation
from gpbnb.report.gravity_probe_b.model import SEED, YEAR, gravity_probe_b, gravity_probe_b_year
from gpbnb.report.stored_table import Column
from gpbnb.report.sweep import Sweep

#: Format in which the model is stored, by base; every format of this base in :data:`CASES` contains it.
STORED = {2: FloatFormat(2, 14), 10: FloatFormat(10, 4)}

#: The models, with roll periods of 600 s as in the reports, 77.5 s as flown, and 600 s without process noise.
MODELS = ("roll 600 s", "roll 77.5 s", "no process noise")

#: Steps of a year that a sample recomputes, about eleven days, and those of a bound.
SAMPLE_STEPS, SAMPLE_OF_BOUND = 100_000, 464


class YearCase(NamedTuple):
    """One run of the year; a precision of 0 stands for the reference in double-double."""

    model: str
    base: int
    precision: int
    rounding: Rounding
    form: Form

    @property
    def fmt(self) -> FloatFormat | MaybeNone:
        """The format of the run; None for double-double."""
        return FloatFormat(self.base, self.precision, self.rounding) if self.precision else None

    @property
    def reference(self) -> YearCase:
        """The case that serves as the reference for this one."""
        return YearCase(self.model, self.base, 0, Rounding.NEAREST, Form.INNOVATION)


def _cases() -> tuple[YearCase, ...]:
    usual, flown, noiseless = MODELS
    nearest, chop = Rounding.documented()
    others = (Form.INNOVATION, Form.JOSEPH, Form.UD)
    cases = [YearCase(usual, 2, t, nearest, Form.HUNG) for t in (24, 18, 32, 14, 20, 53)]
    cases += [YearCase(usual, 2, t, chop, Form.HUNG) for t in (24, 18, 32)]
    cases += [YearCase(usual, 2, 24, nearest, form) for form in others]
    cases += [YearCase(usual, 10, 8, nearest, Form.HUNG), YearCase(usual, 10, 6, nearest, Form.HUNG)]
    cases += [YearCase(flown, 2, 24, nearest, Form.HUNG), YearCase(noiseless, 2, 24, nearest, Form.HUNG)]
    cases += [YearCase(usual, 2, t, nearest, Form.HUNG) for t in (22, 28)]
    cases += [YearCase(usual, 2, 18, nearest, form) for form in others]
    cases += [YearCase(usual, 2, 24, nearest, Form.HUNG_SECOND_GAIN), YearCase(usual, 10, 8, chop, Form.HUNG)]
    cases += [YearCase(usual, 10, 8, nearest, Form.UD), YearCase(usual, 10, 10, nearest, Form.HUNG)]
    cases += [YearCase(usual, 2, 24, chop, form) for form in others]
    cases += [YearCase(usual, 10, 8, nearest, form) for form in others[:2]]
    cases += [YearCase(usual, 10, 4, nearest, Form.HUNG), YearCase(usual, 10, 16, nearest, Form.HUNG)]
    cases += [YearCase(usual, 2, t, nearest, Form.HUNG) for t in (16, 26, 40)]
    cases += [YearCase(usual, 2, t, chop, Form.HUNG) for t in (14, 20, 28, 53)]
    cases += [YearCase(usual, 2, 53, nearest, form) for form in others]
    # Neighbours of the smallest precisions that meet a milliarcsecond a year, or the report's criterion.
    cases += [
        YearCase(usual, 10, 9, nearest, Form.HUNG),
        *(YearCase(usual, 2, t, nearest, Form.HUNG) for t in (31, 33, 19)),
    ]
    return tuple(cases)


#: All runs, the most informative first.
CASES = _cases()

#: Runs with their own contraction bound, the references of the first model, from which the other bounds follow.
BOUNDED_CASES = tuple(YearCase(MODELS[0], base, 0, Rounding.NEAREST, Form.INNOVATION) for base in STORED)


@cache
def model(name: str, base: int) -> LinearModel:
    """Return one of :data:`MODELS` as stored in a base."""
    roll = "77.5" if name == MODELS[1] else "600"
    return gravity_probe_b(roll, process_noise=name != MODELS[2]).rounded(STORED[base])


@cache
def simulation(name: str) -> Simulation:
    """Return the simulated measurements, the same for both bases; the truth follows the model of base 2."""
    return gravity_probe_b_year(model(name, 2))


def checkpoint_steps(steps: int = YEAR) -> tuple[int, ...]:
    """Return the checkpoints of a year up to some step, three per decade."""
    return tuple(step for step in log_spaced(YEAR, 3) if step <= steps)


# -- what is computed ---------------------------------------------------------------------------------


def rows(case: YearCase, steps: int = YEAR) -> list[tuple[str, ...]]:
    """Return the rows of a case in ``year.csv`` up to some step, with six significant digits."""
    chosen = checkpoint_steps(steps)
    z, true = _reference(case.reference, chosen)
    found = emulate(model(case.model, case.base), z, case.fmt, case.form, chosen, true)
    return _written(case, found.steps.tolist(), np.column_stack([found.state[:, :4], *norms(found)]))


def norms(found: History) -> list[NDArray[np.float64]]:
    """Return norms of errors after each step: (21) of the state, (22) of gain and covariance relative to the true ones.

    The last number is the least eigenvalue of the symmetric part of the covariance, in units of the true variances.
    """
    K, P = (found.reference.to_float(letter)[: len(found.steps)] for letter in "KP")
    scale = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    scaled = (P + found.covariance) / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
    least = np.linalg.eigvalsh((scaled + np.swapaxes(scaled, 1, 2)) / 2)[:, 0]
    return [np.abs(found.state).max(axis=1), relative(found.gain, K), relative(found.covariance, P), least]


def relative(error: NDArray[np.float64], true: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return norms (22) of errors over norms of the true matrices, (c,)."""
    size = np.abs(true[: len(error)]).sum(axis=1).max(axis=1)
    return np.asarray(np.abs(error).sum(axis=1).max(axis=1) / size)


@cache
def _reference(case: YearCase, chosen: tuple[int, ...]) -> tuple[NDArray[np.float64], Checkpoints]:
    """Return the measurements up to the last of some steps, and the checkpoints of the filter without rounding."""
    z = simulation(case.model).measurements(chosen[-1])
    return z, reference(model(case.model, case.base), z, chosen)


def bound_rows(case: YearCase, steps: int = YEAR) -> list[tuple[str, ...]]:
    """Return the rows of a reference in ``bounds.csv``, with six significant digits, rounded upwards.

    The errors of a run without its own bound are at most its distance from the reference plus the reference's bound:
    :func:`gpbnb.filters.contraction.companion_bound`.
    """
    chosen = checkpoint_steps(steps)
    run = Run(model(case.model, case.base), None, case.form, chosen, bounded=True)
    run.take(simulation(case.model).measurements(chosen[-1]))
    true = run.checkpoints()
    states, gains, covariances = run.bounds
    others = relative(gains, true.to_float("K")), relative(covariances, true.to_float("P"))
    numbers = np.column_stack([states[:, :4], states.max(axis=1), *others]) * (1 + 1e-5)
    return _written(case, chosen, numbers)


def _written(case: YearCase, steps: Iterable[int], numbers: NDArray[np.float64]) -> list[tuple[str, ...]]:
    name = case.model, str(case.base), str(case.precision), case.rounding.value, case.form.name.lower()
    lines = zip(steps, numbers.tolist(), strict=True)
    return [(*name, str(step), *(f"{number:.6g}" for number in line)) for step, line in lines]


def _same(stored: tuple[str, ...], computed: tuple[str, ...]) -> bool:
    """Whether two rows of a year agree, apart from the last digits of an eigenvalue, which depend on LAPACK."""
    return stored[:-1] == computed[:-1] and math.isclose(
        float(stored[-1]), float(computed[-1]), rel_tol=1e-4, abs_tol=1e-12
    )


# -- what is stored -----------------------------------------------------------------------------------

BOUND_COLUMNS = (
    Column("model", "text", choices=MODELS),
    Column("base", "integer", 2, 16),
    Column("precision", "integer", 0, 53),
    Column("rounding", "text", choices=tuple(rounding.value for rounding in Rounding.documented())),
    Column("form", "text", choices=tuple(form.name.lower() for form in WITH_PROGRAM)),
    Column("step", "integer", 1, YEAR),
    *(Column(f"{name}_{axis}", low=0) for name in ("drift", "rate") for axis in (2, 3)),
    *(Column(name, low=0) for name in ("state", "gain", "covariance")),
)
"""Columns of ``bounds.csv``: drift angles in mas and their rates in mas/yr, the largest of any state in its unit, and
norms (22) of gain and covariance relative to the true values."""

COLUMNS = (
    *BOUND_COLUMNS[:6],
    *(Column(each.name) for each in BOUND_COLUMNS[6:10]),
    *BOUND_COLUMNS[10:],
    Column("least_eigenvalue"),
)
"""Columns of ``year.csv``, the errors in the same units. Those of drift have a sign. The last is the least eigenvalue
of the covariance, scaled to ones on the true diagonal; it is below zero for an indefinite one."""


class Year(NamedTuple):
    """Errors of a year in one format and form, or bounds of them, after each of the steps.

    Parameters
    ----------
    drift, rate : (c, 2), of the drift angles in mas and of their rates in mas/yr.
    """

    case: YearCase
    steps: NDArray[np.int64]
    drift: NDArray[np.float64]
    rate: NDArray[np.float64]


def _years(sweep: Sweep[YearCase], file: Path | None) -> tuple[Year, ...]:
    groups: dict[YearCase, list[Any]] = {}
    for row in sweep.load(file).rows:
        case = YearCase(row[0], int(row[1]), int(row[2]), Rounding(row[3]), Form[row[4].upper()])
        groups.setdefault(case, []).append(row[5:10])
    found = ((case, np.array(group, dtype=float)) for case, group in groups.items())
    return tuple(Year(case, each[:, 0].astype(np.int64), each[:, 1:3], each[:, 3:5]) for case, each in found)


@cache
def load(file: Path | None = None) -> tuple[Year, ...]:
    """Load the years that ship with the package, in the order of ``CASES``."""
    return _years(SWEEP, file)


@cache
def bounds() -> dict[YearCase, Year]:
    """Load the contraction bounds of ``BOUNDED_CASES`` that ship with the package."""
    return {each.case: each for each in _years(BOUND_SWEEP, None)}


SWEEP = Sweep(
    "gravity_probe_b/year",
    COLUMNS,
    6,
    lambda: CASES,
    rows,
    SEED,
    sample=lambda case, rng: rows(case, steps=SAMPLE_STEPS),
    same=_same,
)
BOUND_SWEEP = Sweep(
    "gravity_probe_b/bounds",
    BOUND_COLUMNS,
    6,
    lambda: BOUNDED_CASES,
    bound_rows,
    SEED,
    sample=lambda case, rng: bound_rows(case, steps=SAMPLE_OF_BOUND),
)
