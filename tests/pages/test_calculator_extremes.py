"""The calculators with the most extreme numbers that they accept, and figures of numbers that no calculator has yet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gpbnb.report.calculators import forms
from gpbnb.report.calculators import page as html

ADDRESS = "book/calculators.html"
CALCULATORS = pytest.mark.parametrize("calculator", forms.CALCULATORS, ids=lambda each: each.id)
LONGEST = 60_000  # ms; then the browser ends the script, which could otherwise run forever
POINTS = 121
MOST = 40  # lines of the grid
SMALLEST, TINY, LARGEST = 5e-324, 2.0**-1022, 2.0**1023 * (2 - 2.0**-52)

# What a form shows: how its figure is said and looks, and each number in it that an axis or a curve is placed by.
READ = """id => {
    const form = document.getElementById(`calculator-${id}`), box = form.querySelector(".calculator-drawing");
    const svg = box.querySelector("svg"), all = (name) => [...(svg?.querySelectorAll(name) ?? [])];
    const numbers = (node, names) => names.map(name => Number(node.getAttribute(name)));
    return {
        said: box.getAttribute("aria-label"), state: form.dataset.state, height: Number(svg?.getAttribute("height")),
        width: Number(svg?.getAttribute("width")), elements: form.querySelectorAll("*").length,
        lines: all("line").map(line => numbers(line, ["x1", "y1", "x2", "y2"])),
        texts: all("text").map(text => [...numbers(text, ["x", "y"]), text.textContent]),
        circles: all("circle").map(circle => numbers(circle, ["cx", "cy"])),
        curves: all("path").map(path => path.getAttribute("d").split(/[ML]/).slice(1))
            .map(points => points.map(point => point.split(" ").map(Number))),
        cells: [...form.querySelectorAll("td[data-name]")].map(cell => cell.textContent),
    };
}"""
# Writes numbers into a form and reads it, for one set of numbers after the other.
FILL = f"""([id, every]) => every.map(given => {{
    const form = document.getElementById(`calculator-${{id}}`);
    for (const [name, text] of Object.entries(given)) form.elements[name].value = text;
    form.querySelector("input").dispatchEvent(new Event("input", {{bubbles: true}}));
    return ({READ})(id);
}})"""


def ask(page, function: str, argument: object) -> object:
    """Evaluate a function on the page, but end it after a time: a page that hangs would never answer."""
    session = page.context.new_cdp_session(page)
    call = f"JSON.stringify(({function})({html.json.dumps(argument)}))"
    found = session.send("Runtime.evaluate", {"expression": call, "returnByValue": True, "timeout": LONGEST})
    session.detach()
    assert "exceptionDetails" not in found, found
    return html.json.loads(found["result"]["value"])


def check_figure(shown: dict) -> None:
    """Everything in a figure has a place within its frame, and there is not too much of it."""
    left, right, top, bottom = 58, shown["width"] - 14, 28, shown["height"] - 44
    assert 0 < len(shown["lines"]) <= MOST
    for x1, y1, x2, y2 in shown["lines"]:
        assert left - 0.1 <= min(x1, x2) <= max(x1, x2) <= right + 0.1
        assert top - 0.1 <= min(y1, y2) <= max(y1, y2) <= bottom + 0.1
    points = [point for curve in shown["curves"] for point in curve] + shown["circles"]
    for x, y in points:
        assert left - 0.1 <= x <= right + 0.1
        assert top - 0.1 <= y <= bottom + 0.1
    assert 0 < max(map(len, shown["curves"])) <= POINTS + 1
    assert all(len(text) < 80 for *_, text in shown["texts"])
    labels = [text for _, y, text in shown["texts"] if y == shown["height"] - 26]
    assert len(labels) == len(set(labels))
    powers = [text for x, _, text in shown["texts"] if x == 52]
    assert len(powers) == len(set(powers)) >= 2
    assert all(-325 < int(text[2:].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) < 310 for text in powers)


@pytest.fixture(scope="module")
def opened(open_page):
    with open_page(ADDRESS, shared=True) as page:
        yield page


# -- the calculators -------------------------------------------------------------------------------


def typed(each: forms.Input, value: float) -> str:
    return str(int(value)) if each.whole or each.choices else repr(float(value))


def extremes(calculator: forms.Calculator) -> list[dict[str, str]]:
    """Every field at its least, at its most, and at ends of its slider; then any of these for each field."""
    rng = np.random.default_rng(sum(map(ord, calculator.id)))
    levels = [
        [each.least, each.most, *(() if each.choices else each.slider), calculator.values(example)[each.name]]
        for each in calculator.inputs
        for example in [next(iter(calculator.examples))]
    ]
    chosen = [[some[0] for some in levels], [some[1] for some in levels], [some[-1] for some in levels]]
    chosen += [[rng.choice(some) for some in levels] for _ in range(150)]
    return [
        {each.name: typed(each, value) for each, value in zip(calculator.inputs, values, strict=True)}
        for values in chosen
    ]


@CALCULATORS
def test_every_extreme_that_is_accepted_is_computed_and_drawn(opened, calculator):
    found = ask(opened, FILL, [calculator.id, extremes(calculator)])
    elements = {shown["elements"] for shown in found}
    assert max(elements) - min(elements) < 100  # nothing is added with each figure
    for shown in found:
        assert shown["state"] == "computed"
        assert all(shown["cells"])
        check_figure(shown)
    assert opened.faults == []


def test_a_share_below_the_smallest_number_does_not_stop_the_page(opened):
    """The least share that is drawn is a subnormal number, the next ones are zero."""
    given = {"period": "1e6", "b": "1000", "t": "60", "chop": "0", "duration": "100000", "drift": "6600"}
    (shown,) = ask(opened, FILL, ["deroll", [given]])
    check_figure(shown)
    assert 2 < len(shown["curves"][0]) < 60
    bases = [{**given, "b": str(base)} for base in range(2, 1001)]
    for shown in ask(opened, FILL, ["deroll", bases]):
        check_figure(shown)


def test_a_long_text_is_refused_at_once(opened):
    found = ask(
        opened, FILL, ["deroll", [{"period": "9" * 300_000 + "x"}, {"period": "9" * 300_000}, {"period": "600"}]]
    )
    assert [shown["state"] for shown in found] == ["waiting", "waiting", "computed"]


# -- figures of any numbers ------------------------------------------------------------------------

#: The ends of the horizontal axis, whether it is logarithmic, and the height of the curve at x, in JavaScript.
SWEEPS = {
    "one subnormal number": (1.0, 10.0, False, "1e-323"),
    "the smallest number": (1.0, 10.0, False, "5e-324"),
    "the largest number": (1.0, 10.0, False, "Number.MAX_VALUE"),
    "a constant": (1.0, 10.0, False, "1"),
    "a constant that is no power of ten": (1.0, 10.0, True, "0.3"),
    "neighbours": (1.0, 2.0, False, "1 + x * Number.EPSILON"),
    "subnormal numbers": (SMALLEST, TINY, True, "x"),
    "from zero on": (0.0, 1.0, False, "x"),
    "from zero on through subnormal numbers": (0.0, 1e-320, False, "x"),
    "all numbers": (SMALLEST, LARGEST, True, "x"),
    "all numbers, falling": (SMALLEST, LARGEST, True, "1 / x"),
    "far beyond": (1e20, 1e20 + 32768.0, False, "x"),
    "beyond all whole numbers": (2.0**53, 2.0**53 + 2.0, False, "x"),
    "to the largest number": (1e300, LARGEST, False, "x"),
    "a single place": (5.0, 5.0, False, "x"),
    "a single place of a logarithmic axis": (5.0, 5.0, True, "x"),
    "a narrow logarithmic axis": (5.0, 5.0 + 1e-12, True, "x"),
    "some zeros": (1.0, 10.0, False, "x < 5 ? 0 : x"),
    "some that are no numbers": (1.0, 10.0, False, "x < 3 ? NaN : x < 5 ? Infinity : x < 7 ? -x : x"),
}
NO_CURVE = {"zero": "0", "no number": "NaN", "infinity": "Infinity", "negative numbers": "-x", "negative zero": "-0"}


def synthetic(low: float, high: float, log: bool) -> forms.Calculator:
    """A calculator with one input, whose figure shows one result against it."""
    return replace(
        forms.ROUNDING,
        id="synthetic",
        title="Synthetic",
        inputs=(forms.Input("x", "x", low, high, (low, high), log=log),),
        definitions=lambda: (),
        columns=("quantity", "value"),
        lines=(forms.Line("y", ("y",)),),
        sentence="y is {y}.",
        figure=forms.Figure("x", "y against x", "y", (("y", "y"),)),
        examples={"first": {"x": repr(low)}},
        shown={"x": "x"},
        reference=lambda given: {},
        missing={},
    )


def figure_of(page, low: float, high: float, log: bool, height: str) -> dict:
    """Put a synthetic calculator into the page; the figure, and how often the height was computed."""
    calculator = synthetic(low, high, log)
    form, _, script = html.form(calculator).partition("<script>")
    spec = script.partition(",\n(given) =>")[0]
    program = f"{spec}, ({{x}}) => (window.computed += 1, {{x, y: {height}}}));"
    put = """([form, program, read]) => {
        document.getElementById("synthetic")?.remove();
        document.body.insertAdjacentHTML("beforeend", `<div id="synthetic">${form}</div>`);
        window.computed = 0;
        (0, eval)(program);
        return {...(0, eval)(read)("synthetic"), computed: window.computed};
    }"""
    return ask(page, put, [form, program, f"({READ})"])


@pytest.mark.parametrize("sweep", SWEEPS)
def test_a_figure_of_any_numbers_has_an_end(opened, sweep):
    low, high, log, height = SWEEPS[sweep]
    shown = figure_of(opened, low, high, log, height)
    check_figure(shown)
    assert shown["computed"] <= POINTS + 1
    assert len(shown["said"]) < 300
    (curve,) = shown["curves"]
    if not log and "some" not in sweep:  # every place has a point, if its height is not zero
        places = {low + (high - low) * (i / (POINTS - 1)) for i in range(POINTS)}
        assert len(curve) == len(places - {0.0})
    else:
        assert len(curve) >= (1 if low == high else 40)


@pytest.mark.parametrize("height", NO_CURVE)
def test_without_a_positive_number_there_is_no_curve(opened, height):
    shown = figure_of(opened, 1.0, 10.0, False, NO_CURVE[height])
    assert shown["curves"] == shown["lines"] == []
    assert shown["said"] == "y against x: no result is a positive number, so there is no curve."
    assert shown["computed"] == POINTS + 1


# -- a figure of earlier numbers -------------------------------------------------------------------


@CALCULATORS
def test_an_invalid_field_dims_the_figure_until_it_is_valid_again(opened, calculator):
    form = opened.locator(f"#calculator-{calculator.id}")
    field = opened.locator(f"#calculator-{calculator.id}-{calculator.inputs[0].name}")
    drawing, picture = form.locator(".calculator-drawing"), form.locator("svg").first
    first = calculator.examples[next(iter(calculator.examples))]
    ask(opened, FILL, [calculator.id, [first]])
    said, curve = drawing.get_attribute("aria-label"), form.locator("path.curve").first.get_attribute("d")
    assert picture.evaluate("e => getComputedStyle(e).opacity") == "1"
    for text in ("x", "xx"):  # and stays so with the next error
        field.fill(text)
        assert field.get_attribute("aria-invalid") == "true"
        assert picture.evaluate("e => getComputedStyle(e).opacity") == "0.35"
        assert drawing.get_attribute("aria-label") == f"Figure of earlier numbers, because a field is not valid. {said}"
        assert form.locator("path.curve").first.get_attribute("d") == curve
    field.fill(first[calculator.inputs[0].name])
    assert field.get_attribute("aria-invalid") is None
    assert picture.evaluate("e => getComputedStyle(e).opacity") == "1"
    assert drawing.get_attribute("aria-label") == said


def test_a_dimmed_figure_follows_the_width_and_stays_dimmed(open_page):
    with open_page(ADDRESS, shared=True) as page:
        drawing = page.locator("#calculator-deroll .calculator-drawing")
        page.locator("#calculator-deroll-period").fill("x")
        said = drawing.get_attribute("aria-label")
        wide = drawing.locator("svg").bounding_box()["width"]
        page.set_viewport_size({"width": 390, "height": 844})
        page.wait_for_function(
            "w => document.querySelector('#calculator-deroll .calculator-drawing svg').clientWidth < w", arg=wide
        )
        assert drawing.get_attribute("aria-label") == said
        assert drawing.locator("svg").evaluate("e => getComputedStyle(e).opacity") == "0.35"
