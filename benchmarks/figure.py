"""The timings as a figure: how many times as long as gpbnb each library takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt

from benchmarks.timing import Row


def draw(table: Sequence[Row], path: Path) -> None:
    """One bar a library, one group a task, on a logarithmic axis; the line is gpbnb."""
    tasks = list(dict.fromkeys(row.task for row in table))
    shown = [row for row in table if row.library != "gpbnb"]
    with mpl.rc_context({"svg.hashsalt": "gpbnb", "svg.fonttype": "none"}):
        figure, ax = plt.subplots(figsize=(7.0, 0.32 * len(shown) + 0.45 * len(tasks) + 0.8), layout="constrained")
        place, ticks, labels = 0.0, [], []
        for task in tasks:
            ax.text(
                0.0, place, f" {task}", transform=ax.get_yaxis_transform(), fontweight="bold", fontsize=9, va="center"
            )
            place += 0.9
            for row in (row for row in shown if row.task == task):
                ax.barh(place, row.ratio, left=0, height=0.7, color="C0" if row.ratio >= 1 else "C1")
                ax.text(row.ratio * 1.08, place, f"{row.ratio:.3g}×", va="center", fontsize=8)
                ticks.append(place)
                labels.append(row.library)
                place += 0.8
            place += 0.2
        ax.axvline(1.0, color="black", linewidth=1)
        ax.set_xscale("log")
        ax.set_xlim(min(0.3, min(row.ratio for row in shown) / 2), max(row.ratio for row in shown) * 3)
        ax.set_yticks(ticks, labels)
        ax.invert_yaxis()
        ax.set_xlabel("time / time of gpbnb")
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)
