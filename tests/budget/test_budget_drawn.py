"""Every name, colour and line in the figures of the error budget belongs to what it stands at."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawn import BLACK, BLUE, GREEN, GREY, NAVY, PINK, PURPLE, at, look, named, near
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex

from gpbnb.report.budget import figures
from gpbnb.report.budget.experiment import Draws
from gpbnb.report.budget.theory import Budget, ErrorForm, Kind, Source


def test_budget_curve(ax):
    goal, larger, linear, printed, *_ = figures.budget_curve((44, 0.15), (2.0, 3.0), ax, most=25)
    n = range(1, 26)
    assert at(goal, *((k, 2 / math.sqrt(k)) for k in n))
    assert at(larger, *((k, 3 / math.sqrt(k)) for k in n))
    assert at(linear, *((k, 2 / k) for k in n))
    assert at(printed, (44, 0.15))
    assert [look(each)[:2] for each in (goal, larger, linear)] == [(GREEN, "-"), (GREEN, "-"), (GREY, ":")]
    assert (printed.get_markeredgecolor(), printed.get_markerfacecolor()) == (BLACK, "none")
    names = named(ax)
    assert near(names.pop("independent,\ntotal 3 mas/yr"), GREEN, (9, 1))
    assert near(names.pop("independent,\ntotal 2 mas/yr"), GREEN, (25, 0.4))
    assert near(names.pop("all of the same sign,\ntotal 2 mas/yr"), GREY, (9, 2 / 9))
    assert near(names.pop("printed example"), BLACK, (44, 0.15))
    assert not names


def budget():
    forms = list(ErrorForm)
    return Budget(
        tuple(
            Source(f"source {i}", Kind.CONSTANT, form, float(error))
            for i, (form, error) in enumerate(zip(forms, (3, 1, 4, 2), strict=True))
        )
    )


def test_shares(ax):
    artists = figures.shares(budget(), ax)
    bars = artists[:4]
    # Of 3² + 1² + 4² + 2² = 30; the largest has the highest place.
    assert [bar.get_width() for bar in bars] == pytest.approx([100 / 30, 400 / 30, 900 / 30, 1600 / 30])
    ticks = [tick.get_text() for tick in ax.get_yticklabels()]
    assert ticks == ["source 1", "source 3", "source 0", "source 2"]
    paint = {"bias": BLUE, "drift": PURPLE, "scale factor": PINK, "noise": NAVY}
    expected = ["3 %, drift", "13 %, noise", "30 %, bias", "53 %, scale factor"]
    names = named(ax)
    for i, (text, bar) in enumerate(zip(expected, bars, strict=True)):
        assert near(names.pop(text), BLACK, (bar.get_width(), i))
        assert to_hex(bar.get_facecolor()).upper() == paint[text.split(", ")[1]]
    assert not names


def test_distribution(ax):
    draws = Draws(budget(), np.array([-3.0, -1.0, 0.0, 0.0, 0.5, 2.0]))
    artists = figures.distribution(draws, ax)
    bars = artists[:61]
    assert sum(bar.get_height() * bar.get_width() for bar in bars) == pytest.approx(1)
    assert (bars[0].get_x(), bars[-1].get_x() + bars[-1].get_width()) == pytest.approx((-10.2, 10.2))
    assert {to_hex(bar.get_facecolor()).upper() for bar in bars} == {BLUE}
    top = max(bar.get_height() for bar in bars)
    assert top == pytest.approx(2 / 6 / (20.4 / 61))  # two of six draws in one of 61 bins
    lines = [each for each in artists if isinstance(each, LineCollection)]
    names = named(ax)
    for line, (value, text, paint, height) in zip(
        lines,
        (
            (math.sqrt(30), "root-sum-square", BLACK, 1.3),
            (1.0, "goal", GREY, 1.08),  # mas/yr
            (10.0, "sum of all errors", BLACK, 0.7),
        ),
        strict=True,
    ):
        assert sorted(segment[0, 0] for segment in line.get_segments()) == pytest.approx([-value, value])
        assert {float(segment[1, 1]) for segment in line.get_segments()} == {height * top}
        assert to_hex(line.get_edgecolor()[0]).upper() == paint
        assert near(names.pop(text), paint, (value, height * top))
    styles = [line.get_linestyle()[0][1] for line in lines]
    assert styles[0] is None
    assert len({str(style) for style in styles}) == 3
    assert near(names.pop("random draws"), BLUE, (-1, 0.9 * top))
    assert not names
    assert ax.get_ylim() == pytest.approx((0, 1.42 * top))  # above the highest line, at 1.3
    assert ax.get_xlim() == pytest.approx((-10.2, 10.2))  # beyond the widest lines, at 10
