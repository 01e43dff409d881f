"""The figure style of the book, and the one rule of its colours and lines.

========================  =====================================================================================
what is drawn             how
========================  =====================================================================================
observed errors           :data:`OBSERVED`, points; a thin line may join them. Further series take
                          ``OBSERVED_OTHERS``. Filled markers are rounded to nearest, open ones chopped.
bounds that hold          :data:`VALID`, a solid line
printed formulas          :data:`REFUTED`, a broken line: dashed as printed, dashes and dots as corrected. Printed
that fail                 numbers are open markers.
formats                   the ramp :func:`bits_colour`, pink for few bits and navy for many
tolerances, limits        ``REFERENCE``, dotted
hundreds of points        :func:`envelope`, a band
========================  =====================================================================================

Curves have their names beside them; a legend has at most :data:`MOST_ENTRIES` entries. Panels whose axes have the same
label have the same limits. :func:`defects` lists where a figure departs from the rule, and the figures of notebooks
warn of it when they are drawn, which fails the build.

The background of the SVG is transparent. In dark mode the style sheet of the book inverts the lightness of a picture
and keeps its hues, so a figure needs no second version.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from typing import Any, Protocol

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import display as show
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike, NDArray

from gpbnb.report.display.vector import png, svg

OBSERVED = "#0072B2"
"""Colour of errors that were measured or simulated."""
OBSERVED_OTHERS = ("#7B3FA0", "#B8478C", "#1F2F6B", "#5468CF")
COLOURS = (OBSERVED, *OBSERVED_OTHERS)
"""Blues and purples for several observed series in one figure."""
VALID = "#007D5F"
"""Colour of bounds and formulas that hold."""
REFUTED = "#C44E00"
"""Colour of printed formulas that fail."""
BLACK = "#000000"
REFERENCE = "#6B6B6B"
MOST_ENTRIES = 6
"""Most entries of a legend."""
_RAMP = LinearSegmentedColormap.from_list("bits", ["#C43C8C", "#7B3FA0", "#16265E"])
_FEWEST, _MOST = 2.0, 53.0

WIDTH = 4.8
"""Width of a figure in inches."""
TEXT = 11.0
"""Size of the text in points. It gives 17 pixels on a desktop and more than 10 on a phone 390 pixels wide."""

_STYLE: dict[Any, Any] = {
    "figure.dpi": 110,
    "savefig.dpi": 110,
    "figure.facecolor": "white",
    "axes.facecolor": "none",
    "figure.constrained_layout.use": True,
    "font.size": TEXT,
    "axes.titlesize": TEXT,
    "axes.labelsize": TEXT,
    "xtick.labelsize": TEXT,
    "ytick.labelsize": TEXT,
    "legend.fontsize": TEXT,
    "axes.grid": True,
    "grid.color": "#8080804D",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.markersize": 4.5,
}


class HasPrecision(Protocol):
    """A format with a base and a number of digits."""

    @property
    def base(self) -> int:
        """The base."""

    @property
    def precision(self) -> int:
        """The number of digits."""


class BookFigure(Figure):
    """A figure that moves names apart when it is drawn, and warns in a notebook if it departs from the rule."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.last_moves: list[Callable[[], None]] = []
        self._judged = False

    def _ipython_display_(self) -> None:
        picture = svg(self, TEXT)
        show({"image/svg+xml": picture, "image/png": png(self), "text/plain": repr(self)}, raw=True)

    def draw(self, renderer: Any) -> None:
        """Draw the figure after the names at its right edge have found their places."""
        if self.last_moves and (engine := self.get_layout_engine()):
            engine.execute(self)
        for move in self.last_moves:
            move()
        super().draw(renderer)
        if isinstance(self.canvas, FigureCanvasAgg) and "inline" in plt.get_backend() and not self._judged:
            self._judged = True
            for defect in defects(self):
                warnings.warn(defect, stacklevel=2)


def figure(
    columns: int = 1, height: float = 3.6, rows: int = 1, share: str = "", width: float = WIDTH
) -> tuple[Figure, NDArray[Any]]:
    """Create a figure with panels side by side or one below the other.

    Parameters
    ----------
    columns, rows : number of panels; rows fit a phone better than columns.
    height : height of the whole figure in inches.
    share : axes that the panels share because a reader compares them: "x", "y" or "xy".
    width : width of the whole figure in inches; the text of a wider figure is smaller on a phone.

    Returns
    -------
    figure, axes : `axes` is an array (rows · columns,), row by row.
    """
    plt.draw_if_interactive()  # loads the backend now, because rc_context would undo the settings that it makes
    if "inline" in plt.get_backend():
        plt.uninstall_repl_displayhook()  # it draws what a cell is about to show and to close
    with plt.rc_context(_STYLE):
        fig, axes = plt.subplots(
            rows,
            columns,
            figsize=(width, height),
            squeeze=False,
            sharex="x" in share,
            sharey="y" in share,
            FigureClass=BookFigure,
        )
    return fig, axes.ravel()


def colours(count: int, palette: Sequence[str] = COLOURS) -> Sequence[str]:
    """Return a colour for each of `count` curves."""
    if count > len(palette):
        raise ValueError(f"got {count} curves; needed at most {len(palette)}, or colours repeat; draw two figures")
    return palette[:count]


def bits_colour(fmt: HasPrecision) -> str:
    """Return the colour of a format in every figure: from pink for 2 bits to navy for 53 or more, by its β."""
    bits = 1 + (fmt.precision - 1) * math.log2(fmt.base)
    return to_hex(_RAMP(min((bits - _FEWEST) / (_MOST - _FEWEST), 1.0))).upper()


def loglog(ax: Axes) -> None:
    """Make both axes logarithmic."""
    ax.set_xscale("log")
    ax.set_yscale("log")


def legend(ax: Axes, **options: Any) -> None:
    """Show the legend without a frame."""
    ax.legend(frameon=False, fontsize=TEXT, **options)


def envelope(ax: Axes, x: ArrayLike, y: ArrayLike, **style: Any) -> Any:
    """Draw the least and the largest value of a long series within each bin of a logarithmic axis, as a band.

    Parameters
    ----------
    x, y : (n,), positive `x`; values of `y` that are not positive are left out.
    style : passed to :meth:`matplotlib.axes.Axes.fill_between`.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    bins = 60
    place = np.minimum((bins * np.log(x / x[0]) / np.log(x[-1] / x[0])).astype(int), bins - 1)
    groups = [np.flatnonzero((place == each) & (y > 0)) for each in range(bins)]
    groups = [group for group in groups if group.size]
    middle = [float(np.exp(np.log(x[group]).mean())) for group in groups]
    low, high = ([float(edge(y[group])) for group in groups] for edge in (np.min, np.max))
    return ax.fill_between(middle, low, high, lw=0.8, **style)


def name(
    ax: Axes,
    text: str,
    at: tuple[float, float],
    colour: str,
    shift: tuple[float, float] = (6.0, 0.0),
    **options: Any,
) -> Annotation:
    """Write the name of a curve beside it, in its colour.

    Parameters
    ----------
    at : point of the curve, in data coordinates.
    shift : offset of the text from that point, in typographic points; the text extends away from the curve.
    options : passed to :meth:`matplotlib.axes.Axes.annotate`.
    """
    across, up = shift
    options.setdefault("ha", "left" if across > 0 else "right" if across < 0 else "center")
    options.setdefault("va", "bottom" if up > 0 else "top" if up < 0 else "center")
    options.setdefault("fontsize", TEXT)
    return ax.annotate(text, at, shift, textcoords="offset points", color=colour, **options)


def apart(heights: Sequence[float], lines: Sequence[int], size: float) -> list[float]:
    """Return heights for texts that collide at the given ones: as close to these as possible, in the same order.

    Parameters
    ----------
    heights : wanted heights of the middles of the texts.
    lines : number of lines of each text.
    size : height of a line, in the unit of `heights`.
    """
    order = sorted(range(len(heights)), key=heights.__getitem__)
    placed = [heights[i] for i in order]
    for _ in range(200):
        for k, (low, high) in enumerate(pairwise(order)):
            overlap = size * ((lines[low] + lines[high]) / 2) - (placed[k + 1] - placed[k])
            if overlap > 0:
                placed[k] -= overlap / 2
                placed[k + 1] += overlap / 2
    return [placed[order.index(i)] for i in range(len(order))]


def name_ends(ax: Axes, ends: Mapping[str, tuple[float, str]]) -> list[Annotation]:
    """Write names to the right of a panel, each at the height where its curve ends.

    Names that collide move apart. If one moves far, lines join all names to their curves.

    Parameters
    ----------
    ends : for each name, the height in data coordinates and the colour.
    """
    notes = [
        ax.annotate(
            text,
            (1, height),
            (6, 0),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=colour,
            va="center",
            fontsize=TEXT,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.8, "shrinkA": 1, "shrinkB": 1, "relpos": (0, 0.5)},
        )
        for text, (height, colour) in ends.items()
    ]

    def move_apart() -> None:
        points = 72 / ax.figure.dpi
        heights = [float(ax.transData.transform((1, note.xy[1]))[1]) * points for note in notes]
        lines = [note.get_text().count("\n") + 1 for note in notes]
        moves = np.subtract(apart(heights, lines, 1.3 * TEXT), heights)
        far = bool((np.abs(moves) > TEXT / 2).any())
        for note, move in zip(notes, moves, strict=True):
            note.set_position((18 if far else 6, move))
            if note.arrow_patch:
                note.arrow_patch.set_visible(far)

    if isinstance(ax.figure, BookFigure):
        ax.figure.last_moves.append(move_apart)
    return notes


def label(ax: Axes, x: str, y: str, title: str = "") -> None:
    """Name both axes, each with its quantity and unit; an axis that panels share is named once, at the edge."""
    place = ax.get_subplotspec()
    above = place is not None and not place.is_last_row() and len(ax.get_shared_x_axes().get_siblings(ax)) > 1
    beside = place is not None and not place.is_first_col() and len(ax.get_shared_y_axes().get_siblings(ax)) > 1
    ax.set_xlabel("" if above else x)
    ax.set_ylabel("" if beside else y)
    if title:
        ax.set_title(title, fontsize=TEXT, loc="left")


def defects(fig: Figure) -> list[str]:
    """List where a drawn figure departs from the rule of this module."""
    found = [*_wrong_texts(fig)]
    for ax in fig.axes:
        found += [*_wrong_lines(ax)]
        if (box := ax.get_legend()) is not None and len(box.get_texts()) > MOST_ENTRIES:
            found.append(f"a legend has {len(box.get_texts())} entries; at most {MOST_ENTRIES}, or name the curves")
    return [*found, *_wrong_places(fig), *_wrong_axes(fig)]


def contrast(colour: str) -> float:
    """Return the contrast of a colour with white, as WCAG defines it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05))


def _texts(fig: Figure) -> Iterator[tuple[Any, Text]]:
    """Yield the texts that are seen, with the panel in which they stand if they can lie on its curves."""
    yield from ((None, text) for text in fig.texts if text.get_text().strip())
    for ax in [each for one in fig.axes for each in (one, *one.child_axes) if each.name != "3d"]:
        inside = [*ax.texts, *(box.get_texts() if (box := ax.get_legend()) is not None else [])]
        around = [each for each in ax.get_children() if isinstance(each, Text) and each not in ax.texts]  # titles
        for axis in (ax.xaxis, ax.yaxis) if ax.axison else ():
            low, high = sorted(axis.get_transform().transform(axis.get_view_interval()))
            slack = 1e-9 * (high - low)
            around.append(axis.label)
            major: Any = axis.get_majorticklocs()
            minor: Any = axis.get_minorticklocs()
            placed: list[tuple[Any, Any]] = [*zip(axis.get_major_ticks(len(major)), major, strict=True)]
            placed += zip(axis.get_minor_ticks(len(minor)), minor, strict=True)
            for tick, at in placed:
                if low - slack <= float(axis.get_transform().transform(at)) <= high + slack:
                    around += [tick.label1, tick.label2]
        for group, place in ((inside, ax), (around, None)):
            yield from ((place, text) for text in group if text.get_visible() and text.get_text().strip())


def _wrong_texts(fig: Figure) -> Iterator[str]:
    for _, text in _texts(fig):
        words = text.get_text()
        if float(text.get_fontsize()) < TEXT:
            yield f"{words!r} has {text.get_fontsize():g} points; needed {TEXT:g}, to be read on a phone"
        if contrast(to_hex(text.get_color())) < 4.5:
            yield f"{words!r} has a contrast of {contrast(to_hex(text.get_color())):.1f}; needed 4.5"
        if "no unit" in words:
            yield f"{words!r} names the lack of a unit"
        if re.search(r"(?<!\w)-\d", re.sub(r"\$[^$]*\$", "", words)):
            yield f"{words!r} has a hyphen for a minus sign"


def _wrong_lines(ax: Axes) -> Iterator[str]:
    for line in ax.lines:
        style, colour = line.get_linestyle(), to_hex(line.get_color()).upper()
        if style not in ("None", "", " "):
            if colour == REFUTED and style not in ("--", "-."):
                yield f"a refuted formula has the line style {style!r}; needed a broken line"
            if colour == VALID and style != "-":
                yield f"a valid formula has the line style {style!r}; needed a solid line"
        for axis, given, which in ((ax.xaxis, line.get_xdata(), 0), (ax.yaxis, line.get_ydata(), 1)):
            in_data = line.get_transform().contains_branch_seperately(ax.transData)[which]
            if in_data and axis.get_scale() == "log" and (np.asarray(given, dtype=np.float64) <= 0).any():
                yield f"{line.get_label()!r} has a number that is not positive on a logarithmic axis"


def _wrong_places(fig: Figure) -> Iterator[str]:
    texts = [(ax, text, _box(text)) for ax, text in _texts(fig)]
    for (_, one, a), (_, other, b) in combinations(texts, 2):
        if a.overlaps(b):
            yield f"{one.get_text()!r} lies on {other.get_text()!r}"
    for ax, text, box in texts:
        if _names_nothing(text):
            yield f"{text.get_text()!r} is not seen: it names a point beyond the axes"
            continue
        if not (fig.bbox.x0 <= box.x0 and box.x1 <= fig.bbox.x1 and fig.bbox.y0 <= box.y0 and box.y1 <= fig.bbox.y1):
            yield f"{text.get_text()!r} leaves the figure"
        if ax is not None:
            view = ax.get_window_extent()
            if ax.axison and box.overlaps(view) and (box.y0 < view.y0 or box.x0 < view.x0):
                yield f"{text.get_text()!r} lies on the edge of the axes"
            for line in ax.lines:
                if line.get_visible() and _crosses(ax, line, box):
                    yield f"{text.get_text()!r} lies on the curve {line.get_label()!r}"
    for ax in fig.axes:
        if ax.name != "3d" and ax.axison:
            yield from _beyond(ax)


def _names_nothing(text: Text) -> bool:
    """Whether a name is not drawn because its point lies beyond the axes."""
    if not isinstance(text, Annotation) or text.xycoords != "data" or text.get_annotation_clip() is False:
        return False
    view = text.axes.get_window_extent()  # type: ignore[union-attr]
    x, y = text.axes.transData.transform(text.xy)  # type: ignore[union-attr]
    return not (view.x0 - 1 <= x <= view.x1 + 1 and view.y0 - 1 <= y <= view.y1 + 1)


def _box(text: Text) -> Bbox:
    """Return the box of the letters: without the room above and below them."""
    box = Text.get_window_extent(text)
    return Bbox.from_extents(box.x0 + 1, box.y0 + 0.15 * TEXT, box.x1 - 1, box.y1 - 0.15 * TEXT)


def _crosses(ax: Axes, line: Line2D, box: Bbox) -> bool:
    points = line.get_transform().transform(
        np.column_stack([np.asarray(xy, float) for xy in line.get_data(orig=False)])
    )
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return False
    if line.get_marker() not in ("None", "", None):
        inside = (points[:, 0] > box.x0) & (points[:, 0] < box.x1) & (points[:, 1] > box.y0) & (points[:, 1] < box.y1)
        if inside.any():
            return True
    if line.get_linestyle() in ("None", "", " "):
        return False
    view = ax.get_window_extent()
    seen = Bbox.intersection(box, view)
    return seen is not None and line.get_transform().transform_path(line.get_path()).intersects_bbox(seen, filled=False)


def _beyond(ax: Axes) -> Iterator[str]:
    """Yield points and bars that the limits of the axes cut off."""
    view = ax.get_window_extent()
    view = Bbox.from_extents(view.x0 - 2, view.y0 - 2, view.x1 + 2, view.y1 + 2)
    for line in ax.lines:
        if line.get_marker() not in ("None", "", None):
            points = line.get_transform().transform(
                np.column_stack([np.asarray(xy, float) for xy in line.get_data(orig=False)])
            )
            if any(np.isfinite(point).all() and not view.contains(*point) for point in points):
                yield f"{line.get_label()!r} has points beyond the axes"
    for patch in ax.patches:
        if isinstance(patch, Rectangle) and patch.get_height() and patch.get_width():
            box = patch.get_window_extent()
            if not (view.x0 <= box.x0 and box.x1 <= view.x1 and view.y0 <= box.y0 and box.y1 <= view.y1):
                yield "a bar leaves the axes"


def _wrong_axes(fig: Figure) -> Iterator[str]:
    """Yield axes with numbers and no label, and axes with the same label and other limits."""
    limits: dict[tuple[str, str], set[tuple[float, float]]] = {}
    for ax in fig.axes:
        if not ax.axison or ax.name == "3d":
            continue
        for which, axis in (("x", ax.xaxis), ("y", ax.yaxis)):
            words = axis.label.get_text()
            ticks = [tick.label1.get_text() for tick in axis.get_major_ticks() if tick.label1.get_visible()]
            if not words and any(re.fullmatch(r"\$.+\$|[−-]?[\d.,]+", tick) for tick in ticks):
                yield f"the {which} axis has numbers and no label"
            if words:
                low, high = axis.get_view_interval()
                limits.setdefault((which, words), set()).add((float(low), float(high)))
    for (which, words), different in limits.items():
        if len(different) > 1:
            yield f"the {which} axes {words!r} of several panels have different limits; share them"
