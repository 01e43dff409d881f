"""Tables of the chapter on why (125) fails."""

from __future__ import annotations

from collections.abc import Sequence

from gpbnb.report.display.tables import Table
from gpbnb.report.kalman.independent import FirstStep, ModelShare


def first_steps(found: Sequence[FirstStep]) -> Table:
    """Tabulate models that exceed (105) in their first step, by kind, with the 95 % limits of the probability."""
    rows = [(each.kind, str(each.models), str(each.exceeded), f"{each.low:.2f} to {each.high:.2f}") for each in found]
    return Table(
        "models that exceed (105) in their first step",
        ("kind", "models", "models that exceed (105)", "probability"),
        tuple(rows),
    )


def shares_by_form(found: Sequence[ModelShare]) -> Table:
    """Tabulate the mean share of formats in which random models exceed a bound, with its 95 % interval by model."""
    rows = [
        (
            str(each.form),
            f"({each.bound})",
            str(each.models),
            f"{100 * each.share:.0f} %",
            f"{100 * each.low:.0f} to {100 * each.high:.0f} %",
        )
        for each in found
    ]
    head = ("form", "bound", "models", "mean share of formats", "95 % interval by model")
    return Table("random models that exceed a bound", head, tuple(rows))
