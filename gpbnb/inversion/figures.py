"""Figures of the chapter on matrix inversion: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import MaxNLocator

from gpbnb.display.style import BOUND, COLOURS, OBSERVED, REFERENCE, STRICT, colours, label, legend
from gpbnb.inversion.example import PLACES, PRINTED, Column
from gpbnb.inversion.experiment import Frozen, Trial
from gpbnb.inversion.tables import in_math


class Box(NamedTuple):
    """A box of the flow chart: its centre, its text, and the boxes that follow."""

    x: float
    y: float
    text: str
    follows: tuple[str, ...]


#: The boxes of Figure III-1, the computation at the left, its errors at the right.
CHART: Mapping[str, Box] = {
    "given": Box(0.24, 0.97, "Given matrix $A$", ("triangularize",)),
    "triangularize": Box(0.24, 0.82, "Triangularize $A$ into $A_T$", ("transform", "errors of A_T")),
    "transform": Box(
        0.24, 0.64, "The same for each $u_j$:\n$A x_j = u_j$ becomes $A_T x_j = b_j$", ("substitute", "errors of b")
    ),
    "substitute": Box(
        0.24,
        0.43,
        "Back substitution in $A_T x_j = b_j$\ngives $\\hat A^{-1} = [x_1 \\;\\ldots\\; x_n]$",
        ("errors of x", "inverse"),
    ),
    "errors of A_T": Box(0.76, 0.82, "$\\tilde A$, error in $A_T$, (59)", ("errors of b",)),
    "errors of b": Box(0.76, 0.64, "$\\tilde b_j$, error in $b_j$, (60)", ("errors of x",)),
    "errors of x": Box(0.76, 0.43, "$\\Delta A$ once, each $\\Delta b_j$, (89), (90)", ("sum of errors",)),
    "sum of errors": Box(
        0.76, 0.28, "$\\delta A = \\tilde A + \\Delta A$,  $\\delta b_j = \\tilde b_j + \\Delta b_j$", ("inverse",)
    ),
    "inverse": Box(
        0.5,
        0.13,
        "$\\delta(A^{-1}) = \\hat A^{-1}\\;[\\,\\delta b_1 - \\delta A\\,x_1"
        " \\;\\ldots\\; \\delta b_n - \\delta A\\,x_n\\,]$, (95)",
        ("norm",),
    ),
    "norm": Box(0.5, 0.0, "$\\|\\delta(A^{-1})\\|$, the error bound for $A^{-1}$", ()),
}


def flow_chart(ax: Axes) -> list[Artist]:
    """Figure III-1, drawn anew: boxes and arrows."""
    ax.set_axis_off()
    ax.set_xlim(0, 1)
    ax.set_ylim(-0.05, 1.02)
    drawn = {}
    for name, box in CHART.items():
        errors = "errors" in name
        style = {
            "boxstyle": "round,pad=0.45",
            "facecolor": "#FBEADF" if errors else "#DCEBF5",
            "edgecolor": BOUND if errors else OBSERVED,
        }
        drawn[name] = ax.text(box.x, box.y, box.text, ha="center", va="center", fontsize=10, bbox=style)
    arrows: list[Artist] = []
    for name, box in CHART.items():
        for follower in box.follows:
            arrow = FancyArrowPatch(
                (box.x, box.y),
                (CHART[follower].x, CHART[follower].y),
                arrowstyle="-|>",
                mutation_scale=11,
                color=REFERENCE,
                patchA=drawn[name].get_bbox_patch(),
                patchB=drawn[follower].get_bbox_patch(),
                shrinkA=2,
                shrinkB=2,
            )
            arrows.append(ax.add_patch(arrow))
    return [*drawn.values(), *arrows]


def table1(bounds: Sequence[Column], errors: Sequence[Column], ax: Axes) -> list[Artist]:
    """Table 1: every reading of both columns (points) and the printed numbers (open markers)."""
    artists: list[Artist] = []
    for columns, name, printed, colour, shift in (
        (bounds, "bounds, every reading", "bound", BOUND, -0.12),
        (errors, "errors, every reading", "error", OBSERVED, 0.12),
    ):
        x = np.repeat(np.arange(len(PLACES)) + shift, len(columns))
        y = np.array([one.values for one in columns]).T.ravel()
        artists += ax.plot(x, y, "_", ms=11, color=colour, alpha=0.25)
        ax.plot([], [], "_", ms=11, color=colour, label=name)  # in the legend without the haze
        values = [float(value) for value in PRINTED[printed]]
        marker = "s" if printed == "bound" else "o"
        artists += ax.plot(
            np.arange(len(PLACES)) + shift,
            values,
            marker,
            ms=8,
            mfc="white",
            mec=STRICT,
            label=f"{printed}s as printed",
        )
    ax.set_yscale("log")
    ax.set_xticks(range(len(PLACES)), [str(p) for p in PLACES])
    ax.set_xlim(-0.5, len(PLACES) - 0.5)
    legend(ax, fontsize=9)
    label(ax, "places after the decimal point", "error norm (no unit)")
    return artists


def violations(result: Frozen, bounds: Sequence[str], ax: Axes) -> list[Artist]:
    """Share of the regular matrices of each family whose error exceeds a bound, a bar for each bound."""
    families = [str(row["family"]) for row in result.select(format="all", bound=bounds[0]) if row["family"] != "all"]
    width = 0.8 / len(bounds)
    artists: list[Artist] = []
    for k, (name, colour) in enumerate(zip(bounds, colours(len(bounds), (STRICT, *COLOURS)), strict=True)):
        rows = [result.select(family=family, format="all", bound=name)[0] for family in families]
        share = [100 * int(row["violations_regular"]) / max(1, int(row["regular"])) for row in rows]
        bars = ax.bar(
            np.arange(len(families)) + (k - (len(bounds) - 1) / 2) * width,
            share,
            width,
            color=colour,
            label=in_math(name),
        )
        artists += list(bars)
    ax.set_xticks(range(len(families)), [family.replace(" ", "\n") for family in families], fontsize=9)
    legend(ax, fontsize=9)
    label(ax, "family of matrices", "inverses beyond the bound (%)")
    return artists


def ratios(trials: Sequence[Trial], bounds: Sequence[str], ax: Axes, against: str = "size") -> list[Artist]:
    """Bound over error: medians with the range as a band against the size, or points against the condition number."""
    artists: list[Artist] = []
    for name, marker, colour in zip(bounds, "osD^Pv", colours(len(bounds), (STRICT, *COLOURS)), strict=False):
        having = [one for one in trials if name in one.bounds and one.error]
        if against == "condition":
            x = [one.condition for one in having]
            artists += ax.plot(
                x, [one.overestimation(name) for one in having], marker, ms=3.5, color=colour, label=name
            )
            continue
        sizes = sorted({one.n for one in having})
        groups = [[one.overestimation(name) for one in having if one.n == n] for n in sizes]
        artists.append(
            ax.fill_between(sizes, [min(g) for g in groups], [max(g) for g in groups], color=colour, alpha=0.12)
        )
        artists += ax.plot(sizes, [np.median(g) for g in groups], marker=marker, color=colour, lw=1, label=name)
    artists.append(ax.axhline(1, color=BOUND, lw=1.2))
    ax.set_yscale("log")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    if against == "condition":
        limit = float(1 / trials[0].matrix.format.unit_roundoff)
        artists.append(ax.axvline(limit, color=REFERENCE, ls=":", label=r"$1/\beta$"))
        ax.set_xscale("log")
    label(ax, "condition number (no unit)" if against == "condition" else "rows $n$", "bound / error (no unit)")
    return artists
