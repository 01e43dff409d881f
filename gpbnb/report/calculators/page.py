"""Write a calculator as HTML: a form, which a script shows, and a table of examples, which needs no script."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import sympy as sp

from gpbnb.report.calculators.javascript import Definition, print_function
from gpbnb.report.display.derivation import Step

if TYPE_CHECKING:
    from gpbnb.report.calculators.forms import Calculator, Input

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
    parts = (
        f'<form class="calculator" id="calculator-{calculator.id}" aria-label="{title}" hidden novalidate>',
        '<div class="calculator-inputs">',
        *(_field(calculator, each) for each in calculator.inputs),
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


def _field(calculator: Calculator, each: Input) -> str:
    name, label = _id(calculator, each), escape(each.label)
    value = next(iter(calculator.examples.values()))[each.name]
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
