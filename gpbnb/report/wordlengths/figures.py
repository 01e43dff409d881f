"""Figures of the chapter on wordlength: results in, artists out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.report.display.style import BLACK, OBSERVED, REFERENCE, REFUTED, VALID, label, legend, line_styles
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


def standards(ax: Axes, upright: bool = True) -> list[Artist]:
    """Draw lines at the precisions of the IEEE formats within the axis, and label them at its end."""
    artists: list[Artist] = []
    low, high = ax.get_xlim() if upright else ax.get_ylim()
    for name, fmt in STANDARD.items():
        if low <= fmt.precision <= high:
            draw = ax.axvline if upright else ax.axhline
            artists.append(draw(fmt.precision, color=REFERENCE, ls=":", lw=1.0))
            above = 1.035 if name == "binary32" else 1.0  # binary16 is close, and the names would touch
            x, y = (fmt.precision, above) if upright else (1.0, fmt.precision)
            transform = ax.get_xaxis_transform() if upright else ax.get_yaxis_transform()
            side: Any = "center" if upright else "right"
            artists.append(
                ax.text(x, y, name, color=REFERENCE, fontsize=8.5, transform=transform, ha=side, va="bottom")
            )
    return artists


def survey(emulated: Mapping[str, Curve], bounded: Mapping[str, Curve], ax: Axes) -> list[Artist]:
    """Draw finite errors (points) and bounds (lines) over the tolerance against the bits, one colour for each form."""
    artists: list[Artist] = []
    for (name, curve), (marker, colour) in zip(emulated.items(), line_styles(len(emulated), "os^Dv"), strict=True):
        points = [(t, ratio) for t, ratio in curve if 0 < ratio < math.inf]
        artists += ax.plot(*zip(*points, strict=True), marker, color=colour, label=name)
        lines = [(t, ratio) for t, ratio in bounded.get(name, ()) if ratio < math.inf]
        if lines:
            artists += ax.plot(*zip(*lines, strict=True), "-", color=colour, label=f"{name}, bound")
    artists.append(ax.axhline(1, color=REFERENCE, ls="--", label="tolerance"))
    ax.set_yscale("log")
    artists += standards(ax)
    legend(ax, fontsize=8.5)
    label(ax, "bits", "error or bound / tolerance")
    return artists


def growth(points: Mapping[str, Curve], lines: Mapping[str, Curve], ax: Axes) -> list[Artist]:
    """Draw bits against the number of steps: observed (points), bounds and formulas (lines)."""
    artists: list[Artist] = []
    for (name, curve), (marker, colour) in zip(points.items(), line_styles(len(points), "os^Dv"), strict=True):
        artists += ax.plot(*zip(*curve, strict=True), marker, color=colour, label=name)
    for (name, curve), style in zip(lines.items(), ("-", "--", "-.", ":"), strict=False):
        colour = REFUTED if name.startswith("(125)") else VALID
        artists += ax.plot(*zip(*curve, strict=True), style, color=colour, label=name)
    ax.set_xscale("log")
    artists += standards(ax, upright=False)
    legend(ax, fontsize=8.5)
    label(ax, "steps $k$", "bits needed for the tolerance")
    return artists


def overview(found: Mapping[str, Mapping[str, int]], ax: Axes) -> list[Artist]:
    """Draw the bits that many problems need, one row for each problem, by kind of answer.

    Parameters
    ----------
    found : bits by problem, then by kind of answer, one of :data:`KINDS`.

    Raises
    ------
    ValueError : another kind.
    """
    unknown = {kind for each in found.values() for kind in each} - set(KINDS)
    if unknown:
        raise ValueError(f"got the kinds {sorted(unknown)}; needed some of {', '.join(KINDS)}")
    artists: list[Artist] = []
    names = list(found)
    for name, each in found.items():
        y = names.index(name)
        artists += ax.plot([min(each.values()), max(each.values())], [y, y], color="#D0D0D0", zorder=1)
    for kind, (marker, edge, face) in KINDS.items():
        places = [(each[kind], names.index(name)) for name, each in found.items() if kind in each]
        if places:
            style = {"ms": 13, "mew": 2.5} if marker == "|" else {"ms": 8}
            line = ax.plot(*zip(*places, strict=True), marker, mec=edge, mfc=face, ls="none", label=kind, **style)
            artists += line
    ax.set_yticks(np.arange(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_xlim(left=0)
    artists += standards(ax)
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    ax.set_xlabel("bits")
    return artists


def changes(names: Sequence[str], errors: Mapping[str, Sequence[float]], ax: Axes) -> list[Artist]:
    """Draw the error for each way of computing over that for Hung's arithmetic, the first; skip rejected ones."""
    artists: list[Artist] = []
    for (label_, values), (marker, colour) in zip(errors.items(), line_styles(len(errors), "osD^"), strict=True):
        points = [(value / values[0], y) for y, value in enumerate(values) if math.isfinite(value)]
        artists += ax.plot(*zip(*points, strict=True), marker, color=colour, mfc="none", label=label_)
    ax.axvline(1, color=REFERENCE, lw=0.8)
    ax.set_xscale("log")
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlabel("error / error with Hung's arithmetic")
    legend(ax, loc="upper center", bbox_to_anchor=(0.3, -0.18), ncols=2)
    return artists


def bands(found: Mapping[str, Sequence[tuple[int, Sequence[float]]]], ax: Axes, share: float = 0.9) -> list[Artist]:
    """Draw median, central share and largest error / tolerance of many records, against the bits."""
    artists: list[Artist] = []
    low, high = (1 - share) / 2, (1 + share) / 2
    for (name, points), (_, colour) in zip(found.items(), line_styles(len(found)), strict=True):
        bits = [t for t, _ in points]
        below, middle, above, most = np.array([np.quantile(each, (low, 0.5, high, 1)) for _, each in points]).T
        artists.append(
            ax.fill_between(bits, below, above, color=colour, alpha=0.3, lw=0, label=f"{share:.0%} of records")
        )
        artists += ax.plot(bits, middle, "-", color=colour, label=f"{name}: median")
        artists += ax.plot(bits, most, ":", color=colour, label="the worst record")
    artists.append(ax.axhline(1, color=REFERENCE, ls="--", lw=1.0))
    ax.annotate("tolerance", (1, 1), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=REFERENCE)
    ax.set_yscale("log")
    legend(ax, loc="lower left")
    label(ax, "bits", "largest error / tolerance")
    return artists
