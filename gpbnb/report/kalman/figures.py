"""Figures of the chapter on the Kalman filter: results in, artists out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.bounded_run import BoundedHistory
from gpbnb.report.display.style import (
    OBSERVED,
    REFUTED,
    TEXT,
    VALID,
    label,
    loglog,
)
from gpbnb.report.kalman import report_bounds

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
