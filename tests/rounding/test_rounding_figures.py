"""gpbnb.report.rounding.figures: what is drawn is the result; axes, legends and colours say what it is."""

from __future__ import annotations

import re

import numpy as np
import pytest
from drawn import colour, names_of

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display import style
from gpbnb.report.rounding import experiment, figures, theory

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
TWO = FloatFormat(10, 2)


def check_names(ax, x, y):
    assert x in ax.get_xlabel()
    assert y in ax.get_ylabel()


@pytest.mark.parametrize("rule", Rounding.documented())
def test_sawtooth(ax, rule):
    result = experiment.sawtooth(FloatFormat(10, 2, rule), 300)
    points, line, largest = figures.sawtooth(result, ax)
    assert np.array_equal(points.get_xdata(), result.x)
    assert np.array_equal(points.get_ydata(), result.error)
    assert points.get_linestyle() == "None"
    assert colour(points) == style.OBSERVED
    beta = float(result.fmt.unit_roundoff)
    assert list(line.get_ydata()) == [beta, beta]
    assert colour(line) == style.VALID
    assert ax.get_xscale() == "log"
    assert ax.get_ylim()[0] == 0
    assert max(result.error.max(), beta) < ax.get_ylim()[1]
    assert names_of(ax) == [r"bound $\beta$"]
    assert list(largest.get_ydata()) == [beta / (1 + beta)] * 2
    assert 0.93 * beta / (1 + beta) < result.error.max() <= beta / (1 + beta)
    check_names(ax, "number $x$", "relative error")
    assert (
        ax.get_title(loc="left")
        == rf"{rule.value}, 2 decimal digits: bound $\beta$, {'(8)' if rule is NEAREST else '(13)'}"
    )


def test_worst_ratios(ax):
    curves = [[experiment.worst_product(fmt, n) for n in (2, 3, 5)] for fmt in (FloatFormat(10, 1), FloatFormat(2, 4))]
    *lines, bound = figures.worst_ratios(curves, "1982 (20)", ax, "factors", "bound (20)")
    for line, curve in zip(lines, curves, strict=True):
        assert list(line.get_xdata()) == [2, 3, 5]
        assert list(line.get_ydata()) == [trial.ratio("1982 (20)") for trial in curve]
        assert line.get_marker() not in ("", "None")
    assert len({colour(line) for line in lines}) == 2
    assert list(bound.get_ydata()) == [1, 1]
    assert colour(bound) == style.REFUTED
    assert set(names_of(ax)) == {"1 decimal digit", "4 bits", "bound (20)"}
    check_names(ax, "factors $n$", "worst error / bound (20)")


def test_growth(ax):
    lengths = (2, 10, 40)
    results = [
        experiment.growth(FloatFormat(2, 8, rule), kind, lengths, 9, np.random.default_rng(3))
        for kind, rule in (("like signs", NEAREST), ("like signs", CHOP), ("constant", NEAREST))
    ]
    *drawn, bound, law = figures.growth(results, ax)
    for result, points, line in zip(results, drawn[::2], drawn[1::2], strict=True):
        for drawn_, sizes in (
            (points, np.median(abs(result.errors), axis=1)),
            (line, abs(result.errors).max(axis=1)),
        ):  # a logarithmic axis has no place for zero
            assert list(drawn_.get_xdata()) == [n for n, size in zip(lengths, sizes, strict=True) if size]
            assert np.array_equal(drawn_.get_ydata(), sizes[sizes > 0])
        assert points.get_linestyle() == "None"
        assert colour(points) == colour(line)
    assert list(bound.get_ydata()) == [1, 9, 39]
    beta = results[0].fmt.unit_roundoff
    assert list(law.get_ydata()) == [theory.probabilistic_sum_factor(n, beta) / float(beta) for n in lengths]
    named = {"like signs,\nnearest", "like signs,\nchop", "constant,\nnearest", "bound $n-1$", r"$\sqrt{n}$ law"}
    assert set(names_of(ax)) == named
    assert (colour(bound), colour(law)) == (style.VALID, style.REFUTED)
    for curve, text in ((bound, "bound $n-1$"), (law, r"$\sqrt{n}$ law")):
        (place,) = (each.xy for each in ax.texts if each.get_text() == text)
        assert place in list(zip(curve.get_xdata(), curve.get_ydata(), strict=True))
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    check_names(ax, "terms $n$", r"error of the sum / $\beta\sum|x_j|$")


def test_cancellation(ax):
    fmt = FloatFormat(10, 5)
    exact = experiment.chain_trial([fmt.array([[1, 2]]), fmt.array([[3], [4]])])
    trials = [*experiment.cancelling_chains(fmt, 4, np.random.default_rng(4)), exact]
    inexact = [trial for trial in trials if trial.error]  # a logarithmic axis has no place for zero
    assert not exact.error
    points, printed, bound = figures.cancellation(trials, ax)
    norms = [float(column_sum_norm(t.inputs[0]) * column_sum_norm(t.inputs[1])) for t in trials]
    lost = [norm / float(column_sum_norm(t.true)) for norm, t in zip(norms, trials, strict=True)]
    assert list(points.get_xdata()) == pytest.approx(lost[:-1])
    assert list(points.get_ydata()) == pytest.approx(
        [float(t.error) / norm for norm, t in zip(norms, inexact, strict=False)], rel=1e-12, abs=0
    )
    beta = float(fmt.unit_roundoff)
    assert list(bound.get_ydata()) == pytest.approx([2 * beta] * len(trials))
    assert list(printed.get_ydata()) == pytest.approx([2 * beta / x for x in sorted(lost)], rel=1e-12, abs=0)
    assert [colour(each) for each in (points, printed, bound)] == [style.OBSERVED, style.REFUTED, style.VALID]
    assert set(names_of(ax)) == {"error", "bound (32)", "(31) as\nprinted"}
    check_names(ax, "cancellation", "error / ")


def test_pessimism(ax):
    rng = np.random.default_rng(5)
    groups = [(str(n), experiment.sweep("dot", FloatFormat(2, 24), [n], 6, rng)) for n in (3, 8)]
    artists = figures.pessimism(groups, "strict", ax, "products", "the strict bound")
    medians = [line for line in artists if getattr(line, "get_linewidth", lambda: 0)() == 2]
    assert [line.get_ydata()[0] for line in medians] == [
        np.median([trial.ratio("strict") for trial in trials]) for _, trials in groups
    ]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["3", "8"]
    assert any(colour(line) == style.VALID and list(line.get_ydata()) == [1, 1] for line in ax.lines)
    assert ax.get_yscale() == "log"
    check_names(ax, "products $n$", "error / bound")


def test_every_function_returns_the_artists_it_drew(ax):
    result = experiment.sawtooth(TWO, 50)
    artists = figures.sawtooth(result, ax)
    assert artists == ax.lines[: len(artists)]
    assert all(re.match(r"\w", line.get_label()) for line in artists)


def test_no_more_curves_than_can_be_told_apart(ax):
    curve = [experiment.worst_product(TWO, 2)]
    with pytest.raises(ValueError, match="got 6 curves; needed at most 5, or colours repeat; draw two figures"):
        figures.worst_ratios([curve] * 6, "1982 (20)", ax, "factors", "bound")
    growth = experiment.growth(TWO, "constant", (2, 3), 2, np.random.default_rng(0))
    with pytest.raises(ValueError, match="got 6 curves; needed at most 5"):
        figures.growth([growth] * 6, ax)
