"""Tables of the chapter on the error budget."""

from __future__ import annotations

from collections.abc import Sequence

from gpbnb.report.budget.theory import METHODS, Budget, ReadBudget
from gpbnb.report.display.tables import Table


def sources(budget: Budget) -> Table:
    """Tabulate every source with its residual and its share; the last rows hold the totals."""
    body = [
        (
            source.name,
            source.kind.value,
            source.form.value,
            f"{source.error:.3g}",
            ", ".join(f"{method} × {getattr(source, method):.3g}" for method in METHODS if getattr(source, method) < 1),
            source.group,
            f"{source.residual:.3g}",
            f"{100 * budget.share(source):.1f} %",
        )
        for source in budget.sources
    ]
    blanks = ("",) * 5
    body.append(
        ("root-sum-square", *blanks, f"{budget.total:.4g}", f"{100 * sum(map(budget.share, budget.sources)):.1f} %")
    )
    body.append(("worst case", *blanks, f"{budget.worst_case:.4g}", ""))
    header = ("source", "kind", "form", "error (mas)", "reduced by", "group", "remaining (mas)", "share")
    return Table(f"{len(budget.sources)} sources", header, tuple(body))


def refused(reading: ReadBudget) -> Table:
    """Tabulate the rejected rows by line."""
    body = tuple((str(row.line), ", ".join(row.cells), row.reason) for row in reading.refused)
    return Table(f"{len(body)} rejected rows", ("line", "row", "reason"), body)


def curve(rows: Sequence[tuple[str, int, float]]) -> Table:
    """Tabulate cases of equal sources, given as name, number of sources, and size of each in milliarcseconds."""
    body = tuple(
        (name, str(count), f"{each:.4f}", f"{each * count**0.5:.4f}", f"{each * count:.3f}")
        for name, count, each in rows
    )
    header = ("case", "sources", "error of each (mas)", "root-sum-square (mas)", "sum if all have the same sign (mas)")
    return Table(f"{len(body)} cases", header, body)
