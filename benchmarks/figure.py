"""The timings as a figure: how many times as long as gpbnb each library takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt

from benchmarks.timing import Row
from gpbnb.report.display.style import OBSERVED, REFERENCE, TEXT, figure, label, name
from gpbnb.report.display.vector import svg


def draw(table: Sequence[Row], path: Path) -> None:
    """One line a task, one point a library, on a logarithmic axis; the library that comes closest is named."""
    tasks: dict[str, list[Row]] = {}
    for row in table:
        if row.library != "gpbnb":
            tasks.setdefault(row.task, []).append(row)
    fig, (ax,) = figure(height=0.26 * len(tasks) + 0.9, width=6.4)
    ax.axvline(1.0, color=REFERENCE, lw=1)
    name(ax, "gpbnb", (1.0, -1), REFERENCE)
    names = []
    for place, peers in enumerate(tasks.values()):
        closest = min(peers, key=lambda row: row.ratio)
        ratios = [row.ratio for row in peers]
        ax.plot(ratios, [place] * len(peers), "o", color=OBSERVED, mfc="none", ms=4)
        ax.plot([closest.ratio], [place], "o", color=OBSERVED, ms=5)
        names.append(f"{closest.library} {amount(closest.ratio)}")
    ax.set_xscale("log")
    ax.set_xlim(0.3, 2 * max(row.ratio for row in table))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_ylim(len(tasks) - 0.5, -1.5)
    ax.set_yticks(range(len(tasks)), [task if len(task) < 40 else task.replace(", ", ",\n") for task in tasks])
    for each in ax.get_yticklabels():
        if "\n" in each.get_text():
            each.set(fontsize=0.7 * TEXT, linespacing=1.0)  # two lines in the height of one
    aside = ax.secondary_yaxis("right")
    aside.set_yticks([-1, *range(len(tasks))], ["closest", *names])
    aside.tick_params(length=0)
    aside.spines["right"].set_visible(False)
    label(ax, "time / time of gpbnb", "")
    path.write_text(svg(fig, TEXT), encoding="utf-8")
    plt.close(fig)


def amount(ratio: float) -> str:
    """Three digits, without a power of ten."""
    return f"{ratio:,.0f}×" if ratio >= 100 else f"{ratio:.3g}×"
