"""Tables of the chapter on the Kalman bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat, prints_as
from gpbnb.display.tables import Table, arithmetic, scientific, short
from gpbnb.kalman import contraction, probability, report_bounds, smallest, year
from gpbnb.kalman.bounded_run import BoundedHistory
from gpbnb.kalman.ensembles import Summary
from gpbnb.kalman.gravity_probe_b import STATES
from gpbnb.kalman.independent import FirstStep, ModelShare
from gpbnb.kalman.mission import PARAMETERS
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.printed import Terms
from gpbnb.kalman.probability import Share
from gpbnb.kalman.requirement import Requirement
from gpbnb.kalman.sensitivity import Moved

DOUBLE = FloatFormat(2, 53)


def example(k: int, n: int, m: int) -> Table:
    """Tabulate the closing example for (125), printed and corrected: coefficients, β, digits, error in IEEE double."""
    body = []
    for name, faults in report_bounds.CORRECTIONS.items():
        for term, coefficient in zip(("first", "second"), report_bounds.coefficients(k, n, m, **faults), strict=True):
            body.append(
                (
                    name,
                    term,
                    scientific(coefficient, 5),
                    scientific(Fraction(1, coefficient), 4),
                    str(report_bounds.precision_for_coefficient(coefficient)),
                    scientific(coefficient * DOUBLE.unit_roundoff, 2),
                )
            )
    header = ("(125)", "term", "coefficient", "$\\beta$ = 1 / coefficient", "digits", "error in IEEE double")
    return Table(f"the closing example, {len(report_bounds.CORRECTIONS)} ways", header, tuple(body))


def misprints(k: int, n: int, m: int) -> Table:
    """Tabulate each printed number of the closing example, the value by the formula, and the likely origin."""
    first, second = report_bounds.coefficients(k, n, m)
    printed = report_bounds.PRINTED
    wrong = report_bounds.one_digit_misprints(k, n, m, printed["first coefficient"])
    loops = sorted({a * n + b * m + c for a, b, c in wrong})
    ways = " or ".join(f"${a}n+{b}m+{c}$" for a, b, c in wrong)
    products = [loop for loop in loops if prints_as(report_bounds.read_as_product(k, n, m, loop), printed[_SECOND])]
    values: list[tuple[str, str, str]] = [
        (
            "first coefficient",
            scientific(first, 5),
            f"{', '.join(map(str, loops))} times $k$, from a factor {ways}",
        ),
        (
            "second coefficient",
            scientific(second, 5),
            f"{', '.join(map(str, products))} as above, and × in place of +: $k(3n+1)\\cdot0.5(k-1)\\cdot{products[0]}$"
            if products
            else "not found",
        ),
    ]
    for name, coefficient in (("first", first), ("second", second)):
        given = Fraction(printed[f"{name} coefficient"])
        beta = Fraction(printed[f"{name} beta"])
        follows = prints_as(1 / given, printed[f"{name} beta"])
        values.append(
            (f"{name} beta", scientific(Fraction(1, coefficient), 4), _yes(follows, "one over the printed coefficient"))
        )
        exact_digits = 1 - math.log10(2 * float(beta))
        needed = report_bounds.precision_for_coefficient(1 / beta)
        values.append(
            (
                f"{name} digits",
                str(report_bounds.precision_for_coefficient(coefficient)),
                f"the printed β corresponds to {exact_digits:.2f} digits, so {needed} are needed",
            )
        )
    body = tuple((name, f"${_typeset(printed[name])}$", value, why) for name, value, why in values)
    return Table("the printed numbers of the closing example", ("number", "printed", "formula", "explanation"), body)


_SECOND = "second coefficient"


def tolerances(k: int, n: int, m: int, tolerance: Fraction, size: Fraction) -> Table:
    """Tabulate digits that each coefficient requires for an error of `size`, as in the example, and `tolerance`.

    Parameters
    ----------
    k, n, m : values of the example. tolerance, size : allowed error, and size of the quantity, in the same units.
    """
    body = []
    for name, coefficient in zip(("first", "second"), report_bounds.coefficients(k, n, m), strict=True):
        for allowed in (Fraction(1), Fraction(tolerance) / Fraction(size)):
            body.append(
                (
                    name,
                    scientific(allowed, 2),
                    scientific(allowed * Fraction(size), 2),
                    str(report_bounds.precision_for_coefficient(coefficient, allowed)),
                    str(report_bounds.precision_for_coefficient(coefficient, allowed, base=2)),
                )
            )
    header = ("dominant term", "allowed error, relative", "allowed error (mas)", "decimal digits", "bits")
    return Table("digits for an error of 1 and for the tolerance", header, tuple(body))


def violations(fmts: Sequence[FloatFormat]) -> Table:
    """Tabulate error / bound for the scalar filter that violates all bounds, by format and form of (99)."""
    body = []
    for fmt in fmts:
        for name, second in (("first", False), ("second", True)):
            found = smallest.ratios(fmt, smallest.scalar(fmt), second)
            body.append((arithmetic(fmt), name, *(short(ratio, 3) for ratio in found)))
    return Table(
        f"{len(body)} runs of the smallest filter",
        ("arithmetic", "form of (99)", "error / (105)", "error / (108)", "error / (125)"),
        tuple(body),
    )


def order() -> Table:
    """Tabulate the order in which the four equations can be computed."""
    body = []
    for name, second in (("first", False), ("second", True)):
        found = report_bounds.order(second)
        body.append(
            (name, " → ".join(found) if found else "none: (99) needs the result of (101), and (101) that of (99)")
        )
    return Table("the order of (98)-(101)", ("form of (99)", "order"), tuple(body))


def largest_violating_noise(fmts: Sequence[FloatFormat]) -> Table:
    """Tabulate the largest R, for a variance of 1, with which the scalar filter violates each bound."""
    body = []
    for fmt in fmts:
        for name, second in (("first", False), ("second", True)):
            found = smallest.largest_violating_noise(fmt, second)
            cells = (f"{float(found[each]):.3g}" if each in found else "none" for each in smallest.Ratios._fields)
            body.append((arithmetic(fmt), name, *cells))
    header = ("arithmetic", "form of (99)", "$R$ for (105)", "$R$ for (108)", "$R$ for (125)")
    return Table(f"the largest noise that breaks a bound, {len(body)} ways", header, tuple(body))


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
    return Table(f"{len(body)} years", header, tuple(body))


def slack(runs: Sequence[year.Year], bounds: Sequence[year.Bounds], terms: Terms) -> Table:
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


def trials(found: Sequence[Summary]) -> Table:
    """Tabulate, for each kind of random filters and for all, the violations and the largest error / bound."""
    body = []
    kinds = list(dict.fromkeys(each.kind for each in found))
    for name, group in [(kind, [each for each in found if each.kind == kind]) for kind in kinds] + [
        ("all", list(found))
    ]:
        count = sum(each.trials for each in group)
        cells = []
        for bound in ("105", "108", "125"):
            violated = sum(getattr(each, f"violations_{bound}") for each in group)
            largest = max(getattr(each, f"worst_{bound}") for each in group)
            cells.append(f"{100 * violated / count:.1f} %, {short(largest)}")
        largest = max(max(each.state, each.gain, each.covariance) for each in group)
        violated = sum(each.contraction_violations for each in group)
        compared = sum(each.compared for each in group)
        logarithm = sum(each.compared * math.log(each.typical) for each in group if each.compared)
        typical = short(math.exp(-logarithm / compared)) if compared else ""
        body.append((name, str(count), *cells, f"{violated}, {largest:.3f}", typical))
    header = (
        "models",
        "runs",
        *(f"({bound}): violations, largest error / bound" for bound in (105, 108, 125)),
        "contraction bound: violations, largest error / bound",
        "contraction bound / error, typical",
    )
    return Table(f"{sum(each.trials for each in found)} random filters", header, tuple(body))


def requirements(answers: Sequence[tuple[str, Requirement]]) -> Table:
    """Tabulate answers of :func:`gpbnb.kalman.precision.required_precision`."""
    body = []
    for name, answer in answers:
        ratio = f"{dict(answer.tried)[answer.fmt.precision]:.2g}" if answer.fmt else ""
        smallest_format = arithmetic(answer.fmt) if answer.fmt else "none"
        body.append((name, answer.basis, str(answer.steps), smallest_format, ratio))
    header = ("filter", "found by", "steps", "smallest precision", "error or bound / tolerance")
    return Table(f"{len(body)} answers", header, tuple(body))


def _typeset(printed: str) -> str:
    mantissa, _, power = printed.partition("e")
    return rf"{mantissa}\times10^{{{power}}}" if power else mantissa


def _yes(holds: bool, what: str) -> str:
    return what if holds else f"not {what}"


def shares(found: Sequence[Share]) -> Table:
    """Tabulate the share of records within the tolerance for a year, with its 95 % limits, and quantiles."""
    rows = [
        (
            each.states,
            str(each.form),
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


def sensitivity(moved: Sequence[Moved]) -> Table:
    """Tabulate by how many bits each choice changes the answer."""
    rows = tuple(
        (each.choice, each.before, each.after, f"{each.bits:+.1f}".replace("-", "−"), str(each.records))
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
        unit = "bits" if fmt.base == 2 else "digits"
        groups.setdefault((each.setting, each.states, each.form, fmt.rounding.value, unit), []).append(each)
    rows = []
    for (setting, states, form, rounding, unit), group in groups.items():
        answer = probability.needed(group)
        observed, lognormal, shown = ("none" if each is None else f"{each} {unit}" for each in answer)
        at = next((each for each in group if each.fmt.precision == answer.observed), None)
        passed, limits = (f"{at.within} of {at.records}", f"{at.low:.3f} to {at.high:.3f}") if at else ("–", "–")
        rows.append((f"{setting}, {states}", f"{form}, {rounding}", observed, passed, limits, lognormal, shown))
    head = (
        "model and states", "form and rounding", "99 % of the records", "passed", "probability", "99 %, lognormal",
        "99 %, proved with 95 % confidence",
    )  # fmt: skip
    return Table("smallest precision that stays within a milliarcsecond", head, tuple(rows))


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


def bound_costs(
    found: Sequence[tuple[FloatFormat, BoundedHistory]], terms: Terms, reference: year.Bounds, time: float
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
    head = ("bound", "processor time", "extra digits", *(f"bound / error, {arithmetic(fmt)}" for fmt, _ in found))
    return Table(f"what a bound costs, after {k} steps", head, body)
