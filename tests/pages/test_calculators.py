"""The calculators in a real browser: their formulas against the package, and what their forms say and show."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.integration import theory as integration
from gpbnb.report.kalman import report_bounds
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory as rolling

BOOK = Path(__file__).resolve().parents[2] / "book"
NOTEBOOKS = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(BOOK.glob("*.ipynb"))]
CELLS = ["".join(cell["source"]) for notebook in NOTEBOOKS for cell in notebook["cells"]]
FORMS = [text for text in CELLS if text.startswith("<form")]
TRIALS = 500
U = 2.0**-53
DAY = 86400


@pytest.fixture
def page(browser):
    """The forms of the chapters, as a reader finds them."""
    opened = browser.new_page()
    opened.set_content("\n".join(FORMS))
    opened.add_script_tag(path=BOOK / "_static" / "calculators.js")
    yield opened
    opened.close()


# -- formulas --------------------------------------------------------------------------------------


def number_format(given):
    return FloatFormat(given["b"], given["t"], Rounding.CHOP if given["chop"] else Rounding.NEAREST)


def rounding_reference(given):
    """Values, and by how much float64 may differ: 5 roundings, of which γ enlarges those of nβ by 1/(1 - nβ)."""
    beta, n = number_format(given).unit_roundoff, given["n"]
    always = gamma(n, beta) if n * beta < 1 else math.nan
    exact = {"beta": beta, "sharper": beta / (1 + beta), "total": n * beta, "gamma": always}
    return {name: (value, 10 * U * float(value)) for name, value in exact.items() if name != "gamma"} | {
        "gamma": (always, 10 * U * float(always) / float(1 - n * beta))
    }


def kalman_reference(given):
    """Values, and by how much float64 may differ: at most 20 operations for a coefficient, without cancellation."""
    k, n, m = (given[name] for name in "knm")
    x, u, f, goal = (Fraction(given[name]) for name in ("x", "u", "f", "goal"))
    memory = Fraction(-math.expm1(k * math.log(f)) / (1 - float(f))) if 0 < f < 1 else Fraction(k if f else 1)
    counts = [report_bounds.coefficients(k, n, m, **faults) for faults in report_bounds.CORRECTIONS.values()]
    pairs = [(Fraction(a), Fraction(b)) for a, b in counts]
    pairs.append((pairs[-1][0], min(pairs[-1][1], 2 * pairs[-1][0] * memory)))
    found = {"memory": (memory, 10 * U * float(memory))}
    for i, (a, b) in enumerate(pairs, 1):
        size = a * x + b * u
        digits = report_bounds.precision_for_coefficient(size, goal, given["b"])
        # A tie within 1e-14 of the goal, 30 times what rounding of the size can do, may go either way.
        near = (FloatFormat(given["b"], digits + more).unit_roundoff for more in (-1, 0) if digits + more)
        tie = any(abs(float(size * beta / goal) - 1) < 1e-14 for beta in near)
        found |= {name: (value, 30 * U * float(value)) for name, value in ((f"a{i}", a), (f"b{i}", b))}
        found[f"digits{i}"] = (digits, float(tie))
    return found


def deroll_reference(given):
    """Values, and by how much float64 may differ: 5 roundings of the phase, and what the fit makes of them."""
    seconds = given["duration"] * DAY
    error = rolling.worst_rate_error(given["period"], number_format(given))
    phase = float(error) * seconds
    lost = rolling.off_tuned_loss(float(error), seconds)
    found = {
        name: (value, 10 * U * float(value))
        for name, value in {
            "rate": rolling.roll_rate(given["period"]),
            "error": error,
            "beat": 2 * math.pi / float(error) / YEAR,
            "phase": phase,
        }.items()
    }
    found["lost"] = (lost, 20 * U * (lost + phase * abs(math.sin(phase))) + (20 * U * phase) ** 2)
    # The chapter adds 400 terms, of sizes that add up to at most 3/2 min(phase, 1); the drift changes by at most
    # 9/8 of a change of the phase, and where the formula subtracts, its terms are below 14 in size.
    across = rolling.off_tuned_drift(given["drift"], float(error), seconds)
    allowed = 804 * 1.5 * min(phase, 1) + 12 * phase + (100 if phase > 2 else 0)
    found["across"] = (across, U * given["drift"] * allowed)
    return found


def integration_reference(given):
    """Values, and by how much float64 may differ: 15 roundings in the browser, and as many in the chapter."""
    sigma, omega, rate = (given[name] for name in ("sigma", "omega", "rate"))
    found = {
        "mu": omega / rate,
        "walk": float(integration.walk_factor(omega / rate)),
        "exact": integration.random_walk(sigma, omega, rate),
        "printed": sigma * math.sqrt(omega / 6) / rate,
        "ratio": float(integration.approximation_ratio(omega / rate)),
    }
    return {name: (value, 30 * U * value) for name, value in found.items()}


REFERENCES = {
    "rounding": rounding_reference,
    "kalman": kalman_reference,
    "deroll": deroll_reference,
    "integration": integration_reference,
}


SLIDERS = {"k", "n", "m", "x", "u", "goal"}
"""Inputs whose whole range the package takes too long for."""


def random_inputs(fields, rng):
    """Numbers over all that each field accepts, or over its slider."""
    given = {}
    for name, field in fields.items():
        if not field:
            given[name] = int(rng.integers(2))
            continue
        low, high = map(float, field["slider"].split() if name in SLIDERS else (field["least"], field["most"]))
        log = "log" in field
        value = math.exp(rng.uniform(math.log(low), math.log(high))) if log else rng.uniform(low, high)
        if name == "b" and rng.random() < 0.7:
            value = rng.choice([2, 10, 16])
        if name == "f" and rng.random() < 0.5:
            value = 1 - 10 ** rng.uniform(-9, -1)
        given[name] = round(float(value)) if "whole" in field else float(value)
    return given


def fields_of(page, name):
    """The data of each input of a form, empty for a choice."""
    return page.evaluate(
        "name => Object.fromEntries([...document.querySelectorAll(`#calculator-${name} [name]`)]"
        ".map(each => [each.name, {...each.dataset}]))",
        name,
    )


@pytest.mark.parametrize("name", REFERENCES)
def test_random_inputs_agree_with_the_package(page, name):
    rng = np.random.default_rng(sum(map(ord, name)))
    fields, inputs = fields_of(page, name), []
    while len(inputs) < TRIALS:
        given = random_inputs(fields, rng)
        if name == "deroll":
            error = rolling.worst_rate_error(given["period"], number_format(given))
            place = math.log(2 * math.pi / given["period"]) / math.log(given["b"])
            # The chapter's sum is for phases of some hundred radians; near a power of the base, e may be either.
            if error * given["duration"] * DAY > 100 or abs(place - round(place)) < 1e-12:
                continue
        inputs.append(given)
    results = page.evaluate("([name, inputs]) => inputs.map(gpbnbCalculators.formulas[name])", [name, inputs])
    wrong, relative = [], []
    for given, found in zip(inputs, results, strict=True):
        for key, (value, allowed) in REFERENCES[name](given).items():
            if isinstance(value, float) and math.isnan(value):
                assert found[key] is None or math.isnan(found[key])
                continue
            if not abs(found[key] - float(value)) <= allowed + U * abs(float(value)):
                wrong.append((key, given, found[key], float(value)))
            relative.append(allowed / (abs(float(value)) or 1))
    assert wrong == []
    assert np.median(relative) < 1e-13  # no tolerance is so wide that a lost digit would pass


# -- forms -----------------------------------------------------------------------------------------


def field(page, form, name, part=""):
    return page.locator(f"#calculator-{form}-{name}{part}")


def cell(page, form, name):
    return page.locator(f'#calculator-{form} [data-name="{name}"]').inner_text()


def test_each_form_opens_with_its_numbers_computed(page):
    assert len(FORMS) == len(REFERENCES)
    for name in REFERENCES:
        form = page.locator(f"#calculator-{name}")
        assert form.is_visible()
        cells = form.locator("[data-name]").all_inner_texts()
        assert all(cells)
        assert "—" not in cells
        assert "{" not in form.locator("output").inner_text()
    assert cell(page, "kalman", "digits1") == "16"
    assert cell(page, "kalman", "digits4") == "22"
    assert cell(page, "deroll", "rate") == "0.01047"


def test_sliders_choices_and_examples_fill_the_form(page):
    field(page, "rounding", "t", "-slider").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert field(page, "rounding", "t").input_value() == "12"
    assert cell(page, "rounding", "beta") == "5.000\u00a0×\u00a010⁻¹²"
    field(page, "rounding", "n", "-slider").focus()
    page.keyboard.press("ArrowRight")
    assert field(page, "rounding", "n").input_value() == "1020"  # a hundredth of a decade
    field(page, "rounding", "chop").select_option("chopped")
    assert cell(page, "rounding", "beta") == "1.000\u00a0×\u00a010⁻¹¹"
    page.locator("#calculator-rounding").get_by_role("button", name="IEEE double").click()
    assert field(page, "rounding", "b").input_value() == "2"
    assert cell(page, "rounding", "beta") == "1.110\u00a0×\u00a010⁻¹⁶"
    field(page, "deroll", "drift").fill("\u22121")  # the minus sign of a typesetter
    assert field(page, "deroll", "drift", "-error").inner_text().startswith("Got -1; needed a number from 1e-9 to 1e9")
