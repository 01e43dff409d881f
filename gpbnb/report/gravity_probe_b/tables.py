"""Tables of the chapters on the year of Gravity Probe B."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.bounded_run import BoundedHistory
from gpbnb.filters import contraction
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.report.display.tables import Table, short
from gpbnb.report.gravity_probe_b import threshold, year
from gpbnb.report.gravity_probe_b.answers import Moved
from gpbnb.report.gravity_probe_b.mission import PARAMETERS
from gpbnb.report.gravity_probe_b.model import STATES
from gpbnb.report.gravity_probe_b.threshold import Share
from gpbnb.report.kalman import report_bounds
from gpbnb.report.kalman.printed import Terms
from gpbnb.wordlength.requirement import Requirement


def states(model: LinearModel) -> Table:
    """Tabulate the states of the Gravity Probe B model: transition, initial standard deviation, process noise."""
    given = model.to_float()
    body = tuple(
        (name, unit, f"{given['Phi'][0, i, i]:g}", _root(given["P0"][i, i]), _root(given["Q"][0, i, i]))
        for i, (name, unit) in enumerate(STATES)
    )
    header = ("state", "unit", "transition per step", "initial standard deviation", "random walk per step")
    return Table(f"{len(body)} states", header, body)


def _root(variance: float) -> str:
    return short(math.sqrt(variance), 3)


def year_ends(runs: Sequence[year.Year]) -> Table:
    """Tabulate errors at the last step, the first non-positive variance, and the model if there are several."""
    several = len({run.case.model for run in runs}) > 1
    body = []
    for run in runs:
        if run.case.fmt is None:
            raise ValueError(
                "got the reference among the runs; needed only rounded runs, because the reference has no error"
            )
        found = (np.abs(run.drift[-1]).max(), np.abs(run.rate[-1]).max(), run.gain[-1], run.covariance[-1])
        cells = [arithmetic(run.case.fmt), str(run.case.form), *(short(float(each)) for each in found)]
        lost = f"; first non-positive variance at step {run.indefinite:,}" if run.indefinite else ""
        body.append((*([run.case.model] if several else []), *cells, short(float(run.least_eigenvalue[-1])) + lost))
    header = (
        *(["model"] if several else []),
        "arithmetic",
        "form",
        "error of the drift (mas)",
        "error of the rate (mas/yr)",
        "relative error of the gain",
        "relative error of the covariance",
        "smallest eigenvalue",
    )
    return Table("errors after a year", header, tuple(body))


def slack(runs: Sequence[year.Year], bounds: Sequence[year.YearBounds], terms: Terms) -> Table:
    """Tabulate bound / error of the drift rate after a year, for the smallest value of (125) and the companion bound.

    Parameters
    ----------
    runs, bounds : rounded runs, and the bound of the reference for each.
    terms : terms of the model, the same for all runs.
    """
    body = []
    for run, reference in zip(runs, bounds, strict=True):
        fmt, k = run.case.fmt, int(run.steps[-1])
        if fmt is None or reference.steps[-1] != k:
            raise ValueError(
                f"got {run.case.name} with a bound up to step {reference.steps[-1]}; needed one up to step {k}"
            )
        at = int(np.abs(run.rate[-1]).argmax())
        error = abs(float(run.rate[-1, at]))
        companion = float(contraction.companion_bound(run.rate[-1, at], reference.rate[-1, at]))
        cells = [terms.smallest_bound(fmt, k, **faults) / error for faults in report_bounds.CORRECTIONS.values()]
        body.append((arithmetic(fmt), short(error), *(short(each) for each in cells), f"{companion / error:.5f}"))
    header = (
        "arithmetic",
        "error of the rate (mas/yr)",
        *(f"(125), {name}" for name in report_bounds.CORRECTIONS),
        "companion bound",
    )
    return Table(f"bound over error, {len(body)} years", header, tuple(body))


def requirements(answers: Sequence[tuple[str, Requirement]]) -> Table:
    """Tabulate answers of :func:`gpbnb.wordlength.precision.required_precision`."""
    body = []
    for name, answer in answers:
        ratio = f"{dict(answer.tried)[answer.fmt.precision]:.2g}" if answer.fmt else ""
        smallest_format = arithmetic(answer.fmt) if answer.fmt else "none"
        body.append((name, answer.basis, str(answer.steps), smallest_format, ratio))
    header = ("filter", "found by", "steps", "smallest precision", "error or bound / tolerance")
    return Table(f"{len(body)} answers", header, tuple(body))


def shares(found: Sequence[Share]) -> Table:
    """Tabulate the share of records within the tolerance for a year, with its 95 % limits, and quantiles."""
    rows = [
        (
            in_words(each.states),
            in_words(each.form),
            arithmetic(each.fmt),
            f"{each.within} of {each.records}",
            f"{each.low:.3f} to {each.high:.3f}",
            *(f"{each.quantile(p):.2g}" for p in (0.5, 0.9, 1.0)),
            f"{each.quantile_limit:.2g}",
        )
        for each in found
    ]
    head = (
        "state",
        "form",
        "arithmetic",
        "within tolerance",
        "probability",
        "median",
        "90 %",
        "largest",
        "upper limit for 99 % of records",
    )
    return Table("records that stay within a milliarcsecond for a year", head, tuple(rows))


def parameters() -> Table:
    """Tabulate the numbers of the mission model with their sources."""
    rows = tuple((each.name, f"{each.value:g}", each.unit, each.source) for each in PARAMETERS)
    return Table("parameters of the mission model", ("parameter", "value", "unit", "source"), rows)


_WORDS = {"hung": str(Form.HUNG), "ud": str(Form.UD), "joseph": str(Form.JOSEPH)} | {
    "nearest": "rounded to nearest",
    "chop": "chopped",
    "absolute": "absolute angles",
    "deviation": "deviations",
}


def in_words(name: str) -> str:
    """Return the words that a reader knows for a stored name of a form, a rounding or a choice of states."""
    return _WORDS.get(name, name)


def sensitivity(moved: Sequence[Moved]) -> Table:
    """Tabulate by how many bits each choice changes the answer."""
    rows = tuple(
        (
            each.choice,
            in_words(each.before),
            in_words(each.after),
            f"{each.bits:+.1f}".replace("-", "−"),
            str(each.records),
        )
        for each in moved
    )
    return Table("what moves the answer", ("choice", "from", "to", "bits", "records (at least)"), rows)


def needed_precisions(found: Sequence[Share]) -> Table:
    """Tabulate the smallest precisions that meet the tolerance with a probability of 99 %, and the records used.

    There is a row for each kind of formats. The counts and the 95 % limits are those of the smallest precision at which
    99 % of the records stay within the tolerance.
    """
    groups: dict[tuple[str, ...], list[Share]] = {}
    for each in found:
        fmt = each.fmt
        unit = "bits" if fmt.base == 2 else "decimal digits"
        groups.setdefault((each.setting, each.states, each.form, fmt.rounding.value, unit), []).append(each)
    rows = []
    for (setting, states, form, rounding, unit), group in groups.items():
        answer = threshold.needed(group)
        observed, lognormal, shown = ("none" if each is None else f"{each} {unit}" for each in answer)
        at = next((each for each in group if each.fmt.precision == answer.observed), None)
        passed, limits = (f"{at.within} of {at.records}", f"{at.low:.3f} to {at.high:.3f}") if at else ("–", "–")
        rows.append(
            (
                f"{setting}, {in_words(states)}",
                f"{in_words(form)}, {in_words(rounding)}",
                observed,
                passed,
                limits,
                lognormal,
                shown,
            )
        )
    head = (
        "model and states", "form and rounding", "99 % of the records", "passed", "probability", "99 %, lognormal",
        "99 %, proved with 95 % confidence",
    )  # fmt: skip
    return Table("smallest precision that stays within a milliarcsecond", head, tuple(rows))


def bound_costs(
    found: Sequence[tuple[FloatFormat, BoundedHistory]], terms: Terms, reference: year.YearBounds, time: float
) -> Table:
    """Tabulate the cost of each bound of a run, and bound / error of the drift rates at the last step.

    Parameters
    ----------
    found : formats and their bounded runs, all with the same measurements and steps.
    terms : terms of the model for (125).
    reference : bounds of the run in double-double, which serves as the companion.
    time : processor time of that run with its bound, over that of a rounded run.
    """
    k = int(found[0][1].history.steps[-1])
    (row,) = np.flatnonzero(np.asarray(reference.steps) == k)
    ratios: dict[str, list[str]] = {"(125), least $B$": [], "running bound": [], "companion bound": []}
    for fmt, each in found:
        error = np.abs(each.history.state[-1, 2:4])
        at = int(error.argmax())
        bounds = (
            terms.smallest_bound(fmt, k),
            float(each.state[-1, 2 + at]),
            float(contraction.companion_bound(error[at], reference.rate[row, at])),
        )
        for cells, value in zip(ratios.values(), bounds, strict=True):
            cells.append(f"{value / float(error[at]):.3g}")
    costs = (
        ("a formula", "none"),
        (f"{time:.0f} times the run", "106 bits, to repeat each step"),
        (f"{time:.0f} times the run", "106 bits, for a second run"),
    )
    body = tuple((name, *cost, *cells) for (name, cells), cost in zip(ratios.items(), costs, strict=True))
    head = ("bound", "processor time", "extra precision", *(f"bound / error, {arithmetic(fmt)}" for fmt, _ in found))
    return Table(f"what a bound costs, after {k} steps", head, body)
