"""Figures of the chapter on wordlength: results in, artists out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display.style import (
    BLACK,
    OBSERVED,
    REFERENCE,
    REFUTED,
    TEXT,
    VALID,
    bits_colour,
    colours,
    label,
    legend,
    line_styles,
    name,
    name_ends,
)
from gpbnb.wordlength.examples import STANDARD

#: Marker, edge colour and face colour for each kind of answer. Open markers in the colour of refuted formulas belong
#: to (125).
KINDS = {
    "emulation": ("o", OBSERVED, OBSERVED),
    "bound": ("|", VALID, VALID),
    "theory": ("D", BLACK, BLACK),
    "printed": ("o", REFUTED, "none"),
    "corrected": ("s", REFUTED, "none"),
}
Curve = Sequence[tuple[int, float]]


def standards(ax: Axes, upright: bool = True, others: Mapping[str, tuple[float, str]] | None = None) -> list[Artist]:
    """Draw lines at the precisions of the IEEE formats within the axis; name them at its end, and other curves too."""
    artists: list[Artist] = []
    low, high = ax.get_xlim() if upright else ax.get_ylim()
    ends = dict(others or {})
    for words, fmt in STANDARD.items():
        if low <= fmt.precision <= high:
            draw = ax.axvline if upright else ax.axhline
            artists.append(draw(fmt.precision, color=REFERENCE, ls=":", lw=1.0))
            if upright:
                above = (fmt.precision, 1.06 if words == "binary32" else 1.0)  # binary16 is close, names would touch
                place: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "ha": "center", "va": "bottom"}
                artists.append(ax.text(*above, words, color=REFERENCE, fontsize=TEXT, **place))
            ends[words] = float(fmt.precision), REFERENCE
    return artists if upright else [*artists, *name_ends(ax, ends)]


def growth(points: Mapping[str, Curve], lines: Mapping[str, Curve], ax: Axes) -> list[Artist]:
    """Draw bits against the number of steps: observed (points), bounds and formulas (lines, named at their ends)."""
    artists: list[Artist] = []
    for (words, curve), (marker, colour) in zip(points.items(), line_styles(len(points), "os^Dv"), strict=True):
        artists += ax.plot(*zip(*curve, strict=True), marker, color=colour, label=words)
    last = max(steps for curve in (*points.values(), *lines.values()) for steps, _ in curve)
    ends: dict[str, tuple[float, str]] = {}
    broken, above = iter(("--", "-.")), iter((0, -7))
    for words, curve in lines.items():
        refuted = words.startswith("(125)")
        colour = REFUTED if refuted else VALID
        artists += ax.plot(*zip(*curve, strict=True), next(broken) if refuted else "-", color=colour, label=words)
        steps, bits = curve[-1]
        if steps < last:
            artists.append(name(ax, words, (steps, bits), colour, (6, next(above))))
        else:
            ends[words.replace(", ", ",\n")] = bits, colour
    ax.set_xscale("log")
    label(ax, "steps $k$", "bits needed for the tolerance")
    legend(ax, handles=artists[: len(points)], loc="upper left")
    return [*artists, *standards(ax, upright=False, others=ends)]


def overview(found: Mapping[str, Mapping[str, int]], ax: Axes) -> list[Artist]:
    """Draw the bits that many problems need, one row for each problem, by kind of answer.

    Parameters
    ----------
    found : bits by problem, then by kind of answer, one of :data:`KINDS`.
    """
    unknown = {kind for each in found.values() for kind in each} - set(KINDS)
    if unknown:
        raise ValueError(f"got the kinds {sorted(unknown)}; needed some of {', '.join(KINDS)}")
    artists: list[Artist] = []
    names = list(found)
    for problem, each in found.items():
        y = names.index(problem)
        artists += ax.plot([min(each.values()), max(each.values())], [y, y], color="#D0D0D0", zorder=1)
    for kind, (marker, edge, face) in KINDS.items():
        places = [(each[kind], names.index(problem)) for problem, each in found.items() if kind in each]
        if places:
            style = {"ms": 13, "mew": 2.5} if marker == "|" else {"ms": 8}
            words = f"(125), {kind}" if edge == REFUTED else kind
            artists += ax.plot(*zip(*places, strict=True), marker, mec=edge, mfc=face, ls="none", label=words, **style)
    ax.set_yticks(np.arange(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_xlim(left=0)
    artists += standards(ax)
    legend(ax, loc="upper center", bbox_to_anchor=(0.3, -0.14), ncols=3)
    ax.set_xlabel("bits")
    return artists


def changes(names: Sequence[str], errors: Mapping[tuple[str, int], Sequence[float]], ax: Axes) -> list[Artist]:
    """Draw the error for each way of computing over that for the first way; skip rejected ones.

    Parameters
    ----------
    names : ways of computing.
    errors : for each filter and number of bits, the error with each way, or infinity.
    """
    artists: list[Artist] = []
    for ((filter_, bits), values), (marker, _) in zip(errors.items(), line_styles(len(errors), "osD^"), strict=True):
        colour, words = bits_colour(FloatFormat(2, bits)), f"{filter_}, {bits} bits"
        points = [(value / values[0], y) for y, value in enumerate(values) if math.isfinite(value)]
        artists += ax.plot(*zip(*points, strict=True), marker, color=colour, mfc="none", ms=7, label=words)
    ax.axvline(1, color=REFERENCE, lw=0.8)
    ax.set_xscale("log")
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlabel("error / error with ties away and any exponent")
    legend(ax, loc="upper center", bbox_to_anchor=(0.3, -0.18), ncols=2)
    return artists


def bands(found: Mapping[str, Sequence[tuple[int, Sequence[float]]]], ax: Axes, share: float = 0.9) -> list[Artist]:
    """Draw median, central share and largest error / tolerance of many records, against the bits."""
    artists: list[Artist] = []
    low, high = (1 - share) / 2, (1 + share) / 2
    for (words, points), (_, colour) in zip(found.items(), line_styles(len(found)), strict=True):
        bits = [t for t, _ in points]
        below, middle, above, most = np.array([np.quantile(each, (low, 0.5, high, 1)) for _, each in points]).T
        artists.append(
            ax.fill_between(bits, below, above, color=colour, alpha=0.3, lw=0, label=f"{100 * share:.0f} % of records")
        )
        artists += ax.plot(bits, middle, "-", color=colour, label=f"{words}: median")
        artists += ax.plot(bits, most, ":", color=colour, label="the worst record")
    artists.append(ax.axhline(1, color=REFERENCE, ls=":", lw=1.0))
    name_ends(ax, {"tolerance": (1.0, REFERENCE)})
    ax.set_yscale("log")
    legend(ax, loc="lower left")
    label(ax, "bits", "largest error / tolerance")
    return artists


def variances(found: Mapping[str, Curve], rate: float, ax: Axes) -> list[Artist]:
    """Draw a computed variance against time, one line for each format; a variance below zero has collapsed.

    Parameters
    ----------
    found : step and variance, (m/s)², by the name of the format.
    rate : steps in a second.
    """
    artists: list[Artist] = [ax.axhline(0, color=REFERENCE, ls=":", lw=1.0)]
    ends = {}
    for (words, curve), colour in zip(found.items(), colours(len(found)), strict=True):
        times, values = [k / rate for k, _ in curve], [value for _, value in curve]
        artists += ax.plot(times, values, color=colour, marker="o", ms=2.5, lw=1.0)
        ends[words] = values[-1], colour
    label(ax, "time (s)", "speed variance (m²/s²)")
    return [*artists, *name_ends(ax, ends)]
