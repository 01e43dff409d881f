"""What a picture consists of, and its HTML: a still figure, and the form that a script shows in its place."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from gpbnb.report.display.style import TEXT
from gpbnb.report.display.vector import address


def short_number(number: float, digits: int = 6) -> float:
    """Round a number of the data to a few digits, which no processor computes differently."""
    return float(f"{number:.{digits}g}")


@dataclass(frozen=True)
class Input:
    """A number that the reader enters.

    Parameters
    ----------
    name : its name in the script.
    label : its name for the reader, including letter and unit.
    least, most : accepted range.
    slider : range of the slider, which may be smaller; if `log`, the slider moves in decades.
    whole : whether it must be a whole number.
    choices : names for 0, 1, …, if only these values are accepted.
    """

    name: str
    label: str
    least: float
    most: float
    slider: tuple[float, float] = (0.0, 1.0)
    whole: bool = False
    log: bool = False
    choices: tuple[str, ...] = ()

    def html(self, value: str) -> str:
        """Return a field that shows this value, or the name of this choice, in the form of calculators.js."""
        if self.choices:
            options = "".join(
                f'<option value="{i}"{" selected" * (text == value)}>{escape(text)}</option>'
                for i, text in enumerate(self.choices)
            )
            field = f'<select name="{self.name}">{options}</select>'
        else:
            kind = " data-whole" * self.whole + " data-log" * self.log
            field = (
                f'<input name="{self.name}" value="{value}" data-least="{self.least:g}" data-most="{self.most:g}" '
                f'data-slider="{self.slider[0]:g} {self.slider[1]:g}"{kind}>'
            )
        return f"<label>{escape(self.label)} {field}</label>"


@dataclass(frozen=True)
class Picture:
    """A picture that notebooks display as HTML.

    Parameters
    ----------
    id : unique name in lower-case letters; also the name of the JavaScript file, which holds two functions.
        The first computes values from inputs and data, the second draws them and returns the height of the drawing.
    title : title of the picture.
    inputs : inputs; `start` holds what each shows at first, as typed.
    start : input → text, or name of the choice.
    sentence : the picture in words, with names of values in braces. Screen readers read it.
    caption : what to look at.
    data : function that returns the data for the script, which can be written as JSON.
    still : function that draws the still figure.
    alt : the still figure in words.
    """

    id: str
    title: str
    inputs: tuple[Input, ...]
    start: Mapping[str, str]
    sentence: str
    caption: str
    data: Callable[[], Any]
    still: Callable[[], Figure]
    alt: str

    def _repr_html_(self) -> str:
        parts = (
            '<div class="picture">',
            f'<p class="picture-still"><img alt="{escape(self.alt)}" src="{escape(self.still_address())}"></p>',
            f'<form class="calculator" data-calculator="{self.id}" aria-label="{escape(self.title)}" hidden>',
            '<div class="calculator-fields">',
            *(each.html(self.start[each.name]) for each in self.inputs),
            "</div>",
            '<figure class="calculator-figure"><div class="calculator-drawing" role="img" aria-label=""></div>'
            f"<figcaption>{escape(self.caption)}</figcaption></figure>",
            f'<output data-says="{escape(self.sentence)}"></output>',
            "</form></div>",
            f"<style>\n{(files(__package__) / 'pictures.css').read_text('utf-8')}</style>",
            f"<script>\n{self.script()}\n</script>",
        )
        return "\n".join(parts)

    def script(self) -> str:
        """Return the script that gives the functions and the data of the picture to calculators.js."""
        data = json.dumps(self.data(), ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
        code = (files(__package__) / f"{self.id}.js").read_text("utf-8")
        return (
            f"(() => {{\n{code}\n(window.gpbnbPictures ??= {{}}).{self.id} = {{ compute, draw, data: {data} }};\n}})();"
        )

    def still_address(self) -> str:
        """Return the still figure as an address that holds it."""
        figure = self.still()
        found = address(figure, TEXT)
        plt.close(figure)
        return found

    def __repr__(self) -> str:
        return f"<picture: {self.title}>"
