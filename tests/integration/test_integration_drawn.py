"""Every name, arrow, sign and reference line in the figures of digital integration belongs to what it stands at."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn import BLUE, GREEN, GREY, ORANGE, PINK, VIOLET, at, labelled, look, named, near, points_of
from matplotlib.colors import to_hex
from matplotlib.patches import ArrowStyle, Circle, FancyArrowPatch, Rectangle
from matplotlib.text import Text

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.style import bits_colour
from gpbnb.report.integration import experiment, figures, theory
from gpbnb.report.integration.experiment import Accuracy, WalkSweep

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP


def walk(mu):
    """(35): the variance of the walk a cycle, over σ²T²."""
    mu = np.asarray(mu, dtype=float)
    return (1 + np.exp(-mu)) / (1 - np.exp(-mu)) - 2 / mu


def curves(ax):
    found = {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}
    assert len(found) == sum(not line.get_label().startswith("_") for line in ax.lines)
    return found


# -- the block diagram ----------------------------------------------------------------------------

BOXES = {
    "integrator": r"$\int dt$",
    "feedback": r"$\omega_{bw}$",
    "exact": "exact integral\n" r"$\int x_1\,dt$",
    "digital": "trapezoidal rule, every $T$ s\n" r"$x_{3_n}=x_{3_{n-1}}+\frac{1}{2}(x_{1_n}+x_{1_{n-1}})T$",
}
#: Fig. 1 of savage2016: what leads where. x1 begins at the integrator and branches off three times.
PATHS = {
    ("", "first sum"),
    ("first sum", "integrator"),
    ("integrator", "exact"),
    ("integrator", "feedback"),
    ("feedback", "first sum"),
    ("integrator", "digital"),
    ("exact", "second sum"),
    ("digital", "second sum"),
    ("second sum", ""),
}


def test_block_diagram(ax):
    artists = figures.block_diagram(ax)
    texts = {
        each.get_text(): each.get_position() for each in artists if hasattr(each, "get_text") and each.get_text() != "−"
    }
    boxes = [each for each in artists if isinstance(each, Rectangle)]
    sums = sorted((each for each in artists if isinstance(each, Circle)), key=lambda each: each.center[0])
    assert len(boxes) == 4
    assert not any(circle.get_fill() for circle in sums)
    areas = {}
    for name, text in BOXES.items():
        (box,) = [each for each in boxes if inside(each, texts[text])]
        areas[name] = box
    for name, circle in zip(("first sum", "second sum"), sums, strict=True):
        areas[name] = circle
    heads = [each for each in artists if isinstance(each, FancyArrowPatch)]
    assert {type(each.get_arrowstyle()) for each in heads} == {ArrowStyle.CurveFilledB}
    straight = [points_of(line) for line in ax.lines]
    found = set()
    for head in heads:
        start, end = (tuple(float(x) for x in place) for place in head._posA_posB)
        while any(math.dist(start, later) < 1e-9 for _, later in straight):  # back along the corners
            start = next(earlier for earlier, later in straight if math.dist(start, later) < 1e-9)
        found.add((source(areas, heads, start), touching(areas, end)))
    assert found == PATHS
    assert len(heads) == len(PATHS)
    # What each signal is called, beside its line.
    assert beside(texts["$n_{p1}$"], (0.1, 3.6), (1.34, 3.6))
    assert beside(texts["$x_1$"], (3.4, 3.6), (5.9, 3.6))
    assert beside(texts["$x_2$"], (8.8, 3.6), (12.4, 3.6))
    assert beside(texts["$x_{3_n}$"], (11.1, 1.0), (12.4, 1.0))
    assert beside(texts["$e_n$"], (12.66, 2.3), (14.1, 2.3))
    # n_p1 − ω x1, and e = x3 − x2: the exact integral comes from above, the digital one from below.
    signs = [
        (each.get_text(), each.get_position())
        for each in artists
        if hasattr(each, "get_text") and each.get_text() in "−+"
    ]
    first, second = (circle.center for circle in sums)
    near_first = [(sign, y) for sign, (x, y) in signs if math.dist((x, y), first) < 0.8]
    near_second = sorted((y, sign) for sign, (x, y) in signs if math.dist((x, y), second) < 0.8)
    assert near_first == [("−", pytest.approx(3.1))]
    assert near_first[0][1] < first[1]  # beside the feedback, which comes from below
    assert [sign for _, sign in near_second] == ["+", "−"]
    assert near_second[0][0] < second[1] < near_second[1][0]
    assert len(signs) == 3


def inside(box, place):
    (x, y), width, height = box.get_xy(), box.get_width(), box.get_height()
    return x < place[0] < x + width and y < place[1] < y + height


def touching(areas, place):
    """The part at whose edge a line ends; empty for the edge of the diagram."""
    for name, area in areas.items():
        if isinstance(area, Circle):
            if math.dist(area.center, place) < area.radius + 0.02:
                return name
        else:
            (x, y), width, height = area.get_xy(), area.get_width(), area.get_height()
            if x - 0.02 <= place[0] <= x + width + 0.02 and y - 0.02 <= place[1] <= y + height + 0.02:
                return name
    return ""


def source(areas, heads, place):
    """The part from which a line comes; a line that branches off another comes from where that one does."""
    found = touching(areas, place)
    if found:
        return found
    for head in heads:
        (x0, y0), (x1, y1) = head._posA_posB
        if y0 == y1 == place[1] and x0 < place[0] < x1:
            return touching(areas, (x0, y0))
    return ""


def beside(place, start, end):
    return start[0] <= place[0] <= end[0] and 0.2 < place[1] - start[1] < 0.5


# -- curves ---------------------------------------------------------------------------------------


def test_accuracy(ax):
    mu = np.array([1e-9, 1e-2, 1.0, 5.0, 10.0])
    results = {
        "printed": Accuracy(mu, np.array([1e30, 1e30, 100.0, 1e-9, 0.5])),
        "stable": Accuracy(mu, np.array([0.5, 0.7, 0.1, 0.2, 0.3])),
    }
    figures.accuracy(results, ax)
    found = curves(ax)
    top = 2.0**53
    assert at(found["printed"], *zip(mu, [top, top, 100.0, 1e-2, 0.5], strict=True))
    assert at(found["stable"], *zip(mu, [0.5, 0.7, 0.1, 0.2, 0.3], strict=True))
    assert (look(found["printed"]), look(found["stable"])) == ((ORANGE, "", "x"), (GREEN, "", "o"))
    assert (set(found["no digit correct"].get_ydata()), look(found["no digit correct"])[:2]) == ({top}, (GREY, ":"))
    names = named(ax)
    assert near(names.pop("printed"), ORANGE, (1e-2, top))
    assert near(names.pop("stable"), GREEN, (1e-2, 0.7))
    assert near(names.pop("no digit correct"), GREY, (10, top))
    assert not names


def test_approximations(ax):
    figures.approximations(3, ax)
    found, names = curves(ax), named(ax)
    mu = np.array(found["(39)"].get_xdata())
    partial, first = np.zeros_like(mu), mu / 6
    # The series of (35): μ/6 − μ³/360 + μ⁵/15120.
    for label, text, paint, term in (
        ("(39)", "(39)", ORANGE, first),
        ("2 terms", "2", BLUE, -(mu**3) / 360),
        ("3 terms", "3 terms", PINK, mu**5 / 15120),
    ):
        partial += term
        with np.errstate(invalid="ignore"):
            expected = abs(np.sqrt(partial / walk(mu)) - 1)
        shown = np.isfinite(found[label].get_ydata()) & (mu > 0.1)  # the printed form of (35) cancels below
        assert found[label].get_ydata()[shown] == pytest.approx(expected[shown], rel=1e-6, abs=1e-11)
        assert look(found[label])[:2] == (paint, "--" if term is first else "-")
        place, (x, y) = names.pop(text)
        assert place == paint
        index = int(np.argmin(abs(mu - x)))
        assert (mu[index], found[label].get_ydata()[index]) == (x, y)
    assert (found[r"$\mu=2\pi$"].get_xdata()[0], look(found[r"$\mu=2\pi$"])[:2]) == (2 * np.pi, (GREY, ":"))
    assert near(names.pop(r"$2\pi$"), GREY, (2 * np.pi, 2e-6))
    assert not names


def test_powers(ax):
    figures.powers(ax)
    found = curves(ax)
    mu = np.array(found["bandwidth"].get_xdata())
    h = 1e-4
    power = (np.log(walk(mu * (1 + h))) - np.log(walk(mu * (1 - h)))) / (np.log(1 + h) - np.log(1 - h)) / 2
    chosen = mu > 0.1  # the printed form of (35) cancels below
    # σ √(walk(μ) T): bandwidth enters through μ alone, the rate through μ and through T.
    assert found["bandwidth"].get_ydata()[chosen] == pytest.approx(power[chosen], abs=1e-5)
    assert found["iteration rate"].get_ydata()[chosen] == pytest.approx(-power[chosen] - 0.5, abs=1e-5)
    assert {look(line)[:2] for line in found.values()} == {(GREEN, "-")}
    flat = [line for line in ax.lines if line not in found.values()]
    assert [(line.get_ydata()[0], *look(line)[:2]) for line in flat] == [(0.5, ORANGE, "--"), (-1.0, ORANGE, "--")]
    words = [(text.get_text(), tuple(text.xy), to_hex(text.get_color()).upper()) for text in ax.texts]
    assert words == [
        ("power of the bandwidth", (0.012, 0.5), GREEN),
        ("abstract", (100, 0.5), ORANGE),
        ("power of the iteration rate", (0.012, -1.0), GREEN),
        ("abstract", (100, -1.0), ORANGE),
    ]


SWEPT = WalkSweep(np.array([0.3, 1.0, 20.0]), 1000, 800, np.array([0.051, 0.17, 0.95]))


def test_random_walk(ax):
    figures.random_walk(SWEPT, ax)
    found, names = curves(ax), named(ax)
    x = np.array(found["(35)"].get_xdata())
    assert (x[0], x[-1]) == pytest.approx((0.2, 30))
    assert found["(35)"].get_ydata() == pytest.approx(np.sqrt(walk(x)))
    assert found["(39)"].get_ydata() == pytest.approx(np.sqrt(x / 6))
    assert at(
        found["simulation"], *((mu, math.sqrt(w)) for mu, w in zip((0.3, 1.0, 20.0), (0.051, 0.17, 0.95), strict=True))
    )
    assert {name: look(line)[:2] for name, line in found.items()} == {
        "(35)": (GREEN, "-"),
        "(39)": (ORANGE, "--"),
        "simulation": (BLUE, ""),
    }
    assert near(names.pop("(35)"), GREEN, (x[-1], math.sqrt(walk(x[-1]))))
    assert near(names.pop("(39)"), ORANGE, (x[-1] / 4, math.sqrt(x[-1] / 24)))
    assert near(names.pop("simulation"), BLUE, (10 * x[0], math.sqrt(10 * x[0] / 6)))
    assert not names


def test_deviations(ax):
    figures.deviations(SWEPT, ax)
    found, names = curves(ax), named(ax)
    error = math.sqrt(2 / 800)
    exact = [float(theory.error_variance(1000, mu)) / 1000 for mu in SWEPT.mu]
    assert exact == pytest.approx(walk(SWEPT.mu), rel=2e-3)
    assert at(
        found["from (35)"], *((mu, (w / e - 1) / error) for mu, w, e in zip(SWEPT.mu, SWEPT.walk, exact, strict=True))
    )
    # μ = 20 is more than six standard errors away from (39).
    assert at(
        found["from (39)"],
        *((mu, (w / (mu / 6) - 1) / error) for mu, w in zip(SWEPT.mu[:2], SWEPT.walk[:2], strict=True)),
    )
    assert (look(found["from (35)"]), look(found["from (39)"])) == ((BLUE, "", "o"), (ORANGE, "", "s"))
    (band,) = ax.patches
    assert (band.get_y(), band.get_height()) == (-2, 4)
    assert ax.get_xlim() == pytest.approx((0.3 / 1.5, 20 * 1.5))
    edge = 0.3 / 1.3
    assert near(names.pop("grey band: 95 % of all deviations"), GREY, (edge, 2))
    assert near(names.pop("dots: from (35)"), BLUE, (edge, -2))
    assert near(names.pop("squares: from (39)"), ORANGE, (edge, -2))
    assert not names


def test_build_up(ax):
    mu, n = 0.2, (1, 10, 100)
    process = theory.first_order(3.0, 0.4)
    runs = [
        experiment.IntegrationErrors(process, 2.0, theory.RULES[name], n, size * np.array([[1.0, -1], [2, 2], [5, -5]]))
        for name, size in (("trapezoidal", 1.5), ("rectangular, new sample", 30.0))
    ]
    figures.build_up(runs, mu, ax)
    found, names = curves(ax), named(ax)
    # In units of σ T = 3/2.
    assert at(found["trapezoidal"], (1, 1), (10, 2), (100, 5))
    assert at(found["rectangular"], (1, 20), (10, 40), (100, 100))
    x = np.array(found["exact, trapezoidal"].get_xdata())
    assert (x[0], x[-1]) == pytest.approx((1, 100))
    assert found["exact, trapezoidal"].get_ydata() == pytest.approx(np.sqrt(theory.error_variance(x, mu)))
    assert found["exact, rectangular"].get_ydata() == pytest.approx(np.sqrt(theory.rectangle_error_variance(x, mu)))
    assert found["random walk (35)"].get_ydata() == pytest.approx(np.sqrt(x * walk(mu)))
    assert {name: look(line) for name, line in found.items()} == {
        "trapezoidal": (BLUE, "", "o"),
        "rectangular": (PINK, "", "s"),
        "exact, trapezoidal": (GREEN, "-", ""),
        "exact, rectangular": (GREEN, "-", ""),
        "random walk (35)": (GREY, ":", ""),
    }
    assert labelled(ax) == {"trapezoidal": (BLUE, "", "o"), "rectangular": (PINK, "", "s")}
    assert not names


def test_rules_first_order(ax):
    figures.rules_first_order(("trapezoidal", "Simpson"), ax)
    found, names = curves(ax), named(ax)
    mu = np.array(found["trapezoidal"].get_xdata())
    assert found["trapezoidal"].get_ydata() == pytest.approx(np.ones(60))
    assert found["Simpson"].get_ydata() == pytest.approx(np.sqrt(1 + np.tanh(mu / 2) / 9 / walk(mu)), rel=1e-6)
    best = [theory.best_possible_rate(theory.first_order(1.0, one), 1.0) for one in mu.tolist()]
    assert found["scaled samples (lower bound)"].get_ydata() == pytest.approx(np.sqrt(best / walk(mu)), rel=1e-6)
    assert {name: look(line)[:2] for name, line in found.items()} == {
        "trapezoidal": (BLUE, "-"),
        "Simpson": (PINK, "-"),
        "scaled samples (lower bound)": (GREY, ":"),
    }
    assert near(names.pop("trapezoidal"), BLUE, (1, found["trapezoidal"].get_ydata()[-1]))
    assert near(names.pop("Simpson"), PINK, (1, found["Simpson"].get_ydata()[-1]))
    assert near(names.pop("scaled samples"), GREY, (1, found["scaled samples (lower bound)"].get_ydata()[-1]))
    assert not names


def test_rules_resonant(ax):
    figures.rules_resonant(("trapezoidal", "Simpson"), 0.05, ax)
    found = curves(ax)
    rate = np.array(found["Simpson"].get_xdata())
    assert (rate[0], rate[-1]) == pytest.approx((0.3, 30))
    process = theory.resonant(1.0, 2 * np.pi, 0.05)
    names = named(ax)
    for name, paint in (("trapezoidal", BLUE), ("Simpson", PINK)):
        assert near(names.pop(name), paint, (1, found[name].get_ydata()[-1]))
        expected = math.sqrt(theory.walk_rate(process, float(rate[77]), theory.RULES[name]))
        assert found[name].get_ydata()[77] == pytest.approx(expected)
        assert look(found[name])[:2] == (paint, "-")
    assert found["trapezoidal"].get_ydata()[77] != found["Simpson"].get_ydata()[77]


FORMATS = (FloatFormat(2, 11), FloatFormat(2, 20, CHOP))
FEW, MANY = map(bits_colour, FORMATS)


@pytest.fixture
def swept():
    rates = np.array([32.0, 64.0, 128.0])
    one = np.array([9.0, 3.0, 1.0])
    errors = (np.stack([one, one + 1]), np.stack([one * 0.01, one * 100]), np.stack([one * 7, one * 11]))
    return experiment.RateSweep(64.0, 2.0, 20, FORMATS, rates, *errors)


def test_errors_over_rate(ax, swept):
    figures.errors_over_rate(swept, ax)
    found, names = curves(ax), named(ax)
    assert at(found["discretization"], (32, 9), (64, 3), (128, 1))
    assert at(found["rounding, 11 bits"], (32, 0.09), (64, 0.03), (128, 0.01))
    assert at(found["rounding, 20 bits, chopped"], (32, 900), (64, 300), (128, 100))
    assert {name: look(line) for name, line in found.items()} == {
        "discretization": (BLUE, "", "x"),
        "rounding, 11 bits": (FEW, "", "s"),
        "rounding, 20 bits, chopped": (MANY, "", "D"),
    }
    open_ = [found[f"rounding, {word}"].get_markerfacecolor() == "none" for word in ("11 bits", "20 bits, chopped")]
    assert open_ == [False, True]
    lines = [line for line in ax.lines if line not in found.values()]
    for line, (fmt, field) in zip(
        lines, ((FORMATS[0], "discretization"), (FORMATS[0], "rounding"), (FORMATS[1], "rounding")), strict=True
    ):
        for index in (0, 39):
            expected = theory.two_errors(1.0, 64.0, float(line.get_xdata()[index]), 2.0, fmt)
            assert line.get_ydata()[index] == pytest.approx(getattr(expected, field))
        assert look(line)[:2] == (GREEN, "-")
    assert near(names.pop("discretization"), BLUE, (1, 1))
    assert near(names.pop("11 bits"), FEW, (1, 0.01))
    assert near(names.pop("20 bits, chopped"), MANY, (1, 100))
    assert not names


def test_names_that_would_collide_move_apart(ax, swept):
    close = np.array([9.0, 3.0, 1.05])
    figures.errors_over_rate(replace(swept, rounding=np.stack([close, close * 1.05])), ax)
    ax.figure.canvas.draw()
    boxes = {text.get_text(): Text.get_window_extent(text) for text in ax.texts}
    low, middle, high = (boxes[text] for text in ("discretization", "11 bits", "20 bits, chopped"))
    assert low.y1 < middle.y1
    assert middle.y1 < high.y1
    assert not low.overlaps(middle)
    assert not middle.overlaps(high)


def test_totals(ax, swept):
    figures.totals(replace(swept, rates=np.array([1000.0, 2000.0, 4000.0])), ax)
    found, names = curves(ax), named(ax)
    assert at(found["11 bits"], (1000, 63), (2000, 21), (4000, 7))
    assert at(found["20 bits, chopped"], (1000, 99), (2000, 33), (4000, 11))
    assert [look(line) for line in found.values()] == [(FEW, "", "s"), (MANY, "", "D")]
    line, star, other = (line for line in ax.lines if line not in found.values())
    for each, fmt in zip((line, other), FORMATS, strict=True):
        expected = theory.two_errors(1.0, 64.0, 1000.0, 2.0, fmt).total
        assert points_of(each)[0] == pytest.approx((1000, expected))
        assert look(each)[:2] == (GREEN, "-")
    # The best rate of the second format is beyond the axis.
    best = theory.best_rate(64.0, 2.0, FORMATS[0])
    assert best < 4000 < theory.best_rate(64.0, 2.0, FORMATS[1])
    assert at(star, (best, theory.two_errors(1.0, 64.0, best, 2.0, FORMATS[0]).total))
    assert (to_hex(star.get_markeredgecolor()).upper(), star.get_marker()) == (FEW, "*")
    assert near(names.pop("11 bits"), FEW, (1, 7))
    assert near(names.pop("20 bits, chopped"), MANY, (1, 11))
    assert not names


DURATIONS = {"1 minute": 60.0, "1 hour": 3600.0, "1 day": 86400.0}


def test_best_rates(ax):
    figures.best_rates(628.0, DURATIONS, [20, 24, 30], ax)
    names = named(ax)
    for i, ((text, seconds), paint) in enumerate(zip(DURATIONS.items(), (BLUE, PINK, VIOLET), strict=True)):
        nearest, chopped = ax.lines[2 * i : 2 * i + 2]
        for line, rounding in ((nearest, NEAREST), (chopped, CHOP)):
            assert line.get_ydata()[2] == theory.best_rate(628.0, seconds, FloatFormat(2, 30, rounding))
            assert [x for x, _ in points_of(line)] == [20, 24, 30]
        assert (look(nearest)[:2], look(chopped)[:2]) == ((paint, "-"), (paint, ":"))
        assert nearest.get_label() == text
        assert names[text][0] == paint
        assert names[text][1] == (1, nearest.get_ydata()[2])


def test_needed_bits(ax):
    figures.needed_bits(628.0, DURATIONS, [100.0, 1000.0], ax)
    names = named(ax)
    for i, ((text, seconds), paint) in enumerate(zip(DURATIONS.items(), (BLUE, PINK, VIOLET), strict=True)):
        nearest, chopped = ax.lines[2 * i : 2 * i + 2]
        for line, rounding in ((nearest, NEAREST), (chopped, CHOP)):
            expected = [theory.needed_precision(628.0, f, seconds, 2, rounding) for f in (100.0, 1000.0)]
            assert at(line, (100, expected[0]), (1000, expected[1]))
        assert (look(nearest)[:2], look(chopped)[:2]) == ((paint, "-"), (paint, ":"))
        assert nearest.get_label() == text
        assert names[text][0] == paint
        assert names[text][1] == (1, nearest.get_ydata()[1])
