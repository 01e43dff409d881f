"""Figures of the chapter on wordlength: results in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.report.display.style import (
    REFERENCE,
    colours,
    label,
    name_ends,
)

Curve = Sequence[tuple[int, float]]


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
