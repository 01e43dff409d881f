"""What a reader sees of a figure."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.container import ErrorbarContainer
from matplotlib.text import Annotation, Text


def legend_of(ax: Axes) -> list[str]:
    """The lines of the legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def names_of(ax: Axes) -> list[str]:
    """The names written beside curves; none covers another or leaves the figure."""
    ax.figure.canvas.draw()
    names = [text for text in ax.texts if isinstance(text, Annotation)]
    boxes = [Text.get_window_extent(text) for text in names]  # without the lines that lead to them
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    whole = ax.figure.bbox
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 and whole.y0 <= b.y0 and b.y1 <= whole.y1 for b in boxes)
    return [text.get_text() for text in names]


def colour(artist: Artist) -> str:
    """As written in gpbnb.report.display.style."""
    return to_hex(artist.get_color()).upper()


# The colours of the book, written out: observed errors, valid bounds, refuted formulas, references, other series.
BLUE, GREEN, ORANGE, GREY, BLACK = "#0072B2", "#007D5F", "#C44E00", "#6B6B6B", "#000000"
PURPLE, PINK, NAVY, VIOLET = "#7B3FA0", "#B8478C", "#1F2F6B", "#5468CF"


def look(artist: Any) -> tuple[str, str, str]:
    """Colour, line style and marker of a line, or of the points of error bars."""
    line = artist[0] if isinstance(artist, ErrorbarContainer) else artist
    mark = "" if line.get_marker() in ("None", None) else line.get_marker()
    style = "" if line.get_linestyle() == "None" else line.get_linestyle()
    paint = to_hex(line.get_color()).upper()
    if mark and not style:
        paint = to_hex(line.get_markeredgecolor()).upper()
    return paint, style, mark


def points_of(artist: Any) -> list[tuple[float, float]]:
    """The points of a line, or of error bars."""
    line = artist[0] if isinstance(artist, ErrorbarContainer) else artist
    return [(float(x), float(y)) for x, y in zip(line.get_xdata(), line.get_ydata(), strict=True)]


def at(artist: Any, *expected: tuple[float, float], rel: float = 1e-9) -> bool:
    """Whether a line, or error bars, consists of these points."""
    found = points_of(artist)
    return len(found) == len(expected) and all(
        math.isclose(a, b, rel_tol=rel, abs_tol=1e-12)
        for one, other in zip(found, expected, strict=True)
        for a, b in zip(one, other, strict=True)
    )


def spans_of(bars: ErrorbarContainer) -> list[float]:
    """Half the length of each error bar."""
    (segments,) = bars[2]
    return [float(abs(high[1] - low[1]) / 2) for low, high in segments.get_segments()]


def labelled(ax: Axes) -> dict[str, tuple[str, str, str]]:
    """The look of each artist that the legend shows, by its label there."""
    box = ax.get_legend()
    return {text.get_text(): look(handle) for text, handle in zip(box.get_texts(), box.legend_handles, strict=True)}


def named(ax: Axes) -> dict[str, tuple[str, tuple[float, float]]]:
    """Colour of each name beside a curve, and the point of the curve that it names, in data coordinates.

    A name at the end of a panel has the horizontal place 1, the end.
    """
    notes = [text for text in ax.texts if isinstance(text, Annotation) and text.get_text()]
    assert len({text.get_text() for text in notes}) == len(notes)
    return {text.get_text(): (colour(text), (float(text.xy[0]), float(text.xy[1]))) for text in notes}


def near(found: tuple[str, tuple[float, float]], paint: str, at: tuple[float, float]) -> bool:
    """Whether a name has a colour and stands at a point."""
    return found[0] == paint and all(
        math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) for a, b in zip(found[1], at, strict=True)
    )
