"""The one figure style: what was observed is drawn as points, a bound as a line, a print as an open marker."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

# Okabe and Ito's colours, told apart by colour-blind readers and on paper.
OBSERVED = "#0072B2"
OBSERVED_OTHERS = ("#009E73", "#CC79A7", "#E69F00", "#56B4E9")
COLOURS = (OBSERVED, *OBSERVED_OTHERS)
MARKERS = "osD^v"
BOUND = "#D55E00"
STRICT = "#000000"
REFERENCE = "#767676"

_STYLE: dict[Any, Any] = {
    "figure.dpi": 110,
    "savefig.dpi": 110,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.constrained_layout.use": True,
    "font.size": 10.5,
    "axes.grid": True,
    "grid.color": "#E0E0E0",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.markersize": 4.5,
}


def figure(columns: int = 1, height: float = 3.6) -> tuple[Figure, NDArray[Any]]:
    """Start a figure of panels side by side.

    Parameters
    ----------
    columns : number of panels.
    height : in inches; the width is that of a page of the book.

    Returns
    -------
    figure, axes : `axes` is an array (columns,).
    """
    plt.draw_if_interactive()  # loads the backend: what it sets inside rc_context would be undone
    with plt.rc_context(_STYLE):
        fig, axes = plt.subplots(1, columns, figsize=(8.0, height), squeeze=False)
    return fig, axes[0]


def colours(count: int, palette: Sequence[str] = COLOURS) -> Sequence[str]:
    """A colour for each of some curves.

    Raises
    ------
    ValueError : more curves than colours.
    """
    if count > len(palette):
        raise ValueError(f"got {count} curves; needed at most {len(palette)}, or colours repeat; draw two figures")
    return palette[:count]


def line_styles(count: int, markers: str = MARKERS) -> list[tuple[str, str]]:
    """Marker and colour of each of some curves; see :func:`colours`."""
    return list(zip(markers, colours(count), strict=False))


def loglog(ax: Axes) -> None:
    """Make both axes logarithmic."""
    ax.set_xscale("log")
    ax.set_yscale("log")


def legend(ax: Axes, **options: Any) -> None:
    """Show the legend without a frame."""
    ax.legend(frameon=False, **options)


def label(ax: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes, each with its quantity and unit."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if title:
        ax.set_title(title, fontsize=10.5, loc="left")
