"""A year of Gravity Probe B, 3,153,600 steps: ``python -m benchmarks.year`` writes the table to ``benchmarks/results``.

Times are those of the processor, of one core, so that what else the machine does enters little. The aims, 6 s in base 2
and 25 s in base 10, were set for a processor on which NumPy takes 36.6 s. On others they are these shares of NumPy's
time.
"""

from __future__ import annotations

import csv
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from benchmarks.kalman import numpy_step
from benchmarks.timing import machine
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run
from gpbnb.filters.simulation import BLOCK
from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b import model as gravity_probe_b
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.mission import Mission
from gpbnb.report.gravity_probe_b.model import TRUTH

RESULTS = Path(__file__).parent / "results"
RECORDS = 100
BINARY_SHARE, DECIMAL_SHARE = 6 / 36.6, 25 / 36.6
NUMPY_TAKES = 20  # one block of so many


class Timed(NamedTuple):
    """A year in one arithmetic."""

    arithmetic: str
    seconds: float
    aim: float | None  # seconds, if one was set

    @property
    def reached(self) -> str:
        """``yes``, ``no`` or nothing."""
        return "" if self.aim is None else "yes" if self.seconds <= self.aim else "no"


def seconds(work: Callable[[], Any]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def measure(steps: int = gravity_probe_b.YEAR) -> list[Timed]:
    """Run both arithmetics and NumPy in turns, block by block; NumPy takes every twentieth, and its time is scaled."""
    usual = year.MODELS[0]
    runs = {
        FloatFormat(base, precision): Run(year.model(usual, base), FloatFormat(base, precision), Form.INNOVATION, ())
        for base, precision in ((2, 24), (10, 8))
    }
    given = year.model(usual, 2).to_float()
    Phi, H = given["Phi"][0], given["H"]
    plain = [(Phi, Phi.T, given["Q"][0], h, h.T, given["R"][0]) for h in H]
    x, P, identity = given["x0"].reshape(-1, 1), given["P0"], np.eye(len(Phi))
    source, truth = year.simulation(usual), np.array(TRUTH)
    for fmt in runs:  # compiles
        Run(year.model(usual, fmt.base), fmt, Form.INNOVATION, ()).take(source.measurements(1))
    total, numpy_steps, numpy_total = dict.fromkeys(runs, 0.0), 0, 0.0
    for number in tqdm(range(-(-steps // BLOCK)), desc="a year, thrice", unit="block"):
        before = number * BLOCK
        z, truth = source.block(number, truth, steps - before)
        for fmt, run in runs.items():
            total[fmt] += seconds(lambda run=run, z=z: run.take(z))  # type: ignore[misc]
        if number % NUMPY_TAKES == 0:
            start = time.process_time()
            for k, each in enumerate(z, before):
                x, P = numpy_step((*plain[k % len(plain)], each.reshape(-1, 1), identity), x, P)
            numpy_total += time.process_time() - start
            numpy_steps += len(z)
    binary, decimal = total.values()
    numpy_year = numpy_total * steps / numpy_steps
    return [
        Timed("base 2, 24 bits, every operation rounded", binary, round(BINARY_SHARE * numpy_year, 1)),
        Timed("NumPy, float64, unrounded", numpy_year, None),
        Timed("base 10, 8 digits, every operation rounded", decimal, round(DECIMAL_SHARE * numpy_year, 1)),
        Timed(f"base 2, 24 bits, {RECORDS} records at once", many_records(steps), round(6 * binary, 1)),
        Timed("the mission model, base 2, 24 bits", mission_year(steps), None),
    ]


def many_records(steps: int) -> float:
    """A year of many records through one gain; the time of every twentieth block is scaled."""
    given = year.model(year.MODELS[0], 2)
    run = Run(given, FloatFormat(2, 24), Form.INNOVATION, (), records=RECORDS)
    one = year.simulation(year.MODELS[0]).measurements(BLOCK)
    z = np.ascontiguousarray(np.repeat(one[:, :, np.newaxis], RECORDS, axis=2))
    run.carry(z[:1], 1)  # compiles
    blocks = -(-steps // BLOCK)
    taken = range(0, blocks, NUMPY_TAKES)
    return sum(seconds(lambda: run.carry(z, 1)) for _ in taken) * steps / (len(taken) * BLOCK)


def mission_year(steps: int) -> float:
    """A year of the mission model for one record, its measurement matrices included; scaled as above."""
    mission = Mission()
    run = Run(mission.model(2), FloatFormat(2, 24), Form.INNOVATION, ())
    z = np.zeros((BLOCK, 2, 1))
    run.carry(z[:1], 1)  # compiles

    def block(number: int) -> None:
        run.use_measurement_matrices(mission.matrices(number, 2))
        run.carry(z, 1)

    taken = range(0, -(-steps // BLOCK), NUMPY_TAKES)
    return sum(seconds(lambda number=number: block(number)) for number in taken) * steps / (len(taken) * BLOCK)  # type: ignore[misc]


def main() -> int:
    found, about = measure(), machine()
    with (RESULTS / "year.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow((*Timed._fields, "reached"))
        writer.writerows((each.arithmetic, f"{each.seconds:.3g}", each.aim or "", each.reached) for each in found)
    body = tuple(
        (
            each.arithmetic,
            f"{each.seconds:.3g}\N{NO-BREAK SPACE}s",
            f"{each.aim:g}\N{NO-BREAK SPACE}s" if each.aim else "",
            each.reached,
        )
        for each in found
    )
    table = Table("a year", ("arithmetic", "processor time of a year", "aim", "reached"), body)
    measured = ", ".join(f"{name} {about[name]}" for name in ("processor", "system", "python", "numpy", "numba"))
    (RESULTS / "year.md").write_text(f"{table.markdown()}\n\nMeasured on: {measured}.\n", encoding="utf-8")
    print(table.markdown())
    return 1 if any(each.reached == "no" for each in found) else 0


if __name__ == "__main__":
    sys.exit(main())
