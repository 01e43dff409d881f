"""Numbers in the text of the book: computed ones come by glue; all others are in typed_numerals.csv, with a reason."""

from __future__ import annotations

import ast
import csv
import json
import math
import re
from collections.abc import Callable
from fractions import Fraction
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from test_notebooks import SHOWN

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import doubledouble
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.budget import theory as budget
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.model import YEAR
from gpbnb.report.integration import theory as integration
from gpbnb.report.kalman import report_bounds
from gpbnb.report.rolling import theory as rolling

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*(ROOT / "book").glob("*.ipynb"), *(ROOT / "book").glob("*.md")])
NOT_PROSE = re.compile(
    "|".join(
        (
            r"^```\{glossary\}$|```.*?```|^```$",  # code and figures, but not the glossary
            r"<form.*?</form>",  # fields of calculators
            r"^:{3,}.*?$|^:\w+:.*?$",  # directives and their options
            r"\$\$.*?\$\$|\$[^$]*\$",  # math
            r"\{[\w:-]+\}`[^`]*`|`[^`]*`",  # roles, glue among them, and inline code
            r"(?<=\])\([^)\s]*\)",  # where a link leads
            r'"[^"\n]{,200}"',  # quotations
            r"\(\d{1,3}[a-z]?\)",  # numbers of equations
            r"\b(?:[Ss]ections?|Table|Fig\.|Figure) [\dIVX][\w.-]*(?:(?:,| to| and) \d[\w.]*)*",
            r"\b(?:1982|1984|2016)\b",  # the documents
            r"^\d+\. ",  # numbers of a list
        )
    ),
    re.DOTALL | re.MULTILINE,
)
NUMERAL = re.compile(r"(?<![\w-])\.?\d[\d.,]*")

#: Phrases with a numeral that was not computed: what a document printed, what a computation was given, what follows
#: from these by counting (exact), formats and names, and facts from a cited source (cited).
TYPED = list(csv.DictReader((ROOT / "tests" / "typed_numerals.csv").read_text(encoding="utf-8").splitlines()))
REASONS = {"printed", "given", "exact", "formats", "names", "cited"}
#: Sentences of the README, which cannot glue: what it says, and the number in the book, rounded to so many places: a
#: glued one, or the given one of those that a cell prints.
README = {
    "below 31 arcseconds,": ("rolling", ("limit =", 0), 31, 0),
    "any error below 20.8 arcseconds": ("rolling", ("whatever its course", 0), 20.8, 1),
    "in 0.7 % of single steps": ("kalman", ("def before_gain", 3), 0.7, 1),
    "for all 100,126 random inverses for which it exists": ("inversion", None, 100_126, 0),
}


def formulas(page: Path) -> str:
    """The formulas of a page, one a line."""
    return "\n".join(" ".join(each.split()) for each in re.findall(r"\$\$.*?\$\$|\$[^$]*\$", source(page), re.DOTALL))


def source(page: Path) -> str:
    """Text and captions of a page as they are written."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".ipynb":
        parts = []
        for cell in json.loads(text)["cells"]:
            figure = cell["metadata"].get("mystnb", {}).get("figure", {})
            parts.append("".join(cell["source"]) if cell["cell_type"] == "markdown" else figure.get("caption", ""))
        text = "\n\n".join(parts)
    return text


def prose(page: Path) -> str:
    """Text and captions of a page, without what is no prose; white space as single blanks."""
    return strip(source(page))


def strip(text: str) -> str:
    return " ".join(NOT_PROSE.sub(" · ", text).split())


def numerals(text: str) -> list[str]:
    """Each numeral with what stands around it."""
    return [text[max(0, found.start() - 40) : found.end() + 25] for found in NUMERAL.finditer(text)]


def glued(page: str, key: str) -> float:
    for cell in json.loads((ROOT / "book" / f"{page}.ipynb").read_text(encoding="utf-8"))["cells"]:
        for output in cell.get("outputs", []):
            if output.get("metadata", {}).get("scrapbook", {}).get("name") == key:
                return float(ast.literal_eval("".join(output["data"]["application/papermill.record/text/plain"])))
    raise KeyError(f"{page} glues no {key}")


# -- what is computed here --------------------------------------------------------------------------------------------


def printed(page: str, code: str) -> list[float]:
    """The numbers that a cell printed."""
    for cell in json.loads((ROOT / "book" / f"{page}.ipynb").read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code" and code in "".join(cell["source"]):
            text = "".join("".join(output.get("text", "")) for output in cell["outputs"])
            return [float(each) for each in re.findall(r"\d+\.\d+", text)]
    raise KeyError(f"{page} has no cell with {code}")


def error_of_integration(rounding: Rounding) -> float:
    """Least total error with 24 bits, an hour and 100 Hz."""
    fmt, omega = FloatFormat(2, 24, rounding), 200 * math.pi
    return integration.two_errors(1.0, omega, integration.best_rate(omega, 3600.0, fmt), 3600.0, fmt).total


def decades_a_digit() -> float:
    """Decades that each decimal digit takes off the error of the drift rate after a year, on average."""
    base = year.YearCase(year.MODELS[0], 10, 8, Rounding.NEAREST, Form.HUNG)
    runs = {run.case: run for run in year.load()}
    ends = [float(np.abs(runs[base._replace(precision=t)].rate[-1]).max()) for t in (8, 16)]
    return math.log10(ends[0] / ends[1]) / 8


def fitted_slope(record: sp.Expr) -> sp.Expr:
    """Slope of the line fitted to a record by the weight of the text, for T = 1."""
    t = sp.Symbol("t")
    return sp.integrate(12 * (t - sp.Rational(1, 2)) * record, (t, 0, 1))


def rolled_gain() -> float:
    """Standard error without roll over that with roll, for a year of 100,000 turns."""
    return rolling.drift_error_unrolled(1.0, at_rest=True) / rolling.drift_error_rolled(1.0, rolling.YEAR / 1e5)


def exact_up_to_degree_five(first: sp.Expr, second: sp.Expr) -> bool:
    """Whether the two-point rule with these weights of the derivatives integrates powers exactly, up to the fifth."""
    t = sp.Symbol("t")

    def added(f: sp.Expr) -> sp.Expr:
        at = [[sp.diff(f, t, j).subs(t, end) for end in (0, 1)] for j in range(3)]
        return sum(at[0]) / 2 + first * (at[1][0] - at[1][1]) + second * sum(at[2])

    return all(added(t**d) == sp.Rational(1, d + 1) for d in range(6)) and added(t**6) != sp.Rational(1, 7)


def stored_guarantee(name: str, column: str) -> float:
    table = files("gpbnb.report.guarantees") / "guarantees.csv"
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return next(float(row[column]) for row in csv.DictReader(lines) if row["name"] == name)


def half_of_a_cycle() -> bool:
    """nL less the error variance stays below L/2 for every μ and n."""
    for mu in (1e-6, 0.1, 1.0, 10.0, 1e4):
        rate, n = float(integration.walk_factor(mu)), np.array([1, 2, 10, 1000, 10**7])
        if not (n * rate - integration.error_variance(n, mu) < rate / 2 * (1 + 1e-9)).all():
            return False
    return True


def near(number: float) -> Any:
    """Within 1 %."""
    return pytest.approx(number, rel=0.01)


def relative_error(number: str) -> float:
    exactly = Fraction(number)
    return float(abs(FloatFormat(10, 3).round(exactly) - exactly) / exactly)


def mean_square_of_a_rounding() -> sp.Expr:
    """Over numbers whose logarithm is uniformly distributed, from b**(t-1) to b**t, whose spacing is 1."""
    b, t, x = sp.symbols("b t x", positive=True)
    mean = sp.integrate(1 / (12 * x**2) / x, (x, b ** (t - 1), b**t)) / sp.log(b)
    return sp.simplify(mean - (b**2 - 1) / (24 * sp.log(b)) * b ** (-2 * t))


MU = sp.Symbol("mu")
SERIES = MU / 6 - MU**3 / 360 + MU**5 / 15120

#: Quantities in words and numbers in formulas that cannot be glued, by page and phrase. For formulas, each function
#: computes the number in another way than by the formula.
COMPUTED: dict[tuple[str, str], Callable[[], Any]] = {
    ("budget", "be a quarter larger"): lambda: budget.equal_error(1.253, 44) / budget.equal_error(1, 44) == near(1.25),
    ("geometry", "more than a hundred times as"): lambda: 6.6 / 0.04 > 100,
    ("guarantee", "tens of thousands of steps"): lambda: stored_guarantee("altimeter", "repeat") > 10_000,
    ("guarantee", "more than half of the"): lambda: min(printed("guarantee", "outcome.ratios")) > 50,
    ("principles", "more than three hundred times"): lambda: 300 < 1 / (6 * FloatFormat(10, 4).unit_roundoff) < 400,
    ("mission", "finer than ten digits, coarser than eleven"): lambda: (
        FloatFormat(10, 10).unit_roundoff > Fraction(2) ** -int(glued("mission", "mission_bits"))
        and FloatFormat(10, 11).unit_roundoff < Fraction(2) ** -int(glued("mission", "mission_bits"))
    ),
    ("mission", "than two bits"): lambda: glued("mission", "timing_bits") < 2,
    ("processors", "far more than sixteen bits"): lambda: glued("wordlength", "span") > 32,
    ("year", "by about fifteen on"): lambda: 10 ** decades_a_digit() == pytest.approx(15, abs=0.5),
    ("year", "only about four"): lambda: round(6606 / YEAR * 2**11) == 4,
    ("integration", r"\mu^2/120"): lambda: (
        float(integration.approximation_ratio(0.01)) - 1 == pytest.approx(0.01**2 / 120, rel=1e-4)
    ),
    ("integration", r"{24\ln b}"): lambda: mean_square_of_a_rounding() == 0,
    ("kalman", "7n+3m+6 = 82"): lambda: report_bounds.coefficients(1, 10, 2)[0] == 82,
    ("rolling", r"\sqrt{4T/3T_r}"): lambda: rolled_gain() == pytest.approx(math.sqrt(4 / 3 * 1e5), rel=1e-12),
    ("rolling", r"12\,t\,(t-T/2)/T^3"): lambda: fitted_slope(sp.Integer(1)) == 0 and fitted_slope(sp.Symbol("t")) == 1,
    ("notation", r"4.85\times10^{-9}"): lambda: f"{math.pi / 180 / 3600 / 1000:.2e}" == "4.85e-09",
    ("year", r"6606/3{,}153{,}600 \approx 0.0021"): lambda: f"{6606 / YEAR:.4f}" == "0.0021",
    ("year", r"2^{-11} \approx 0.0005"): lambda: (
        f"{2.0 ** (math.floor(math.log2(6606)) - 23):.4f}" == f"{2.0**-11:.4f}" == "0.0005"
    ),
    ("year", r"47\beta"): lambda: report_bounds.gain_count(10, 2) == 47,
    ("year", r"34\beta"): lambda: report_bounds.covariance_count(10, 2) == 34,
    ("arithmetic", r"2^{-850}"): lambda: doubledouble.LEAST == 2.0**-850,
    ("arithmetic", r"2^{1000}"): lambda: doubledouble.LIMIT == 2.0**1000,
}


def test_a_typed_numeral_is_found_and_what_is_no_prose_is_passed_over():
    text = (
        'It is 3.5 times (18) of 1984, {glue:text}`a:.2f`, `4`, $5$, "6 of 7", [8](x#9), section 1.2: by .25%, float64'
    )
    assert NUMERAL.findall(strip(text)) == ["3.5", "8", ".25"]
    assert numerals("It is 3.5 times") == ["It is 3.5 times"]


def unlisted(text, rows, page):
    """The text without the phrases that a list has for the page; each of them must be there."""
    for row in rows:
        if row["page"] == page.stem:
            assert row["phrase"] in text, (row, "is no longer there: drop it from the list")
            text = text.replace(row["phrase"], " ")
    return text


def number(numeral: str) -> float:
    return float(numeral.replace(",", "").rstrip("."))


def in_sight(page: Path) -> set[float]:
    """The numbers that an open page's cells print, and those in its code, which a reader can change."""
    if page.stem not in SHOWN:
        return set()
    found = []
    for cell in json.loads(page.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            found.append("".join(cell["source"]).replace("_", ""))
            for output in cell["outputs"]:
                found += ["".join(output.get("text", "")), "".join(output.get("data", {}).get("text/plain", ""))]
    return {float(each) for text in found for each in re.findall(r"(?<![\w.])\d*\.?\d+(?:e[+-]?\d+)?", text)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_result_is_typed(page):
    text, seen = unlisted(prose(page), TYPED, page), in_sight(page)
    typed = [text[max(0, f.start() - 40) : f.end() + 25] for f in NUMERAL.finditer(text) if number(f[0]) not in seen]
    assert typed == [], "print a computed number in a cell, or put it in by glue; list one that was not computed"


def test_each_line_of_the_list_has_a_page_a_reason_and_a_numeral():
    assert {row["page"] for row in TYPED} <= {page.stem for page in PAGES}
    assert {row["reason"] for row in TYPED} == REASONS
    assert [row for row in TYPED if not NUMERAL.search(row["phrase"])] == []


@pytest.mark.parametrize(("page", "phrase"), COMPUTED)
def test_a_quantity_that_is_computed_here_is_in_the_text(page, phrase):
    (path,) = (each for each in PAGES if each.stem == page)
    assert phrase in prose(path) or phrase in formulas(path), "drop it from COMPUTED"


@pytest.mark.parametrize(("page", "phrase"), COMPUTED)
def test_a_typed_quantity_is_what_is_computed(page, phrase):
    assert COMPUTED[page, phrase]()


@pytest.mark.parametrize("phrase", README)
def test_the_readme_says_what_the_book_computes(phrase):
    page, key, number, places = README[phrase]
    assert phrase in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    if key is None:
        assert number in in_sight(ROOT / "book" / f"{page}.ipynb")
        return
    found = glued(page, key) if isinstance(key, str) else printed(page, key[0])[key[1]]
    assert round(found, places) == number


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "CHANGELOG.md"])
def test_links_to_files_lead_to_files(name):
    targets = re.findall(r"\]\(([^)\s]+)\)", (ROOT / name).read_text(encoding="utf-8"))
    assert [each for each in targets if "://" not in each and not (ROOT / each.partition("#")[0]).exists()] == []
