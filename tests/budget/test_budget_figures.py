"""gpbnb.report.budget.figures and tables: what is shown is the result."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from tabulated import by_header

from gpbnb.report.budget import experiment, figures, tables, theory
from gpbnb.report.display import style

READING = theory.read(files("gpbnb.report.budget") / "example.csv")
BUDGET = READING.budget


def test_budget_curve(ax):
    one, other, signs, printed, *names = figures.budget_curve((44, 0.15), (1.0, 1.253), ax, most=50)
    n = np.arange(1, 51)
    assert list(one.get_xdata()) == list(n)
    assert np.allclose(one.get_ydata(), n**-0.5, rtol=1e-15)
    assert np.allclose(other.get_ydata(), 1.253 * n**-0.5, rtol=1e-15)
    assert np.array_equal(signs.get_ydata(), 1 / n)
    assert (list(printed.get_xdata()), list(printed.get_ydata())) == ([44], [0.15])
    assert printed.get_markerfacecolor() == "none"
    assert one.get_color() == other.get_color() == style.VALID
    assert "printed example" in [each.get_text() for each in names]
    assert ax.get_ylabel() == "error of each (mas/yr)"
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left <= 1 < 50 < right
    assert bottom <= 1 / 50 < 1.253 < top


def test_shares(ax):
    artists = figures.shares(BUDGET, ax)
    bars, names = artists[: len(BUDGET.sources)], artists[len(BUDGET.sources) :]
    ordered = sorted(BUDGET.sources, key=BUDGET.share)
    assert [bar.get_width() for bar in bars] == [100 * BUDGET.share(source) for source in ordered]
    assert [tick.get_text() for tick in ax.get_yticklabels()] == [source.name for source in ordered]
    colours = {source.form: bar.get_facecolor() for source, bar in zip(ordered, bars, strict=True)}
    assert len(set(colours.values())) == len(colours) == 4
    for source, written in zip(ordered, names, strict=True):
        assert written.get_text() == f"{100 * BUDGET.share(source):.0f} %, {source.form.value}"
    assert "%" in ax.get_xlabel()


def test_distribution(ax):
    draws = experiment.draw(BUDGET, 2000, np.random.default_rng(1))
    artists = figures.distribution(draws, ax)
    lines = {line[0, 0] for each in artists[61:] if isinstance(each, LineCollection) for line in each.get_segments()}
    expected = (BUDGET.total, theory.GOAL, BUDGET.worst_case)
    assert lines == {sign * value for value in expected for sign in (1, -1)}
    assert sum(bar.get_height() * bar.get_width() for bar in artists[:61]) == pytest.approx(1)
    assert "mas" in ax.get_xlabel()
    low, high = ax.get_xlim()
    assert low == -high < draws.errors.min()
    assert draws.errors.max() < high


def test_table_of_sources():
    table = tables.sources(BUDGET)
    *rows, total, worst = table.body
    assert [row[0] for row in rows] == [source.name for source in BUDGET.sources]
    for source, row in zip(BUDGET.sources, rows, strict=True):
        assert row[1:3] == (source.kind.value, source.form.value)
        assert (row[3], row[5]) == (f"{source.error:.3g}", source.group)
        assert row[6] == f"{source.residual:.3g}"
        assert row[7] == f"{100 * BUDGET.share(source):.1f} %"
    assert rows[0][4] == "roll × 0.0005"
    assert total[6] == f"{BUDGET.total:.4g}"
    assert total[7] == "100.0 %"
    assert worst[6] == f"{BUDGET.worst_case:.4g}"


def test_a_line_of_the_table_of_sources():
    noise = theory.Source("readings", theory.Kind.PROCESS, theory.ErrorForm.NOISE, 1.2345, 0.56781, 0.5, 1.0, "sensor")
    bias = theory.Source("offset", theory.Kind.CONSTANT, theory.ErrorForm.BIAS, 0.12345)
    table = tables.sources(theory.Budget((noise, bias)))
    line, _, total, worst = by_header(table)
    assert table.title == "2 sources"
    assert line == {
        "source": "readings",
        "kind": "random process",
        "form": "noise",
        "error (mas)": "1.23",
        "reduced by": "roll × 0.568, orbit × 0.5",
        "group": "sensor",
        "remaining (mas)": "0.35",
        "share": "89.0 %",
    }
    empty = dict.fromkeys(("kind", "form", "error (mas)", "reduced by", "group"), "")
    assert total == {"source": "root-sum-square", **empty, "remaining (mas)": "0.3716", "share": "100.0 %"}
    assert worst == {"source": "worst case", **empty, "remaining (mas)": "0.4739", "share": ""}


def test_table_of_refused_rows():
    table = tables.refused(READING)
    assert [row[0] for row in table.body] == ["9", "10", "11", "12"]
    assert "TBD" in table.body[0][2]
    assert table.body[0][1].startswith("starlight, deterministic")
    assert table.title == "4 rejected rows"
    assert by_header(table)[1] == {
        "line": "10",
        "row": "magnetic field, random process, , 0.1, , , , , ",
        "reason": "form is ''; needed one of bias, drift, scale factor, noise",
    }


def test_table_of_the_curve():
    table = tables.curve([("printed", 44, 0.15)])
    assert table.title == "1 cases"
    (line,) = by_header(table)
    assert line == {
        "case": "printed",
        "sources": "44",
        "error of each (mas)": "0.1500",
        "root-sum-square (mas)": f"{0.15 * 44**0.5:.4f}",
        "sum if all have the same sign (mas)": "6.600",
    }
