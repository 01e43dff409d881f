"""Numbers in the descriptions of figures are those that the figures show: each is computed here from its source."""

from __future__ import annotations

import json
import math
import re
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.budget import theory as budget
from gpbnb.report.geometry import theory as geometry
from gpbnb.report.gravity_probe_b import answers, summary, threshold, year
from gpbnb.report.rolling import theory as rolling

BOOK = Path(__file__).resolve().parents[1] / "book"
ARCSEC = math.pi / 180 / 3600


@cache
def alt(page: str, name: str) -> str:
    """The description of one figure of a page."""
    for cell in json.loads((BOOK / f"{page}.ipynb").read_text(encoding="utf-8"))["cells"]:
        shown = cell["metadata"].get("mystnb", {})
        if shown.get("figure", {}).get("name") == name:
            return str(shown["image"]["alt"])
    raise KeyError(f"{page} has no figure {name}")


def says(page: str, name: str, *phrases: str) -> None:
    assert [phrase for phrase in phrases if phrase not in alt(page, name)] == []


def test_years_within_a_milliarcsecond():
    places = {}
    spread = {}
    for each in threshold.shares(threshold.SWEEP.load()):
        if each.fmt.base == 2 and each.fmt.rounding is Rounding.NEAREST:
            share = each.within / each.records
            place = (
                "all above" if share == 0 else "mostly above" if share < 0.5 else "mostly below" if share < 1 else "all"
            )
            places.setdefault((each.states, place), []).append(each.fmt.precision)
            spread.setdefault(each.states, []).append(max(each.errors) / min(each.errors))
    assert places == {
        ("absolute", "all above"): [28, 29],
        ("absolute", "mostly above"): [30, 31],
        ("absolute", "mostly below"): [32],
        ("absolute", "all"): [33, 34, 35, 36],
        ("deviation", "all above"): [22, 23, 24],
        ("deviation", "mostly below"): [25],
        ("deviation", "all"): [26, 27, 28, 29, 30],
    }
    assert all(1.5 < factor < 2.5 for factors in spread.values() for factor in factors[:2])
    assert 9 < max(map(max, spread.values())) < 10
    says(
        "mission",
        "fig-mission-shares",
        "all points lie above the tolerance of one at 28 and 29 bits, most at 30 and 31, few at 32",
        "few at 32, and none from 33 bits on",
        "all points lie above it up to 24 bits, some at 25, and none from 26 bits on",
        "a factor of about two in the coarsest formats, and of up to ten in finer ones",
    )


def test_phase_errors():
    geodetic, frame = rolling.phase_error_cost((6600.0, 40.0), math.radians(1))
    small = rolling.phase_error_cost((6600.0, 40.0), math.radians(31 / 3600))[1]
    says(
        "rolling",
        "fig-phase-cost",
        f"they end at 40 and at {40 + frame:.0f} milliarcseconds",
        f"at 31 arcseconds and {small:.0f} milliarcsecond, and a point at one degree and {frame:.0f}",
    )
    assert abs(geodetic) < 2


def test_budget():
    example = budget.read(files("gpbnb.report.budget") / "example.csv").budget
    shares = sorted(((100 * example.share(each), each.name) for each in example.sources), reverse=True)
    text = alt("budget", "fig-own")
    numbers = [f"{share:.0f}" for share, _ in shares]
    listed = text.partition("percent: ")[2].partition(".")[0].split(", ")
    assert [each.rpartition(" ")[2] for each in listed] == numbers
    says(
        "budget",
        "fig-own",
        f"plus and minus {example.total:.1f} for the root-sum-square, {budget.GOAL:.0f} for the goal",
        f"and {example.worst_case:.1f} milliarcseconds per year for the sum of all errors",
    )
    assert budget.equal_error(1.0, 44) == pytest.approx(0.15, abs=0.005)
    assert pytest.approx(1.25, abs=0.01) == 1.253  # a quarter higher
    says("budget", "fig-budget", "44 sources with 0.15 each", "a total of 1.253 lies a quarter higher", "down to 0.01")


def test_the_year():
    runs = {run.case: run for run in year.load()}
    base = year.YearCase(year.MODELS[0], 2, 24, Rounding.NEAREST, Form.HUNG)
    end = {t: float(np.abs(runs[base._replace(precision=t)].rate[-1]).max()) for t in (18, 24, 32, 40, 53)}
    assert round(end[18], -3) == 26_000
    assert 0.8 < end[32] < 1
    assert [round(math.log10(end[t])) for t in (40, 53)] == [-3, -8]
    says(
        "year",
        "fig-kalman-year",
        "end at 26000 milliarcseconds a year with 18 bits",
        f"{end[24]:.0f} with 24, just below 1 with 32, 10⁻³ with 40 and 10⁻⁸ with 53",
    )
    says("year", "fig-kalman-125", f"The error rises from 10⁻⁹ to {end[24]:.0f} milliarcseconds a year")
    # What the ledger's closing example prints.
    needed = answers.find_answers(1.0)
    says("year", "fig-kalman-digits", "at {} and {} digits".format(*needed.printed))
    own, simulated, formula, _, years, _, _, every, _, _ = summary.find()
    asked = "9 and 17 digits, which are 28 and 54 bits", "13 and 20 digits, which are 41 and 64 bits"
    for row, words in zip((own, formula), asked, strict=True):
        assert [f"{t}" for t in row.decimal] == re.findall(r"\d+", words)[:2]
        assert [f"{summary.binary_digits(t):.0f}" for t in row.decimal] == re.findall(r"\d+", words)[2:]
        says("index", "fig-front", words)
    says("index", "fig-front", f"a point stands at {simulated.bits} bits", f"a green bar stands at {every.bits} bits")
    says("index", "fig-front", f"the point at {years.bits} bits")


def test_geometry():
    assert math.hypot(15, 8) == 17
    says("geometry", "fig-deroll", "15 and minus 8 arcseconds", "between plus and minus 17 arcseconds")
    crossing = ARCSEC / 1000 / geometry.GEODETIC / ARCSEC  # of |x| |φ|
    assert float(geometry.small_angle_loss("gamma1", 31 * ARCSEC)) == pytest.approx(ARCSEC / 1000, rel=0.02)
    says("geometry", "fig-losses", f"crosses one milliarcsecond at {crossing:.0f} arcseconds")


def test_rounding():
    says("rounding", "fig-sawtooth", "tallest just above 1 and 10", "the horizontal line at 0.05")
    assert float(FloatFormat(10, 2).unit_roundoff) == 0.05
