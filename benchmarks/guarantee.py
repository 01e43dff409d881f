"""Time guarantees for all time: ``python -m benchmarks.guarantee`` writes the table to ``benchmarks/results``.

Times are those of the processor, of one core, after one call that compiles.
"""

from __future__ import annotations

import csv
import time
from fractions import Fraction
from pathlib import Path

import numpy as np

from benchmarks.timing import machine
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.display.tables import Table
from gpbnb.kalman.forms import Form
from gpbnb.kalman.guarantee.bound import guarantee, limits
from gpbnb.kalman.model import LinearModel

RESULTS = Path(__file__).parent / "results"
#: n, m, steps of the model's cycle, decay of its states in a step, and the seconds allowed, if any. All are in UD form:
#: in the others, the computed gain of five or more slow states keeps changing in its last digits for 20,000 steps.
CASES = (
    (1, 1, 1, 0.95, None),
    (2, 1, 1, 0.95, None),
    (3, 1, 1, 0.95, 5.0),
    (5, 1, 1, 0.95, None),
    (10, 2, 1, 0.95, None),
    (10, 2, 31, 0.8, 300.0),
)


def model(n: int, m: int, cycle: int, decay: float = 0.95, seed: int = 7) -> LinearModel:
    """A stable model whose measurement matrix goes through a cycle."""
    rng = np.random.default_rng([seed, n, m])
    Phi = decay * np.eye(n) + 0.03 * rng.standard_normal((n, n))
    H = rng.standard_normal((m, n))
    turned = [H * np.cos(2 * np.pi * k / cycle + np.arange(n)) for k in range(cycle)]
    unit = exact(np.eye(n, dtype=np.int64))
    rounded = np.round(np.array(turned) * 2**20) / 2**20
    return LinearModel(
        Phi=np.round(Phi * 2**20) / 2**20,
        H=rounded,
        Q=unit / 10,
        R=exact(np.eye(m, dtype=np.int64)),
        x0=np.array([Fraction(0)] * n, dtype=object),
        P0=unit,
        name=f"n = {n}, m = {m}, cycle {cycle}, decay {decay}",
    )


def main() -> int:
    """Time each case, print and store."""
    header = ("filter", "repeats from step", "period", "steps back", "seconds", "to be reached", "reached")
    body = []
    for n, m, cycle, decay, least in CASES:
        given, within = model(n, m, cycle, decay), limits(n, m, state=100, innovation=10)
        guarantee(given, FloatFormat(2, 24), within, Form.UD)
        begin = time.process_time()
        found = guarantee(given, FloatFormat(2, 24), within, Form.UD)
        seconds = time.process_time() - begin
        if not found.for_ever:
            raise RuntimeError(f"{given.name}: {found.why}")
        reached = "" if least is None else "yes" if seconds <= least else "no"
        wanted = "" if least is None else f"≤ {least:g}"
        body.append(
            (
                given.name,
                str(found.schedule.repeat),
                str(found.schedule.period),
                str(found.lags),
                f"{seconds:.2f}",
                wanted,
                reached,
            )
        )
        print(*body[-1], flush=True)
    with (RESULTS / "guarantee.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *body])
    about = ", ".join(f"{name} {value}" for name, value in machine().items())
    table = Table("guarantees", header, tuple(body)).markdown()
    (RESULTS / "guarantee.md").write_text(f"{table}\n\nMeasured on: {about}.\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
