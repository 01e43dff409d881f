"""The calculators in a real browser: their numbers against the package, and their use by keyboard and ear."""

from __future__ import annotations

import functools
import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from mpmath import mp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.calculators import forms
from gpbnb.report.calculators.page import show

from . import axe
from . import browser as tools

ADDRESS = "book/calculators.html"
TRIALS = 1000
U = mpmath.mpf(2) ** -53
CALCULATORS = pytest.mark.parametrize("calculator", forms.CALCULATORS, ids=lambda each: each.id)


@pytest.fixture(scope="module")
def calculators(open_page):
    with open_page(ADDRESS, shared=True) as page:
        yield page


@pytest.fixture
def fresh(calculators):
    """The page with the first example in each form, as it is when it is opened."""
    calculators.evaluate(
        "names => [...document.querySelectorAll('button')].filter(b => names.includes(b.textContent.trim()))"
        ".forEach(b => b.click())",
        [next(iter(calculator.examples)) for calculator in forms.CALCULATORS],
    )
    return calculators


@pytest.fixture(scope="module")
def opened(open_page):
    """The page as it is when it is opened."""
    with open_page(ADDRESS, shared=True) as page:
        yield page


@pytest.fixture(scope="module")
def mistyped(open_page):
    """The page with an error in each form."""
    with open_page(ADDRESS, shared=True) as page:
        for calculator in forms.CALCULATORS:
            field(page, calculator.id, calculator.inputs[0].name).fill("x")
        yield page


# -- numbers ---------------------------------------------------------------------------------------


class Undecided(Exception):
    """Rounding could take either side of a step or a condition."""


def rounded(expression: sp.Expr, known: dict[str, tuple[mpmath.mpf, mpmath.mpf]]) -> tuple[mpmath.mpf, mpmath.mpf]:
    """Value of an expression, and how far its float64 evaluation may be off.

    `known` has the same of its symbols. Each of + - * / sqrt is rounded once; a function of the library is taken to be
    off by one unit in the last place, 2u; errors of arguments go on by their derivatives, and second orders by the
    factor below.
    """
    args = [rounded(each, known) for each in expression.args if not isinstance(expression, sp.Piecewise)]
    values, errors = [v for v, _ in args], [e for _, e in args]
    if expression.is_Symbol:
        return known[expression.name]
    if expression.is_Number or expression is sp.pi:
        if expression is sp.nan:
            return mpmath.nan, mpmath.mpf(0)
        value = mpmath.mpf(expression.p) / expression.q if expression.is_Rational else mpmath.pi * 1
        return value, mpmath.mpf(0) if expression.is_Integer else U * abs(value)
    if isinstance(expression, (sp.Add, sp.Mul)) and not any(errors) and all(mpmath.isint(v) for v in values):
        whole = sum(values) if isinstance(expression, sp.Add) else mpmath.fprod(values)
        if sum(map(abs, values)) < 2**53 and mpmath.fprod(values) < 2**53:
            return whole, mpmath.mpf(0)
    if isinstance(expression, sp.Add):
        sizes = abs(sum(values)) + sum(errors) if len(args) == 2 else len(args) * sum(abs(v) for v in values)
        return sum(values), sum(errors) + U * sizes
    if isinstance(expression, sp.Mul) and len(args) == 2 and values[0] == -1:
        return -values[1], errors[1]
    if isinstance(expression, sp.Mul):
        grown = mpmath.fprod(abs(v) + e for v, e in args) * (1 + len(args) * U)
        return mpmath.fprod(values), grown - mpmath.fprod(abs(v) for v in values)
    if isinstance(expression, sp.Pow):
        base, exponent = values
        value = base**exponent
        library = 0 if exponent == 1 else U if exponent in (-1, mpmath.mpf(1) / 2, -mpmath.mpf(1) / 2) else 2 * U
        relative = abs(exponent) * errors[0] / abs(base) + abs(mpmath.log(base)) * errors[1] * (
            not expression.exp.is_Number
        )
        return value, abs(value) * (relative + library)
    if isinstance(expression, sp.Min):
        return min(values), max(errors)
    if isinstance(expression, sp.floor):
        if mpmath.nint(values[0]) - errors[0] <= values[0] <= mpmath.nint(values[0]) + errors[0]:
            raise Undecided
        return mpmath.floor(values[0]), mpmath.mpf(0)
    if isinstance(expression, sp.Piecewise):
        for branch, condition in expression.args:
            if condition == sp.true or holds(condition, known):
                return rounded(branch, known)
    derivatives = {
        "exp": (mpmath.exp, mpmath.exp),
        "expm1": (mpmath.expm1, mpmath.exp),
        "log": (mpmath.log, lambda x: 1 / x),
        "sin": (mpmath.sin, lambda x: abs(mpmath.cos(x))),
        "cos": (mpmath.cos, lambda x: abs(mpmath.sin(x))),
    }
    function, derivative = derivatives[expression.func.__name__]
    value = function(values[0])
    return value, abs(value) * 2 * U + derivative(values[0]) * errors[0] + errors[0] ** 2


def holds(condition: sp.Basic, known: dict[str, tuple[mpmath.mpf, mpmath.mpf]]) -> bool:
    (left, below), (right, above) = (rounded(each, known) for each in condition.args)
    if isinstance(condition, sp.Eq):
        return left == right
    if left != right and abs(left - right) <= below + above:
        raise Undecided
    return left <= right if isinstance(condition, sp.LessThan) else left < right


def tolerances(calculator, given):
    """Value and tolerance of every definition without a search; all inputs are float64 and exact."""
    known = {name: (mpmath.mpf(value), mpmath.mpf(0)) for name, value in given.items()}
    for name, expression in expressions(calculator.definitions):
        value, error = rounded(expression, known)
        known[name] = value, error * mpmath.mpf("1.001")  # terms of second order: 1e-13 of the first
    return known


@functools.cache
def expressions(definitions):
    return [(each.name, each.expression.doit()) for each in definitions() if each.smallest is None]


def random_inputs(calculator, rng):
    """Numbers spread over all that is taken; reals of the search for digits over what its sliders reach."""
    given = {}
    for each in calculator.inputs:
        low, high = each.slider if calculator.id == "kalman" and not each.choices else (each.least, each.most)
        value = math.exp(rng.uniform(math.log(low), math.log(high))) if each.log else rng.uniform(low, high)
        if each.choices:
            value = rng.integers(len(each.choices))
        elif each.name == "b" and rng.random() < 0.7:
            value = rng.choice([2, 10, 16])
        elif each.name == "f" and rng.random() < 0.5:
            value = 1 - 10 ** rng.uniform(-9, -1)
        given[each.name] = round(float(value)) if each.whole or each.choices else float(value)
    return given


def compare(calculator, given, known, computed):
    """Yield name, relative difference from the package, and what rounding allows, for each number."""
    wanted = calculator.reference(given)
    for name, exact in wanted.items():
        if name not in known:
            continue
        found = computed[name]
        if isinstance(exact, float) and math.isnan(exact):
            assert found is None or math.isnan(found)
            continue
        exact_mp = mpmath.mpf(exact.numerator) / exact.denominator if isinstance(exact, Fraction) else mpmath.mpf(exact)
        value, allowed = known[name]
        if isinstance(exact, float):
            # float64 in Python too: as many roundings again, and 5 ulp of the chapter's evaluation (its own test's)
            allowed = 2 * allowed + 10 * U * abs(value)
            if name == "across":  # a sum of 400 terms, see tests/calculators
                allowed += 804 * U * 1.5 * abs(given["drift"]) * min(known["phase"][0], 1)
        size = abs(value) or mpmath.mpf(1)
        yield name, float(abs(mpmath.mpf(found) - exact_mp) / size), float(allowed / size)


@CALCULATORS
def test_a_thousand_random_inputs_agree_with_the_package(calculators, calculator):
    rng = np.random.default_rng(sum(map(ord, calculator.id)))
    inputs, bounds = [], []
    with mp.workdps(40):
        while len(inputs) < TRIALS:
            given = random_inputs(calculator, rng)
            try:
                known = tolerances(calculator, given)
            except Undecided:
                continue
            # the chapter's quadrature is for phases of some hundred radians
            if "phase" not in known or known["phase"][0] < 100:
                inputs.append(given)
                bounds.append(known)
        results = calculators.evaluate(
            "([id, inputs]) => inputs.map(given => gpbnbCalculators.compute(id, given))", [calculator.id, inputs]
        )
        compared = [
            (name, difference, allowed, given)
            for given, known, computed in zip(inputs, bounds, results, strict=True)
            for name, difference, allowed in compare(calculator, given, known, computed)
        ]
    assert [row for row in compared if row[1] > row[2]] == []
    assert {name for name, *_ in compared} >= {name for line in calculator.lines for name in line.names} - {
        f"digits{i}" for i in range(1, 6)
    }
    # No tolerance is so wide that a lost digit would pass unseen where nothing is ill-conditioned.
    assert np.median([allowed for *_, allowed, _ in compared]) < 1e-14
    worst = max(compared, key=lambda row: row[1])
    print(f"{calculator.id}: {len(compared)} numbers, largest relative difference {worst[1]:.1e} ({worst[0]})")


def test_digits_needed_agree_with_the_package(calculators):
    calculator = forms.KALMAN
    rng = np.random.default_rng(125)
    inputs = [random_inputs(calculator, rng) for _ in range(TRIALS)]
    results = calculators.evaluate("inputs => inputs.map(given => gpbnbCalculators.compute('kalman', given))", inputs)
    differing = 0
    for given, computed in zip(inputs, results, strict=True):
        wanted = calculator.reference(given)
        rule = Rounding.CHOP if given["chop"] else Rounding.NEAREST
        for i in range(1, 6):
            found, exact = computed[f"digits{i}"], wanted[f"digits{i}"]
            if found != exact:
                # A tie within 1e-13 of the goal, ten times what rounding of the size can do, may go either way.
                at = FloatFormat(given["b"], min(found, exact), rule).unit_roundoff
                assert abs(float(wanted[f"size{i}"] * at / Fraction(given["goal"])) - 1) < 1e-13
                differing += 1
    assert differing < TRIALS / 100


def test_the_walk_keeps_its_digits_where_the_print_loses_them(calculators):
    """Langevin's function from 1e-300 to 1e300, within 4u of its value in many digits."""
    rng = np.random.default_rng(35)
    mus = [*(10.0 ** rng.uniform(-290, 290, 500)), *(10.0 ** rng.uniform(-2, 2, 500)), 4.0, math.nextafter(4.0, 5)]
    found = calculators.evaluate(
        "mus => mus.map(mu => gpbnbCalculators.compute('integration', {sigma: 1, omega: mu, rate: 1}).walk)", mus
    )
    printed = calculators.evaluate("mus => mus.map(mu => (1 + Math.exp(-mu)) / (1 - Math.exp(-mu)) - 2 / mu)", mus)
    with mp.workdps(700):
        exact = [mpmath.coth(mpmath.mpf(mu) / 2) - 2 / mpmath.mpf(mu) for mu in mus]
        away = [float(abs(f / e - 1) / U) for f, e in zip(found, exact, strict=True)]
        lost = [p is None or not math.isfinite(p) or abs(p / e - 1) > 1e-3 for p, e in zip(printed, exact, strict=True)]
    print(f"walk: off by at most {max(away):.1f} u; as printed {sum(lost)} of {len(mus)} have not three digits")
    assert max(away) < 8  # 4 levels of the fraction that matter, of two roundings each, and halved errors below them
    assert sum(lost) > 200


@CALCULATORS
def test_the_page_writes_numbers_as_the_package_does(calculators, calculator):
    for example in calculator.examples:
        for value in calculator.reference(calculator.values(example)).values():
            assert calculators.evaluate("x => gpbnbCalculators.show(x)", float(value)) == show(float(value))


# -- use -------------------------------------------------------------------------------------------


def field(page, calculator, name, part=""):
    return page.locator(f"#calculator-{calculator}-{name}{part}")


def cell(page, calculator, name):
    return page.locator(f'#calculator-{calculator} td[data-name="{name}"]')


def sentence(page, calculator):
    return page.locator(f"#calculator-{calculator} output")


@CALCULATORS
def test_begins_with_the_first_example_computed(opened, calculator):
    example = next(iter(calculator.examples))
    computed = calculator.reference(calculator.values(example))
    assert opened.get_by_role("form", name=calculator.title).is_visible()
    for line in calculator.lines:
        for name in line.names:
            assert cell(opened, calculator.id, name).inner_text() == show(computed[name])
    said = sentence(opened, calculator.id).inner_text()
    assert said
    assert "{" not in said
    assert opened.faults == []


@CALCULATORS
def test_every_control_has_a_name_and_is_reached_by_tab(fresh, calculator):
    form = fresh.get_by_role("form", name=calculator.title)
    for each in calculator.inputs:
        if each.choices:
            assert form.get_by_role("combobox", name=each.label, exact=True).count() == 1
        else:
            assert form.get_by_role("textbox", name=each.label, exact=True).count() == 1
            assert form.get_by_role("slider", name=f"{each.label}, slider", exact=True).count() == 1
    field(fresh, calculator.id, calculator.inputs[0].name).focus()
    reached = []
    while fresh.evaluate("id => document.activeElement.form?.id === id", f"calculator-{calculator.id}"):
        reached.append(fresh.evaluate("document.activeElement.id"))
        fresh.keyboard.press("Tab")
    wanted = [
        f"calculator-{calculator.id}-{each.name}{part}"
        for each in calculator.inputs
        for part in (("",) if each.choices else ("", "-slider"))
    ]
    assert reached[: len(wanted)] == wanted
    assert fresh.evaluate("document.activeElement.tagName") in (
        "DIV",
        "BUTTON",
    )  # the table that scrolls, or an example


def test_a_slider_moves_by_arrow_keys(fresh):
    places = field(fresh, "rounding", "t")
    field(fresh, "rounding", "t", "-slider").focus()
    drawn = fresh.locator("#calculator-rounding circle").first.get_attribute("cx")
    said = fresh.locator("#calculator-rounding .calculator-drawing").get_attribute("aria-label")
    fresh.keyboard.press("ArrowRight")
    fresh.keyboard.press("ArrowRight")
    assert places.input_value() == "12"
    assert cell(fresh, "rounding", "beta").inner_text() == show(FloatFormat(10, 12).unit_roundoff)
    assert fresh.locator("#calculator-rounding circle").first.get_attribute("cx") != drawn
    field(fresh, "rounding", "n", "-slider").focus()
    fresh.keyboard.press("End")
    assert field(fresh, "rounding", "n").input_value() == "1000000000"
    assert fresh.locator("#calculator-rounding .calculator-drawing").get_attribute("aria-label") != said
    fresh.keyboard.press("Home")
    assert field(fresh, "rounding", "n").input_value() == "1"
    assert field(fresh, "rounding", "n", "-slider").get_attribute("aria-valuetext") == "1"


def test_a_typed_number_moves_the_slider_and_enter_does_no_harm(fresh):
    rate = field(fresh, "integration", "rate")
    rate.fill("1e3")
    rate.press("Enter")
    assert float(field(fresh, "integration", "rate", "-slider").input_value()) == 3
    assert cell(fresh, "integration", "mu").inner_text() == "0.001"
    assert fresh.url.endswith(ADDRESS)


def test_a_choice_is_made_by_key(fresh):
    field(fresh, "rounding", "chop").focus()
    fresh.keyboard.press("ArrowDown")
    fresh.keyboard.press("Enter")
    fresh.wait_for_function("document.querySelector('#calculator-rounding-chop').value === '1'")
    assert cell(fresh, "rounding", "beta").inner_text() == show(FloatFormat(10, 10, Rounding.CHOP).unit_roundoff)


@CALCULATORS
def test_examples_fill_the_form_by_key(fresh, calculator):
    for example in reversed(calculator.examples):
        fresh.get_by_role("button", name=example, exact=True).focus()
        fresh.keyboard.press("Enter")
        computed = calculator.reference(calculator.values(example))
        for line in calculator.lines:
            for name in line.names:
                assert cell(fresh, calculator.id, name).inner_text() == show(computed[name]), (example, name)


@pytest.mark.parametrize(
    ("calculator", "name", "typed", "message"),
    [
        ("rounding", "t", "", "Got nothing; needed a whole number from 1 to 90."),
        ("rounding", "t", "ten", "Got “ten”; needed a whole number from 1 to 90, such as 10, 0.5 or 1e-3."),
        ("rounding", "t", "2.5", "Got 2.5; needed a whole number from 1 to 90; round it."),
        ("rounding", "b", "1", "Got 1; needed a whole number from 2 to 1000."),
        ("rounding", "n", "1e13", "Got 1e13; needed a whole number from 1 to 1e12."),
        ("deroll", "period", "77,5", "with a point as decimal mark and no separators."),
        ("deroll", "period", "-5", "Got -5; needed a number from 0.001 to 1e6."),
        ("deroll", "drift", "Infinity", "Got “Infinity”; needed a number from 1e-9 to 1e9"),
        ("integration", "sigma", "1e999", "Got 1e999; needed a number from 1e-15 to 1e15."),
        ("integration", "omega", "<b>x</b>", "Got “<b>x</b>”; needed a number"),
        ("kalman", "f", "1.2", "Got 1.2; needed a number from 0 to 1; when a closed loop expands, B of (122) grows"),
        ("kalman", "x", "9" * 40, "Got 99999999999999999999999…; needed"),
    ],
)
def test_a_bad_number_is_answered_kindly(fresh, calculator, name, typed, message):
    entry = field(fresh, calculator, name)
    entry.fill(typed)
    note = field(fresh, calculator, name, "-error")
    assert message in note.inner_text()
    assert entry.get_attribute("aria-invalid") == "true"
    assert note.get_attribute("id") in entry.get_attribute("aria-describedby").split()
    assert set(fresh.locator(f"#calculator-{calculator} td[data-name]").all_inner_texts()) == {"—"}
    label = fresh.locator(f"label[for=calculator-{calculator}-{name}]").inner_text()
    fresh.wait_for_function(
        "([id, text]) => document.querySelector(`#${id} output`).textContent === text",
        arg=[f"calculator-{calculator}", f"Nothing computed: see what is said below {label}."],
    )
    entry.fill("1")
    if calculator != "rounding" or name != "b":
        assert note.inner_text() == ""
        assert entry.get_attribute("aria-invalid") is None
        assert "—" not in fresh.locator(f"#calculator-{calculator} td[data-name]").all_inner_texts()
    assert fresh.faults == []


def test_a_minus_sign_of_the_typesetter_and_spaces_are_read(fresh):
    field(fresh, "deroll", "drift").fill(" 1e\u22123 ")
    assert field(fresh, "deroll", "drift", "-error").inner_text() == ""
    assert cell(fresh, "deroll", "across").inner_text() != "—"


def test_too_many_roundings_say_why_there_is_no_bound(fresh):
    field(fresh, "rounding", "t").fill("3")
    assert cell(fresh, "rounding", "gamma").inner_text() == (
        "none: nβ is 5; needed less than 1; use more digits or fewer operations"
    )
    assert cell(fresh, "rounding", "total").inner_text() == "5"


def test_what_changed_is_said_once_it_rests(fresh):
    fresh.wait_for_timeout(500)  # what the fixture changed is said
    output = sentence(fresh, "rounding")
    assert output.evaluate("e => e.computedRole ?? 'status'") == "status"
    before = output.inner_text()
    field(fresh, "rounding", "t").fill("12")
    assert output.inner_text() == before
    fresh.wait_for_function("t => document.querySelector('#calculator-rounding output').textContent !== t", arg=before)
    assert "5.000\u00a0×\u00a010⁻¹²" in output.inner_text()


@pytest.mark.parametrize("size", tools.SIZES)
def test_axe_finds_no_violation_among_errors(mistyped, size):
    mistyped.set_viewport_size(tools.SIZES[size])
    mistyped.evaluate("window.scrollTo(0, 0)")
    mistyped.wait_for_function("!document.querySelector('#pst-back-to-top')?.checkVisibility({opacityProperty: true})")
    assert axe.violations(mistyped) == []
    mistyped.evaluate("window.scrollTo(1000, 0)")
    assert mistyped.evaluate("window.scrollX") == 0


def test_the_figure_follows_the_width(open_page):
    with open_page(ADDRESS, shared=True) as page:
        drawing = page.locator("#calculator-kalman .calculator-drawing svg")
        wide = drawing.bounding_box()["width"]
        page.set_viewport_size(tools.SIZES["phone"])
        page.wait_for_function(
            "w => document.querySelector('#calculator-kalman .calculator-drawing svg').clientWidth < w", arg=wide
        )
        box, around = drawing.bounding_box(), page.locator("#calculator-kalman").bounding_box()
        assert box["x"] >= around["x"]
        assert box["x"] + box["width"] <= around["x"] + around["width"]


def test_works_from_the_file_system(open_page):
    with open_page("book/index.html", shared=True) as served:
        page = served.context.browser.new_context(offline=True).new_page()
        faults = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto((tools.HTML / ADDRESS).as_uri(), wait_until="load")
        field(page, "rounding", "t").fill("4")
        assert cell(page, "rounding", "beta").inner_text() == show(FloatFormat(10, 4).unit_roundoff)
        assert faults == []
        page.context.close()


def test_without_scripts_there_are_the_tables(open_page):
    with open_page("book/index.html", shared=True) as served:
        page = served.context.browser.new_context(java_script_enabled=False).new_page()
        page.goto((tools.HTML / ADDRESS).as_uri(), wait_until="load")
        for calculator in forms.CALCULATORS:
            assert not page.locator(f"#calculator-{calculator.id}").is_visible()
        tables = page.locator(".calculator-examples")
        assert tables.count() == len(forms.CALCULATORS)
        assert all(tables.nth(i).is_visible() for i in range(tables.count()))
        assert page.locator(".calculator-examples button").count() == 0
        page.context.close()


def test_on_paper_there_are_the_tables(fresh):
    fresh.emulate_media(media="print")
    for calculator in forms.CALCULATORS:
        assert not fresh.locator(f"#calculator-{calculator.id}").is_visible()
    assert all(table.is_visible() for table in fresh.locator(".calculator-examples").all())
