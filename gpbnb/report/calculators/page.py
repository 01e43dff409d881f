"""What a calculator consists of, and its HTML: a form, which a script shows, and a table, which needs no script."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from html import escape
from importlib.resources import files
from typing import Any

import sympy as sp

from gpbnb.report.calculators.javascript import Definition, print_function
from gpbnb.report.display.derivation import Step

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


Values = Mapping[str, float]


@dataclass(frozen=True)
class Input:
    """A number that the reader enters.

    Parameters
    ----------
    name : its name in the formulas.
    label : its name for the reader, including letter and unit.
    least, most : accepted range.
    slider : range of the slider, which may be smaller; if `log`, the slider moves in decades.
    whole : whether it must be a whole number.
    choices : names for 0, 1, …, if only these values are accepted.
    cure : advice at the end of the message that rejects a number.
    """

    name: str
    label: str
    least: float
    most: float
    slider: tuple[float, float] = (0.0, 1.0)
    whole: bool = False
    log: bool = False
    choices: tuple[str, ...] = ()
    cure: str = ""

    def number(self, text: str) -> float:
        """Read a value of an example, or a name among `choices`."""
        if self.choices:
            return self.choices.index(text)
        return int(text) if self.whole else float(text)


@dataclass(frozen=True)
class Line:
    """A line of results: its label and the names in its cells."""

    label: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Figure:
    """A figure of results against one input.

    Parameters
    ----------
    sweep : name of the input.
    title, axis : title of the figure, and label of the vertical axis with its unit.
    curves : names of results and their labels. The vertical axis and the axis of a `log` input are logarithmic.
    """

    sweep: str
    title: str
    axis: str
    curves: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Calculator:
    """A calculator, which notebooks display as HTML.

    Parameters
    ----------
    id : unique name in lower-case letters.
    title : title of the form.
    inputs : inputs, with the names that the definitions use.
    definitions : function that returns the definitions from :mod:`gpbnb.report.calculators.derivation`.
    columns, lines : headers and rows of the results; there is one header more than a row has names.
    sentence : the result in words, with names in braces.
    figure : the figure.
    examples : label → value of each input as typed; the form starts with the first example.
    shown : names in the table of examples, and their headers.
    reference : function that computes the results with the chapters' Python functions.
    formulas : names whose formulas are displayed; `letters` holds the TeX of these names and of the symbols in them.
    missing : name → why this result may not exist.
    """

    id: str
    title: str
    inputs: tuple[Input, ...]
    definitions: Callable[[], tuple[Definition, ...]]
    columns: tuple[str, ...]
    lines: tuple[Line, ...]
    sentence: str
    figure: Figure
    examples: Mapping[str, Mapping[str, str]]
    shown: Mapping[str, str]
    reference: Callable[[Values], dict[str, Any]]
    formulas: tuple[str, ...]
    letters: Mapping[str, str]
    missing: Mapping[str, str] = field(default_factory=dict)

    def values(self, example: str) -> dict[str, float]:
        """Return the inputs of an example as numbers."""
        return {each.name: each.number(self.examples[example][each.name]) for each in self.inputs}

    def _repr_html_(self) -> str:
        return form(self)

    def __repr__(self) -> str:
        return f"<calculator: {self.title}>"


# -- HTML --------------------------------------------------------------------------------------------


class Runtime:
    """Style and script that all calculators of a page share; shown once, before the first."""

    def _repr_html_(self) -> str:
        style, script = ((files(__package__) / f"calculators.{kind}").read_text("utf-8") for kind in ("css", "js"))
        return f"<style>\n{style}</style>\n<script>\n{script}</script>"

    def __repr__(self) -> str:
        return "<style and script of the calculators>"


def show(value: Any) -> str:
    """Write a number with four significant digits, or with all digits if it is a whole number below a million."""
    if not math.isfinite(value):
        return "—" if math.isnan(value) else "∞"
    if value == int(value) and abs(value) < 1e6:
        return str(int(value))
    mantissa, _, exponent = f"{float(value):.3e}".partition("e")
    rounded = float(f"{mantissa}e{exponent}")
    if 1e-3 <= abs(rounded) < 1e5:
        return repr(rounded).removesuffix(".0")
    return f"{mantissa}\u00a0×\u00a010{str(int(exponent)).translate(_SUPERSCRIPTS)}"


def form(calculator: Calculator) -> str:
    """Return the HTML of a calculator."""
    title, every = escape(calculator.title), " ".join(_id(calculator, each) for each in calculator.inputs)
    first = next(iter(calculator.examples.values()))
    parts = (
        f'<form class="calculator" id="calculator-{calculator.id}" aria-label="{title}" hidden novalidate>',
        '<div class="calculator-inputs">',
        *(input_field(calculator.id, each, first[each.name]) for each in calculator.inputs),
        "</div>",
        f'<output class="calculator-sentence" for="{every}"></output>',
        '<div class="calculator-scroll">',
        _results(calculator),
        "</div>",
        f'<figure class="calculator-figure"><div class="calculator-drawing" role="img" aria-label=""></div>'
        f'<ul class="calculator-legend"></ul><figcaption>{escape(calculator.figure.title)}; '
        "circles mark your numbers.</figcaption></figure>",
        "</form>",
        f'<div class="calculator-scroll">{_examples(calculator)}</div>',
        f"<script>\n{script(calculator)}\n</script>",
    )
    return "\n".join(parts)


def script(calculator: Calculator) -> str:
    """Return the script that makes a form interactive, including the formulas."""
    spec = {
        "id": calculator.id,
        "inputs": [asdict(each) for each in calculator.inputs],
        "results": [name for line in calculator.lines for name in line.names],
        "sentence": calculator.sentence,
        "figure": asdict(calculator.figure),
        "missing": dict(calculator.missing),
    }
    text = json.dumps(spec, ensure_ascii=False).replace("<", "\\u003c")
    compute = print_function([each.name for each in calculator.inputs], calculator.definitions())
    return f"gpbnbCalculators.add({text},\n{compute});"


def _id(calculator: Calculator, each: Input) -> str:
    return f"calculator-{calculator.id}-{each.name}"


def input_field(form: str, each: Input, value: str) -> str:
    """Return the HTML of an input of the form with this id, with the value that it shows at first."""
    name, label = f"calculator-{form}-{each.name}", escape(each.label)
    if each.choices:
        options = "".join(
            f'<option value="{i}"{" selected" if text == value else ""}>{escape(text)}</option>'
            for i, text in enumerate(each.choices)
        )
        return (
            f'<div class="calculator-field"><label for="{name}">{label}</label>'
            f'<select id="{name}" name="{each.name}">{options}</select></div>'
        )
    ends = re.sub(r"e\+?(-?)0*", r"e\1", f"from {each.least:g} to {each.most:g}")
    low, high = (math.log10(end) if each.log else end for end in each.slider)
    step = 1 if each.whole and not each.log else 0.01 if each.log else (high - low) / 1000
    kind = "a whole number" if each.whole else "a number"
    return (
        f'<div class="calculator-field"><label for="{name}">{label}</label>'
        f'<input type="text" inputmode="decimal" autocomplete="off" spellcheck="false" id="{name}" name="{each.name}" '
        f'value="{value}" aria-describedby="{name}-hint {name}-error">'
        f'<input type="range" id="{name}-slider" aria-label="{label}, slider" min="{low:g}" max="{high:g}" '
        f'step="{step:g}">'
        f'<small id="{name}-hint">{kind} {ends}</small>'
        f'<p class="calculator-error" id="{name}-error"></p></div>'
    )


def _results(calculator: Calculator) -> str:
    head = "".join(f'<th scope="col">{escape(text)}</th>' if text else "<td></td>" for text in calculator.columns)
    body = "".join(
        f'<tr><th scope="row">{escape(line.label)}</th>'
        + "".join(f'<td data-name="{name}"></td>' for name in line.names)
        + "</tr>"
        for line in calculator.lines
    )
    return (
        f'<table class="calculator-results"><caption>{escape(calculator.title)}: results</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    )


def _examples(calculator: Calculator) -> str:
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in ("example", *calculator.shown.values()))
    rows = []
    for label, typed in calculator.examples.items():
        computed = calculator.reference(calculator.values(label))
        cells = (typed[name] if name in typed else show(computed[name]) for name in calculator.shown)
        numbers = escape(json.dumps(dict(calculator.values(label))), quote=True)
        row = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        rows.append(f'<tr><th scope="row" data-numbers="{numbers}">{escape(label)}</th>{row}</tr>')
    return (
        f'<table class="calculator-examples"><caption>{escape(calculator.title)}: examples</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


class Formulas:
    """The formulas of a calculator, typeset from the expressions in its script."""

    def __init__(self, calculator: Calculator) -> None:
        self.calculator = calculator
        self.definitions = [each for each in calculator.definitions() if each.name in calculator.formulas]

    def _repr_markdown_(self) -> str:
        lines = " \\\\[0.5em]\n".join(self._latex(each).replace(r"\;=\;", "&=", 1) for each in self.definitions)
        return f"$$\n\\begin{{aligned}}\n{lines}\n\\end{{aligned}}\n$$"

    def _latex(self, each: Definition) -> str:
        letters = self.calculator.letters
        expression = each.expression if each.shown is None else each.shown
        named = {s: sp.Symbol(letters.get(s.name, s.name), nonnegative=True) for s in expression.free_symbols}
        return Step("", sp.Symbol(letters.get(each.name, each.name)), expression.subs(named)).latex()

    def __repr__(self) -> str:
        return f"<formulas: {self.calculator.title}>"
