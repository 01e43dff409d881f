"""Tables of the chapter on the error budget."""

from __future__ import annotations

from collections.abc import Sequence

from gpbnb.budget.theory import METHODS, Budget, Reading
from gpbnb.display.tables import Table


def sources(budget: Budget) -> Table:
    """Every source with its residual and its share; the sums in the last lines."""
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
    header = ("source", "kind", "form", "error (mas)", "reduced by", "group", "left (mas)", "share")
    return Table(f"{len(budget.sources)} sources", header, tuple(body))


def refused(reading: Reading) -> Table:
    """Rows that were refused, by line."""
    body = tuple((str(row.line), ", ".join(row.cells), row.reason) for row in reading.refused)
    return Table(f"{len(body)} rows refused", ("line", "row", "reason"), body)


def curve(rows: Sequence[tuple[str, int, float]]) -> Table:
    """Statements of so many sources of one size each: name, number, milliarcseconds."""
    body = tuple(
        (name, str(count), f"{each:.4f}", f"{each * count**0.5:.4f}", f"{each * count:.3f}")
        for name, count, each in rows
    )
    header = ("case", "sources", "each (mas)", "root-sum-square (mas)", "all of one sign (mas)")
    return Table(f"{len(body)} cases", header, body)
