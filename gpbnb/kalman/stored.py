"""The stored sweeps of the Kalman filter, which can be recomputed and verified.

The commands of :mod:`gpbnb.kalman.year` and :mod:`gpbnb.kalman.ensembles` write the first two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gpbnb.kalman import ensembles, mission_runs, threshold, year
from gpbnb.kalman.emulation import emulate
from gpbnb.kalman.filter_run import Checkpoints, reference
from gpbnb.kalman.guarantee import filters, scalar
from gpbnb.kalman.year_cases import CASES, Case, checkpoint_steps, model, simulation
from gpbnb.sweeps import Sweep

HERE = Path(__file__).parent

#: Steps of a year that a sample recomputes, about eleven days.
SAMPLE_STEPS = 100_000


def rows(cell: Any, result: Sequence[Any]) -> list[tuple[str, ...]]:
    """Return rows as computed; a saved result has lists in place of tuples."""
    return [tuple(row) for row in result]


def first_steps(case: Case, directory: Path | None = None, steps: int = SAMPLE_STEPS) -> list[tuple[str, ...]]:
    """Return the rows of a year up to some step."""
    chosen = tuple(step for step in checkpoint_steps() if step <= steps)
    z = simulation(case.model).measurements(chosen[-1])
    fmt = case.fmt
    if fmt is None:
        raise ValueError(f"got {case}, a reference; needed a case with a format")
    given = model(case.model, case.base)
    return year.rows(case, emulate(given, z, fmt, case.form, chosen, _true(case.model, case.base, chosen)))


@cache
def _true(name: str, base: int, chosen: tuple[int, ...]) -> Checkpoints:
    return reference(model(name, base), simulation(name).measurements(chosen[-1]), chosen)


def sample_of_year(case: Case, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows of the first eleven days."""
    return first_steps(case)


def same_errors(stored: tuple[str, ...], computed: tuple[str, ...]) -> bool:
    """Whether two rows of a year agree, apart from the last digits of an eigenvalue, which depend on LAPACK."""
    return stored[:-1] == computed[:-1] and math.isclose(
        float(stored[-1]), float(computed[-1]), rel_tol=1e-4, abs_tol=1e-12
    )


def trials_of_seed(seed: int, directory: Path | None = None) -> list[tuple[str, ...]]:
    """Return the rows for one seed of the random filters."""
    todo = ensembles.tasks(1, first_seed=seed)
    return ensembles.lines(seed, ensembles.sweep(todo, batch=len(todo)))


YEAR: Sweep[Case] = Sweep(
    name="kalman/year",
    file=HERE / "year.csv",
    columns=year.COLUMNS,
    key=6,
    cells=lambda: CASES,
    compute=first_steps,
    rows=rows,
    command="python -m gpbnb.kalman.year",
    seed=1984,
    sample=sample_of_year,
    same=same_errors,
)

ENSEMBLES: Sweep[int] = Sweep(
    name="kalman/ensembles",
    file=HERE / "ensembles.csv",
    columns=ensembles.COLUMNS,
    key=3,
    cells=lambda: range(ensembles.REPEATS),
    compute=trials_of_seed,
    rows=rows,
    command=ensembles.COMMAND,
    seed=0,
)


def stored() -> tuple[Sweep[Any], ...]:
    """Return all stored sweeps of the chapter."""
    added: tuple[Sweep[Any], ...] = (threshold.SWEEP, mission_runs.SWEEP, filters.SWEEP, scalar.SWEEP)
    later = tuple(each for each in added if each.file.exists())
    return (YEAR, ENSEMBLES, *later)
