"""Figures of the chapters on the year of Gravity Probe B: results in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.display.style import (
    BLACK,
    COLOURS,
    OBSERVED,
    OBSERVED_OTHERS,
    REFERENCE,
    REFUTED,
    VALID,
    colours,
    label,
    legend,
    loglog,
)
from gpbnb.report.display.tables import arithmetic
from gpbnb.report.gravity_probe_b.answers import Answers, decimal_digits, largest
from gpbnb.report.gravity_probe_b.threshold import Share
from gpbnb.report.gravity_probe_b.year import Year
from gpbnb.report.kalman import report_bounds
from gpbnb.report.kalman.figures import bound_by_digits

_QUANTITIES = {
    "drift": "error of the drift angle (mas)",
    "rate": "error of the drift rate (mas/yr)",
    "gain": "relative gain error (no unit)",
    "covariance": "relative covariance error (no unit)",
}
_MARKERS = {Form.HUNG: "o", Form.HUNG_SECOND_GAIN: "P", Form.INNOVATION: "^", Form.JOSEPH: "s", Form.UD: "D"}


def years(runs: Sequence[Year], quantity: str, ax: Axes, tolerance: float | None = None) -> list[Artist]:
    """Draw the error of one quantity against the step, one curve for each run.

    Parameters
    ----------
    quantity : "drift" or "rate", the larger of two errors; "gain" or "covariance", norms.
    tolerance : tolerance to draw as a line, in the unit of the quantity.

    Raises
    ------
    ValueError : another quantity, or more curves than there are colours.
    """
    if quantity not in _QUANTITIES:
        raise ValueError(f"got quantity {quantity!r}; needed one of {', '.join(_QUANTITIES)}")
    artists: list[Artist] = []
    for run, colour in zip(runs, colours(len(runs), (*COLOURS, BLACK, REFERENCE)), strict=True):
        values = np.abs(getattr(run, quantity))
        if values.ndim > 1:
            values = values.max(axis=1)
        if run.case.fmt is None:
            raise ValueError(
                "got the reference among the runs; needed only rounded runs, because the reference has no error"
            )
        seen = values > 0
        artists += ax.plot(
            run.steps[seen], values[seen], marker=_MARKERS[run.case.form], color=colour, lw=0.8, label=_name(run)
        )
    if tolerance is not None:
        artists.append(ax.axhline(tolerance, color=REFERENCE, ls=":", label="tolerance"))
    loglog(ax)
    label(ax, "step $k$", _QUANTITIES[quantity])
    return artists


def lines(curves: Sequence[tuple[str, Sequence[float], Sequence[float]]], ax: Axes) -> list[Artist]:
    """Draw bounds against the step, given as name, steps and values; the last bound holds and the others fail."""
    artists: list[Artist] = []
    for number, (name, steps, values) in enumerate(curves):
        last = number == len(curves) - 1
        style = "-" if last else ("-", "--", "-.")[number % 3]
        artists += ax.plot(steps, values, color=VALID if last else REFUTED, ls=style, label=name)
    return artists


def level(name: str, value: float, ax: Axes) -> Artist:
    """Draw a printed bound that is the same at each step and that the errors exceed."""
    return ax.axhline(value, color=REFUTED, label=name)


def _name(run: Year) -> str:
    fmt = run.case.fmt
    if fmt is None:
        return "reference"
    return arithmetic(fmt) + ("" if run.case.form is Form.HUNG else f", {run.case.form}")


def year_end(
    runs: Sequence[Year],
    ax: Axes,
    tolerance: float,
    faults: Mapping[str, Mapping[str, bool]],
    answers: Sequence[tuple[str, Sequence[float]]],
) -> list[Artist]:
    """Draw the largest error of drift or rate in a year against the digits, with (125) and the answers.

    Parameters
    ----------
    tolerance : tolerance in mas and mas/yr.
    faults : names, and the corrected faults of (125), as for
        :func:`gpbnb.report.kalman.report_bounds.gravity_probe_b_bound`.
    answers : names and numbers of digits. The report's answers are open markers at the error that they allow, which is
        as large as the drift of a year; the last answer is a vertical bar through the tolerance.
    """
    artists: list[Artist] = []
    for form, rounding in [(form, rounding) for rounding in Rounding.documented() for form in Form]:
        group = [run for run in runs if run.case.form is form and run.case.rounding is rounding]
        if points := _points(group):
            colour = OBSERVED if rounding is Rounding.NEAREST else OBSERVED_OTHERS[2]
            name = f"{form}, {rounding.value}"
            artists += ax.plot(*zip(*sorted(points), strict=True), _MARKERS[form], color=colour, label=name, alpha=0.7)
    for (name, corrected), style in zip(faults.items(), ("-", "--", "-."), strict=False):
        artists += bound_by_digits(ax, corrected, ls=style, label=name)
    artists.append(ax.axhline(tolerance, color=REFERENCE, ls=":", label="tolerance"))
    for (name, places), marker in zip(answers[:-1], "os^", strict=False):
        colour = REFUTED if marker == "o" else BLACK
        height = [float(report_bounds.YEAR_SIZE)] * len(places)
        artists += ax.plot(list(places), height, marker, mfc="none", mec=colour, ms=9, label=name)
    for name, places in answers[-1:]:
        artists += ax.plot(
            list(places), [tolerance] * len(places), "|", color=BLACK, ms=26, mew=2, ls="none", label=name
        )
    ax.set_yscale("log")
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(1.0, 1.0), markerscale=0.6)
    label(ax, r"decimal digits, $1-\log_{10} 2\beta$", "largest error in a year (mas, mas/yr)")
    return artists


def digits_needed(found: Answers, ax: Axes) -> list[Artist]:
    """Draw the answers for the digits of a year, and the error of every emulated year; see :func:`year_end`."""
    lines: dict[str, Mapping[str, bool]] = {
        "(125), printed formula": {},
        "(125), all faults corrected": report_bounds.ALL_CORRECTED,
    }
    marked: list[tuple[str, Sequence[float]]] = [
        ("printed answers", found.printed),
        ("formula", found.formula),
        ("all faults corrected", found.corrected),
        ("observed", [found.observed[Rounding.NEAREST]]),
    ]
    return year_end(found.runs, ax, found.tolerance, lines, marked)


def headline(found: Answers, ax: Axes) -> list[Artist]:
    """Draw :func:`digits_needed` for the front page, with direct labels and without the forms of the filter."""
    artists: list[Artist] = []
    for rounding, colour, word in (
        (Rounding.CHOP, OBSERVED_OTHERS[2], "emulated, chopped"),
        (Rounding.NEAREST, OBSERVED, "emulated, rounded"),
    ):
        group = [run for run in found.runs if run.case.rounding is rounding]
        artists += ax.plot(*zip(*_points(group), strict=True), "o", color=colour, ms=6, alpha=0.75, label=word)
    for word, faults, style, place, away in (
        ("(125) as printed", {}, "-", 0, (2, -38)),
        ("(125) with its faults corrected", report_bounds.ALL_CORRECTED, "--", 12, (6, 6)),
    ):
        (line,) = bound_by_digits(ax, faults, ls=style)
        x, y = np.asarray(line.get_xdata())[place], np.asarray(line.get_ydata())[place]
        artists += [line, _beside(ax, word, (x, y), away, REFUTED)]
    artists.append(ax.axhline(found.tolerance, color=REFERENCE, ls=":"))
    artists.append(_beside(ax, "tolerance: one milliarcsecond", (3.5, found.tolerance), (0, -14), REFERENCE))
    size = float(report_bounds.YEAR_SIZE)
    artists.append(ax.axhline(size, color=REFERENCE, ls=":"))
    artists.append(_beside(ax, "the drift in a year", (16.4, size), (0, -13), REFERENCE, ha="right"))
    artists += ax.plot(found.printed, [size] * 2, "o", mfc="none", mec=REFUTED, ms=11, mew=1.5)
    artists += [
        _beside(ax, f"{place} printed", (place, size), (-6, 9), REFUTED, ha="center") for place in found.printed
    ]
    ax.set_yscale("log")
    ax.set_ylim(1e-11, 1e23)
    ax.set_yticks(10.0 ** np.arange(-8, 24, 8))
    ax.set_xticks(range(4, 24, 2))
    legend(ax, loc="lower left")
    label(ax, "decimal digits of the arithmetic", "largest error in a year (mas, mas/yr)")
    return artists


def _points(runs: Sequence[Year]) -> list[tuple[float, float]]:
    """List the digits of each rounded run and its largest error in the year."""
    return [(decimal_digits(fmt), largest(run)) for run in runs if (fmt := run.case.fmt) is not None]


def _beside(
    ax: Axes, text: str, at: tuple[float, float], away: tuple[float, float], colour: str, ha: str = "left"
) -> Artist:
    return ax.annotate(text, at, away, textcoords="offset points", color=colour, ha=ha)


def shares(found: Sequence[Share], ax: Axes, tolerance: float = 1.0) -> list[Artist]:
    """Draw the largest error of each record (points) against bits or digits, a column for each format, with medians."""
    artists: list[Artist] = []
    for states, colour in zip(dict.fromkeys(each.states for each in found), (OBSERVED, *OBSERVED_OTHERS), strict=False):
        group = [each for each in found if each.states == states]
        for each in group:
            # Spread points by rank, so that every record is visible.
            places = each.fmt.precision + 0.6 * (np.arange(each.records) + 0.5) / each.records - 0.3
            artists += ax.plot(places, np.sort(each.errors), ".", color=colour, ms=3)
        points = [(each.fmt.precision, each.quantile(0.5)) for each in group]
        artists += ax.plot(*zip(*points, strict=True), "_", color=colour, ms=18, mew=2, label=f"{states}, median")
    artists.append(ax.axhline(tolerance, color=REFERENCE, ls=":", label="tolerance"))
    ax.set_yscale("log")
    ax.set_xticks(sorted({each.fmt.precision for each in found}))
    legend(ax)
    label(ax, "bits" if found[0].fmt.base == 2 else "decimal digits", "largest error in a year (mas, mas/yr)")
    return artists
