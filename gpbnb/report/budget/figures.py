"""Figures of the chapter on the error budget: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.report.budget import theory
from gpbnb.report.budget.experiment import Draws
from gpbnb.report.budget.theory import Budget, ErrorForm
from gpbnb.report.display.style import BLACK, OBSERVED, OBSERVED_OTHERS, REFERENCE, VALID, label, loglog, name


def budget_curve(printed: tuple[float, float], totals: Sequence[float], ax: Axes, most: int = 100) -> list[Artist]:
    """Draw Figure II-2: the largest error of each of N equal sources, independent or all of the same sign.

    Parameters
    ----------
    printed : number of sources and error of each source in the report; milliarcseconds per year.
    totals : two root-sum-squares, in milliarcseconds per year; the first is the goal.
    most : largest number of sources.
    """
    n = np.arange(1, most + 1)
    goal, larger = totals
    artists: list[Artist] = []
    for total in (goal, larger):
        artists += ax.plot(n, [theory.equal_error(total, int(k)) for k in n], color=VALID)
    artists += ax.plot(n, goal / n, ":", color=REFERENCE)
    artists += ax.plot(*printed, "o", mfc="none", mew=1.6, color=BLACK, ms=9)
    artists.append(
        name(ax, f"independent,\ntotal {larger:g} mas/yr", (9, theory.equal_error(larger, 9)), VALID, (7, 3))
    )
    last = (most, theory.equal_error(goal, most))
    artists.append(name(ax, f"independent,\ntotal {goal:g} mas/yr", last, VALID, (0, -6), ha="right"))
    artists.append(name(ax, f"all of the same sign,\ntotal {goal:g} mas/yr", (9, goal / 9), REFERENCE, (-6, -4)))
    artists.append(name(ax, "printed example", printed, BLACK, (-7, -5)))
    loglog(ax)
    ax.set_xlim(1, 1.15 * most)
    ax.set_ylim(goal / most, 2 * larger)
    label(ax, "number of equal sources $N$", "error of each (mas/yr)")
    return artists


def shares(budget: Budget, ax: Axes) -> list[Artist]:
    """Draw the share of each source in the square of the total, largest on top, coloured by the form of the error."""
    ordered = sorted(budget.sources, key=budget.share)
    colours = dict(zip(ErrorForm, (OBSERVED, *OBSERVED_OTHERS[:3]), strict=True))
    parts = [100 * budget.share(source) for source in ordered]
    places = np.arange(len(ordered))
    bars = ax.barh(places, parts, color=[colours[source.form] for source in ordered])
    artists: list[Artist] = list(bars)
    for place, part, source in zip(places, parts, ordered, strict=True):
        artists.append(name(ax, f"{part:.0f} %, {source.form.value}", (max(part, 0), float(place)), BLACK, (5, 0)))
    ax.set_yticks(places, [source.name for source in ordered])
    ax.set_xlim(min(0, *parts), 1.45 * max(parts))
    ax.grid(False, axis="y")
    label(ax, "share of the square of the total (%)", "")
    return artists


def distribution(result: Draws, ax: Axes) -> list[Artist]:
    """Draw the distribution of random total errors, with the root-sum-square, the sum of all errors and the goal."""
    total, worst = result.budget.total, result.budget.worst_case
    widest = 1.02 * max(worst, float(np.abs(result.errors).max()))
    heights, edges = np.histogram(result.errors, bins=61, range=(-widest, widest), density=True)
    bars = ax.bar(edges[:-1], heights, np.diff(edges), align="edge", color=OBSERVED, alpha=0.55)
    artists: list[Artist] = list(bars)
    top = float(heights.max())
    for value, style, height, text in (
        (total, "-", 1.3, "root-sum-square"),
        (theory.GOAL, ":", 1.08, "goal"),
        (worst, "--", 0.7, "sum of all errors"),
    ):
        colour = REFERENCE if text == "goal" else BLACK
        artists.append(ax.vlines((-value, value), 0, height * top, color=colour, ls=style, lw=1.4))
        artists.append(name(ax, text, (value, height * top), colour, (4, -1)))
    artists.append(name(ax, "random draws", (-theory.GOAL, 0.9 * top), OBSERVED, (-6, 0)))
    ax.set_ylim(0, 1.42 * top)
    ax.set_xlim(-widest, widest)
    label(ax, "total error (mas/yr)", "density (yr/mas)")
    return artists
