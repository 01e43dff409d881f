"""gpbnb.report.gravity_probe_b.summary: the table of answers on the front page and in the README."""

from __future__ import annotations

import json
import re
from itertools import takewhile
from pathlib import Path

from tabulated import by_header

from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.search import least_from_which_on
from gpbnb.filters.forms import Form
from gpbnb.report.display import style
from gpbnb.report.gravity_probe_b import answers, figures, summary, year

ROOT = Path(__file__).resolve().parents[2]


def lines_of(page):
    """The lines that the cells of a page print."""
    cells = json.loads((ROOT / "book" / f"{page}.ipynb").read_text(encoding="utf-8"))["cells"]
    return [line for cell in cells for output in cell.get("outputs", []) for line in output.get("text", [])]


def fewest(title, place=0):
    """The fewest bits in a list of the page about a hundred years from which on 99 % of the years pass."""
    lines = lines_of("mission")
    start = [k for k, line in enumerate(lines) if line == f"{title}\n"][place]
    rows = [re.match(r"  (\d+) bits: +(\d+) of +(\d+)", line) for line in lines[start + 1 :]]
    passed = {int(row[1]): int(row[2]) >= 0.99 * int(row[3]) for row in takewhile(bool, rows)}
    return least_from_which_on(passed)


def test_the_answers_are_those_that_the_chapters_derive():
    printed, allowed, formula, one, simple, real, flown, proved, single, double = summary.find()
    assert printed.decimal == (9, 17)
    first, second = (f"and {digits} digits" for digits in formula.decimal)
    chapter = (ROOT / "book" / "kalman.ipynb").read_text(encoding="utf-8")
    assert re.search(rf"\(125\) .*{first} .*{second}", chapter)
    assert all(f", {digits} digits\\n" in chapter for digits in printed.decimal)
    cases = {year.YearCase(year.MODELS[0], 2, t, Rounding.NEAREST, Form.HUNG): t for t in range(14, 54)}
    errors = {cases[run.case]: answers.largest(run) for run in year.load() if run.case in cases}
    assert errors[allowed.bits] <= summary.DRIFT < errors[allowed.bits - 1]
    assert errors[one.bits] <= 1 < errors[one.bits - 1]
    assert (simple.bits, simple.deviation) == (fewest("absolute angles"), fewest("deviations"))
    assert (real.bits, real.deviation) == (fewest("absolute angles", 1), fewest("deviations", 1))
    assert (flown.bits, flown.deviation) == (
        None,
        fewest("deviations, a step every 2 s and a roll of 77.5 s, as flown"),
    )
    scaled = {line.split(":")[0]: line for line in lines_of("guarantee") if "scaled from 53 bits" in line}
    assert scaled["absolute"].endswith(f"scaled from 53 bits: {proved.bits} bits\n")
    assert scaled["deviation"].endswith(f"scaled from 53 bits: {proved.deviation} bits\n")
    assert (single.bits, single.meaning, double.bits, double.meaning) == (24, "too few", 53, "ample")
    assert "all 300 within" in simple.meaning


def test_the_front_page_has_the_errors_on_both_sides_of_the_own_criterion():
    (row,) = (row for row in by_header(summary.table()) if row["answer"] == "The same, simulated")
    runs = {run.case: answers.largest(run) for run in year.load()}
    case = year.YearCase(year.MODELS[0], 2, 20, Rounding.NEAREST, Form.HUNG)
    more, less = runs[case], runs[case._replace(precision=19)]
    assert more <= summary.DRIFT < less
    assert (row["bits"], row["basis"]) == ("20", f"one year: {more:,.0f} mas; 19 bits: {less:,.0f}")


def test_the_ring_of_the_front_page_marks_what_its_first_sentence_says():
    _, axes = style.figure()
    figures.answer_line(found := summary.find(), axes[0])
    (ring,) = (line for line in axes[0].lines if line.get_markersize() == 18)
    (years,) = (each for each in found if each.source == "300 simulated years")
    assert (ring.get_xdata()[0], ring.get_ydata()[0]) == (years.bits, 0)
    assert axes[0].get_yticklabels()[1].get_text() == "1 mas"
    front = json.loads((ROOT / "book" / "index.ipynb").read_text(encoding="utf-8"))["cells"][0]
    assert f"**{years.bits} bits.** In all of 300 simulated years" in "".join(front["source"])


def test_the_readme_shows_the_table():
    assert summary.table().markdown() in (ROOT / "README.md").read_text(encoding="utf-8")
