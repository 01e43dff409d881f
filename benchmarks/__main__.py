"""Time gpbnb beside its peers, in one run on one machine; write the table and its figure to ``benchmarks/results``."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

from benchmarks import integration, kalman, multiply_add, rounding
from benchmarks.figure import draw
from benchmarks.timing import Row, machine

RESULTS = Path(__file__).parent / "results"


def in_units(seconds: float) -> str:
    """Three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.3g} µs"


def line(row: Row) -> str:
    task = row.task if row.library == "gpbnb" else ""
    return f"{task:<38} {row.library:<17} {in_units(row.seconds):>9} {row.ratio:>9.2f}× {row.reach:>7} {row.reached}"


def main() -> int:
    about = machine()
    print(", ".join(f"{name} {value}" for name, value in about.items()), flush=True)
    table: list[Row] = []
    for part in (rounding, multiply_add, kalman, integration):
        found = part.measure()
        print("\n".join(map(line, found)), flush=True)
        table += found
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / "timings.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        writer.writerows((*row[:2], f"{row.seconds:.4g}", f"{row.ratio:.4g}", *row[4:]) for row in table)
    (RESULTS / "machine.json").write_text(json.dumps(about, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    draw(table, RESULTS / "timings.svg")
    missed = sum(row.reached == "no" for row in table)
    print(f"{sum(row.reached == 'yes' for row in table)} reached, {missed} missed; written to benchmarks/results")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
