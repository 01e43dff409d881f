"""The rule of colours, lines and texts: each departure is named, and the figures of the book are judged by it."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import numpy as np
import pytest

from gpbnb.report.display import style

BOOK = Path(__file__).resolve().parents[2] / "book"
CELLS = [
    (path.stem, number, cell)
    for path in sorted(BOOK.glob("*.ipynb"))
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"])
    if any("image/svg+xml" in output.get("data", {}) for output in cell.get("outputs", ()))
]


@pytest.mark.parametrize("cell", [pytest.param(cell, id=f"{page}-{number}") for page, number, cell in CELLS])
def test_every_figure_of_the_book_was_judged_and_found_right(cell):
    """A figure of :func:`style.figure` warns in a notebook, on stderr, of each departure from the rule."""
    source = "".join(cell["source"])
    calls = [node.func for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    assert any(isinstance(func, ast.Attribute) and func.attr == "figure" and func.value.id == "style" for func in calls)
    assert [output for output in cell["outputs"] if output.get("name") == "stderr"] == []


def good():
    fig, axes = style.figure(rows=2, share="x")
    for ax in axes:
        ax.plot([1, 2, 3], [1, 2, 1.5], "o", color=style.OBSERVED, label="observed")
        ax.axhline(3, color=style.VALID)
        ax.set_xlim(0.5, 3.5)
        ax.set_ylim(0.5, 3.5)
        style.name(ax, "bound", (1, 3), style.VALID, (0, 3))
        style.label(ax, "time (s)", "length (m)")
    return fig, axes


def judged(fig):
    fig.canvas.draw()
    return style.defects(fig)


def test_a_good_figure_has_no_defect():
    """A missing point is none beyond the axes, and nothing is beyond axes that are not drawn."""
    fig, axes = good()
    axes[0].plot([1, 2], [np.nan, 2], "o", color=style.OBSERVED)
    assert judged(fig) == []
    cut(axes[0])
    axes[0].axis("off")
    assert judged(fig) == []


def small(ax):
    ax.text(2, 2.5, "small", fontsize=8.5)


def small_on_the_right(ax):
    ax.tick_params(axis="y", labelright=True, labelleft=False, labelsize=8)


def faint(ax):
    ax.text(2, 2.5, "faint", color="#3E93C8", fontsize=style.TEXT)


def hyphen(ax):
    ax.text(2, 2.5, "slope -1.2", fontsize=style.TEXT)


def solid(ax):
    ax.axhline(2.5, color=style.REFUTED)


def dashed(ax):
    ax.axhline(2.5, color=style.VALID, ls="--")


def zero(ax):
    ax.set_yscale("log")
    ax.plot([1, 2], [0, 2], color=style.OBSERVED)
    ax.set_ylim(0.5, 3.5)


def crowded(ax):
    for number in range(7):
        ax.plot([1, 2], [1, 1 + number / 10], color=style.OBSERVED, label=f"{number}")
    style.legend(ax, loc="upper left", bbox_to_anchor=(1, 1))


def cover(ax):
    style.name(ax, "another", (1, 3), style.VALID, (0, 3))


def crossed(ax):
    style.name(ax, "a name", (2.5, 3), style.VALID, (0, 0))


def on_points(ax):
    ax.plot([2.5], [2.2], "s", color=style.OBSERVED, label="squares")
    style.name(ax, "a name", (2.5, 2.2), style.OBSERVED, (0, 0))


def outside(ax):
    style.name(ax, "far out to the right of it", (3.4, 2.5), style.BLACK, (90, 0)).set_in_layout(False)


def lost(ax):
    style.name(ax, "lost", (9, 9), style.BLACK)


def at_the_edge(ax):
    style.name(ax, "an edge", (2, 0.5), style.BLACK, (0, 0))


def cut(ax):
    ax.plot([2, 2], [9, 2], "o", color=style.OBSERVED, label="high")


def bar(ax):
    ax.bar([3.4], [1], 0.6, color=style.OBSERVED)


def unnamed(ax):
    ax.set_ylabel("")


def other_limits(ax):
    ax.set_ylim(0, 4)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (small, "8.5 points; needed 11"),
        (small_on_the_right, "8 points; needed 11"),
        (faint, "has a contrast of 3.4; needed 4.5"),
        (hyphen, "has a hyphen for a minus sign"),
        (solid, "a refuted formula has the line style '-'"),
        (dashed, "a valid formula has the line style '--'"),
        (zero, "not positive on a logarithmic axis"),
        (crowded, "a legend has 8 entries; at most 6"),
        (cover, "lies on 'another'"),
        (crossed, "'a name' lies on the curve"),
        (on_points, "'a name' lies on the curve 'squares'"),
        (outside, "leaves the figure"),
        (lost, "'lost' is not seen"),
        (at_the_edge, "'an edge' lies on the edge of the axes"),
        (cut, "'high' has points beyond the axes"),
        (bar, "a bar leaves the axes"),
        (unnamed, "the y axis has numbers and no label"),
        (other_limits, "the y axes 'length (m)' of several panels have different limits"),
    ],
)
def test_each_departure_is_named(spoil, words):
    fig, axes = good()
    spoil(axes[1])
    found = judged(fig)
    assert any(words in each for each in found), found
