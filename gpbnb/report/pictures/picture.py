"""What a picture consists of, and its HTML: a still figure, and the form that a script shows in its place."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from html import escape
from importlib.resources import files
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from gpbnb.report.calculators.page import Input, Runtime, input_field
from gpbnb.report.display.style import TEXT
from gpbnb.report.display.vector import address


def short_number(number: float, digits: int = 6) -> float:
    """Round a number of the data to a few digits, which no processor computes differently."""
    return float(f"{number:.{digits}g}")


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
        return "\n".join((Runtime()._repr_html_(), self.html()))

    def html(self) -> str:
        """Return the HTML of the picture alone, without the style and the script that all pictures share."""
        title, every = escape(self.title), " ".join(f"calculator-{self.id}-{each.name}" for each in self.inputs)
        parts = (
            '<div class="picture">',
            f'<p class="picture-still"><img alt="{escape(self.alt)}" src="{escape(self.still_address())}"></p>',
            f'<form class="calculator" id="calculator-{self.id}" aria-label="{title}" hidden novalidate>',
            '<div class="calculator-inputs">',
            *(input_field(self.id, each, self.start[each.name]) for each in self.inputs),
            "</div>",
            '<figure class="calculator-figure"><div class="calculator-drawing" role="img" aria-label=""></div>'
            f'<ul class="calculator-legend"></ul><figcaption>{escape(self.caption)}</figcaption></figure>',
            f'<output class="calculator-sentence" for="{every}"></output>',
            "</form></div>",
            f"<script>\n{self.script()}\n</script>",
        )
        return "\n".join(parts)

    def script(self) -> str:
        """Return the script that makes the picture interactive, including its data."""
        spec = {
            "id": self.id,
            "inputs": [asdict(each) for each in self.inputs],
            "results": [],
            "sentence": self.sentence,
            "figure": {"title": self.title},
            "missing": {},
            "data": self.data(),
        }
        text = json.dumps(spec, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
        code = (files(__package__) / f"{self.id}.js").read_text("utf-8")
        return f"(() => {{\n{code}\ngpbnbCalculators.add({text}, compute, draw);\n}})();"

    def still_address(self) -> str:
        """Return the still figure as an address that holds it."""
        figure = self.still()
        found = address(figure, TEXT)
        plt.close(figure)
        return found

    def __repr__(self) -> str:
        return f"<picture: {self.title}>"
