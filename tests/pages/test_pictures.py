"""The pictures that a reader can move: what is drawn against the package's own numbers, by keyboard and on a phone."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.contributions import contributions
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.report.examples import tracker
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.pictures import views
from gpbnb.report.pictures.operations import STEP
from gpbnb.report.rolling import theory

from . import axe
from . import browser as tools

ADDRESSES = {
    "numberline": "book/rounding.html",
    "year": "book/kalman.html",
    "roll": "book/rolling.html",
    "step": "book/guarantee.html",
}
PICTURES = pytest.mark.parametrize("picture", views.PICTURES, ids=lambda each: each.id)
RULES = dict(zip(("to nearest", "chopped"), Rounding.documented(), strict=True))
READ = """id => {
    const box = document.querySelector(`#calculator-${id} .calculator-drawing`), svg = box.querySelector("svg");
    const number = (node, name) => Number(node.getAttribute(name));
    const all = (selector) => [...svg.querySelectorAll(selector)];
    const center = (selector) => all(selector).map(c => [number(c, "cx"), number(c, "cy")]);
    return {
        texts: all("text").map(t => [number(t, "x"), number(t, "y"), t.textContent]),
        boxes: all("text").map(t => { const b = t.getBBox(); return [b.x, b.y, b.x + b.width, b.y + b.height] }),
        numbers: all("line.number").map(l => number(l, "x1")), curves: all("path.curve").map(p => p.getAttribute("d")),
        teeth: svg.querySelector(".teeth")?.getAttribute("d"), rounded: center(".rounded"), here: center(".here"),
        given: svg.querySelector(".given")?.getAttribute("d"), turned: center(".turned"), circles: center("circle"),
        marked: center("circle.curve-0"),
        range: ["x", "width"].map(key => number(svg.querySelector(".range") ?? svg, key)),
        step: svg.querySelector(".step")?.getAttribute("d"), ulp: svg.querySelector(".ulp")?.getAttribute("d"),
        limits: all(".limit").map(l => number(l, "y1")), ways: all(".way").length,
        bars: all(".share").map(r => [number(r, "x"), number(r, "width"), number(r, "y") + number(r, "height") / 2]),
        said: box.getAttribute("aria-label"), width: number(svg, "width"), height: number(svg, "height"),
        state: document.querySelector(`#calculator-${id}`).dataset.state,
    };
}"""


@pytest.fixture(scope="module", params=tools.SIZES)
def pages(request, open_page):
    """The pages with the pictures, opened when they are asked for, on a desktop and on a phone."""
    opened = {}

    def at(picture):
        if picture not in opened:
            manager = open_page(ADDRESSES[picture], request.param, shared=True)
            opened[picture] = manager, manager.__enter__()
        return opened[picture][1]

    yield at
    for manager, _ in opened.values():
        manager.__exit__(None, None, None)


def show(value):
    """A number as the script writes it: four significant digits, or all of a whole number below a million."""
    if value == int(value) and abs(value) < 1e6:
        return str(int(value))
    mantissa, _, exponent = f"{value:.3e}".partition("e")
    rounded = float(f"{mantissa}e{exponent}")
    if 1e-3 <= abs(rounded) < 1e5:
        return repr(rounded).removesuffix(".0")
    return f"{mantissa}\u00a0×\u00a010{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def type_in(page, picture, **given):
    """Enter numbers by the keyboard alone."""
    for name, value in given.items():
        field = page.locator(f"#calculator-{picture}-{name}")
        field.focus()
        if field.evaluate("e => e.tagName") == "SELECT":
            for _ in range(field.locator("option").count()):
                page.keyboard.press("ArrowUp")
            while field.evaluate("e => e.selectedOptions[0].textContent") != value:
                page.keyboard.press("ArrowDown")
        else:
            page.keyboard.press("Control+a")
            page.keyboard.type(value)
    return page.evaluate(READ, picture)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("base", "t", "x"),
    [
        ("10", "1", "2.4"),
        ("10", "2", "1.05"),
        ("10", "2", "9.96"),
        ("2", "1", "3"),
        ("16", "3", "1e-6"),
        ("10", "12", "123456.7890125"),
        ("10", "1", "1"),
        ("2", "3", "7.999999"),
    ],
)
def test_a_number_is_rounded_as_the_package_rounds_it(pages, base, t, x, rule):
    found = type_in(pages("numberline"), "numberline", base=base, t=t, chop=rule, x=x)
    fmt = FloatFormat(int(base), int(t), RULES[rule])
    exact = Fraction(x)
    kept = fmt.round(exact)
    error = abs(kept - exact) / exact
    assert f"{show(float(exact))} becomes" in found["said"]
    assert f"= {show(float(kept))}: a relative error of {show(float(error))}, " in found["said"]
    assert found["said"].endswith(f"which is {show(float(error / fmt.unit_roundoff))} β.")
    # The marks are the numbers of the format around the rounded one, in proportion.
    marks, (place, _) = found["numbers"], found["rounded"][0]
    assert [marks[0], marks[-1]] == pytest.approx([44, found["width"] - 14])
    (at,) = [i for i, mark in enumerate(marks) if abs(mark - place) < 1e-6]
    tiny = Fraction(1, 10**30)
    numbers = [kept]
    for _ in range(at):
        numbers.insert(0, FloatFormat(int(base), int(t), Rounding.DOWN).round(numbers[0] * (1 - tiny)))
    for _ in range(len(marks) - 1 - at):
        numbers.append(FloatFormat(int(base), int(t), Rounding.UP).round(numbers[-1] * (1 + tiny)))
    assert numbers[0] <= exact <= numbers[-1]
    scale = (marks[-1] - marks[0]) / float(numbers[-1] - numbers[0])
    assert marks == pytest.approx([marks[0] + float(each - numbers[0]) * scale for each in numbers], abs=1e-2)
    # The shaded part of the lower graph is what the upper one shows, as far as it has the same leading power.
    left, right = marks[0], marks[-1]
    power = Fraction(int(base)) ** (math.floor(math.log(exact, int(base)) + 1e-12))
    shares = [math.log(min(max(each / power, 1), int(base)), int(base)) for each in (numbers[0], numbers[-1])]
    start, width = found["range"]
    assert [start, start + width] == pytest.approx(
        [left + shares[0] * (right - left), left + max(shares[1], shares[0] + 2 / (right - left)) * (right - left)],
        abs=0.1,
    )
    tip = float(found["given"][1:].split()[0])
    assert tip == pytest.approx(marks[0] + float(exact - numbers[0]) * scale, abs=0.1)


def runs(chop):
    rule = Rounding.documented()[chop]
    chosen = [run for run in year.load() if run.case.model == year.MODELS[0] and run.case.base == 2]
    return {r.case.precision: r for r in chosen if r.case.form is Form.HUNG and r.case.rounding is rule}


@pytest.mark.parametrize("quantity", ["rate", "drift"])
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("t", ["14", "25", "53"])
def test_a_year_shows_the_stored_run(pages, t, rule, quantity):
    found = type_in(
        pages("year"), "year", t=t, chop=rule, quantity=f"drift {'angle' if quantity == 'drift' else 'rate'}"
    )
    stored = runs(list(RULES).index(rule))
    bits = max(each for each in stored if each <= int(t))
    run = stored[bits]
    assert (f"No run with {t} bits is stored" in found["said"]) == (bits != int(t))
    assert f"With {bits} bits" in found["said"]
    errors = np.abs(getattr(run, quantity)).max(axis=1)
    assert f"it is {show(float(f'{errors[-1]:.3g}'))} mas" in found["said"]
    days = [step * 10 / 86400 for step in run.steps]
    above = np.flatnonzero(errors > 1)
    if not above.size:
        assert "stays below 1 mas" in found["said"]
    else:
        assert f"and day {show(days[above[0]])}" in found["said"]
        assert ("still does at the end" in found["said"]) == (above[-1] == len(errors) - 1)
    # The circles, by the labels of the axes.
    circles = [(x, y) for x, y in found["circles"]]
    shown = [(day, error) for day, error in zip(days, errors, strict=True) if error > 0]
    assert len(circles) == len(shown)
    (limit,) = found["limits"]
    slope = (circles[0][1] - circles[-1][1]) / math.log10(shown[-1][1] / shown[0][1])
    for (x, y), (day, error) in zip(circles, shown, strict=True):
        assert y == pytest.approx(limit - slope * math.log10(error), abs=0.25)
        share = math.log(day / days[0]) / math.log(days[-1] / days[0])
        assert x == pytest.approx(58 + share * (found["width"] - 98), abs=1e-3)
    # Each curve of this rounding has its bits at its end, the largest error above, and no two collide.
    ends = [(y, int(text)) for x, y, text in found["texts"] if x == found["width"] - 26]
    last = {each: np.abs(getattr(stored[each], quantity)).max(axis=1)[-1] for each in stored}
    assert sorted(each for _, each in ends) == sorted(stored)
    heights = [float(f"{last[each]:.3g}") for _, each in sorted(ends)]
    assert heights == sorted(heights, reverse=True)
    assert np.diff(sorted(y for y, _ in ends)).min() >= 12.5
    step, ulp = (float(found[name][1:].split()[0]) for name in ("step", "ulp"))
    decade = (found["width"] - 72) / -math.floor(math.log10(8192 * 2.0**-53))
    assert (step - ulp) / decade == pytest.approx(math.log10(6606 / 3153600 / 2.0 ** (13 - bits)), abs=0.01)


@pytest.mark.parametrize("period", ["20", "77.5", "1e6"])
@pytest.mark.parametrize("phase", ["1", "31", "36000"])
def test_roll_and_deroll_show_the_numbers_of_the_theory(pages, period, phase):
    found = type_in(pages("roll"), "roll", period=period, phase=phase)
    seconds, angle = float(period), math.radians(float(phase) / 3600)
    density = float(theory.flicker_density(theory.LEVEL, 1 / seconds, theory.INTERVAL))
    rolled = theory.drift_error_rolled(theory.LEVEL, seconds, interval=theory.INTERVAL)
    unrolled = theory.drift_error_unrolled(theory.LEVEL, at_rest=True)
    across = theory.phase_error_cost(theory.DRIFTS, angle)[1]
    numbers = [float(each) for each in said_numbers(found["said"])]
    expected = [seconds, density, unrolled, rolled, unrolled / rolled, float(phase), float(across)]
    assert numbers[: len(expected)] == pytest.approx(expected, rel=6e-4)
    (here,), (turned,) = found["here"], found["turned"]
    low = 1 / theory.YEAR
    share = math.log(1 / seconds / low) / math.log(0.05 / low)
    assert here[0] == pytest.approx(58 + share * (found["width"] - 72), abs=0.1)
    share = math.log(float(phase)) / math.log(36000)
    assert turned[0] == pytest.approx(58 + share * (found["width"] - 72), abs=0.1)
    (limit,) = found["limits"]
    assert (turned[1] < limit) == (across > 1)


# For each operation that rounds, those whose results its error reaches, and the arcs between them.
REACHED = {"a": (7, 7), "b": (6, 6), "c": (5, 4), "d": (2, 1), "e": (2, 1), "x₁′": (1, 0), "x₂′": (1, 0)}


@pytest.mark.parametrize("state", ["position", "velocity"])
@pytest.mark.parametrize("operation", STEP.inputs[0].choices)
def test_an_operation_shows_its_share_and_its_way(pages, operation, state):
    page = pages("step")
    found = type_in(page, "step", operation=operation, state=state)
    guaranteed = guarantee(tracker(), FloatFormat(2, 24), limits(state=[1000, 30], innovation=8))
    each = contributions(guaranteed)
    rounding = np.flatnonzero(each.errors)
    o, i = rounding[STEP.inputs[0].choices.index(operation)], ["position", "velocity"].index(state)
    share = 100 * each.sums[i] / guaranteed.bound[i]
    said = [float(number) for number in said_numbers(f". {found['said'].partition('at most ')[2]}")]
    expected = [each.errors[o], 24, *np.abs(each.effects[:, o]), each.sums[i, o], share[o]]
    assert said == pytest.approx(expected, rel=6e-4, abs=1e-9)
    # The bars are in proportion, or one pixel if they were shorter.
    lengths = np.array([width for _, width, _ in found["bars"]])
    assert len(lengths) == len(rounding)
    most = lengths.max()
    assert lengths == pytest.approx(np.maximum(1, most * share[rounding] / share[rounding].max()), rel=1e-4)
    reached, arcs = REACHED[operation.partition(" ")[0]]
    assert len([text for _, _, text in found["texts"] if "=" in text]) == len(rounding)
    assert found["ways"] == arcs
    assert len(found["marked"]) == reached


def said_numbers(text):
    """The numbers of a sentence, with powers of ten as written for people."""
    plain = re.sub(
        r"\u00a0×\u00a010([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)",
        lambda m: "e" + m[1].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")),
        text,
    )
    return re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", plain.partition(". ")[2])


@PICTURES
def test_axe_finds_nothing_in_a_picture(pages, picture):
    page = pages(picture.id)
    type_in(page, picture.id, **picture.start)
    assert axe.violations(page, within=f"#calculator-{picture.id}") == []


@PICTURES
def test_paper_and_a_page_without_script_show_the_still_figure(open_page, picture):
    with open_page(ADDRESSES[picture.id]) as page:
        still, live = page.locator(".picture-still img"), page.locator(f"#calculator-{picture.id}")
        assert not still.is_visible()
        assert live.is_visible()
        page.emulate_media(media="print")
        assert still.is_visible()
        assert not live.is_visible()
        assert still.evaluate("async e => { await e.decode(); return e.naturalWidth }") > 500
        page.emulate_media(media="screen")
        live.evaluate("e => { e.hidden = true }")
        assert still.is_visible()
