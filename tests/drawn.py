"""What a reader sees of a figure."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.text import Annotation


def legend_of(ax: Axes) -> list[str]:
    """The lines of the legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def names_of(ax: Axes) -> list[str]:
    """The names written beside curves; none covers another or leaves the figure."""
    ax.figure.canvas.draw()
    names = [text for text in ax.texts if isinstance(text, Annotation)]
    boxes = [text.get_window_extent() for text in names]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    whole = ax.figure.bbox
    assert all(whole.x0 <= b.x0 and b.x1 <= whole.x1 and whole.y0 <= b.y0 and b.y1 <= whole.y1 for b in boxes)
    return [text.get_text() for text in names]


def colour(artist: Artist) -> str:
    """As written in gpbnb.display.style."""
    return to_hex(artist.get_color()).upper()
