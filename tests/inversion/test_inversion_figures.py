"""gpbnb.report.inversion.figures: what is drawn is the result; axes, legends and colours say what it is."""

from __future__ import annotations

import numpy as np
import pytest
from drawn import colour, legend_of, names_of
from matplotlib.patches import FancyArrowPatch

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display import style
from gpbnb.report.inversion import example, experiment, figures
from gpbnb.report.inversion.experiment import Frozen

FMT = FloatFormat(2, 24)


class TestFlowChart:
    def test_boxes_and_arrows(self, ax):
        artists = figures.flow_chart(ax)
        texts = [artist.get_text() for artist in artists if hasattr(artist, "get_text")]
        assert texts == [box.text for box in figures.CHART.values()]
        arrows = [artist for artist in artists if isinstance(artist, FancyArrowPatch)]
        assert len(arrows) == sum(len(box.follows) for box in figures.CHART.values())
        assert not ax.axison

    def test_every_box_leads_to_the_bound(self):
        reached = {"bound on error"}
        for _ in figures.CHART:
            reached |= {name for name, box in figures.CHART.items() if reached.intersection(box.follows)}
        assert reached == set(figures.CHART)
        followed = {name for box in figures.CHART.values() for name in box.follows}
        assert set(figures.CHART) - followed == {"given"}

    def test_no_box_covers_another(self, ax):
        artists = figures.flow_chart(ax)
        ax.figure.canvas.draw()
        frames = [artist.get_bbox_patch().get_window_extent() for artist in artists if hasattr(artist, "get_text")]
        assert not any(a.overlaps(b) for i, a in enumerate(frames) for b in frames[:i])
        inside = ax.figure.bbox
        assert all(inside.x0 <= f.x0 and f.x1 <= inside.x1 and inside.y0 <= f.y0 and f.y1 <= inside.y1 for f in frames)


def test_table1(ax):
    bounds, errors = example.bound_readings()[::40], example.error_readings()[::20]
    drawn = figures.table1(bounds, errors, ax)
    for points, printed, columns, name in zip(
        drawn[::2], drawn[1::2], (bounds, errors), ("bound", "error"), strict=True
    ):
        assert sorted(points.get_ydata()) == sorted(v for c in columns for v in c.values)
        assert [float(v) for v in example.PRINTED[name]] == list(printed.get_ydata())
        assert printed.get_markerfacecolor() == "none"
    assert colour(drawn[0]) == style.REFUTED
    assert colour(drawn[2]) == style.OBSERVED
    assert [label.get_text() for label in ax.get_xticklabels()] == ["3", "5", "8"]
    assert ax.get_yscale() == "log"
    expected = ["all readings\nof the bound", "bound as\nprinted", "all readings\nof the error", "error as\nprinted"]
    assert names_of(ax) == expected


def test_violations(ax):
    rows = [
        {"family": family, "format": "all", "bound": bound, "regular": "40", "violations_regular": str(k + 2 * i)}
        for i, family in enumerate(("random", "Kahan", "all"))
        for k, bound in enumerate(("x", "chart, A_T"))
    ]
    points = figures.violations(Frozen({}, tuple(rows)), ("x", "chart, A_T"), ax)
    assert [list(each.get_xdata()) for each in points] == [[0, 5], [2.5, 7.5]]
    assert [each.get_markeredgecolor() for each in points] == [style.REFUTED] * 2
    assert len({(each.get_marker(), each.get_markerfacecolor()) for each in points}) == 2
    assert [label.get_text() for label in ax.get_yticklabels()] == ["random", "Kahan"]
    assert legend_of(ax) == ["x", "norm of (95), $A_T^{-1}$"]
    assert "(%)" in ax.get_xlabel()
    (alone,) = figures.violations(Frozen({}, tuple(rows[::2])), ("x",), ax)
    assert list(alone.get_xdata()) == [0, 5]
    with pytest.raises(ValueError, match="got 5 bounds; needed at most 4"):
        figures.violations(Frozen({}, tuple(rows)), ("x",) * 5, ax)


class TestRatios:
    NAMES = ("Higham", "ball", "a posteriori")

    def test_against_size(self, ax):
        trials = experiment.against_size(FMT, (2, 4), 5, np.random.default_rng(1))
        *lines, error = figures.ratios(trials, self.NAMES, ax)
        for line, name in zip(lines, self.NAMES, strict=True):
            assert list(line.get_xdata()) == [2, 4]
            expected = [np.median([one.overestimation(name) for one in trials if one.n == n]) for n in (2, 4)]
            assert list(line.get_ydata()) == expected
            assert colour(line) == style.VALID
        assert list(error.get_ydata()) == [1, 1]
        assert colour(error) == style.OBSERVED
        assert sorted(names_of(ax)) == sorted([*self.NAMES, "error"])
        assert ax.get_yscale() == "log"
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("rows $n$", "bound / error, median")

    def test_against_condition(self, ax):
        trials = experiment.against_condition(FMT, 4, np.linspace(0, 7, 8), np.random.default_rng(1))
        *points, _, limit = figures.ratios(trials, self.NAMES, ax, "condition")
        for artist, name in zip(points, self.NAMES, strict=True):
            having = sorted((one for one in trials if name in one.bounds), key=lambda one: one.condition)
            assert list(artist.get_xdata()) == [one.condition for one in having]
            assert list(artist.get_ydata()) == [one.overestimation(name) for one in having]
        assert list(limit.get_xdata()) == [2**24, 2**24]
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        assert "condition number" in ax.get_xlabel()
