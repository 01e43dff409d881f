"""The stored sweeps over inverses, which can be recomputed and verified."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from gpbnb.report.inversion import experiment
from gpbnb.report.inversion.experiment import Cell, Sample
from gpbnb.sweeps import Sweep


def compute(cell: Cell, directory: Path | None = None, *, names: Sequence[str]) -> dict[str, Any]:
    """Compute a cell and return the attributes of its sample."""
    return vars(experiment.cell_sample(cell, names))


def restored(result: dict[str, Any], names: Sequence[str]) -> Sample:
    """Return the sample with these attributes."""
    sample = Sample(names)
    vars(sample).update(result)
    return sample


def rows(cell: Cell, result: dict[str, Any], *, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the rows of a cell, one for each bound."""
    return [tuple(row.values()) for row in experiment.cell_rows(cell, restored(result, names))]


def sums(results: Sequence[tuple[Cell, dict[str, Any]]], *, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the rows of all cells together and of each family."""
    samples = [(cell, restored(result, names)) for cell, result in results]
    return [tuple(row.values()) for row in experiment.sum_rows(samples, names)]


def sweep(name: str) -> Sweep[Cell]:
    """Return one of the sweeps of :data:`gpbnb.report.inversion.experiment.SWEEPS`."""
    cells, names = experiment.SWEEPS[name]
    return Sweep(
        name=f"inversion/{name}",
        file=Path(__file__).with_name(f"{name}.csv"),
        columns=experiment.COLUMNS,
        key=5,
        cells=cells,
        compute=partial(compute, names=names),
        rows=partial(rows, names=names),
        command=f"python -m gpbnb.report.inversion {name}",
        seed=experiment.SEED,
        summary=partial(sums, names=names),
        packages=("numpy", "numba", "python-flint"),
    )


def stored() -> tuple[Sweep[Cell], ...]:
    """Return all sweeps of the chapter."""
    return tuple(sweep(name) for name in experiment.SWEEPS)
