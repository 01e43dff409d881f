"""Evidence for the numbers of the book: what was checked, against what, how often, and how often it disagreed."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from gpbnb.report.display.tables import Table
from gpbnb.report.guarantees import filters, scalar, survey


class Checked(NamedTuple):
    """One kind of evidence: the number of cases that were checked, and of those that disagreed."""

    cases: int
    wrong: int


def operations(file: Path) -> Checked:
    """Count operations compared with other arithmetic, from a table that ``make exactness`` stores."""
    return Checked(*_sums(file, "all", "different"))


def compiled(file: Path) -> Checked:
    """Count builds of generated C code that were compared with the emulation, and those that differ."""
    agree, wrong = _sums(file, "builds", "different")
    return Checked(agree + wrong, wrong)


def _sums(file: Path, *names: str) -> list[int]:
    """Return the sums of two columns of the table in a Markdown file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    header, _, *cells = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")
    ]
    rows = [dict(zip(header, row, strict=True)) for row in cells]
    return [sum(int(row[name].replace(",", "")) for row in rows) for name in names]


def attacks() -> Checked:
    """Count emulated runs against guarantees, and those that exceed their bound."""
    kalman, linear = filters.load(), survey.load()
    return Checked(
        sum(row.runs for row in kalman) + sum(row.runs for row in linear),
        sum(row.wrong for row in kalman)
        + sum(max(float(row.random), float(row.constant), float(row.chosen)) > 1 for row in linear),
    )


def true_errors() -> Checked:
    """Count filters whose worst error is known exactly, and those whose bound is smaller."""
    rows = [row for row in scalar.load() if row.result == "compared"]
    return Checked(len(rows), sum(float(row.ratio) > 1 for row in rows))


def table(found: dict[str, tuple[str, Checked]]) -> Table:
    """Tabulate evidence.

    Parameters
    ----------
    found : for each kind of cases, what they were compared with, and the counts.
    """
    header = ("what we checked", "against what", "cases", "disagreements")
    body = tuple((what, other, f"{each.cases:,}", f"{each.wrong:,}") for what, (other, each) in found.items())
    return Table(f"{len(body)} kinds of evidence", header, body)
