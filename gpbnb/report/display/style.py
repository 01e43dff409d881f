"""The figure style of the book: its size, its palette, and direct labels.

Every figure uses the same three colours: :data:`OBSERVED` for errors that were measured or simulated, :data:`VALID` for
bounds and formulas that hold, :data:`REFUTED` for printed formulas that fail. Points show observations, a solid line
a valid formula, a dashed line a refuted one. The background is transparent. In dark mode the style sheet of the book
inverts the lightness of a picture and keeps its hues, so a figure needs no second version.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from numpy.typing import NDArray

OBSERVED = "#0072B2"
"""Colour of errors that were measured or simulated."""
OBSERVED_OTHERS = ("#7B3FA0", "#B8478C", "#1F2F6B", "#3E93C8")
COLOURS = (OBSERVED, *OBSERVED_OTHERS)
"""Blues and purples for several observed series in one figure."""
VALID = "#007D5F"
"""Colour of bounds and formulas that hold."""
REFUTED = "#C44E00"
"""Colour of printed formulas that fail."""
BLACK = "#000000"
REFERENCE = "#6B6B6B"
MARKERS = "osD^v"

WIDTH = 6.4
"""Width of a figure in inches."""
TEXT = 11.0
"""Size of the text in points. It gives 17 pixels on a desktop and more than 8 on a phone 390 pixels wide."""

_STYLE: dict[Any, Any] = {
    "figure.dpi": 110,
    "savefig.dpi": 110,
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "axes.facecolor": "none",
    "figure.constrained_layout.use": True,
    "font.size": TEXT,
    "axes.titlesize": TEXT,
    "axes.labelsize": TEXT,
    "xtick.labelsize": TEXT,
    "ytick.labelsize": TEXT,
    "legend.fontsize": TEXT,
    "axes.grid": True,
    "grid.color": "#8080804D",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.markersize": 4.5,
}


def figure(columns: int = 1, height: float = 3.6, rows: int = 1) -> tuple[Figure, NDArray[Any]]:
    """Create a figure with panels side by side or one below the other.

    Parameters
    ----------
    columns, rows : number of panels; rows fit a phone better than columns.
    height : height of the whole figure in inches; the width is that of a page of the book.

    Returns
    -------
    figure, axes : `axes` is an array (rows · columns,), row by row.
    """
    plt.draw_if_interactive()  # loads the backend now, because rc_context would undo the settings that it makes
    with plt.rc_context(_STYLE):
        fig, axes = plt.subplots(rows, columns, figsize=(WIDTH, height), squeeze=False)
    return fig, axes.ravel()


def colours(count: int, palette: Sequence[str] = COLOURS) -> Sequence[str]:
    """Return a colour for each of `count` curves.

    Raises
    ------
    ValueError : more curves than colours.
    """
    if count > len(palette):
        raise ValueError(f"got {count} curves; needed at most {len(palette)}, or colours repeat; draw two figures")
    return palette[:count]


def line_styles(count: int, markers: str = MARKERS) -> list[tuple[str, str]]:
    """Return a marker and a colour for each of `count` curves; see :func:`colours`."""
    return list(zip(markers, colours(count), strict=False))


def loglog(ax: Axes) -> None:
    """Make both axes logarithmic."""
    ax.set_xscale("log")
    ax.set_yscale("log")


def legend(ax: Axes, **options: Any) -> None:
    """Show the legend without a frame."""
    options.setdefault("fontsize", TEXT)
    ax.legend(frameon=False, **options)


def name(
    ax: Axes,
    text: str,
    at: tuple[float, float],
    colour: str,
    shift: tuple[float, float] = (6.0, 0.0),
    **options: Any,
) -> Annotation:
    """Write the name of a curve beside it, in its colour.

    Parameters
    ----------
    at : point of the curve, in data coordinates.
    shift : offset of the text from that point, in typographic points; the text extends away from the curve.
    options : passed to :meth:`matplotlib.axes.Axes.annotate`.
    """
    across, up = shift
    options.setdefault("ha", "left" if across > 0 else "right" if across < 0 else "center")
    options.setdefault("va", "bottom" if up > 0 else "top" if up < 0 else "center")
    options.setdefault("fontsize", TEXT)
    return ax.annotate(text, at, shift, textcoords="offset points", color=colour, **options)


def name_ends(ax: Axes, ends: Mapping[str, tuple[float, str]]) -> list[Annotation]:
    """Write names to the right of a panel, each at the height where its curve ends; move colliding names apart.

    Call this function last, when scales, limits and axis labels are set.

    Parameters
    ----------
    ends : for each name, the height in data coordinates and the colour.
    """
    ax.figure.draw_without_rendering()  # type: ignore[union-attr]
    points = 72 / ax.figure.dpi
    heights = {text: float(ax.transData.transform((1, y))[1]) * points for text, (y, _) in ends.items()}
    order = sorted(ends, key=heights.__getitem__)
    placed = [heights[text] for text in order]
    for _ in range(200):
        for i in range(len(order) - 1):
            lines = sum(text.count("\n") + 1 for text in order[i : i + 2]) / 2
            overlap = 1.25 * TEXT * lines - (placed[i + 1] - placed[i])
            if overlap > 0:
                placed[i] -= overlap / 2
                placed[i + 1] += overlap / 2
    return [
        ax.annotate(
            text,
            (1, ends[text][0]),
            (6, place - heights[text]),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=ends[text][1],
            va="center",
            fontsize=TEXT,
            annotation_clip=False,
        )
        for text, place in zip(order, placed, strict=True)
    ]


def label(ax: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes, each with its quantity and unit."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if title:
        ax.set_title(title, fontsize=TEXT, loc="left")
