"""Figures of the chapter on measurement geometry: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gpbnb.display.style import BOUND, OBSERVED, OBSERVED_OTHERS, REFERENCE, STRICT, label, legend, line_styles, loglog
from gpbnb.geometry import theory
from gpbnb.geometry.experiment import Year
from gpbnb.measurement import ARCSEC, MAS, deroll, roll, rotation, theta_of

Frames = Mapping[str, NDArray[np.float64]]
FRAME_COLOURS = dict(
    zip(("a", "i", "φ", "t", "r", "g"), (REFERENCE, STRICT, OBSERVED, *OBSERVED_OTHERS[:2], BOUND), strict=True)
)
FRAME_NAMES = {
    "a": "absolute",
    "i": "intermediate",
    "φ": "roll",
    "t": "telescope",
    "r": "readout",
    "g": "gyro",
}


def in_space(fig: Figure, axes: Sequence[Axes]) -> list[Any]:
    """Give axes of a figure a third dimension."""
    solid = []
    for column, ax in enumerate(axes, start=1):
        ax.remove()
        new: Any = fig.add_subplot(1, len(axes), column, projection="3d")
        new.set_box_aspect((1, 1, 1), zoom=1.25)
        new.set_axis_off()
        solid.append(new)
    return solid


def frames(
    alpha: Sequence[float], beta: Sequence[float], gamma: Sequence[float], phi: Sequence[float], phase: float
) -> Frames:
    """Matrix from the absolute frame to each of the six; its rows are the axes of that frame. Angles in radians."""
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


def triads(matrices: Frames, ax: Any, ring: str | None = None) -> list[Artist]:
    """Figure IV-1: the axes of some frames in space; with the readout ring of the frame `ring`."""
    artists: list[Artist] = []
    for k, (name, matrix) in enumerate(matrices.items()):
        colour, letter = FRAME_COLOURS[name], r"\varphi" if name == "φ" else name
        for axis, row in zip("xyz", matrix * (1 + 0.18 * k), strict=True):
            artists.append(ax.quiver(0, 0, 0, *row, color=colour, lw=1.6, arrow_length_ratio=0.07))
            artists.append(ax.text(*(row * 1.1), f"${axis}_{{{letter}}}$", color=colour, ha="center", va="center"))
    if ring is not None:
        turn = np.linspace(0, 2 * np.pi, 90)
        around = 0.55 * (np.cos(turn)[:, None] * matrices[ring][0] + np.sin(turn)[:, None] * matrices[ring][1])
        artists += ax.plot(*around.T, color=FRAME_COLOURS[ring], lw=1.2, ls="--")
    rolling = ring is not None
    low, high = (-0.95, 1.35) if rolling else (-0.55, 1.45)
    for limit in (ax.set_xlim, ax.set_ylim, ax.set_zlim):
        limit(low, high)
    ax.view_init(elev=24, azim=-52)
    names = ", ".join(FRAME_NAMES[name] for name in matrices)
    artists.append(ax.text2D(0.5, 0.04, names, transform=ax.transAxes, ha="center"))
    return artists


def chain(ax: Axes) -> list[Artist]:
    """Figure IV-2: the chain of frames with the angles between them."""
    places = {"g": (0.0, 1.0), "a": (0.0, 0.0), "i": (1.2, 0.5), "φ": (2.35, 0.5), "t": (3.4, 0.5), "r": (4.5, 0.5)}
    links = [
        ("g", "i", r"$\theta$", (0.1, 0.12), "-"),
        ("a", "i", r"$\alpha$", (0.1, -0.13), "-"),
        ("g", "a", r"$\varphi=\theta-\alpha$", (-0.42, 0.0), "-"),
        ("i", "φ", r"$\omega t$", (0.07, 0.1), "-"),
        ("φ", "t", r"$\beta$", (-0.07, 0.1), "-"),
        ("t", "r", r"$\gamma$", (0.0, 0.1), "-"),
        ("g", "r", r"$\delta$, grows with the roll", (0.2, 0.55), "--"),
    ]
    artists: list[Artist] = []
    for start, end, name, shift, style in links:
        (x0, y0), (x1, y1) = places[start], places[end]
        slanted = end == "i"  # into the side of a wide box
        arrow = {"arrowstyle": "->", "ls": style, "color": REFERENCE, "shrinkA": 28, "shrinkB": 48 if slanted else 30}
        if style == "--":
            arrow |= {"connectionstyle": "arc3,rad=-0.22", "shrinkB": 24}
        artists.append(ax.annotate("", (x1, y1), (x0, y0), arrowprops=arrow))
        artists.append(ax.text((x0 + x1) / 2 + shift[0], (y0 + y1) / 2 + shift[1], name, ha="center", va="center"))
    for name, (x, y) in places.items():
        box = {"boxstyle": "round,pad=0.4", "fc": "white", "ec": FRAME_COLOURS[name], "lw": 1.6}
        text = ("$\\varphi$" if name == "φ" else f"${name}$") + f"\n{FRAME_NAMES[name]}"
        artists.append(ax.text(x, y, text, ha="center", va="center", bbox=box, fontsize=9.5))
    ax.set_xlim(-0.8, 4.95)
    ax.set_ylim(-0.25, 1.5)
    ax.set_axis_off()
    return artists


def deroll_of_a_roll(
    readings: NDArray[np.float64], phase: NDArray[np.float64], ax: Axes, printed: bool
) -> list[Artist]:
    """Angles α3 and α2 over a roll, by (5) or by (8) as printed, beside the true ones.

    Parameters
    ----------
    readings : (n, 2), y and z of the telescope in radians, without misalignments.
    phase : (n,), radians.
    """
    truth = deroll(readings, phase)[0]
    back = theory.printed_deroll(readings, phase) if printed else deroll(readings, phase)
    artists: list[Artist] = []
    for k, sign, name, colour, marker in ((0, -1, "3", OBSERVED, "o"), (1, 1, "2", OBSERVED_OTHERS[0], "s")):
        artists += ax.plot(
            phase / (2 * np.pi), sign * back[:, k] / ARCSEC, marker, color=colour, label=rf"$\hat\alpha_{name}$"
        )
        artists.append(ax.axhline(sign * truth[k] / ARCSEC, color=colour, lw=1, label=rf"$\alpha_{name}$"))
    largest = float(np.hypot(*readings[0])) / ARCSEC
    ax.set_ylim(-1.1 * largest, 1.9 * largest)
    legend(ax, ncols=2, fontsize=9, loc="upper right")
    label(ax, "roll (turns)", "angle (arcsec)", "(8) as printed" if printed else "(5)")
    return artists


def losses(curves: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], ax: Axes) -> list[Artist]:
    """Error of φ that small-angle forms make, against one angle: simulated (points), analysis (lines)."""
    artists: list[Artist] = []
    styles = zip("osD^", (BOUND, OBSERVED, *OBSERVED_OTHERS[:2]), strict=True)
    for (marker, colour), (name, (sizes, errors)) in zip(styles, curves.items(), strict=False):
        shown = rf"$\{name[:-1]}_{name[-1]}$"
        artists += ax.plot(sizes / ARCSEC, errors / MAS, marker, color=colour, label=shown, mfc="none")
        artists += ax.plot(sizes / ARCSEC, theory.small_angle_loss(name, sizes) / MAS, color=colour, lw=1)
    artists.append(ax.axhline(1, color=STRICT, ls=":", label="the goal, 1 mas"))
    loglog(ax)
    legend(ax, loc="lower right")
    label(ax, "angle (arcsec)", r"error of $\varphi$ (mas)")
    return artists


def first_rolls(still: Year, rolled: Year, ax: Axes) -> list[Artist]:
    """Measured φ2 over the first rolls: samples with roll, their means, and samples without roll."""
    minutes = rolled.step / 60 * np.arange(len(rolled.first))
    block = rolled.block
    middle = rolled.step / 60 * (np.arange(len(rolled.first) // block) * block + (block - 1) / 2)
    artists: list[Artist] = [
        *ax.plot(minutes, rolled.first[:, 0] / ARCSEC, ".-", lw=0.6, color=OBSERVED, label="rolling, samples"),
        *ax.plot(middle, rolled.phi[: len(middle), 0] / ARCSEC, "D", color=BOUND, label="means of a roll"),
        *ax.plot(
            still.step / 60 * np.arange(len(still.first))[: len(minutes)],
            still.first[: len(minutes), 0] / ARCSEC,
            color=STRICT,
            ls="--",
            label="no roll",
        ),
    ]
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(0, 1.02))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.55 * (high - low))
    label(ax, "time (minutes)", r"$\varphi_2$ (arcsec)", "first rolls")
    return artists


def year_errors(results: Mapping[str, Year], ax: Axes, component: int) -> list[Artist]:
    """Error of φ2 (0) or φ3 (1) over a year, simulated means (points) beside the analysis (lines)."""
    artists: list[Artist] = []
    for (marker, colour), (name, result) in zip(line_styles(len(results)), results.items(), strict=True):
        some = np.linspace(0, len(result.time) - 1, 13).astype(int)
        time = result.time[some]
        simulated = result.phi[some, component] - result.case.drift[component] * time
        analysed = theory.measured(result.case, result.roll_period is not None, time)[:, component]
        artists += ax.plot(time, simulated / MAS, marker, color=colour, label=name)
        artists += ax.plot(time, analysed / MAS, color=colour, lw=1)
    ax.axhline(0, color=REFERENCE, lw=0.6)
    legend(ax, fontsize=9)
    label(ax, "time (years)", rf"error of $\varphi_{component + 2}$ (mas)")
    return artists


def precessions(ax: Any, declination: float) -> list[Artist]:
    """Figure I-1: the two drifts of a gyro in polar orbit that points to a star of this declination, in radians."""
    turn = np.linspace(0, 2 * np.pi, 120)
    star = np.array([np.cos(declination), 0, np.sin(declination)])
    geodetic = np.cross([0, 1, 0], star)
    motional = np.cross([0, 0, 1], star)
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    artists: list[Artist] = [
        ax.plot_surface(
            0.45 * np.cos(u) * np.sin(v), 0.45 * np.sin(u) * np.sin(v), 0.45 * np.cos(v), color="#CFE3F2", alpha=0.5
        ),
        *ax.plot(np.cos(turn), 0 * turn, np.sin(turn), color=REFERENCE, lw=1.2),
    ]
    gyro = np.array([np.cos(1.1), 0.0, np.sin(1.1)])
    tip = gyro + 0.8 * star
    arrows = (
        ((0, 0, -0.8), (0, 0, 1.6), STRICT, "Earth's axis", (0, 0, 0.9)),
        (gyro, 0.8 * star, OBSERVED, "spin axis, to the star", gyro + 0.4 * star + np.array([0.1, 0, 0.2])),
        (tip, 0.5 * geodetic, BOUND, "geodetic", tip + 0.62 * geodetic),
        (tip, 0.6 * motional, OBSERVED_OTHERS[0], "motional", tip + motional + np.array([0.15, 0, -0.06])),
    )
    for start, way, colour, name, place in arrows:
        artists.append(ax.quiver(*start, *way, color=colour, lw=1.8, arrow_length_ratio=0.12))
        artists.append(ax.text(*place, name, color=colour, fontsize=9.5, ha="center", clip_on=False))
    artists.append(ax.text(-0.8, 0, -0.98, "polar orbit", color=REFERENCE, fontsize=9.5, ha="center"))
    for limit, (low, high) in ((ax.set_xlim, (-0.6, 1.4)), (ax.set_ylim, (-1.0, 1.0)), (ax.set_zlim, (-0.9, 1.1))):
        limit(low, high)
    ax.set_box_aspect((1, 1, 1), zoom=1.1)
    ax.view_init(elev=18, azim=-62)
    return artists
