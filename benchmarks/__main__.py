"""Time gpbnb beside its peers, in one run on one machine; write the table and its figure to ``benchmarks/results``."""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from benchmarks import kalman, matrices, multiply_add, rounding
from benchmarks.figure import amount, draw
from benchmarks.timing import Row, machine
from gpbnb.report.display.tables import Table

RESULTS = Path(__file__).parent / "results"


def in_units(seconds: float) -> str:
    """Three digits and a unit, which a narrow column must not part."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g}\N{NO-BREAK SPACE}{unit}"
    return f"{seconds / 1e-6:.3g}\N{NO-BREAK SPACE}µs"


def cells(row: Row) -> tuple[str, ...]:
    """What is printed of a row."""
    least = "" if row.least is None else f"≥ {row.least:.3g}×"
    return row.library, in_units(row.seconds), amount(row.ratio), least, row.reached


def line(row: Row) -> str:
    library, seconds, ratio, least, reached = cells(row)
    task = row.task if row.library == "gpbnb" else ""
    return f"{task:<38} {library:<17} {seconds:>9} {ratio:>9} {least:>7} {reached}"


def write(table: Sequence[Row], about: dict[str, str], folder: Path) -> None:
    """Write the rows as CSV, as the table that the book shows, and as a figure; and what they were measured on."""
    folder.mkdir(exist_ok=True)
    with (folder / "timings.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow((*Row._fields, "reached"))
        for row in table:
            least = "" if row.least is None else f"{row.least:g}"
            writer.writerow((row.task, row.library, f"{row.seconds:.4g}", f"{row.ratio:.4g}", least, row.reached))
    header = ("task", "library", "time", "time / time of gpbnb")
    body = tuple((row.task if row.library == "gpbnb" else "", *cells(row)[:3]) for row in table)
    machine_line = "Measured on: " + ", ".join(f"{name} {value}" for name, value in about.items()) + "."
    (folder / "timings.md").write_text(
        f"{Table('timings', header, body).markdown()}\n\n{machine_line}\n", encoding="utf-8"
    )
    draw(table, folder / "timings.svg")


def main() -> int:
    about = machine()
    print(", ".join(f"{name} {value}" for name, value in about.items()), flush=True)
    table: list[Row] = []
    for part in tqdm((rounding, multiply_add, matrices, kalman), desc="benchmarks", unit="part"):
        found = part.measure()
        tqdm.write("\n".join(map(line, found)))
        table += found
    write(table, about, RESULTS)
    missed = sum(row.reached == "no" for row in table)
    print(f"{sum(row.reached == 'yes' for row in table)} reached, {missed} missed; written to benchmarks/results")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
