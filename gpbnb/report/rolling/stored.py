"""The stored survey of drift rates as a sweep, which can be recomputed and verified."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gpbnb.report.rolling import experiment
from gpbnb.sweeps import Sweep


def compute(gyros: int, directory: Path | None = None) -> list[tuple[str, ...]]:
    """Simulate a year for each of several gyros; the noise of each does not depend on their number."""
    study = experiment.drift_rates(
        experiment.SURVEY_PERIODS, gyros, experiment.survey_rng(), progress=directory is not None
    )
    return experiment.survey_rows(study)


def rows(gyros: int, result: Sequence[Any]) -> list[tuple[str, ...]]:
    """Return the rows of the table; a saved result has lists in place of tuples."""
    return [tuple(row) for row in result]


def sample(gyros: int, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows of the first one to three gyros."""
    return compute(int(rng.integers(1, 4)))


SWEEP: Sweep[int] = Sweep(
    name="rolling/drift_rates",
    file=experiment.SURVEY,
    columns=experiment.SURVEY_COLUMNS,
    key=1,
    cells=lambda: (experiment.SURVEY_GYROS,),
    compute=compute,
    rows=rows,
    command="python -m gpbnb.report.rolling",
    seed=1984,
    sample=sample,
)
