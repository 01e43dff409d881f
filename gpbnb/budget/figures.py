"""Figures of the chapter on the error budget: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.budget import theory
from gpbnb.budget.experiment import Draws
from gpbnb.budget.theory import Budget, ErrorForm
from gpbnb.display.style import BOUND, OBSERVED, OBSERVED_OTHERS, REFERENCE, STRICT, label, legend, loglog


def budget_curve(printed: tuple[float, float], totals: Sequence[float], ax: Axes, most: int = 100) -> list[Artist]:
    """Figure II-2: error of each of N equal sources for a root-sum-square, and where all have one sign.

    Parameters
    ----------
    printed : number of sources and error of each that the document states; milliarcseconds.
    totals : root-sum-squares, milliarcseconds; a curve each, the first that of the document.
    most : largest number of sources.
    """
    n = np.arange(1, most + 1)
    artists: list[Artist] = []
    for total, colour in zip(totals, (OBSERVED, OBSERVED_OTHERS[2]), strict=False):
        each = [theory.equal_error(total, int(k)) for k in n]
        artists += ax.plot(n, each, color=colour, label=f"root-sum-square {total:g} mas")
    artists += ax.plot(n, totals[0] / n, color=BOUND, ls="--", label=f"all of one sign, {totals[0]:g} mas")
    artists += ax.plot(*printed, "o", mfc="white", color=STRICT, ms=8, label="printed example")
    loglog(ax)
    legend(ax)
    label(ax, "number of equal sources $N$ (no unit)", "error of each (mas)")
    return artists


def shares(budget: Budget, ax: Axes) -> list[Artist]:
    """Each source's share of the square of the total, largest first, in the colour of its form."""
    ordered = sorted(budget.sources, key=budget.share)
    colours = dict(zip(ErrorForm, (OBSERVED, BOUND, *OBSERVED_OTHERS[:2]), strict=True))
    bars = ax.barh(
        [source.name for source in ordered],
        [100 * budget.share(source) for source in ordered],
        color=[colours[source.form] for source in ordered],
    )
    used = {source.form: bar for source, bar in zip(ordered, bars, strict=True)}
    legend(
        ax, handles=[used[form] for form in ErrorForm if form in used], labels=[f.value for f in ErrorForm if f in used]
    )
    ax.grid(False, axis="y")
    label(ax, "share of the total's square (%)", "")
    return list(bars)


def distribution(result: Draws, ax: Axes) -> list[Artist]:
    """Total errors drawn at random (bars) with root-sum-square (lines), worst case and goal."""
    total, worst = result.budget.total, result.budget.worst_case
    heights, edges = np.histogram(result.errors, bins=60, density=True)
    bars = ax.bar(edges[:-1], heights, np.diff(edges), align="edge", color="#DCEBF5", edgecolor=OBSERVED, lw=0.5)
    artists: list[Artist] = list(bars)
    for value, colour, style, name in (
        (total, OBSERVED, "-", "± root-sum-square"),
        (theory.GOAL, REFERENCE, ":", "± the goal, 1 mas"),
        (worst, BOUND, "--", "± worst case"),
    ):
        artists += [ax.axvline(value, color=colour, ls=style, label=name), ax.axvline(-value, color=colour, ls=style)]
    legend(ax, fontsize=8.5, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    label(ax, "total error (mas)", "density (1/mas)")
    return artists
