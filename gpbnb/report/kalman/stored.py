"""The stored sweep of random filters, which can be recomputed and verified.

The command of :mod:`gpbnb.report.kalman.ensembles` writes it.
"""

from __future__ import annotations

from pathlib import Path

from gpbnb.report.kalman import ensembles
from gpbnb.sweeps import Sweep, as_computed

HERE = Path(__file__).parent


def trials_of_seed(seed: int, directory: Path | None = None) -> list[tuple[str, ...]]:
    """Return the rows for one seed of the random filters."""
    todo = ensembles.tasks(1, first_seed=seed)
    return ensembles.lines(seed, ensembles.sweep(todo, batch=len(todo)))


ENSEMBLES: Sweep[int] = Sweep(
    name="kalman/ensembles",
    file=HERE / "ensembles.csv",
    columns=ensembles.COLUMNS,
    key=3,
    cells=lambda: range(ensembles.REPEATS),
    compute=trials_of_seed,
    rows=as_computed,
    command=ensembles.COMMAND,
    seed=0,
)
