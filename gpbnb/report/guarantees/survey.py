"""Emulated runs against guarantees: random stable filters in many formats, with random, constant and chosen inputs."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.gains import filter_schedule
from gpbnb.bounds.guarantee import closed_loops, from_schedule, limits
from gpbnb.filters.structures import state_space
from gpbnb.report.guarantees.adversary import responses, run_against
from gpbnb.report.sweep import Number, sweep_of_rows
from gpbnb.report.sweep import load as load_rows

ROWS = 2_000
RANDOM, CONSTANT, CHOSEN = 40, 6, 5
"""Runs of each kind for a filter."""
STEPS = 300


class SurveyRow(NamedTuple):
    """A filter in a format, and the largest error / bound over states, steps and runs, for each kind of run."""

    seed: int
    n: int
    m: int
    base: int
    precision: int
    rounding: str
    radius: Number
    runs: int
    random: Number
    constant: Number
    chosen: Number


def compute(seed: int) -> SurveyRow:
    """Compute one row; its seed determines all random numbers."""
    rng = np.random.default_rng([19, seed])
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 3))
    A, B = rng.standard_normal((n, n)), rng.standard_normal((n, m))
    A *= rng.uniform(0.3, 0.97) / np.abs(np.linalg.eigvals(A)).max()
    base = int(rng.choice([2, 10]))
    precision = int(rng.integers(6, 31) if base == 2 else rng.integers(3, 9))
    fmt = FloatFormat(base, precision, list(Rounding)[int(rng.integers(2))])
    A, B = np.round(A * 2**20) / 2**20, np.round(B * 2**20) / 2**20
    Z = 10.0 ** rng.uniform(-2, 3, m)
    found = from_schedule(filter_schedule(state_space(A, B), fmt), limits(measurement=Z))
    if not found.for_ever:  # rounded to few digits, the loop may be unstable
        return SurveyRow(seed, n, m, base, precision, fmt.rounding.value, f"{found.radius:.4f}", 0, "0", "0", "0")
    F, worst = closed_loops(found.schedule), [0.0, 0.0, 0.0]
    every = [responses(found.schedule, F, state, STEPS) for state in range(n)]
    for kind, runs in enumerate((RANDOM, CONSTANT, CHOSEN)):
        rows, pools = [], []
        for _ in range(runs):
            rows.append(every[int(rng.integers(n))])
            if kind == 1:
                pools.append(np.broadcast_to(Z * rng.uniform(-1, 1, m), (STEPS, 1, m)))
            else:
                pools.append(Z * rng.uniform(-1, 1, (STEPS, 30 if kind == 2 else 1, m)))
        pool = np.array(pools) * (1 - 2.0**-5)
        _, _, errors = run_against(found, np.array(rows), pool, ahead=kind == 2)
        worst[kind] = float((np.abs(errors).max(axis=(0, 1)) / found.bound).max())
    total = RANDOM + CONSTANT + CHOSEN
    ratios = [f"{each:.4g}" for each in worst]
    return SurveyRow(seed, n, m, base, precision, fmt.rounding.value, f"{found.radius:.4f}", total, *ratios)


SWEEP = sweep_of_rows("guarantees/survey", SurveyRow, lambda: range(ROWS), compute, seed=19)
load = partial(load_rows, SWEEP, SurveyRow)
