"""Figures of the chapter on wordlength: results in, artists out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display.style import (
    REFERENCE,
    bits_colour,
    colours,
    label,
    legend,
    line_styles,
    name_ends,
)

Curve = Sequence[tuple[int, float]]


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
