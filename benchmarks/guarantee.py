"""Time guarantees for all time: ``python -m benchmarks.guarantee`` writes the table to ``benchmarks/results``.

Each case runs in a process of its own, after one that compiles. Times are those of the processor, of one core, and
memory is the most that the process held, with Python and its packages.
"""

from __future__ import annotations

import csv
import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.timing import machine
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.report.display.tables import Table
from gpbnb.report.examples import cyclic

RESULTS = Path(__file__).parent / "results"


class Case(NamedTuple):
    """A filter of :func:`gpbnb.report.examples.cyclic` in 24 bits, and what is to be reached, if anything.

    Parameters
    ----------
    n, m, cycle, decay : states, measurements, steps of the model's cycle, and decay of its states in a step.
    form : in the innovation form, the computed gain of five or more slow states keeps changing in its last digits, and
        is enclosed; of fifty states, in the UD form as well. In 24 bits, fifty states with a decay of 0.95 are too
        many: some grow by 1.18 a step, their variances span nine decades, and the innovation form loses definiteness.
    seconds, megabytes : the most allowed, None for any.
    """

    n: int
    m: int
    cycle: int
    decay: float
    form: Form
    seconds: float | None = None
    megabytes: float | None = None


CASES = (
    Case(1, 1, 1, 0.95, Form.UD),
    Case(2, 1, 1, 0.95, Form.UD),
    Case(3, 1, 1, 0.95, Form.UD, 5.0),
    Case(5, 1, 1, 0.95, Form.UD),
    Case(10, 2, 1, 0.95, Form.UD),
    Case(10, 2, 1, 0.95, Form.INNOVATION),
    Case(10, 2, 31, 0.8, Form.UD, 300.0),
    Case(10, 2, 31, 0.8, Form.INNOVATION, 300.0),
    Case(50, 2, 1, 0.5, Form.UD, 20.0, 300.0),
    Case(50, 2, 1, 0.5, Form.INNOVATION, 20.0, 300.0),
    Case(50, 2, 1, 0.7, Form.INNOVATION),
)


class Measured(NamedTuple):
    """What the table shows of a guarantee."""

    name: str
    repeat: int | None
    period: int | None
    bound: float
    seconds: float
    megabytes: float


def measure(case: Case) -> Measured:
    """Compute a guarantee in this process."""
    given = cyclic(case.n, case.m, case.cycle, case.decay)
    begin = time.process_time()
    found = guarantee(given, FloatFormat(2, 24), limits(state=100, innovation=10), form=case.form)
    seconds = time.process_time() - begin
    if not found.for_ever:
        raise RuntimeError(f"{given.name}: {found.why}")
    held, at = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, found.schedule
    return Measured(given.name, at.repeat, at.period, float(found.bound.max()), seconds, held)


def in_a_process(case: Case) -> Measured:
    """Compute a guarantee in a new process."""
    command = [sys.executable, "-m", "benchmarks.guarantee", str(CASES.index(case))]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return Measured(*json.loads(done.stdout.splitlines()[-1]))


def reached(case: Case, found: Measured) -> str:
    """Say whether a case takes no more than allowed."""
    if case.seconds is None:
        return ""
    within = found.seconds <= case.seconds and (case.megabytes is None or found.megabytes <= case.megabytes)
    return "yes" if within else "no"


def allowed(case: Case) -> str:
    """Say what a case may take."""
    limits = (case.seconds, "s"), (case.megabytes, "MB")
    return ", ".join(f"≤ {most:g}\N{NO-BREAK SPACE}{unit}" for most, unit in limits if most is not None)


def main() -> int:
    """Time each case, print and store; with the number of a case, measure it in this process."""
    if len(sys.argv) > 1:
        print(json.dumps(measure(CASES[int(sys.argv[1])])))
        return 0
    header = (
        "filter", "form", "repeats from step", "period", "largest bound", "seconds", "MB", "to be reached", "reached",
    )  # fmt: skip
    body = []
    for case in CASES:
        in_a_process(case)
        found = in_a_process(case)
        steps = (str(each or "") for each in (found.repeat, found.period))
        numbers = f"{found.bound:.3g}", f"{found.seconds:.2f}", f"{found.megabytes:.0f}"
        body.append((found.name, str(case.form), *steps, *numbers, allowed(case), reached(case, found)))
        print(*body[-1], flush=True)
    with (RESULTS / "guarantee.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *body])
    about = ", ".join(f"{name} {value}" for name, value in machine().items())
    table = Table("guarantees", header, tuple(body)).markdown()
    (RESULTS / "guarantee.md").write_text(f"{table}\n\nMeasured on: {about}.\n", encoding="utf-8")
    return 1 if any(row[-1] == "no" for row in body) else 0


if __name__ == "__main__":
    raise SystemExit(main())
