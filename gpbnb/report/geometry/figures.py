"""Figures of the chapter on measurement geometry: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gpbnb.report.display.style import (
    BLACK,
    MARKERS,
    OBSERVED,
    OBSERVED_OTHERS,
    REFERENCE,
    REFUTED,
    TEXT,
    VALID,
    label,
    loglog,
    name_ends,
)
from gpbnb.report.display.style import name as write
from gpbnb.report.geometry import theory
from gpbnb.report.geometry.experiment import MisalignedYear
from gpbnb.report.measurement import ARCSEC, MAS, deroll, roll, rotation, theta_of

Frames = Mapping[str, NDArray[np.float64]]
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


Angles: TypeAlias = Sequence[float] | NDArray[np.float64]


def frames(alpha: Angles, beta: Angles, gamma: Angles, phi: Angles, phase: float) -> Frames:
    """Return the rotation from the absolute frame to each frame; its rows are the axes. Angles in radians."""
    A = rotation(alpha)
    R = roll(phase) @ A
    T = rotation(beta) @ R
    return {
        "a": np.eye(3),
        "i": A,
        "φ": R,
        "t": T,
        "r": rotation(gamma) @ T,
        "g": rotation(theta_of(phi, alpha)).T @ A,
    }


#: Alignment of the labels that would otherwise lie on an arrow.
BESIDE = {
    "xg": ("left", "top"),
    "yi": ("right", "bottom"),
    "ya": ("left", "bottom"),
    "xφ": ("center", "bottom"),
    "yt": ("right", "center"),
}


def triads(matrices: Frames, ax: Any, ring: str | None = None) -> list[Artist]:
    """Draw Figure IV-1: the axes of some frames in space, and the readout ring of the frame `ring`."""
    artists: list[Artist] = []
    for k, (name, matrix) in enumerate(matrices.items()):
        colour, letter = FRAME_COLOURS[name], r"\varphi" if name == "φ" else name
        for axis, row in zip("xyz", matrix * (1 + 0.18 * k), strict=True):
            artists.append(ax.quiver(0, 0, 0, *row, color=colour, lw=1.6, arrow_length_ratio=0.07))
            across, along = BESIDE.get(axis + name, ("center", "center"))
            artists.append(
                ax.text(*(row * 1.1), f"${axis}_{{{letter}}}$", color=colour, ha=across, va=along, fontsize=TEXT)
            )
    if ring is not None:
        turn = np.linspace(0, 2 * np.pi, 90)
        around = 0.55 * (np.cos(turn)[:, None] * matrices[ring][0] + np.sin(turn)[:, None] * matrices[ring][1])
        artists += ax.plot(*around.T, color=FRAME_COLOURS[ring], lw=1.2, ls="--")
    rolling = ring is not None
    low, high = (-0.95, 1.35) if rolling else (-0.55, 1.45)
    for limit in (ax.set_xlim, ax.set_ylim, ax.set_zlim):
        limit(low, high)
    ax.view_init(elev=24, azim=-35 if rolling else -60)
    names = ", ".join(FRAME_NAMES[name] for name in matrices)
    artists.append(ax.text2D(0.5, 0.04, names, transform=ax.transAxes, ha="center", fontsize=TEXT))
    return artists


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


def deroll_of_a_roll(
    readings: NDArray[np.float64], phase: NDArray[np.float64], ax: Axes, printed: bool
) -> list[Artist]:
    """Draw the angles α3 and α2 that (5) or (8) computes over one roll (points), and the true angles (lines).

    Parameters
    ----------
    readings : (n, 2), y and z of the telescope in radians, without misalignments.
    phase : (n,), radians.
    printed : use (8) as printed instead of (5).
    """
    truth = deroll(readings, phase)[0]
    back = theory.printed_deroll(readings, phase) if printed else deroll(readings, phase)
    turns, colour = phase / (2 * np.pi), REFUTED if printed else VALID
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    for k, sign, index, marker, fill in ((0, -1, "3", "o", colour), (1, 1, "2", "s", "none")):
        true = sign * truth[k] / ARCSEC
        artists += ax.plot(turns, sign * back[:, k] / ARCSEC, marker, color=colour, mfc=fill)
        artists.append(ax.axhline(true, color=BLACK, lw=1))
        ends[rf"true $\alpha_{index}$"] = true, BLACK
    formula = "equation (8)" if printed else "equation (5)"
    ax.set_xlim(-0.03, 1.03)
    largest = float(np.hypot(*readings[0])) / ARCSEC
    ax.set_ylim(-1.2 * largest, 1.35 * largest)
    ax.set_xticks(np.linspace(0, 1, 5))
    title = rf"{formula}: circles $\hat\alpha_3$, squares $\hat\alpha_2$"
    label(ax, "roll (turns)", "angle (arcsec)", title)
    return [*artists, *name_ends(ax, ends)]


def losses(curves: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], ax: Axes) -> list[Artist]:
    """Draw the error of φ from small-angle forms against one angle: simulated (points), third-order theory (lines)."""
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    for marker, (angle, (sizes, errors)) in zip(MARKERS, curves.items(), strict=False):
        line = theory.small_angle_loss(angle, sizes) / MAS
        artists += ax.plot(sizes / ARCSEC, errors / MAS, marker, color=OBSERVED, mfc="none")
        artists += ax.plot(sizes / ARCSEC, line, color=VALID, lw=1)
        ends[rf"$\{angle[:-1]}_{angle[-1]}$"] = float(line[-1]), VALID
    artists.append(ax.axhline(1, color=REFERENCE, ls=":"))
    loglog(ax)
    low = min(float(sizes.min()) for sizes, _ in curves.values()) / ARCSEC
    artists.append(write(ax, "tolerance, 1 mas", (low, 1), REFERENCE, (0, 3), ha="left"))
    label(ax, "angle (arcsec)", r"error of $\varphi$ after a year (mas)")
    return [*artists, *name_ends(ax, ends)]


def first_rolls(still: MisalignedYear, rolled: MisalignedYear, ax: Axes) -> list[Artist]:
    """Draw the measured φ2 over the first rolls: samples with roll, means over each roll, and samples without roll."""
    minutes = rolled.step / 60 * np.arange(len(rolled.first))
    block = rolled.block
    middle = rolled.step / 60 * (np.arange(len(rolled.first) // block) * block + (block - 1) / 2)
    without = still.first[: len(minutes), 0] / ARCSEC
    samples, means = rolled.first[:, 0] / ARCSEC, rolled.phi[: len(middle), 0] / ARCSEC
    artists: list[Artist] = [
        *ax.plot(minutes, samples, ".-", lw=0.6, color=OBSERVED_OTHERS[0], label="rolling"),
        *ax.plot(middle, means, "D", color=OBSERVED, label="mean over a roll"),
        *ax.plot(still.step / 60 * np.arange(len(without)), without, color=OBSERVED_OTHERS[1], label="no roll"),
    ]
    label(ax, "time (minutes)", r"measured $\varphi_2$ (arcsec)")
    ends = {
        "rolling": (float(samples[-1]), OBSERVED_OTHERS[0]),
        "no roll": (float(without[-1]), OBSERVED_OTHERS[1]),
        "mean over\na roll": (float(means[-1]), OBSERVED),
    }
    return [*artists, *name_ends(ax, ends)]


def year_errors(results: Mapping[str, MisalignedYear], ax: Axes, component: int) -> list[Artist]:
    """Draw the error of φ2 (0) or φ3 (1) over a year: simulated means (points) and the second-order theory (lines)."""
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    colours = (OBSERVED, OBSERVED_OTHERS[1], OBSERVED_OTHERS[2])
    for marker, colour, (case, result) in zip(MARKERS, colours, results.items(), strict=False):
        some = np.linspace(0, len(result.time) - 1, 13).astype(int)
        time = result.time[some]
        simulated = result.phi[some, component] - result.case.drift[component] * time
        analysed = theory.measured(result.case, result.roll_period is not None, time)[:, component]
        artists += ax.plot(time, simulated / MAS, marker, color=colour)
        artists += ax.plot(time, analysed / MAS, color=VALID, lw=1)
        ends[case] = float(analysed[-1]) / MAS, colour
    ax.axhline(0, color=REFERENCE, lw=0.6)
    label(ax, "time (years)", rf"error of $\varphi_{component + 2}$ (mas)")
    return [*artists, *name_ends(ax, ends)]


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
