"""Numbers in the text of the book: an open page prints them; some in words and formulas are computed here."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from test_notebooks import MOST_LINES_OF_A_FUNCTION, PATHS

from gpbnb import BINARY16, BINARY32, BINARY64, FloatFormat, Rounding
from gpbnb.arithmetic.kernels.selection import wide_tag
from gpbnb.report.gravity_probe_b import summary
from gpbnb.report.gravity_probe_b.mission import PARAMETERS
from gpbnb.report.gravity_probe_b.model import YEAR
from gpbnb.report.integration import theory as integration
from gpbnb.report.kalman import report_bounds
from gpbnb.report.rolling import theory as rolling
from tests.corpus import __main__ as corpus

ROOT = Path(__file__).resolve().parents[1]
BOOK = ROOT / "book"
NOT_PROSE = re.compile(
    "|".join(
        (
            r"^```\{glossary\}$|```.*?```|^```$",  # code and figures, but not the glossary
            r"<form.*?</form>",  # fields of calculators
            r"^:{3,}.*?$|^:\w+:.*?$",  # directives and their options
            r"\$\$.*?\$\$|\$[^$]*\$",  # math
            r"\{[\w:-]+\}`[^`]*`|`[^`]*`",  # roles and inline code
            r"\[[^\]]*\]\(bibliography\.md#\w+\)",  # works
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
GIVEN = {
    "index": ("a step every 10 s", "Python 3.11", "CC BY 4.0"),
    "integration": ("34 equations", "wrong by 20 %"),
    "mission": ("9 or 17 decimal digits",),
    "nonlinear": ("pull request 18008", "PX4-ECL 1026"),
    "rolling": ("less than .04 % of the signal", "allows 0.15 mas"),
    "reports": ("with ten states and two measurements", "a phase error of one degree", "the coefficient 84"),
    "story": (
        *("in 1960", "± 18.3", "± 7.2", "on 20 April 2004", "from 28 August 2004 to 14 August 2005", "in 2011"),
        *("less than 0.2 mas per year", "15-bit fixed-point arithmetic"),
    ),
    "notation": ("base 2 and in base 10", "with the indices 2 and 3 in the filter", "1/f noise", "IEEE 754"),
    "README": (
        *("any base from 2 up", "Python 3.11", "gain is computed as PH times 1/S", "with 16-bit coefficients?"),
        *("BSD 3-Clause", "CC BY 4.0"),
    ),
}
"""Phrases with a quantity that is given, not computed."""

WITHOUT_CELLS = ("reports", "story", "notation", "errata", "ledger", "api", "README")
"""Pages that print nothing: each numeral is computed here, or given. Seconds in CONTRIBUTING are measured by hand."""


@cache
def cells(page: str) -> list[dict]:
    return json.loads((BOOK / f"{page}.ipynb").read_text(encoding="utf-8"))["cells"]


def source(page: str) -> str:
    """Text and captions of a page as they are written."""
    for folder in (BOOK, ROOT):
        if (folder / f"{page}.md").exists():
            return (folder / f"{page}.md").read_text(encoding="utf-8").replace(summary.table().markdown(), "")
    return "\n\n".join(
        "".join(cell["source"])
        if cell["cell_type"] == "markdown"
        else cell["metadata"].get("mystnb", {}).get("figure", {}).get("caption", "")
        for cell in cells(page)
    )


@cache
def prose(page: str) -> str:
    """Text and captions without what is no prose; white space as single blanks."""
    return " ".join(NOT_PROSE.sub(" · ", source(page)).split())


def in_sight(page: str) -> set[float]:
    """The numbers that cells print, and those in the code, which a reader can change."""
    if page in WITHOUT_CELLS:
        return set()
    found = []
    for cell in cells(page):
        if cell["cell_type"] == "code":
            found.append("".join(cell["source"]).replace("_", ""))
            for output in cell["outputs"]:
                found += ["".join(output.get("text", "")), "".join(output.get("data", {}).get("text/plain", ""))]
    return {float(each) for text in found for each in re.findall(r"(?<![\w.])\d*\.?\d+(?:e[+-]?\d+)?", text)}


@pytest.mark.parametrize("page", [*(path.stem for path in PATHS), *WITHOUT_CELLS])
def test_each_number_in_the_text_of_a_page_is_in_sight_computed_or_given(page):
    text, seen = prose(page), in_sight(page)
    for phrase in GIVEN.get(page, ()):
        assert phrase in text, "drop it from GIVEN"
        text = text.replace(phrase, " ")
    for phrase in (words for where, words in COMPUTED if where == page):
        text = text.replace(phrase, " ")
    found = ((each.start(), each[0].replace(",", "").rstrip(".")) for each in NUMERAL.finditer(text))
    assert [text[max(0, at - 40) : at + 30] for at, number in found if float(number) not in seen] == []


def output(page: str, code: str) -> str:
    """The text that the cell with this code printed or returned."""
    cell = next(each for each in cells(page) if each["cell_type"] == "code" and code in "".join(each["source"]))
    texts = [each.get("text", "") or each.get("data", {}).get("text/markdown", "") for each in cell["outputs"]]
    return "".join("".join(each) for each in texts)


def printed(page: str, code: str) -> list[float]:
    """The numbers with a point that the cell with this code printed."""
    return [float(each) for each in re.findall(r"\d+\.\d+", output(page, code))]


def fitted_slope(record: sp.Expr) -> sp.Expr:
    """Slope of the line fitted to a record by the weight of the text, for T = 1."""
    t = sp.Symbol("t")
    return sp.integrate(12 * (t - sp.Rational(1, 2)) * record, (t, 0, 1))


def rolled_gain() -> float:
    """Standard error without roll over that with roll, for a year of 100,000 turns."""
    return rolling.drift_error_unrolled(1.0, at_rest=True) / rolling.drift_error_rolled(1.0, rolling.YEAR / 1e5)


def mean_square_of_a_rounding() -> sp.Expr:
    """Over numbers whose logarithm is uniformly distributed, from b**(t-1) to b**t, whose spacing is 1."""
    b, t, x = sp.symbols("b t x", positive=True)
    mean = sp.integrate(1 / (12 * x**2) / x, (x, b ** (t - 1), b**t)) / sp.log(b)
    return sp.simplify(mean - (b**2 - 1) / (24 * sp.log(b)) * b ** (-2 * t))


MISSION = {each.name: each.value for each in PARAMETERS}
DRIFTS = MISSION["geodetic drift, predicted"], MISSION["frame dragging, predicted"]


def of_the_report() -> str:
    """The decimal digits that the closing example asks for."""
    return next(row for row in summary.table().body if row[0] == "Report, own criterion")[2]


def beyond_first_order() -> int:
    """The lowest power of β in what the strict bound of n roundings has beyond the first-order one."""
    n, beta = sp.symbols("n beta", positive=True)
    return sp.degree(sp.series(n * beta / (1 - n * beta) - n * beta, beta, 0, 3).removeO(), beta)


def limit_of(base: int) -> int:
    """The most digits that run in loops."""
    return max(t for t in range(1, 130) if wide_tag(FloatFormat(base, t).rules) is not None)


#: Quantities in words and numbers in formulas, by page and phrase. For formulas, each function
#: computes the number in another way than by the formula.
COMPUTED: dict[tuple[str, str], Callable[[], Any]] = {
    ("guarantee", "more than half of the"): lambda: min(printed("guarantee", "outcome.ratios")) > 50,
    ("kalman", "about four units"): lambda: round(6606 / YEAR * 2**11) == 4,
    ("integration", r"\mu^2/120"): lambda: (
        float(integration.approximation_ratio(0.01)) - 1 == pytest.approx(0.01**2 / 120, rel=1e-4)
    ),
    ("integration", r"{24\ln b}"): lambda: mean_square_of_a_rounding() == 0,
    ("integration", "5.6: try"): lambda: round(integration.approximation_ratio(5.6), 2) == 1.2,
    ("kalman", "about 0.99, and"): lambda: round(100 / (101 + 1e-5), 2) == 0.99,
    ("kalman", "by more than 3,000 standard deviations"): lambda: 3000 < 0.99 / math.sqrt(1e-5 / 101) < 3200,
    ("rounding", "1.05 has the relative error 0.05/1.05 = 0.0476"): lambda: round(0.05 / 1.05, 4) == 0.0476,
    ("kalman", "7n+3m+6 = 82"): lambda: report_bounds.coefficients(1, 10, 2)[0] == 82,
    ("rolling", r"\sqrt{4T/3T_r}"): lambda: rolled_gain() == pytest.approx(math.sqrt(4 / 3 * 1e5), rel=1e-12),
    ("rolling", r"12\,t\,(t-T/2)/T^3"): lambda: fitted_slope(sp.Integer(1)) == 0 and fitted_slope(sp.Symbol("t")) == 1,
    ("kalman", r"6606/3{,}153{,}600 \approx 0.0021"): lambda: f"{6606 / YEAR:.4f}" == "0.0021",
    ("notation", r"4.85\times10^{-9}"): lambda: f"{math.pi / 180 / 3.6e6:.2e}" == "4.85e-09",
    ("reports", "demands 9 decimal digits and the second term 17"): lambda: of_the_report() == "9 or 17",
    ("reports", "asks for 9 digits, or for 17"): lambda: of_the_report() == "9 or 17",
    ("reports", "instead of 82"): lambda: report_bounds.coefficients(1, 10, 2)[0] == 82,
    ("reports", "about half an arcminute"): lambda: round(printed("rolling", "limit =")[0] / 60, 1) == 0.5,
    ("story", "are 6,606.1 and 39.2 milliarcseconds"): lambda: DRIFTS == (6606.1, 39.2),
    ("story", "−6,606.1"): lambda: DRIFTS[0] == 6606.1,
    ("story", "−39.2"): lambda: DRIFTS[1] == 39.2,
    ("story", "−6,601.8"): lambda: round(DRIFTS[0] - MISSION["geodetic drift, true less predicted"], 1) == 6601.8,
    ("story", "−37.2"): lambda: round(DRIFTS[1] - MISSION["frame dragging, true less predicted"], 1) == 37.2,
    ("story", "77.5 seconds"): lambda: MISSION["roll period, flown"] == 77.5,
    ("story", "up to 5 arcseconds"): lambda: round(MISSION["aberration due to the orbit"]) == 5,
    ("story", "about 30 arcseconds"): lambda: round(math.degrees(MISSION["roll-phase offset"] / 1e3) * 3600, -1) == 30,
    ("notation", "A year has 365 days"): lambda: rolling.YEAR == 365 * 86400,
    ("notation", "with 24 and 53 bits"): lambda: (BINARY32.precision, BINARY64.precision) == (24, 53),
    ("notation", "with 11, 24 and 53 binary digits"): lambda: BINARY16.precision == 11,
    ("notation", r"\beta^2"): lambda: beyond_first_order() == 2,
    ("notation", "about 31 decimal digits"): lambda: math.floor(106 * math.log10(2)) == 31,
    ("notation", "about 0.04 arcseconds"): lambda: round(DRIFTS[1] / 1e3, 2) == 0.04,
    ("notation", "6.6 arcseconds"): lambda: round(DRIFTS[0] / 1e3, 1) == 6.6,
    ("README", "a step every 10 s"): lambda: MISSION["time between measurements, report"] == 10,
    ("README", "proved in 53 bits"): lambda: "proof in 53 bits" in summary.table().markdown(),
    ("README", "Seven other rounding modes"): lambda: len(Rounding) == 8,
    ("README", "up to 113 bits, 34 decimal digits or 28 digits in base 16"): lambda: (
        [limit_of(base) for base in (2, 10, 16)] == [113, 34, 28]
    ),
    ("README", "below 31 arcseconds,"): lambda: round(printed("rolling", "limit =")[0]) == 31,
    ("README", "any error below 20.8 arcseconds"): lambda: (
        round(printed("rolling", "whatever its course")[0], 1) == 20.8
    ),
    ("README", "in 0.7 % of single steps"): lambda: round(printed("kalman", "def before_gain")[3], 1) == 0.7,
    ("README", "for all 100,126 random inverses for which it exists"): lambda: 100_126 in in_sight("inversion"),
    ("CONTRIBUTING", "602 seeded runs"): lambda: len(corpus.names()) == 602,
    ("CONTRIBUTING", "at most 17 lines"): lambda: MOST_LINES_OF_A_FUNCTION == 17,
    ("story", "about 4,000 kilometres"): lambda: round(0.02 / (math.pi / 180 / 3.6e6) / 1e6) == 4,
    ("kalman", r"2^{-11} \approx 0.0005"): lambda: (
        f"{2.0 ** (math.floor(math.log2(6606)) - 23):.4f}" == f"{2.0**-11:.4f}" == "0.0005"
    ),
}


@pytest.mark.parametrize(("page", "phrase"), COMPUTED)
def test_a_typed_quantity_is_what_is_computed(page, phrase):
    formulas = re.sub(r"\s+", " ", " ".join(re.findall(r"\$\$.*?\$\$|\$[^$]*\$", source(page), re.DOTALL)))
    assert phrase in prose(page) or phrase in formulas, "drop it from COMPUTED"
    assert COMPUTED[page, phrase]()


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CODE_OF_CONDUCT.md", "CHANGELOG.md"])
def test_links_to_files_lead_to_files(name):
    targets = re.findall(r"\]\(([^)\s]+)\)", (ROOT / name).read_text(encoding="utf-8"))
    assert [each for each in targets if "://" not in each and not (ROOT / each.partition("#")[0]).exists()] == []
