"""Emulated runs against guarantees: random stable filters in many formats, with random, constant and chosen inputs.

``python -m gpbnb.report.guarantees.survey`` recomputes ``survey.csv``. With ``--sample 20`` it recomputes 20
of its rows, chosen at random, and compares them.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.adversary import responses, run_against
from gpbnb.bounds.guarantee import closed_loops, from_schedule, limits
from gpbnb.bounds.linear import state_space
from gpbnb.sweeps import Column, machine, read, write

FILE = Path(__file__).with_name("survey.csv")
COMMAND = "python -m gpbnb.report.guarantees.survey"
ROWS = 2_000
RANDOM, CONSTANT, CHOSEN = 40, 6, 5
"""Runs of each kind for a filter."""
STEPS = 300
_WHOLE = {"seed", "n", "m", "base", "precision", "runs"}
COLUMNS = (
    Column("seed", "integer", 0),
    Column("n", "integer", 1, 4),
    Column("m", "integer", 1, 2),
    Column("base", "integer", choices=("2", "10")),
    Column("precision", "integer", 3, 30),
    Column("rounding", "text", choices=tuple(each.value for each in Rounding)),
    Column("radius", "number", 0),
    Column("runs", "integer", 0, RANDOM + CONSTANT + CHOSEN),
    *(Column(kind, "number", 0) for kind in ("random", "constant", "chosen")),
)
"""Columns of the stored table."""


class Row(NamedTuple):
    """A filter in a format, and the largest error / bound over states, steps and runs, for each kind of run."""

    seed: int
    n: int
    m: int
    base: int
    precision: int
    rounding: str
    radius: str
    runs: int
    random: str
    constant: str
    chosen: str


def compute(seed: int) -> Row:
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
    found = from_schedule(state_space(A, B).schedule(fmt), limits(n, m, measurement=Z))
    if not found.for_ever:  # rounded to few digits, the loop may be unstable
        return Row(seed, n, m, base, precision, fmt.rounding.value, f"{found.radius:.4f}", 0, "0", "0", "0")
    F, steer, worst = closed_loops(found.schedule), np.zeros((m, n + 1)), [0.0, 0.0, 0.0]
    every = [responses(found.schedule, F, state, STEPS) for state in range(n)]
    kinds = [0] * RANDOM + [1] * CONSTANT + [2] * CHOSEN
    for kind in kinds:
        rows = every[int(rng.integers(n))]
        if kind == 0:
            pool = Z * rng.uniform(-1, 1, (STEPS, 1, m))
        elif kind == 1:
            pool = np.broadcast_to(Z * rng.uniform(-1, 1, m), (STEPS, 1, m)).copy()
        else:
            pool = Z * rng.uniform(-1, 1, (STEPS, 30, m))
        _, _, errors = run_against(found, rows, pool * (1 - 2.0**-5), steer, False, ahead=kind == 2)
        worst[kind] = max(worst[kind], float((np.abs(errors).max(axis=0) / found.bound).max()))
    ratios = [f"{each:.4g}" for each in worst]
    return Row(seed, n, m, base, precision, fmt.rounding.value, f"{found.radius:.4f}", len(kinds), *ratios)


def load(file: Path = FILE) -> tuple[Row, ...]:
    """Return the stored rows."""
    return tuple(
        Row(**{name: int(value) if name in _WHOLE else value for name, value in line.items()})  # type: ignore[arg-type]
        for line in read(file, COLUMNS, COMMAND).records()
    )


def sample(count: int, seed: int) -> list[tuple[Row, Row]]:
    """Recompute some stored rows; return pairs that differ."""
    rows = load()
    chosen = np.random.default_rng(seed).choice(len(rows), min(count, len(rows)), replace=False)
    pairs = [(rows[i], compute(rows[i].seed)) for i in chosen]
    return [(stored, again) for stored, again in pairs if stored != again]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the survey, or recompute a sample; return a nonzero status if the sample differs."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Compare emulated runs with their guarantees.")
    parser.add_argument("--sample", type=int, default=0, help="number of rows to recompute and compare")
    parser.add_argument("--seed", type=int, default=0, help="which rows")
    parser.add_argument("--rows", type=int, default=ROWS, help="number of rows to compute")
    parser.add_argument("--output", type=Path, default=Path(".cache/guarantee"), help="folder for survey.csv")
    given = parser.parse_args(arguments)
    if given.sample:
        different = sample(given.sample, given.seed)
        for stored, again in different:
            print(f"stored {stored}, recomputed {again}")
        return bool(different)
    rows = [tuple(map(str, compute(seed))) for seed in tqdm(range(given.rows))]
    given.output.mkdir(parents=True, exist_ok=True)
    write(given.output / FILE.name, COLUMNS, rows, {"command": COMMAND, **machine()})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
