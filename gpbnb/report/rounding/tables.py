"""Tables of the chapter on rounding bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.named import digits
from gpbnb.arithmetic.rational import exact
from gpbnb.report.display.tables import Table
from gpbnb.report.rounding.experiment import Trial, bound_statistics


def bound_statistics_table(trials: Mapping[str, Sequence[Trial]]) -> Table:
    """Tabulate violations and ratios of every bound, grouped by kind of computation."""
    body = [
        (
            sort,
            each.bound,
            str(each.trials),
            str(each.violations),
            f"{each.largest:.3g}",
            f"{each.median:.3g}",
        )
        for sort, group in trials.items()
        for each in bound_statistics(group)
    ]
    header = ("computation", "bound", "trials", "violations", "largest error / bound", "median error / bound")
    return Table(f"{len(body)} bounds in random trials", header, tuple(body))


def worked(trials: Mapping[str, Trial], bounds: Sequence[str]) -> Table:
    """Tabulate single computations: operands, computed and true result, and error / bound for each bound."""
    body = [
        (
            name,
            "; ".join(_short(operand) for operand in trial.inputs if operand.size),
            digits(trial.fmt),
            _short(trial.computed),
            _number(trial.true),
            *(f"{trial.ratio(bound):.5g}" if bound in trial.bounds else "none" for bound in bounds),
        )
        for name, trial in trials.items()
    ]
    header = ("example", "operands", "format", "computed", "exact", *(f"error / {bound}" for bound in bounds))
    return Table(f"{len(body)} worked examples", header, tuple(body))


def _short(operand: FloatArray) -> str:
    lines = operand if operand.ndim > 1 else [operand.reshape(-1)]
    text = "; ".join(", ".join(map(str, line)) for line in lines)
    return text if len(text) <= 60 else f"{text[:40]} … {text[-12:]}"


def _number(value: object) -> str:
    entries = exact(value)
    return f"{float(entries.item()):.10g}" if entries.size == 1 else "a matrix"
