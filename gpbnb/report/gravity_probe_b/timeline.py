"""The story of Gravity Probe B and of the arithmetic of filters as a timeline: dates, sources, and a picture."""

from __future__ import annotations

import textwrap
from datetime import date
from typing import NamedTuple

from matplotlib.figure import Figure

from gpbnb.report.display import style
from gpbnb.report.display.vector import element

FIRST, LAST = 1960, 2017
"""The years between which the timeline runs."""
MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)


class Event(NamedTuple):
    """Something that happened.

    Parameters
    ----------
    lane : name of the row of the picture where it stands.
    begin, end : years, or days in the form 2004-04-20; an event in a single year or on a single day has no end.
    words : what happened.
    sources : keys of the bibliography that give the event and its dates.
    """

    lane: str
    begin: str
    end: str
    words: str
    sources: tuple[str, ...]

    @property
    def when(self) -> str:
        """The dates as a reader writes them."""
        return "–".join(_written(each) for each in (self.begin, self.end) if each)

    @property
    def span(self) -> tuple[float, float]:
        """Beginning and end in years; the same number twice for an event without an end."""
        begin = _year(self.begin)
        return begin, _year(self.end) if self.end else begin


LANES = ("Filters and arithmetic", "Gravity Probe B")
EVENTS = (
    Event(LANES[0], "1960", "", "Kalman's filter", ("kalman1960",)),
    Event(LANES[0], "1960", "1969", "Apollo: 15-bit words, Potter's square root", ("tracy2022", "dyer1969")),
    Event(LANES[0], "1961", "", "Wilkinson: errors of matrix inversion", ("wilkinson1961",)),
    Event(LANES[0], "1976", "", "Thornton: triangular factors of covariances", ("thornton1976",)),
    Event(LANES[0], "1985", "", "IEEE 754", ("ieee1985",)),
    Event(LANES[0], "1986", "", "Verhaegen, Van Dooren: errors of filter forms", ("verhaegen1986",)),
    Event(LANES[0], "2016", "", "Savage: errors of digital integration", ("savage2016",)),
    Event(LANES[1], "1960", "", "Schiff predicts two drifts", ("schiff1960",)),
    Event(LANES[1], "1982", "", "first report by Hung", ("hung1982",)),
    Event(LANES[1], "1984", "", "second report, with bound (125)", ("hung1984",)),
    Event(LANES[1], "2004-04-20", "", "launch", ("everitt2011",)),
    Event(LANES[1], "2004-08-28", "2005-08-14", "data", ("everitt2011",)),
    Event(LANES[1], "2009", "", "the team describes its estimators", ("heifetz2009",)),
    Event(LANES[1], "2011", "", "final results", ("everitt2011",)),
)
LONGEST = 20
"""Letters of a line of the picture."""
CAPTION = (
    "The history of filters in short arithmetic, and of Gravity Probe B. Dots mark events, and bars mark periods. The "
    "orange dot is the bound that this book refutes. Our sources do not name the year of Potter's square root: it came "
    "after Kalman's filter and before the paper of 1969 that extends square-root filtering."
)


def description() -> str:
    """Say in words what the picture shows, lane by lane."""
    lanes = (
        f"{lane}: " + "; ".join(f"{each.when}, {each.words}" for each in EVENTS if each.lane == lane) for lane in LANES
    )
    last = max(each.begin[:4] for each in EVENTS)
    return f"A timeline with two sides, from {FIRST} at the top to {last}. {'. '.join(lanes)}."


def figure(height: float = 7.2) -> Figure:
    """Draw the timeline, the earliest year above, in a figure of this height in inches."""
    top, bottom = FIRST - 8, LAST + 1
    line = 1.45 * style.TEXT / 72 * (bottom - top) / height  # of text, in years
    fig, (ax,) = style.figure(height=height)
    for side, lane in zip((-1, 1), LANES, strict=True):
        align = "right" if side < 0 else "left"
        ax.text(side * 0.25, FIRST - 7, lane, ha=align, va="center", fontweight="bold")
        ax.plot(2 * [side * 0.12], [FIRST, LAST], color=style.REFERENCE, lw=0.8)
        events = [each for each in EVENTS if each.lane == lane]
        texts = [textwrap.fill(f"{_short(each)}: {each.words}", LONGEST) for each in events]
        years = [sum(each.span) / 2 for each in events]
        places = style.apart(years, [text.count("\n") + 1 for text in texts], line)
        for each, text, year, place in zip(events, texts, years, places, strict=True):
            colour = style.REFUTED if "(125)" in text else style.BLACK
            if each.end:
                ax.plot(2 * [side * 0.12], each.span, color=style.REFERENCE, lw=9, alpha=0.5, solid_capstyle="butt")
            else:
                ax.plot([side * 0.12], [year], "o", color=colour, ms=6)
            ax.plot([side * 0.15, side * 0.23], [year, place], color=style.REFERENCE, lw=0.8)
            ax.text(side * 0.25, place, text, ha=align, va="center", color=colour)
    for decade in range(FIRST, LAST, 10):
        ax.text(0, decade, str(decade), ha="center", va="center", color=style.REFERENCE)
    for text in ax.texts:
        text.set_fontsize(style.TEXT)
    ax.set_xlim(-1, 1)
    ax.set_ylim(bottom, top)
    ax.axis("off")
    return fig


def picture() -> str:
    """Return the timeline as an HTML element."""
    return element(figure(), style.TEXT, description(), CAPTION)


def sources() -> str:
    """Tabulate dates, events and sources in MyST Markdown, folded below a title."""
    lines = [
        f"| {each.when} | {each.words} | {{cite:p}}`{','.join(each.sources)}` |"
        for each in sorted(EVENTS, key=lambda each: each.span)
    ]
    head = [":::{dropdown} Dates and sources", "| when | what | source |", "| --- | --- | --- |"]
    return "\n".join([*head, *lines, ":::"])


def _short(event: Event) -> str:
    """Return the year or years of an event, in as few characters as possible."""
    begin, end = event.begin[:4], event.end[:4]
    return f"{begin}–{end[2:]}" if end else begin


def _written(day: str) -> str:
    if "-" not in day:
        return day
    found = date.fromisoformat(day)
    return f"{found.day} {MONTHS[found.month - 1]} {found.year}"


def _year(day: str) -> float:
    if "-" not in day:
        return float(day)
    found = date.fromisoformat(day)
    return found.year + (found.timetuple().tm_yday - 1) / 365.25
