"""What a reader sees of a figure."""

from __future__ import annotations

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex


def legend_of(ax: Axes) -> list[str]:
    """The lines of the legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


def colour(artist: Artist) -> str:
    """As written in gpbnb.display.style."""
    return to_hex(artist.get_color()).upper()
