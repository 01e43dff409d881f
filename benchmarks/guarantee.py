"""Time guarantees for all time: ``python -m benchmarks.guarantee`` writes the table to ``benchmarks/results``.

Times are those of the processor, of one core, after one call that compiles.
"""

from __future__ import annotations

import csv
import time
from pathlib import Path

from benchmarks.timing import machine
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.report.display.tables import Table
from gpbnb.wordlength.examples import cyclic

RESULTS = Path(__file__).parent / "results"
#: n, m, steps of the model's cycle, decay of its states in a step, form, and the seconds allowed, if any. In the
#: innovation form, the computed gain of five or more slow states keeps changing in its last digits, and is enclosed.
CASES = (
    (1, 1, 1, 0.95, Form.UD, None),
    (2, 1, 1, 0.95, Form.UD, None),
    (3, 1, 1, 0.95, Form.UD, 5.0),
    (5, 1, 1, 0.95, Form.UD, None),
    (10, 2, 1, 0.95, Form.UD, None),
    (10, 2, 1, 0.95, Form.INNOVATION, None),
    (10, 2, 31, 0.8, Form.UD, 300.0),
    (10, 2, 31, 0.8, Form.INNOVATION, 300.0),
)


def main() -> int:
    """Time each case, print and store."""
    header = (
        "filter", "form", "repeats from step", "enclosed from step", "period", "steps back", "seconds", "to be reached",
        "reached",
    )  # fmt: skip
    body = []
    for n, m, cycle, decay, form, least in CASES:
        given, within = cyclic(n, m, cycle, decay), limits(n, m, state=100, innovation=10)
        guarantee(given, FloatFormat(2, 24), within, form)
        begin = time.process_time()
        found = guarantee(given, FloatFormat(2, 24), within, form)
        seconds = time.process_time() - begin
        if not found.for_ever:
            raise RuntimeError(f"{given.name}: {found.why}")
        reached = "" if least is None else "yes" if seconds <= least else "no"
        wanted = "" if least is None else f"≤ {least:g}"
        body.append(
            (
                given.name,
                str(form),
                str(found.schedule.repeat or ""),
                str(found.schedule.enclosed or ""),
                str(found.schedule.period or ""),
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
