"""The figures and lines of results of the calculators in a real browser: what each label stands for, written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.report.calculators import forms
from gpbnb.report.calculators.page import show

ADDRESS = "book/calculators.html"
CALCULATORS = pytest.mark.parametrize("calculator", forms.CALCULATORS, ids=lambda each: each.id)

#: The input that is swept, its range as drawn, its label, the axis, and what each curve shows, in the first example.
FIGURES = {
    "rounding": ("t", (1, 60), "Digits t", "relative error", {"n roundings, γₙ": "gamma", "one rounding, β": "beta"}),
    "kalman": (
        "k",
        (1, 1e8),
        "Steps k",
        "error, unit of the state",
        {
            "as printed": "bound1",
            "roundings counted once": "bound2",
            "and errors of either sign": "bound3",
            "and covariance errors carried on": "bound4",
            "and old inputs forgotten": "bound5",
            "allowed error": "goal",
        },
    ),
    "deroll": (
        "t",
        (1, 30),
        "Places of the register t",
        "loss / signal",
        {"loss of the signal, one dimension": "lost"},
    ),
    "integration": (
        "rate",
        (1e-3, 1e6),
        "Iteration rate f (Hz)",
        "random walk, u s per √s",
        {"(35), exact": "exact", "(39), for fast sampling": "printed"},
    ),
}
#: What each line of results shows.
LINES = {
    "rounding": {
        "one rounding, β": ["beta"],
        "one rounding, sharper: β/(1+β)": ["sharper"],
        "n roundings, to first order: nβ": ["total"],
        "n roundings, always: γₙ": ["gamma"],
    },
    "deroll": {
        "roll rate (rad/s)": ["rate"],
        "its error Δω (rad/s)": ["error"],
        "period of the off-tuned signal, 2π/Δω (years)": ["beat"],
        "phase at the end (rad)": ["phase"],
        "loss of the signal at the end, one dimension (above 1: sign reversed)": ["lost"],
        "cross drift, two dimensions (mas a year)": ["across"],
    },
    "integration": {
        "μ = ω/f": ["mu"],
        "random walk, (35) (u s per √s)": ["exact"],
        "random walk, (39) (u s per √s)": ["printed"],
        "(39) / (35)": ["ratio"],
    },
    "kalman": {
        label: [f"a{i}", f"b{i}", f"bound{i}", f"digits{i}"] for i, label in enumerate(FIGURES["kalman"][4], 1) if i < 6
    },
}
READ_FIGURE = """id => {
    const box = document.querySelector(`#calculator-${id} .calculator-drawing`), svg = box.querySelector("svg");
    const number = (node, name) => Number(node.getAttribute(name));
    const texts = [...svg.querySelectorAll("text")].map(t => [number(t, "x"), number(t, "y"), t.textContent]);
    const ends = ["x1", "y1", "x2", "y2"];
    const lines = [...svg.querySelectorAll("line.grid")].map(l => ends.map(name => number(l, name)));
    const style = node => ["stroke", "strokeDasharray", "strokeWidth"].map(name => getComputedStyle(node)[name]);
    const items = [...document.querySelectorAll(`#calculator-${id} li`)].filter(li => li.querySelector("path"));
    return {
        texts, lines, said: box.getAttribute("aria-label"), height: number(svg, "height"),
        curves: [...svg.querySelectorAll("path.curve")].map(p => ({d: p.getAttribute("d"), style: style(p)})),
        here: [...svg.querySelectorAll("circle")].map(c => [number(c, "cx"), number(c, "cy")]),
        legend: items.map(li => [li.textContent.trim(), style(li.querySelector("path"))]),
    };
}"""


@pytest.fixture(scope="module")
def page(open_page):
    """The page as it is when it is opened: each calculator shows its first example."""
    with open_page(ADDRESS, shared=True) as page:
        yield page


def power(text):
    """The number that a label of a logarithmic axis writes."""
    return 10.0 ** int(text[2:].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))


def scales(found, log):
    """From pixels to numbers, as the labels of the grid say; both axes."""
    down = [(x, text) for x, y, text in found["texts"] if y == found["height"] - 26]
    across = [(y - 4, power(text)) for x, y, text in found["texts"] if x == 52]
    right = [(x, math.log10(power(text)) if log else float(text)) for x, text in down]
    assert len(right) >= 2
    assert len(across) >= 2

    def line(places):
        (p0, v0), (p1, v1) = places[0], places[-1]
        assert [v0 + (p - p0) * (v1 - v0) / (p1 - p0) for p, _ in places] == pytest.approx([v for _, v in places])
        return lambda p: v0 + (p - p0) * (v1 - v0) / (p1 - p0)

    horizontal, vertical = line(right), line([(y, math.log10(v)) for y, v in across])
    # Every label has its line of the grid.
    assert sorted({x1 for x1, y1, x2, y2 in found["lines"] if x1 == x2}) == pytest.approx(sorted(x for x, _ in right))
    assert sorted({y1 for x1, y1, x2, y2 in found["lines"] if y1 == y2}) == pytest.approx(sorted(y for y, _ in across))
    return (lambda p: 10 ** horizontal(p)) if log else horizontal, vertical


@CALCULATORS
def test_each_curve_has_the_label_and_the_heights_of_its_result(page, calculator):
    swept, (low, high), axis_x, axis_y, curves = FIGURES[calculator.id]
    found = page.evaluate(READ_FIGURE, calculator.id)
    words = [text for *_, text in found["texts"]]
    assert words.count(axis_x) == words.count(axis_y) == 1
    # The legend has the curves' labels in their order, each with a swatch that looks as its curve.
    assert [label for label, _ in found["legend"]] == list(curves)
    assert [style for _, style in found["legend"]] == [each["style"] for each in found["curves"]]
    assert len({str(each["style"]) for each in found["curves"]}) == len(curves)
    (entry,) = [each for each in calculator.inputs if each.name == swept]
    x_of, y_of = scales(found, entry.log)
    given = calculator.values(next(iter(calculator.examples)))
    low, high = min(low, given[swept]), max(high, given[swept])
    expected_x = np.geomspace(low, high, 121) if entry.log else np.linspace(low, high, 121)
    if entry.whole:
        expected_x = np.unique(np.floor(expected_x + 0.5))
    for name, curve, circle in zip(curves.values(), found["curves"], found["here"], strict=True):
        assert curve["d"].count("M") == 1
        points = [tuple(map(float, each.split())) for each in curve["d"][1:].split("L")]
        values = [(given | calculator.reference(given | {swept: float(x)}))[name] for x in expected_x]
        kept = [(x, float(v)) for x, v in zip(expected_x, values, strict=True) if v and math.isfinite(v)]
        assert len(points) == len(kept)
        for (px, py), (x, value) in zip(points, kept, strict=True):
            # Coordinates have a decimal of a pixel: half of it, and the slope of the axis.
            step = abs(y_of(1) - y_of(0))
            assert abs(y_of(py) - math.log10(value)) < 0.051 * step
            assert abs(px - nearest(x_of, x, found, entry.log)) < 0.06
        here = (given | calculator.reference(given))[name]
        assert 10 ** y_of(circle[1]) == pytest.approx(float(here), rel=1e-6)
        assert x_of(circle[0]) == pytest.approx(given[swept], rel=1e-6)
        first, last = (show(float(values[i])) for i in (0, -1))
        label = next(label for label, each in curves.items() if each == name)
        assert f"{label}: {first} to {last}" in found["said"]


def nearest(x_of, x, found, log):
    """The pixel of a number on the horizontal axis."""
    a, b = x_of(0.0), x_of(1.0)
    return math.log(x / a) / math.log(b / a) if log else (x - a) / (b - a)


@CALCULATORS
def test_each_line_of_results_has_the_label_of_its_numbers(page, calculator):
    computed = calculator.reference(calculator.values(next(iter(calculator.examples))))
    rows = page.evaluate(
        """id => [...document.querySelectorAll(`#calculator-${id} tr`)].filter(r => r.querySelector("td[data-name]"))
            .map(r => [r.children[0], [...r.querySelectorAll("td")]])
            .map(([head, cells]) => [head.textContent.trim(), cells.map(c => c.textContent.trim())])""",
        calculator.id,
    )
    expected = {label: [show(computed[name]) for name in names] for label, names in LINES[calculator.id].items()}
    assert dict(rows) == expected
    assert len(rows) == len(expected)
