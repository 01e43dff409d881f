"""Every label, colour and reference line in the figures of the Kalman filter belongs to the data it stands at."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PINK,
    PURPLE,
    at,
    labelled,
    legend_of,
    look,
    named,
    near,
)
from matplotlib.colors import to_hex

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.display.style import bits_colour
from gpbnb.report.gravity_probe_b import figures as gravity_probe_b_figures
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.answers import Answers
from gpbnb.report.gravity_probe_b.threshold import Share
from gpbnb.report.guarantees import figures as guarantee_figures
from gpbnb.report.kalman import figures

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
STEPS = np.array([1, 10, 100])


def run(precision, rounding, form, size, base=2):
    """A year with errors of its own: the rate's are largest, 4 size, half-way; the drift's reach 3 size."""
    case = year.YearCase(year.MODELS[0], base, precision, rounding, form)
    drift = size * np.array([[1.0, -2.0], [-3.0, 1.0], [0.5, 0.25]])
    rate = size * np.array([[0.0, 0.0], [1.0, -4.0], [2.0, 1.5]])
    one = size * np.array([5.0, 6.0, 7.0])
    return year.Year(case, STEPS, drift, rate, one, 2 * one, 3 * one, one, None, None, 0.0)


def digits(precision, chopped=False):
    """t for which 0.5 · 10^(1−t) is the unit roundoff of so many bits."""
    return 1 - math.log10(2 * 2.0 ** ((1 if chopped else 0) - precision))


@pytest.mark.parametrize(
    ("quantity", "values", "words"),
    [
        ("drift", [2.0, 3.0, 0.5], "error of the drift angle (mas)"),
        ("rate", [None, 4.0, 2.0], "error of the drift rate (mas/yr)"),
        ("gain", [10.0, 12.0, 14.0], "relative error of the gain"),
        ("covariance", [15.0, 18.0, 21.0], "relative error of the covariance"),
    ],
    ids=["drift", "rate", "gain", "covariance"],
)
def test_years(ax, quantity, values, words):
    runs = [
        run(24, NEAREST, Form.HUNG, 1.0),
        run(30, CHOP, Form.HUNG_SECOND_GAIN, 10.0),
        run(24, NEAREST, Form.INNOVATION, 100.0),
        run(24, CHOP, Form.JOSEPH, 1000.0),
        run(7, NEAREST, Form.UD, 1e4, base=10),
    ]
    *curves, tolerance = gravity_probe_b_figures.years(runs, quantity, ax, tolerance=0.3)
    for curve, size in zip(curves, (1.0, 10.0, 100.0, 1000.0, 1e4), strict=True):
        assert at(curve, *((step, size * v) for step, v in zip((1, 10, 100), values, strict=True) if v))
    paints = [bits_colour(each.case.fmt) for each in runs]
    assert [look(curve) for curve in curves] == [(paint, "-", "o") for paint in paints]
    assert paints[0] == paints[2] == paints[3] != paints[1]  # the colour is that of the bits
    assert [curve.get_markerfacecolor() == "none" for curve in curves] == [False, True, False, True, False]
    assert [curve.get_label() for curve in curves] == [
        "24 bits",
        "30 bits, chopped, Hung (1984), second gain",
        "24 bits, innovation",
        "24 bits, chopped, Joseph",
        "7 decimal digits, UD",
    ]
    assert (set(tolerance.get_ydata()), look(tolerance)[:2], tolerance.get_label()) == ({0.3}, (GREY, ":"), "tolerance")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("step $k$", words)
    names = named(ax)
    for curve, paint in zip(curves, paints, strict=True):
        assert near(names.pop(curve.get_label()), paint, (1, curve.get_ydata()[-1]))
    assert near(names.pop("tolerance"), GREY, (1, 0.3))
    assert not names


def test_years_with_limits(ax):
    one = run(24, NEAREST, Form.HUNG, 1.0)
    limits = [
        gravity_probe_b_figures.Limit("holds", STEPS, [7.0, 8.0, 9.0], holds=True),
        gravity_probe_b_figures.Limit("printed", STEPS, [2.0, 3.0, 4.0]),
        gravity_probe_b_figures.Limit("level", STEPS, 0.5),
    ]
    _, *drawn = gravity_probe_b_figures.years([one], "gain", ax, limits=limits)
    assert [(line.get_label(), *look(line)) for line in drawn] == [
        ("holds", GREEN, "-", ""),
        ("printed", ORANGE, "--", ""),
        ("level", ORANGE, "-.", ""),
    ]
    assert at(drawn[0], (1, 7), (10, 8), (100, 9))
    assert at(drawn[2], (1, 0.5), (10, 0.5), (100, 0.5))
    names = named(ax)
    assert near(names.pop("holds"), GREEN, (1, 9))
    assert near(names.pop("printed"), ORANGE, (1, 4))
    assert near(names.pop("level"), ORANGE, (1, 0.5))
    assert set(names) == {"24 bits"}


def test_bound_by_digits(ax):
    (printed,) = figures.bound_by_digits(ax, {}, ls="--")
    assert look(printed)[:2] == (ORANGE, "--")
    places = np.array(printed.get_xdata())
    assert (places[0], places[-1], len(places)) == (3.5, 23, 50)
    beta = Fraction(0.5 * 10.0 ** (1 - places[7]))
    steps = figures.report_bounds.EXAMPLE[0]
    assert printed.get_ydata()[7] == figures.report_bounds.gravity_probe_b_bound(beta, steps)
    # First order in β: a straight line down, a decade for a digit.
    slope = np.diff(np.log10(np.array(printed.get_ydata(), dtype=float))) / np.diff(places)
    assert slope == pytest.approx(-1, abs=1e-9)
    heights = figures.bound_by_steps([10, 1000], FloatFormat(2, 24), {})
    assert heights == [figures.report_bounds.gravity_probe_b_bound(Fraction(1, 2**24), k) for k in (10, 1000)]


ANSWERS = {
    "tolerance": 0.7,
    "printed": (9, 17),
    "formula": (10, 16),
    "corrected": (12, 13),
    "observed": {NEAREST: 10.25, CHOP: 11.75},
    "bits": 32,
    "error": 0.6,
}


def answers():
    runs = [
        run(24, NEAREST, Form.HUNG, 1.0),
        run(32, NEAREST, Form.HUNG, 2.0),
        run(24, CHOP, Form.HUNG, 8.0),
        run(40, NEAREST, Form.UD, 16.0),
        run(40, CHOP, Form.JOSEPH, 32.0),
    ]
    return Answers(runs=runs, **ANSWERS)


@pytest.mark.parametrize("others", [False, True], ids=["front", "others"])
def test_digits_needed(ax, others):
    gravity_probe_b_figures.digits_needed(answers(), ax, others)
    lines = {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}
    assert list(lines) == legend_of(ax)
    assert at(lines["emulated, rounded"], (digits(24), 4), (digits(32), 8), (digits(40), 64))
    assert at(lines["emulated, chopped"], (digits(24, True), 32), (digits(40, True), 128))
    size = 6.6e3  # mas, the geodetic drift of a year
    assert float(figures.report_bounds.YEAR_SIZE) == pytest.approx(size, rel=0.01)
    size = float(figures.report_bounds.YEAR_SIZE)
    assert at(lines["asked for in print"], (9, size), (17, size))
    expected = {
        "emulated, rounded": (BLUE, BLUE, "o"),
        "emulated, chopped": (BLUE, "none", "o"),
        "asked for in print": (ORANGE, "none", "o"),
    }
    if others:
        assert at(lines["by the printed formula"], (10, size), (16, size))
        assert at(lines["by the corrected formula"], (12, size), (13, size))
        expected |= {"by the printed formula": (BLACK, "none", "s"), "by the corrected formula": (BLACK, "none", "^")}
    assert {
        name: (line.get_markeredgecolor(), line.get_markerfacecolor(), line.get_marker())
        for name, line in lines.items()
    } == expected
    printed, corrected = (line for line in ax.lines if look(line)[0] == ORANGE and len(line.get_xdata()) > 2)
    assert (look(printed)[1], look(corrected)[1]) == ("--", "-.")
    bound, x = figures.report_bounds.gravity_probe_b_bound, Fraction(0.5 * 10.0 ** (1 - 3.5))
    assert printed.get_ydata()[0] == bound(x, figures.report_bounds.EXAMPLE[0])
    every = {"once": True, "free_signs": True, "carried": True}
    assert corrected.get_ydata()[0] == bound(x, figures.report_bounds.EXAMPLE[0], **every)
    dotted = [line for line in ax.lines if look(line)[:2] == (GREY, ":")]
    assert [line.get_xdata()[0] for line in dotted[:2]] == [pytest.approx(digits(24)), pytest.approx(digits(53))]
    assert [set(line.get_ydata()) for line in dotted[2:]] == [{0.7}, {size}]
    ring, stem = ax.lines[-2:]
    assert at(ring, (digits(32), 0.6))
    assert (look(ring), ring.get_markerfacecolor()) == ((BLACK, "", "o"), "none")
    assert at(stem, (digits(32), 1e-12), (digits(32), 0.02))
    names = named(ax)
    assert near(names.pop("32 bits or\n10.3 digits"), BLACK, (digits(32), 1e-6))
    assert near(names.pop("binary32"), GREY, (digits(24), 1e-12))
    assert near(names.pop("binary64"), GREY, (digits(53), 1e-12))
    assert near(names.pop("tolerance"), GREY, (1, 0.7))
    assert near(names.pop("drift in\na year"), GREY, (1, size))
    assert {names.pop(word)[0] for word in ("(125)\nas printed", "(125), errors corrected")} == {ORANGE}
    assert not names
    (bits,) = ax.child_axes  # the axis of bits at the top
    assert (bits.get_xlabel(), list(bits.get_xticks())) == ("bits", [16, 24, 32, 40, 53, 64])
    ax.figure.canvas.draw()
    low, high = ax.get_xlim()
    assert bits.get_xlim() == pytest.approx((1 + (low - 1) * math.log2(10), 1 + (high - 1) * math.log2(10)))


def test_contraction(ax):
    state = np.array([[9.0, -1.0], [9.0, 0.0], [9.0, 3.0]])
    bound = np.array([[8.0, 2.0], [8.0, 4.0], [8.0, 6.0]])
    found = SimpleNamespace(history=SimpleNamespace(steps=STEPS, state=state), state=bound)
    points, line, *labels = figures.contraction(found, 1, ax, "rate (mas/yr)")
    assert at(points, (1, 1), (100, 3))  # a logarithmic axis has no place for zero
    assert at(line, (1, 2), (10, 4), (100, 6))
    assert (points.get_color(), line.get_color()) == (BLUE, GREEN)
    assert (points.get_label(), line.get_label()) == ("observed", "contraction bound")
    assert [(each.get_text(), each.get_color(), each.xy) for each in labels] == [
        ("contraction bound", GREEN, (100, 6)),
        ("observed", BLUE, (100, 3)),
    ]


def test_shares(ax):
    def share(states, precision, errors):
        return Share("", states, "", FloatFormat(2, precision), np.array(errors), 0, 0.0, 0.0, 0.0)

    found = [
        share("7 states", 24, [3.0, 1.0]),
        share("9 states", 24, [8.0, 4.0, 6.0]),
        share("7 states", 32, [0.5, 0.25]),
    ]
    *artists, tolerance = gravity_probe_b_figures.shares(found, ax, tolerance=2.5)
    first, second, median, third, other = artists
    assert at(first, (24 + 0.15 - 0.3, 1), (24 + 0.45 - 0.3, 3))
    assert at(second, (32 + 0.15 - 0.3, 0.25), (32 + 0.45 - 0.3, 0.5))
    assert at(median, (24, 2), (32, 0.375))
    assert at(third, (23.8, 4), (24, 6), (24.2, 8))
    assert at(other, (24, 6))
    assert labelled(ax) == {
        "7 states, median": (BLUE, "", "_"),
        "9 states, median": (PURPLE, "", "_"),
        "tolerance": (GREY, ":", ""),
    }
    assert [look(each)[0] for each in artists] == [BLUE, BLUE, BLUE, PURPLE, PURPLE]
    assert set(tolerance.get_ydata()) == {2.5}
    assert ax.get_xlabel() == "bits"
    ax.clear()
    gravity_probe_b_figures.shares([found[0]._replace(fmt=FloatFormat(10, 8))], ax)
    assert ax.get_xlabel() == "decimal digits"


def test_guarantee(ax):
    found = SimpleNamespace(bound=np.array([9.0, 3.0]))
    chosen, random = np.array([[5.0, -0.5], [5.0, 1.5], [5.0, 2.5]]), np.array([[4.0, 0.1], [4.0, -0.2], [4.0, 0.3]])
    guarantee_figures.draw_errors(ax, found, chosen, random, 1, "speed, m/s")
    (bound,) = ax.lines
    adversary, noise = ax.collections
    assert at(bound, (1, 3), (2, 3), (3, 3))
    for band, heights in ((adversary, [0.5, 1.5, 2.5]), (noise, [0.1, 0.2, 0.3])):
        assert sorted({float(y) for y in band.get_paths()[0].vertices[:, 1]}) == heights
    assert legend_of(ax) == [
        "bound for every measurement sequence",
        "measurements chosen by the adversary",
        "random measurements",
    ]
    paints = [to_hex(band.get_facecolor()[0]).upper() for band in (adversary, noise)]
    assert (look(bound)[0], paints) == (GREEN, [BLUE, PINK])
    assert ax.get_ylim() == pytest.approx((3e-3, 150))
