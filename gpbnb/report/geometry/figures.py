"""Figures of the chapter on measurement geometry: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

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


def chain(ax: Axes) -> list[Artist]:
    """Draw Figure IV-2: the chain of frames and the angles between them."""
    places = {
        "g": (0.0, 2.0),
        "a": (0.0, 0.9),
        "i": (1.45, 1.35),
        "φ": (0.25, -0.1),
        "t": (1.4, -0.1),
        "r": (2.6, -0.1),
    }
    half = {"g": 22, "a": 34, "i": 46, "φ": 18, "t": 38, "r": 32}  # widths of the boxes, in points
    links = [
        ("g", "i", r"$\theta$", (0.05, 0.16), "-"),
        ("a", "i", r"$\alpha$", (0.05, -0.18), "-"),
        ("g", "a", r"$\varphi=\theta-\alpha$", (0.42, 0.0), "-"),
        ("i", "φ", r"$\omega t$", (0.2, -0.12), "-"),
        ("φ", "t", r"$\beta$", (-0.1, 0.17), "-"),
        ("t", "r", r"$\gamma$", (0.03, 0.17), "-"),
        ("g", "r", r"$\delta$, grows with the roll", (0.35, 1.42), "--"),
    ]
    artists: list[Artist] = []
    for start, end, name, shift, style in links:
        (x0, y0), (x1, y1) = places[start], places[end]
        upright = x0 == x1
        arrow: dict[str, Any] = {"arrowstyle": "->", "ls": style, "color": REFERENCE}
        arrow |= {"shrinkA": 24 if upright else half[start], "shrinkB": 24 if upright else half[end]}
        if style == "--":
            arrow |= {"connectionstyle": "angle3,angleA=12,angleB=-90", "shrinkA": half[start], "shrinkB": 22}
        artists.append(ax.annotate("", (x1, y1), (x0, y0), arrowprops=arrow))
        artists.append(
            ax.text((x0 + x1) / 2 + shift[0], (y0 + y1) / 2 + shift[1], name, ha="center", va="center", fontsize=TEXT)
        )
    for name, (x, y) in places.items():
        box = {"boxstyle": "round,pad=0.4", "fc": "none", "ec": FRAME_COLOURS[name], "lw": 1.6}
        text = ("$\\varphi$" if name == "φ" else f"${name}$") + f"\n{FRAME_NAMES[name]}"
        artists.append(ax.text(x, y, text, ha="center", va="center", bbox=box, fontsize=TEXT))
    ax.set_xlim(-0.5, 3.0)
    ax.set_ylim(-0.45, 2.55)
    ax.set_axis_off()
    return artists


def precessions(ax: Axes, declination: float) -> list[Artist]:
    """Draw Figure I-1: the drifts of a gyroscope in polar orbit, for a guide star of this declination in radians."""
    turn = np.linspace(0, 2 * np.pi, 200)
    gyro, star = np.array([np.cos(0.9), np.sin(0.9)]), np.array([np.cos(declination), np.sin(declination)])
    tip, down, away = gyro + 1.2 * star, np.array([star[1], -star[0]]), np.array([0.5, 0.35])
    artists: list[Artist] = [
        *ax.fill(0.62 * np.cos(turn), 0.62 * np.sin(turn), color=OBSERVED, alpha=0.15, lw=0),
        *ax.plot(np.cos(turn), np.sin(turn), color=REFERENCE, lw=1.2),
        *ax.plot(*gyro, "o", color=BLACK, ms=8),
    ]
    arrows = (
        (np.array([0, -0.85]), np.array([0, 0.85]), BLACK, "Earth's\naxis", (0.06, 0.0), "left"),
        (gyro, tip, BLACK, "spin axis,\nto the star", (gyro + tip) / 2 + np.array([0.1, 0.4]), "center"),
        (
            tip,
            tip + 0.8 * down,
            OBSERVED,
            "geodetic drift,\nin the plane\nof the orbit",
            tip + 0.45 * down + 0.08,
            "left",
        ),
        (tip, tip + away, OBSERVED_OTHERS[1], "frame dragging,\nat right angles\nto it", tip + away + 0.06, "left"),
    )
    for start, end, colour, name, place, side in arrows:
        look = {
            "arrowstyle": "-|>,head_width=0.25,head_length=0.5",
            "color": colour,
            "lw": 1.8,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        artists.append(ax.annotate("", tuple(end), tuple(start), arrowprops=look))
        artists.append(ax.text(place[0], place[1], name, color=colour, ha=side, va="center", fontsize=TEXT))
    for name, place, side in (
        ("polar orbit", (-0.78, -0.82), "right"),
        ("gyroscope", gyro + np.array([-0.1, 0.45]), "right"),
    ):
        artists.append(ax.text(place[0], place[1], name, color=REFERENCE, ha=side, va="center", fontsize=TEXT))
    ax.set_xlim(-2.1, 4.0)
    ax.set_ylim(-1.15, 1.6)
    ax.set_aspect("equal")
    ax.set_axis_off()
    return artists
