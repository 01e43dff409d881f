"""The HTML of the calculators as written, before any script runs."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from fractions import Fraction

import pytest
from markup import Elements

from gpbnb.report.calculators import forms, page

CALCULATORS = pytest.mark.parametrize("calculator", forms.CALCULATORS, ids=lambda each: each.id)


@CALCULATORS
def test_every_input_has_a_label_a_hint_and_a_place_for_its_error(calculator):
    elements = Elements(page.form(calculator))
    ids = [a["id"] for _, a in elements.found if "id" in a]
    assert len(ids) == len(set(ids))
    labelled = {a["for"] for a in elements.all("label")}
    fields = [a for tag in ("input", "select") for a in elements.all(tag)]
    assert len(fields) == sum(1 if each.choices else 2 for each in calculator.inputs)
    for field in fields:
        assert field["id"] in labelled or field["aria-label"].strip()
        assert set((field.get("aria-describedby") or "").split()) <= set(ids)
    (form,) = elements.all("form")
    assert "hidden" in form
    (output,) = elements.all("output")
    assert output["for"].split() == [f"calculator-{calculator.id}-{each.name}" for each in calculator.inputs]


@CALCULATORS
def test_names_fit_together(calculator):
    names = {each.name for each in calculator.inputs}
    defined = {each.name for each in calculator.definitions()}
    results = {name for line in calculator.lines for name in line.names}
    curves = {name for name, _ in calculator.figure.curves}
    assert not names & defined
    assert results | set(calculator.formulas) | set(calculator.missing) <= defined
    assert {calculator.figure.sweep} <= names
    assert curves | set(calculator.shown) <= names | defined
    assert set(re.findall(r"\{(\w+)\}", calculator.sentence + "".join(calculator.missing.values()))) <= names | defined
    assert all(len(line.names) == len(calculator.columns) - 1 for line in calculator.lines)
    assert len(calculator.examples) > 2


@CALCULATORS
def test_examples_and_sliders_keep_within_what_is_taken(calculator):
    for example in calculator.examples:
        for each in calculator.inputs:
            assert each.least <= calculator.values(example)[each.name] <= each.most
    for each in calculator.inputs:
        if not each.choices:
            assert each.least <= each.slider[0] < each.slider[1] <= each.most
            assert not each.log or each.slider[0] > 0


@CALCULATORS
def test_counts_are_whole_and_sliders_over_a_thousandfold_are_logarithmic(calculator):
    for each in calculator.inputs:
        if not each.choices:
            assert each.whole == (each.name in ("b", "t", "n", "m", "k")), each.name
            low, high = each.slider
            assert each.log == (high > 1000 * low > 0), each.name


@CALCULATORS
def test_sliders_move_by_whole_numbers_hundredths_of_a_decade_or_thousandths_of_their_range(calculator):
    shown = page.form(calculator)
    for each in calculator.inputs:
        if not each.choices:
            ends = rf'id="calculator-{calculator.id}-{each.name}-slider" .*? min="(.*?)" max="(.*?)" step="(.*?)"'
            low, high, step = map(float, re.search(ends, shown).groups())
            expected = 0.01 if each.log else 1 if each.whole else (high - low) / 1000
            assert step == pytest.approx(expected, rel=1e-5)


@CALCULATORS
def test_the_table_needs_no_script_and_is_of_the_chapters_functions(calculator):
    html = page.form(calculator)
    table = html[html.index('<table class="calculator-examples">') :]
    assert html.index("</form>") < html.index('<table class="calculator-examples">')
    for example in calculator.examples:
        row = re.search(rf">{re.escape(example)}</th>(.*?)</tr>", table)[1]
        cells = re.findall(r"<td>(.*?)</td>", row)
        computed = calculator.reference(calculator.values(example))
        wanted = [calculator.examples[example].get(name) or page.show(computed[name]) for name in calculator.shown]
        assert cells == wanted
        assert "—" not in row


def test_the_sample_calculations_are_in_the_table():
    """hung1984, ch. III: .5e-7 and about 4 years; .5e-11 and about 40,000 years."""
    one, two = (forms.DEROLL.reference(forms.DEROLL.values(f"sample calculation {i}")) for i in (1, 2))
    assert one["error"] == Fraction(1, 2) / 10**7
    assert two["error"] == Fraction(1, 2) / 10**11
    assert one["beat"] == pytest.approx(4, rel=0.01)
    assert two["beat"] == pytest.approx(40_000, rel=0.01)


@CALCULATORS
def test_what_is_written_into_a_script_stays_in_it(calculator):
    source = page.script(calculator)
    assert "</" not in source
    assert "<!--" not in source
    spec = json.loads(source[len("gpbnbCalculators.add(") : source.index(",\n(given)")])
    assert spec["id"] == calculator.id
    assert [each["name"] for each in spec["inputs"]] == [each.name for each in calculator.inputs]


def test_not_even_a_sentence_ends_the_script():
    ending = "</script><!-- {beta} -->"
    source = page.script(replace(forms.ROUNDING, sentence=ending))
    assert "<" not in source[: source.index(",\n(given)")]
    assert json.loads(source[len("gpbnbCalculators.add(") : source.index(",\n(given)")])["sentence"] == ending


@CALCULATORS
def test_formulas_are_typeset_without_names_of_the_script(calculator):
    text = page.Formulas(calculator)._repr_markdown_()
    assert text.startswith("$$\n\\begin{aligned}")
    assert text.count("&=") == len(calculator.formulas)
    words = re.findall(r"(?<![\\a-zA-Z])[a-zA-Z]{4,}\d*", re.sub(r"\\text\{.*?\}|\\(begin|end)\{\w+\}", "", text))
    assert words == []


def test_as_many_roundings_as_units_have_no_bound():
    given = {"b": "2", "t": "2", "chop": False}  # the unit roundoff is a quarter
    assert forms._unit_reference({**given, "n": "3"})["gamma"] == 3
    assert math.isnan(forms._unit_reference({**given, "n": "4"})["gamma"])


def test_nothing_is_fetched():
    text = page.Runtime()._repr_html_() + "".join(page.form(each) for each in forms.CALCULATORS)
    assert re.findall(r"https?:(?!//www\.w3\.org/2000/svg)|import\(|@import|url\(|fetch\(", text) == []


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0, "0"),
        (999999, "999999"),
        (1000000, "1.000\u00a0×\u00a010⁶"),
        (0.5, "0.5"),
        (0.001, "0.001"),
        (0.00012345678, "1.235\u00a0×\u00a010⁻⁴"),
        (Fraction(1, 3), "0.3333"),
        (12345.67, "12350"),
        (-12.345, "-12.35"),
        (99999.9, "1.000\u00a0×\u00a010⁵"),
        (-2.5e-12, "-2.500\u00a0×\u00a010⁻¹²"),
        (math.nan, "—"),
        (math.inf, "∞"),
    ],
)
def test_shows_numbers(value, shown):
    assert page.show(value) == shown


def test_an_input_reads_what_examples_hold():
    rule, base = forms.ROUNDING.inputs[2], forms.ROUNDING.inputs[0]
    assert [rule.number(text) for text in rule.choices] == [0, 1]
    assert base.number("10") == 10
    with pytest.raises(ValueError, match="not in"):
        rule.number("upwards")
