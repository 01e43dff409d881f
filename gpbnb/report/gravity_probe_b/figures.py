"""Figures of the chapters on the year of Gravity Probe B: results in, artists out."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.arithmetic.named import BINARY32, BINARY64
from gpbnb.report.display.style import (
    BLACK,
    OBSERVED,
    REFERENCE,
    REFUTED,
    VALID,
    label,
    legend,
    name,
)
from gpbnb.report.gravity_probe_b.summary import DRIFT, YearAnswer, binary_digits


def answer_line(found: Sequence[YearAnswer], ax: Axes) -> list[Artist]:
    """Draw the answers of the front page over bits, one line for each tolerance, and ring the answer to the title."""
    own, simulated, formula, years, every = (
        next(each for each in found if each.source.startswith(source))
        for source in ("Report, own", "The same", "Report, for", "300", "Every")
    )
    fewest, answer, enough = (float(each.bits or 0) for each in (simulated, years, every))
    artists: list[Artist] = []
    for height, printed, seen in ((1, own, fewest), (0, formula, answer)):
        places = [binary_digits(t) for t in printed.decimal]
        artists += ax.plot(places, [height] * 2, "o", mfc="none", mec=REFUTED, ms=9, mew=1.5)
        artists += ax.plot([seen], [height], "o", color=OBSERVED, ms=8)
        marks = [*((place, f"{t} digits", REFUTED) for place, t in zip(places, printed.decimal, strict=True))]
        for place, words, colour in [*marks, (seen, f"{seen:.0f} bits", OBSERVED)]:
            side = "right" if colour == OBSERVED else "left" if place < BINARY64.precision or height else "center"
            artists.append(
                name(
                    ax,
                    words,
                    (place, height),
                    colour,
                    (4 if side == "right" else 0, 14 if side == "right" else 11),
                    ha=side,
                )
            )
    (every_mark,) = ax.plot([enough], [0], "|", color=VALID, ms=16, mew=3)
    artists.append(every_mark)
    artists.append(name(ax, f"{enough:.0f} bits", (enough, 0), VALID, (-4, -22), ha="left"))
    artists += ax.plot([answer], [0], "o", mfc="none", mec=BLACK, ms=18, mew=2)
    for word, fmt in (("binary32", BINARY32), ("binary64", BINARY64)):
        artists.append(ax.axvline(fmt.precision, color=REFERENCE, ls=":"))
        artists.append(name(ax, word, (fmt.precision, -0.75), REFERENCE, (4, 0)))
    for line, word in zip((artists[0], artists[1], every_mark), ("report", "simulated", "every record"), strict=True):
        line.set_label(word)
    ax.set(xlim=(8, 69), ylim=(-0.9, 1.7), yticks=[1, 0], yticklabels=[f"{DRIFT:,} mas", "1 mas"])
    ax.set_xticks(range(20, 70, 10))
    legend(ax, loc="lower right", bbox_to_anchor=(1, 0.97), ncols=3)
    label(ax, "bits", "allowed")
    return artists
