"""The argument of the documents: which part rests on which, and how wrong statements pass from one to the next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

from gpbnb.report.display import style
from gpbnb.report.display.vector import element
from gpbnb.report.ledger.checking import TOPIC_OF, Row
from gpbnb.report.ledger.html import Html
from gpbnb.report.ledger.roots import by_root

PLACES = {
    "rounding": (0.0, 2.4),
    "inversion": (0.0, 1.2),
    "kalman": (0.0, 0.0),
    "budget": (1.55, 2.4),
    "geometry": (1.55, 1.6),
    "rolling": (1.55, 0.8),
    "integration": (1.55, 0.0),
}
"""The parts of the documents in the order of their argument, and where a picture shows each."""
NAMES = {
    "rounding": "Rounding bounds",
    "inversion": "Matrix inversion",
    "kalman": "Kalman filter, (125)",
    "budget": "Error budget",
    "geometry": "Measurement\ngeometry",
    "rolling": "Roll and deroll",
    "integration": "Digital integration",
}
RESTS_ON = (("inversion", "rounding"), ("kalman", "inversion"), ("kalman", "rounding"), ("budget", "rounding"))
"""Each part that uses results of an earlier one."""
ALT = (
    "Seven boxes, one for each part of the documents, with the number of its statements and of wrong ones. Arrows lead "
    "from rounding bounds to matrix inversion, to the Kalman filter and to the error budget, and from matrix inversion "
    "to the Kalman filter. The arrow from inversion to the filter is by far the thickest. Geometry, roll and "
    "integration stand alone."
)
CAPTION = (
    "The parts of the documents, and how errors propagate between four of them. Each box gives the number of "
    "statements in a part, and its bar shows the share that is wrong. An arrow leads to a part that uses results of "
    "another. Its number counts the wrong statements at its head that follow from a root error at its tail."
)


class Stage(NamedTuple):
    """A part of the documents: where it is printed, how many statements it has, and how many of these are wrong."""

    documents: tuple[str, ...]
    statements: int
    wrong: int


def stages(rows: Iterable[Row]) -> dict[str, Stage]:
    """Count the statements of each part, by topic."""
    rows = list(rows)
    found = {}
    for topic in PLACES:
        inside = [row for row in rows if TOPIC_OF[row.statement.id] == topic]
        documents = tuple(sorted({row.statement.document for row in inside}, key=lambda name: name[-4:]))
        found[topic] = Stage(documents, len(inside), sum(row.outcome == "wrong" for row in inside))
    return found


def inherited(rows: Iterable[Row]) -> dict[tuple[str, str], int]:
    """Count the wrong statements of a part whose root error was made in an earlier part: (later, earlier) → number."""
    rows = list(rows)
    order = [*PLACES]
    found: Counter[tuple[str, str]] = Counter()
    for spoiled in by_root(rows).values():
        parts = [TOPIC_OF[row.statement.id] for row in spoiled if row.outcome == "wrong"]
        first = min(parts, key=order.index, default="")
        found.update((part, first) for part in parts if part != first)
    return dict(found)


def figure(rows: Iterable[Row]) -> Figure:
    """Draw the parts as boxes, and what they pass on as arrows."""
    rows = list(rows)
    found, passed = stages(rows), inherited(rows)
    fig, (ax,) = style.figure(height=5.6)
    half = (0.64, 0.35)
    for topic, stage in found.items():
        x, y = PLACES[topic]
        corner = (x - half[0], y - half[1])
        ax.add_patch(
            FancyBboxPatch(
                corner, 2 * half[0], 2 * half[1], "round,pad=0.02", facecolor="none", edgecolor=style.REFERENCE
            )
        )
        ax.add_patch(
            Rectangle(corner, 2 * half[0] * stage.wrong / stage.statements, 0.09, facecolor=style.REFUTED, lw=0)
        )
        years = " and ".join(name[-4:] for name in stage.documents)
        words = f"{NAMES[topic]}\n{years}\n{stage.statements} statements,\n{stage.wrong} wrong"
        ax.text(x, y + 0.05, words, ha="center", va="center", fontsize=style.TEXT, linespacing=1.3)
    for later, earlier in RESTS_ON:
        count = passed.get((later, earlier), 0)
        (x0, y0), (x1, y1) = PLACES[earlier], PLACES[later]
        arrow = {
            "arrowstyle": "-|>",
            "color": style.REFUTED if count else style.REFERENCE,
            "lw": 1.2 + 0.25 * count,
            "mutation_scale": 14 + 0.5 * count,
        }
        if x1 > x0:
            start, end, note = (x0 + 0.67, y0), (x1 - 0.67, y1), (0.0, 0.1)
        elif y0 - y1 > 2:
            start, end, note = (x0 - 0.67, y0), (x1 - 0.67, y1), (-0.38, 0.0)
            arrow["connectionstyle"] = "arc3,rad=0.32"
        else:
            start, end, note = (x0, y0 - 0.38), (x1, y1 + 0.38), (0.14, 0.0)
        ax.annotate("", end, start, arrowprops=arrow)
        middle = ((start[0] + end[0]) / 2 + note[0], (start[1] + end[1]) / 2 + note[1])
        ax.text(*middle, str(count), ha="center", va="center", fontsize=style.TEXT, color=arrow["color"])
    ax.set_xlim(-1.14, 2.22)
    ax.set_ylim(-0.4, 2.8)
    ax.axis("off")
    return fig


def chain_of_errors(rows: Iterable[Row]) -> Html:
    """Show the parts of the documents, and how wrong statements pass from one to the next, as HTML with a picture."""
    return Html("chain of errors", element(figure(rows), style.TEXT, ALT, CAPTION))
