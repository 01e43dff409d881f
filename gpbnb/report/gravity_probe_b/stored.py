"""The stored years of Gravity Probe B as a sweep, which can be recomputed and verified.

The command of :mod:`gpbnb.report.gravity_probe_b.year` writes them.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

from gpbnb.filters.emulation import emulate
from gpbnb.filters.run import Checkpoints, reference
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.year_cases import CASES, Case, checkpoint_steps, model, simulation
from gpbnb.report.kalman.stored import rows
from gpbnb.sweeps import Sweep

HERE = Path(__file__).parent


#: Steps of a year that a sample recomputes, about eleven days.
SAMPLE_STEPS = 100_000


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


YEAR: Sweep[Case] = Sweep(
    name="kalman/year",
    file=HERE / "year.csv",
    columns=year.COLUMNS,
    key=6,
    cells=lambda: CASES,
    compute=first_steps,
    rows=rows,
    command="python -m gpbnb.report.gravity_probe_b.year",
    seed=1984,
    sample=sample_of_year,
    same=same_errors,
)
