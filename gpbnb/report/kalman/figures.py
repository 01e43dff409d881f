"""Figures of the chapter on the Kalman filter: results in, artists out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.bounded_run import BoundedHistory
from gpbnb.filters import kalman_step
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel
from gpbnb.filters.program import CONSTANT, coefficient_matrices
from gpbnb.filters.tracing import Trace
from gpbnb.report.display.style import (
    BLACK,
    OBSERVED,
    OBSERVED_OTHERS,
    REFERENCE,
    REFUTED,
    TEXT,
    VALID,
    label,
    legend,
    loglog,
)
from gpbnb.report.display.style import name as write
from gpbnb.report.kalman import report_bounds
from gpbnb.report.kalman.ensembles import Summary

DIGITS = np.linspace(3.5, 23, 50)


def bound_by_digits(ax: Axes, faults: Mapping[str, bool], **style: Any) -> list[Line2D]:
    """Draw bound (125) at the end of a year against the decimal digits, in mas."""
    betas = [Fraction(0.5 * 10.0 ** (1 - digits)) for digits in DIGITS.tolist()]
    heights = [report_bounds.gravity_probe_b_bound(beta, report_bounds.EXAMPLE[0], **faults) for beta in betas]
    return ax.plot(DIGITS, heights, color=REFUTED, **style)


def bound_by_steps(steps: Iterable[int], fmt: FloatFormat, faults: Mapping[str, bool]) -> list[float]:
    """Return bound (125) in one format after some steps, in mas, for the lines of a figure."""
    return [report_bounds.gravity_probe_b_bound(fmt.unit_roundoff, int(k), **faults) for k in steps]


def contraction(found: BoundedHistory, state: int, ax: Axes, name: str) -> list[Artist]:
    """Draw the error of one state (points) and its contraction bound (line) against the step."""
    steps, error, bound = found.history.steps, np.abs(found.history.state[:, state]), found.state[:, state]
    seen = error > 0
    artists: list[Artist] = [*ax.plot(steps[seen], error[seen], "o", color=OBSERVED, label="observed")]
    artists += ax.plot(steps, bound, color=VALID, label="contraction bound")
    middle = 2 * len(steps) // 3
    places: list[tuple[str, float, str, dict[str, Any]]] = [
        ("contraction bound", bound[middle], VALID, {"xytext": (-4, 6), "ha": "right"}),
        ("observed", error[middle], OBSERVED, {"xytext": (8, -6), "ha": "left", "va": "top"}),
    ]
    for text, y, colour, where in places:
        artists.append(
            ax.annotate(text, (steps[middle], y), color=colour, textcoords="offset points", fontsize=TEXT, **where)
        )
    loglog(ax)
    label(ax, "step $k$", f"error of {name}")
    return artists


def violations(summaries: Sequence[Summary], ax: Axes) -> list[Artist]:
    """Draw the share of random filters that violate each bound, with a group of bars for each form."""
    bounds = (("(105)", "violations_105"), ("(108)", "violations_108"), ("(125)", "violations_125"))
    forms = list(dict.fromkeys(summary.form for summary in summaries))
    artists: list[Artist] = []
    for number, ((name, field), colour) in enumerate(zip(bounds, (OBSERVED, *OBSERVED_OTHERS), strict=False)):
        shares = []
        for form in forms:
            group = [summary for summary in summaries if summary.form == form]
            shares.append(100 * sum(getattr(each, field) for each in group) / sum(each.trials for each in group))
        artists += ax.bar(np.arange(len(forms)) + 0.27 * (number - 1), shares, 0.25, color=colour, label=name).patches
    ax.set_xticks(range(len(forms)), [str(Form[form.upper()]).replace(", ", ",\n") for form in forms])
    ax.set_ylim(0, 118)
    legend(ax, ncols=3, loc="upper right")
    label(ax, "form of the filter", "filters that violate the bound (%)")
    return artists


class StepPart(NamedTuple):
    """A part of a step: its name, its formula in the report, and how many rounded operations it makes."""

    name: str
    formula: str
    operations: int


def step_parts(n: int, m: int) -> tuple[StepPart, ...]:
    """Count the rounded operations of a step in the innovation form with full matrices, in the order of the step."""
    (Phi, H, Q, R), zero = coefficient_matrices((n, n), (m, n), (n, n), (m, m))
    trace = Trace(n + n * n, m, zero, zero + 1)
    states = trace.build.states
    x, P, z = trace.values(states[:n], n, 1), trace.values(states[n:], n, n), trace.values(trace.build.inputs, m, 1)
    model = StepModel(*(trace.coefficients(each) for each in (Phi, H, Q, R)))
    algebra, counts = trace.algebra(), [0]

    def counted(result: Any) -> Any:
        codes = trace.build.finish(states, zero + 2).operations[:, 0]
        counts.append(int((codes != CONSTANT).sum()))
        return result

    V = counted(kalman_step.predicted(algebra, model.Phi, P, model.Q))
    K = counted(kalman_step.gain(algebra, model.H, model.R, V)).K
    counted(kalman_step.updated(algebra, Form.INNOVATION, model, V, K))
    ahead = counted(algebra.times(model.Phi, x))
    difference = counted(z - algebra.times(model.H, ahead))
    counted(kalman_step.corrected_by(algebra, K, ahead, difference))
    names = {
        "predict covariance": r"$P_p = \Phi P\Phi^T + Q$",
        "gain": r"$K = P_pH^T(HP_pH^T + R)^{-1}$",
        "update covariance": r"$P = (I - KH)P_p$",
        "predict state": r"$x_p = \Phi x$",
        "innovation": r"$y = z - Hx_p$",
        "correct state": r"$x = x_p + Ky$",
    }
    return tuple(
        StepPart(name, formula, after - before)
        for (name, formula), (before, after) in zip(names.items(), pairwise(counts), strict=True)
    )


def block_diagram(parts: Sequence[StepPart], ax: Axes) -> list[Artist]:
    """Draw a step as blocks: covariance and gain above, the state below; each block has its share of the roundings."""
    total = sum(part.operations for part in parts)
    artists: list[Artist] = []
    columns = ((0.0, 0.46), (1.2, 0.56), (2.4, 0.46))  # centre and half a width; the formula of the gain is long
    places = [(*column, row) for row in (1.0, 0.0) for column in columns]
    for part, (column, half, row) in zip(parts, places, strict=True):
        share = part.operations / total
        box = FancyBboxPatch(
            (column - half, row - 0.27),
            2 * half,
            0.54,
            boxstyle="round,pad=0.03",
            facecolor=(*to_rgb(OBSERVED), 0.06 + 0.5 * share),
            edgecolor=OBSERVED,
        )
        ax.add_patch(box)
        words = f"{part.name}\n{part.formula}\n{part.operations:,}, {100 * share:.1f} %"
        artists.append(ax.text(column, row, words, ha="center", va="center", fontsize=TEXT, linespacing=1.5))
    arrows = [
        (x, row, x + length, row)
        for row in (1, 0)
        for x, length in ((-0.69, 0.2), (0.49, 0.12), (1.79, 0.12), (2.89, 0.2))
    ]
    for *start, x, y in [*arrows, (1.5, 0.7, 2.08, 0.3), (1.2, -0.55, 1.2, -0.3)]:
        ax.annotate("", (x, y), (start[0], start[1]), arrowprops={"arrowstyle": "->", "color": BLACK, "lw": 1.4})
    letters = (("P", -0.76, 1), ("x", -0.76, 0), ("P", 3.16, 1), ("x", 3.16, 0), ("z", 1.2, -0.66), ("K", 1.9, 0.56))
    for letter, x, y in letters:
        artists.append(ax.text(x, y, f"${letter}$", ha="center", va="center", fontsize=TEXT))
    ax.set_xlim(-0.85, 3.25)
    ax.set_ylim(-0.75, 1.35)
    ax.axis("off")
    return artists


def waterfall(ax: Axes, tolerance: Fraction, observed: float) -> list[Artist]:
    """Draw how the decimal digits that the closing example demands change from its first number to a corrected formula.

    Parameters
    ----------
    tolerance : relative error that is allowed in place of one as large as the drift.
    observed : decimal digits with which an emulated year stayed within that error.
    """
    digits = report_bounds.example_digits(tolerance)
    written = [*report_bounds.written_changes(digits).values()]
    artists: list[Artist] = []
    for row, (before, after) in enumerate(pairwise([0.0, *digits.values()])):
        colour = REFUTED if after >= before else REFERENCE
        artists += ax.barh(-row, after - before, 0.62, left=before, color=colour, alpha=0.85).patches
        count, change = written[row]
        words = f"{count} ({change})" if change else count
        write(ax, words, (max(before, after), -row), BLACK, (6 if row else -6, 0))
        if row:
            ax.plot([before, before], [-row + 1.31, -row - 0.31], color=REFERENCE, lw=0.8)
    ax.axvline(observed, color=OBSERVED, lw=1.4)
    write(ax, f"an emulated year: {observed:.1f}", (observed, 0.75), OBSERVED, (6, 0), annotation_clip=False)
    ax.set_yticks([-row for row in range(len(digits))], [*digits])
    ax.set_ylim(0.5 - len(digits), 1.2)
    ax.set_xlim(0, 36)
    ax.grid(axis="y", visible=False)
    label(ax, "decimal digits", "")
    return artists
