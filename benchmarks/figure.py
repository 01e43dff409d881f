"""The timings as a figure: how many times as long as gpbnb each library takes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt

from benchmarks.timing import Row
from gpbnb.report.display.style import BLACK, OBSERVED, REFERENCE, TEXT, figure, label, legend
from gpbnb.report.display.vector import svg


def draw(table: Sequence[Row], path: Path) -> None:
    """One line a library, one group a task, on a logarithmic axis; what is to be reached is drawn as a bar."""
    places: list[float] = []
    names: list[str] = []
    tasks: list[tuple[float, str]] = []
    place = 0.0
    peers = [row for row in table if row.library != "gpbnb"]
    for row, before in zip(peers, [None, *peers], strict=False):
        if before is None or row.task != before.task:
            place += 1.4
            tasks.append((place - 0.85, row.task))
        places.append(place)
        names.append(row.library)
        place += 0.85
    ratios = [row.ratio for row in peers]
    reaches = [(row.least, place) for row, place in zip(peers, places, strict=True) if row.least is not None]
    fig, (ax,) = figure(height=0.3 * place + 0.9)
    ax.plot(ratios, places, "o", color=OBSERVED, label="measured")
    ax.plot(*zip(*reaches, strict=True), "|", color=BLACK, ms=12, mew=1.6, label="to be reached")
    ends = [last for last, after in zip(places, [*places[1:], math.inf], strict=True) if after > last + 1]
    starts = [start + 0.45 for start, _ in tasks]
    ax.vlines([1.0] * len(tasks), starts, [end + 0.4 for end in ends], color=REFERENCE, lw=1, label="gpbnb")
    for ratio, place in zip(ratios, places, strict=True):
        aside = 8 if ratio > 1 else 26  # beyond the line of gpbnb
        ax.annotate(amount(ratio), (ratio, place), (aside, 0), textcoords="offset points", va="center", fontsize=TEXT)
    for place, task in tasks:
        note = ax.annotate(task, (0, place), (6, 0), ax.get_yaxis_transform(), "offset points", va="center")
        note.set(weight="bold", fontsize=TEXT)
    ax.set_xscale("log")
    ax.set_xlim(min(0.3, min(ratios) / 2), max(ratios) * 6)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_ylim(places[-1] + 0.8, 0)
    ax.set_yticks(places, names)
    ax.grid(axis="y", visible=False)
    legend(ax, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
    label(ax, "time / time of gpbnb", "")
    path.write_text(svg(fig, TEXT), encoding="utf-8")
    plt.close(fig)


def amount(ratio: float) -> str:
    """Three digits, without a power of ten."""
    return f"{ratio:,.0f}×" if ratio >= 100 else f"{ratio:.3g}×"
