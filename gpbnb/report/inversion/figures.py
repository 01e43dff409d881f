"""Figures of the chapter on matrix inversion: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import MaxNLocator

from gpbnb.report.display.style import BLACK, OBSERVED, REFERENCE, REFUTED, TEXT, VALID, label, legend, name, name_ends
from gpbnb.report.inversion.example import PLACES, PRINTED, PrintedColumn
from gpbnb.report.inversion.experiment import Frozen, InverseTrial
from gpbnb.report.inversion.tables import in_math


class Box(NamedTuple):
    """A box of the flow chart: its centre, its text, and the boxes that follow."""

    x: float
    y: float
    text: str
    follows: tuple[str, ...]


#: The boxes of Figure III-1, with the computation on the left and the bounds of its errors on the right.
CHART: Mapping[str, Box] = {
    "given": Box(0.25, 0.98, "Given matrix $A$", ("triangularize",)),
    "triangularize": Box(0.25, 0.83, "Triangularize $A$ into $A_T$", ("transform", "errors of A_T")),
    "transform": Box(0.25, 0.64, "Transform each $u_j$ into $b_j$:\n$A_T x_j = b_j$", ("substitute", "errors of b")),
    "substitute": Box(
        0.25,
        0.43,
        "Back substitution:\n$\\hat A^{-1} = [x_1 \\;\\ldots\\; x_n]$",
        ("errors of x", "error of inverse"),
    ),
    "errors of A_T": Box(0.76, 0.83, "$\\tilde A$, error in $A_T$, (59)", ("errors of b",)),
    "errors of b": Box(0.76, 0.64, "$\\tilde b_j$, error in $b_j$, (60)", ("errors of x",)),
    "errors of x": Box(0.76, 0.44, "$\\Delta A$ and $\\Delta b_j$, (89), (90)", ("sum of the errors",)),
    "sum of the errors": Box(
        0.76,
        0.27,
        "$\\delta A = \\tilde A + \\Delta A$\n$\\delta b_j = \\tilde b_j + \\Delta b_j$",
        ("error of inverse",),
    ),
    "error of inverse": Box(
        0.42,
        0.1,
        "$\\delta(A^{-1}) = \\hat A^{-1}\\;[\\,\\delta b_j - \\delta A\\,x_j\\,]$, (95)",
        ("bound on error",),
    ),
    "bound on error": Box(0.42, -0.06, "Bound $\\|\\delta(A^{-1})\\|$", ()),
}


def flow_chart(ax: Axes) -> list[Artist]:
    """Redraw Figure III-1 with boxes and arrows."""
    ax.set_axis_off()
    ax.set_xlim(0, 1)
    ax.set_ylim(-0.12, 1.04)
    drawn = {}
    for key, box in CHART.items():
        errors = "error" in key
        style = {
            "boxstyle": "round,pad=0.4",
            "facecolor": "#FBEADF" if errors else "#DCEBF5",
            "edgecolor": REFUTED if errors else OBSERVED,
        }
        drawn[key] = ax.text(box.x, box.y, box.text, ha="center", va="center", fontsize=TEXT, bbox=style)
    arrows: list[Artist] = []
    for key, box in CHART.items():
        for follower in box.follows:
            arrow = FancyArrowPatch(
                (box.x, box.y),
                (CHART[follower].x, CHART[follower].y),
                arrowstyle="-|>",
                mutation_scale=11,
                color=REFERENCE,
                patchA=drawn[key].get_bbox_patch(),
                patchB=drawn[follower].get_bbox_patch(),
                shrinkA=2,
                shrinkB=2,
            )
            arrows.append(ax.add_patch(arrow))
    return [*drawn.values(), *arrows]


def table1(bounds: Sequence[PrintedColumn], errors: Sequence[PrintedColumn], ax: Axes) -> list[Artist]:
    """Draw Table 1: every reading of both columns (dashes) and the printed numbers (open markers)."""
    artists: list[Artist] = []
    for columns, printed, colour, shift in ((bounds, "bound", REFUTED, -0.16), (errors, "error", OBSERVED, 0.16)):
        x = np.repeat(np.arange(len(PLACES)) + shift, len(columns))
        y = np.array([one.values for one in columns]).T.ravel()
        artists += ax.plot(x, y, "_", ms=11, color=colour, alpha=0.25)
        values = [float(value) for value in PRINTED[printed]]
        marker = "s" if printed == "bound" else "o"
        artists += ax.plot(np.arange(len(PLACES)) + shift, values, marker, ms=8, mfc="none", mec=BLACK, mew=1.6)
        side = 1 if shift > 0 else -1
        top = max(one.values[0] for one in columns)
        name(
            ax,
            f"all readings\nof the {printed}",
            (shift, top),
            colour,
            (11 * side, 14 if shift < 0 else 26),
            va="center",
        )
        name(ax, f"{printed} as\nprinted", (shift, values[0]), BLACK, (11 * side, 0))
    ax.set_yscale("log")
    ax.set_xticks(range(len(PLACES)), [str(p) for p in PLACES])
    ax.set_xlim(-1.0, len(PLACES) - 0.5)
    label(ax, "places after the decimal point", "error norm")
    return artists


def violations(result: Frozen, bounds: Sequence[str], ax: Axes) -> list[Artist]:
    """Draw, for each family of regular matrices, the share whose error exceeds a printed bound."""
    markers = (("o", REFUTED), ("o", "none"), ("s", REFUTED), ("s", "none"))
    if len(bounds) > len(markers):
        raise ValueError(
            f"got {len(bounds)} bounds; needed at most {len(markers)}, or markers repeat; draw two figures"
        )
    families = [str(row["family"]) for row in result.select(format="all", bound=bounds[0]) if row["family"] != "all"]
    artists: list[Artist] = []
    for k, (bound, (marker, face)) in enumerate(zip(bounds, markers, strict=False)):
        rows = [result.select(family=family, format="all", bound=bound)[0] for family in families]
        share = [100 * int(row["violations_regular"]) / max(1, int(row["regular"])) for row in rows]
        height = np.arange(len(families)) + 0.12 * (k - (len(bounds) - 1) / 2)
        artists += ax.plot(share, height, marker, ms=7, mec=REFUTED, mfc=face, ls="none", label=in_math(bound))
    ax.set_yticks(range(len(families)), families)
    ax.invert_yaxis()
    ax.set_xlim(-1, None)
    legend(ax, loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2)
    label(ax, "inverses with an error above the bound (%)", "family of matrices")
    return artists


#: The marker of each bound, the same in every panel.
BOUND_MARKERS = {
    "Wilkinson": "o",
    "Higham": "s",
    "strict": "D",
    "ball": "^",
    "preconditioned ball": "P",
    "a posteriori": "v",
}


def ratios(trials: Sequence[InverseTrial], bounds: Sequence[str], ax: Axes, against: str = "size") -> list[Artist]:
    """Draw bound / error: medians against the size of the matrix, or every trial against the condition number."""
    artists: list[Artist] = []
    ends = {}
    for bound, other in zip(bounds, "osD^Pv", strict=False):
        marker = BOUND_MARKERS.get(bound, other)
        having = [one for one in trials if bound in one.bounds and one.error]
        if against == "condition":
            having.sort(key=lambda one: one.condition)
            x, y = [one.condition for one in having], [one.overestimation(bound) for one in having]
            artists += ax.plot(x, y, marker, ms=4, color=VALID, label=bound)
            # Label the loosest bound at its last point, the sharpest above its first, any other below its first.
            place, shift = (-1, (6, 0)) if bound == bounds[0] else (0, (1, 4 if bound == bounds[-1] else -8))
            name(ax, bound, (x[place], y[place]), VALID, shift)
            continue
        sizes = sorted({one.n for one in having})
        medians = [float(np.median([one.overestimation(bound) for one in having if one.n == n])) for n in sizes]
        artists += ax.plot(sizes, medians, marker=marker, color=VALID, lw=1, label=bound)
        ends[bound] = medians[-1], VALID
    artists.append(ax.axhline(1, color=OBSERVED, lw=1.2))
    ax.set_yscale("log")
    if against == "condition":
        limit = float(1 / trials[0].matrix.format.unit_roundoff)
        artists.append(ax.axvline(limit, color=REFERENCE, ls=":"))
        ax.set_xscale("log")
        ax.set_ylim(bottom=0.4)
        name(ax, r"$1/\beta$", (limit, ax.get_ylim()[1]), REFERENCE, (-3, -2))
    else:
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    rows = "condition number" if against == "condition" else "rows $n$"
    label(ax, rows, "bound / error" if against == "condition" else "bound / error, median")
    if ends:
        name_ends(ax, {**ends, "error": (1.0, OBSERVED)})
    else:
        name(ax, "error", (min(one.condition for one in trials), 1), OBSERVED, (1, -3))
    return artists
