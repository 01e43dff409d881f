"""HTML of the ledger: text with formulas, verdict badges, and what notebooks display."""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape

from gpbnb.report.display.tables import POWER, minus_signs, one_line

CHAPTERS = {
    "rounding": "Rounding bounds",
    "inversion": "Matrix inversion",
    "kalman": "Why (125) fails",
    "rolling": "1/f noise: roll and deroll",
    "integration": "Digital integration error",
    "budget": "Error budget",
    "geometry": "Measurement geometry",
}
"""Titles of the chapters by topic; the page of a topic has the name of the topic."""


def chapter(topic: str) -> str:
    """Name the chapter of a topic in a note; :func:`typeset` makes it a link."""
    return f"chapter *{CHAPTERS[topic]}*"


EMPHASIS = re.compile(r"(?<![\w*])\*(\w(?:[^*]*\w)?)\*(?![\w*])")
"""Text between stars in a note."""

_TOPIC = {title: topic for topic, title in CHAPTERS.items()}


@dataclass(frozen=True)
class Html:
    """HTML that a notebook displays; its short form is plain text.

    Parameters
    ----------
    title : the short form.
    html : the content.
    """

    title: str
    html: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return f"<{self.title}>"


def chapter_link(topic: str) -> str:
    """Link to the chapter of a topic."""
    return f'<a href="{topic}.html">{CHAPTERS[topic]}</a>'


def badge(outcome: str) -> str:
    """Show a verdict as a word on a coloured background."""
    return f'<span class="verdict verdict-{outcome.replace(" ", "-")}">{escape(outcome)}</span>'


def typeset(text: str) -> str:
    r"""Turn prose with math between dollar signs into HTML; a chapter's title between stars becomes a link."""
    parts = minus_signs(one_line(text)).split("$")
    prose = [POWER.sub(_power, escape(part, quote=False)) for part in parts[::2]]
    parts[::2] = [EMPHASIS.sub(_emphasis, part) for part in prose]
    parts[1::2] = [
        rf'<span class="math notranslate nohighlight">\({escape(math, quote=False)}\)</span>' for math in parts[1::2]
    ]
    return "".join(parts)


def _power(match: re.Match[str]) -> str:
    exponent = str(int(match[2])).replace("-", "−")
    return f"{match[1]}&nbsp;×&nbsp;10<sup>{exponent}</sup>"


def _emphasis(match: re.Match[str]) -> str:
    return chapter_link(_TOPIC[match[1]]) if match[1] in _TOPIC else f"<em>{match[1]}</em>"
