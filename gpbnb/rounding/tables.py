"""Tables of the chapter on rounding bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gpbnb.rounding.experiment import Tally, Trial
from gpbnb.tables import Table


def tallies(results: Mapping[str, Sequence[Tally]]) -> Table:
    """Violations and ratios of every bound, a line each, by sort of computation."""
    body = [
        (
            sort,
            tally.bound,
            str(tally.trials),
            str(tally.violations),
            f"{tally.largest:.3g}",
            f"{tally.median:.3g}",
        )
        for sort, group in results.items()
        for tally in group
    ]
    header = ("computation", "bound", "trials", "violations", "largest error / bound", "median error / bound")
    return Table(f"{len(body)} bounds in random trials", header, tuple(body))


def worked(trials: Mapping[str, Trial], bounds: Sequence[str]) -> Table:
    """Single computations digit by digit: operands, computed and true result, error over each bound."""
    body = [
        (
            name,
            "; ".join(_short(operand) for operand in trial.inputs if operand.size),
            f"{trial.fmt.precision} digits, base {trial.fmt.base}",
            _short(trial.computed),
            _number(trial.true),
            *(f"{trial.ratio(bound):.4g}" if bound in trial.bounds else "none" for bound in bounds),
        )
        for name, trial in trials.items()
    ]
    header = ("example", "operands", "format", "computed", "exact", *(f"error / {bound}" for bound in bounds))
    return Table(f"{len(body)} worked examples", header, tuple(body))


def _short(operand: object) -> str:
    text = " ".join(str(operand).split())
    return text if len(text) <= 60 else f"{text[:40]} … {text[-12:]}"


def _number(value: object) -> str:
    item = getattr(value, "item", None)
    if item is not None and getattr(value, "size", 0) == 1:
        value = item()
    return f"{float(value):.10g}" if not hasattr(value, "shape") else "a matrix"  # type: ignore[arg-type]
