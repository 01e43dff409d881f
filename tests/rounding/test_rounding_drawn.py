"""Every name, label and reference line in the figures of rounding bounds belongs to the data it stands at."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import BLUE, GREEN, GREY, ORANGE, PINK, PURPLE, at, look, named, near
from matplotlib.colors import to_hex

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.style import bits_colour
from gpbnb.report.rounding import figures

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP


@pytest.mark.parametrize(
    ("rounding", "beta", "equation"), [(NEAREST, 0.05, "nearest"), (CHOP, 0.1, "chop")], ids=["nearest", "chop"]
)
def test_sawtooth(ax, rounding, beta, equation):
    result = SimpleNamespace(
        fmt=FloatFormat(10, 2, rounding), x=np.array([1.0, 5.0, 100.0]), error=np.array([0.01, 0.02, 0.0])
    )
    points, bound, largest = figures.sawtooth(result, ax)
    assert at(points, (1, 0.01), (5, 0.02), (100, 0))
    assert (look(points), points.get_label()) == ((BLUE, "", "."), "error")
    assert (set(bound.get_ydata()), look(bound)[:2], bound.get_label()) == ({beta}, (GREEN, "-"), "bound")
    assert largest.get_ydata()[0] == pytest.approx(beta / (1 + beta))
    assert (look(largest)[:2], largest.get_label()) == ((GREY, ":"), "largest error")
    assert ax.get_ylim() == (0, 0.13)  # the same for both
    number = "(8)" if rounding is NEAREST else "(13)"
    assert ax.get_title(loc="left") == rf"{equation}, 2 decimal digits: bound $\beta$, {number}"
    ((text, place),) = named(ax).items()
    assert text == r"bound $\beta$"
    assert near(place, GREEN, (10, beta))


def trial(fmt, n, ratio):
    return SimpleNamespace(fmt=fmt, inputs=[range(n)], ratio={"one": ratio, "two": 99.0}.__getitem__)


def test_worst_ratios(ax):
    formats = [FloatFormat(10, 1), FloatFormat(2, 4), FloatFormat(2, 9)]
    curves = [[trial(fmt, n, 0.1 * n + i) for n in (2, 5)] for i, fmt in enumerate(formats)]
    *lines, bound = figures.worst_ratios(curves, "one", ax, "factors", "bound (20)")
    texts = ("1 decimal digit", "4 bits", "9 bits")
    names = named(ax)
    paints = [bits_colour(fmt) for fmt in formats]
    for i, (line, text, paint, mark) in enumerate(zip(lines, texts, paints, "osD", strict=True)):
        assert at(line, (2, 0.2 + i), (5, 0.5 + i))
        assert (look(line), line.get_label()) == ((paint, "-", mark), text)
        assert near(names.pop(text), paint, (1, 0.5 + i))
    assert (set(bound.get_ydata()), look(bound)[:2]) == ({1}, (ORANGE, "--"))
    assert near(names.pop("bound (20)"), ORANGE, (1, 1))
    assert not names


def test_growth(ax):
    lengths = (2, 8, 32)

    def result(kind, rounding, scale):
        errors = scale * np.array([[-1.0, 2.0, 4.0], [2.0, -8.0, 3.0], [6.0, 9.0, -12.0]])
        return SimpleNamespace(kind=kind, fmt=FloatFormat(2, 8, rounding), lengths=lengths, errors=errors)

    results = [result("like signs", NEAREST, 1), result("like signs", CHOP, 10), result("constant", NEAREST, 100)]
    *drawn, bound, law = figures.growth(results, ax)
    names = named(ax)
    paints = (BLUE, PURPLE, PINK)
    texts = ("like signs,\nnearest", "like signs,\nchop", "constant,\nnearest")
    for i, (text, paint, mark) in enumerate(zip(texts, paints, "osD", strict=True)):
        median, largest = drawn[2 * i : 2 * i + 2]
        size = 10.0**i
        assert at(median, (2, 2 * size), (8, 3 * size), (32, 9 * size))
        assert at(largest, (2, 4 * size), (8, 8 * size), (32, 12 * size))
        assert (look(median), look(largest)) == ((paint, "", mark), (paint, "-", ""))
        assert (median.get_markerfacecolor() == "none") == (i == 1)  # open if chopped
        assert median.get_label() == text.replace("\n", " ")
        assert near(names.pop(text), paint, (1, 12 * size))
    assert at(bound, (2, 1), (8, 7), (32, 31))
    beta = 2.0**-8
    assert (look(bound)[:2], look(law)[:2]) == ((GREEN, "-"), (ORANGE, "--"))
    values = np.array(law.get_ydata())
    expected = [figures.theory.probabilistic_sum_factor(n, Fraction(1, 256)) / beta for n in lengths]
    assert values == pytest.approx(expected)
    assert near(names.pop("bound $n-1$"), GREEN, (8, 7))
    assert near(names.pop(r"$\sqrt{n}$ law"), ORANGE, (8, values[1]))
    assert not names
    assert [bound.get_label(), law.get_label()] == ["bound $n-1$", r"$\sqrt{n}$ law"]


def test_cancellation(ax):
    def one(left, right, product, error, printed, true):
        inputs = [np.array([[Fraction(left)]]), np.array([[Fraction(right)]])]
        return SimpleNamespace(
            inputs=inputs,
            true=np.array([[Fraction(product)]]),
            error=Fraction(error),
            bounds={"(31)": Fraction(printed), "(32)": Fraction(true)},
        )

    trials = [one(4, 5, "1/10", 1, 2, 30), one(2, 3, 3, 3, 6, 18), one(2, 3, 6, 0, 6, 24)]
    points, printed, bound = figures.cancellation(trials, ax)
    # Over the norms' product, 20, 6 and 6; the cancellation is 200, 2 and 1.
    assert at(points, (200, 1 / 20), (2, 3 / 6))
    assert at(printed, (1, 1), (2, 1), (200, 2 / 20))
    assert at(bound, (1, 4), (2, 3), (200, 30 / 20))
    assert [look(each) for each in (points, printed, bound)] == [(BLUE, "", "o"), (ORANGE, "--", ""), (GREEN, "-", "")]
    assert [each.get_label() for each in (points, printed, bound)] == ["error", "(31)", "(32)"]
    names = named(ax)
    assert near(names.pop("bound (32)"), GREEN, (1, 1.5))
    assert near(names.pop("(31) as\nprinted"), ORANGE, (1, 0.1))
    assert near(names.pop("error"), BLUE, (1, (1 / 20 + 3 / 6) / 2))
    assert not names


def test_pessimism(ax):
    def group(*ratios):
        return [SimpleNamespace(ratio={"one": ratio, "two": 9.0}.__getitem__) for ratio in ratios]

    artists = figures.pessimism(
        [("3", group(0.1, 0.2, 0.6)), ("8", group(0.01, 0.03, 0.04))], "one", ax, "products", "the strict bound"
    )
    medians = [each for each in artists if getattr(each, "get_linewidth", lambda: 0)() == 2]
    assert [tuple(each.get_ydata()) for each in medians] == [(0.2, 0.2), (0.03, 0.03)]
    assert [float(np.mean(each.get_xdata())) for each in medians] == [1, 2]
    assert [to_hex(each.get_color()).upper() for each in medians] == [BLUE, BLUE]
    ends = sorted({float(y) for each in artists if hasattr(each, "get_ydata") for y in each.get_ydata()})
    assert (ends[0], ends[-1]) == (0.01, 0.6)  # whiskers reach the least and the largest
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["3", "8"]
    (one,) = [line for line in ax.lines if line not in artists]
    assert (set(one.get_ydata()), look(one)[:2]) == ({1}, (GREEN, "-"))
    names = named(ax)
    assert near(names.pop("the strict bound"), GREEN, (1.5, 1))
    assert not names
    assert math.isclose(ax.get_ylim()[1], 6)
