"""Figures of the chapter on measurement geometry: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gpbnb.report.display.style import BLACK, OBSERVED, OBSERVED_OTHERS, REFERENCE, TEXT

FRAME_COLOURS = dict(
    zip(("a", "i", "φ", "t", "r", "g"), (REFERENCE, BLACK, OBSERVED, *OBSERVED_OTHERS[1:]), strict=True)
)
FRAME_NAMES = {
    "a": "absolute",
    "i": "intermediate",
    "φ": "roll",
    "t": "telescope",
    "r": "readout",
    "g": "gyro",
}


def in_space(fig: Figure, axes: Collection[Axes]) -> list[Any]:
    """Replace the axes of a figure by three-dimensional ones."""
    solid = []
    for column, ax in enumerate(axes, start=1):
        ax.remove()
        new: Any = fig.add_subplot(1, len(axes), column, projection="3d")
        new.set_box_aspect((1, 1, 1), zoom=1.25)
        new.set_axis_off()
        new.patch.set_visible(False)  # it would be black in dark mode
        solid.append(new)
    return solid


def chain(ax: Axes) -> list[Artist]:
    """Draw Figure IV-2: the chain of frames and the angles between them."""
    places = {"g": (0.0, 1.0), "a": (0.0, 0.0), "i": (1.35, 0.5), "φ": (2.45, 0.5), "t": (3.4, 0.5), "r": (4.6, 0.5)}
    half = {"g": 22, "a": 34, "i": 46, "φ": 18, "t": 38, "r": 32}  # widths of the boxes, in points
    links = [
        ("g", "i", r"$\theta$", (0.1, 0.12), "-"),
        ("a", "i", r"$\alpha$", (0.1, -0.13), "-"),
        ("g", "a", r"$\varphi=\theta-\alpha$", (-0.42, 0.0), "-"),
        ("i", "φ", r"$\omega t$", (0.12, 0.12), "-"),
        ("φ", "t", r"$\beta$", (-0.08, 0.12), "-"),
        ("t", "r", r"$\gamma$", (0.02, 0.12), "-"),
        ("g", "r", r"$\delta$, grows with the roll", (0.2, 0.44), "--"),
    ]
    artists: list[Artist] = []
    for start, end, name, shift, style in links:
        (x0, y0), (x1, y1) = places[start], places[end]
        upright = x0 == x1
        arrow: dict[str, Any] = {"arrowstyle": "->", "ls": style, "color": REFERENCE}
        arrow |= {"shrinkA": 22 if upright else half[start], "shrinkB": 22 if upright else half[end]}
        if style == "--":
            arrow |= {"connectionstyle": "arc3,rad=-0.22", "shrinkB": 24}
        artists.append(ax.annotate("", (x1, y1), (x0, y0), arrowprops=arrow))
        artists.append(
            ax.text((x0 + x1) / 2 + shift[0], (y0 + y1) / 2 + shift[1], name, ha="center", va="center", fontsize=TEXT)
        )
    for name, (x, y) in places.items():
        box = {"boxstyle": "round,pad=0.4", "fc": "none", "ec": FRAME_COLOURS[name], "lw": 1.6}
        text = ("$\\varphi$" if name == "φ" else f"${name}$") + f"\n{FRAME_NAMES[name]}"
        artists.append(ax.text(x, y, text, ha="center", va="center", bbox=box, fontsize=TEXT))
    ax.set_xlim(-0.85, 5.05)
    ax.set_ylim(-0.25, 1.5)
    ax.set_axis_off()
    return artists


def precessions(ax: Any, declination: float) -> list[Artist]:
    """Draw Figure I-1: the drifts of a gyroscope in polar orbit, for a guide star of this declination in radians."""
    turn = np.linspace(0, 2 * np.pi, 120)
    star = np.array([np.cos(declination), 0, np.sin(declination)])
    geodetic = np.cross([0, 1, 0], star)
    motional = np.cross([0, 0, 1], star)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    artists: list[Artist] = [
        ax.plot_surface(
            0.45 * np.cos(u) * np.sin(v), 0.45 * np.sin(u) * np.sin(v), 0.45 * np.cos(v), color="#8FBBDD", alpha=0.35
        ),
        *ax.plot(np.cos(turn), 0 * turn, np.sin(turn), color=REFERENCE, lw=1.2),
    ]
    gyro = np.array([np.cos(1.1), 0.0, np.sin(1.1)])
    tip = gyro + 0.8 * star
    arrows = (
        ((0, 0, -0.8), (0, 0, 1.6), BLACK, "Earth's axis", (0.0, 0, -1.16)),
        (gyro, 0.8 * star, REFERENCE, "spin axis, to the star", gyro + 0.36 * star + np.array([0.1, 0, 0.27])),
        (tip, 0.5 * geodetic, OBSERVED, "geodetic", tip + 0.62 * geodetic + np.array([0.2, 0, 0])),
        (tip, 0.6 * motional, OBSERVED_OTHERS[1], "frame dragging", tip + 0.62 * motional + np.array([0.0, 0, 0.06])),
    )
    for start, way, colour, name, place in arrows:
        artists.append(ax.quiver(*start, *way, color=colour, lw=1.8, arrow_length_ratio=0.12))
        artists.append(ax.text(*place, name, color=colour, ha="center", clip_on=False, fontsize=TEXT))
    artists.append(ax.text(-1.05, 0, -0.98, "polar orbit", color=REFERENCE, ha="center", fontsize=TEXT))
    for limit, (low, high) in ((ax.set_xlim, (-0.6, 1.4)), (ax.set_ylim, (-1.0, 1.0)), (ax.set_zlim, (-0.9, 1.1))):
        limit(low, high)
    ax.set_box_aspect((1, 1, 1), zoom=1.0)
    ax.view_init(elev=18, azim=-62)
    return artists
