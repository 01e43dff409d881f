"""Every name, arrow and reference line in the figures of matrix inversion belongs to what it stands at."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
from drawn import BLACK, BLUE, GREEN, GREY, ORANGE, at, labelled, look, named, near
from matplotlib.colors import to_hex
from matplotlib.patches import ArrowStyle, FancyArrowPatch

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import figures
from gpbnb.report.inversion.example import PrintedColumn, Wordlength
from gpbnb.report.inversion.experiment import Frozen, InverseTrial

#: Figure III-1 of hung1984: what follows from what.
ARROWS = {
    ("Given matrix $A$", "Triangularize $A$ into $A_T$"),
    ("Triangularize $A$ into $A_T$", "Transform each $u_j$ into $b_j$:\n$A_T x_j = b_j$"),
    ("Triangularize $A$ into $A_T$", "$\\tilde A$, error in $A_T$, (59)"),
    (
        "Transform each $u_j$ into $b_j$:\n$A_T x_j = b_j$",
        "Back substitution:\n$\\hat A^{-1} = [x_1 \\;\\ldots\\; x_n]$",
    ),
    ("Transform each $u_j$ into $b_j$:\n$A_T x_j = b_j$", "$\\tilde b_j$, error in $b_j$, (60)"),
    ("Back substitution:\n$\\hat A^{-1} = [x_1 \\;\\ldots\\; x_n]$", "$\\Delta A$ and $\\Delta b_j$, (89), (90)"),
    (
        "Back substitution:\n$\\hat A^{-1} = [x_1 \\;\\ldots\\; x_n]$",
        "$\\delta(A^{-1}) = \\hat A^{-1}\\;[\\,\\delta b_j - \\delta A\\,x_j\\,]$, (95)",
    ),
    ("$\\tilde A$, error in $A_T$, (59)", "$\\tilde b_j$, error in $b_j$, (60)"),
    ("$\\tilde b_j$, error in $b_j$, (60)", "$\\Delta A$ and $\\Delta b_j$, (89), (90)"),
    (
        "$\\Delta A$ and $\\Delta b_j$, (89), (90)",
        "$\\delta A = \\tilde A + \\Delta A$\n$\\delta b_j = \\tilde b_j + \\Delta b_j$",
    ),
    (
        "$\\delta A = \\tilde A + \\Delta A$\n$\\delta b_j = \\tilde b_j + \\Delta b_j$",
        "$\\delta(A^{-1}) = \\hat A^{-1}\\;[\\,\\delta b_j - \\delta A\\,x_j\\,]$, (95)",
    ),
    ("$\\delta(A^{-1}) = \\hat A^{-1}\\;[\\,\\delta b_j - \\delta A\\,x_j\\,]$, (95)", "Bound $\\|\\delta(A^{-1})\\|$"),
}
ERRORS = {
    "$\\tilde A$, error in $A_T$, (59)",
    "$\\tilde b_j$, error in $b_j$, (60)",
    "$\\Delta A$ and $\\Delta b_j$, (89), (90)",
}
ERRORS |= {"$\\delta A = \\tilde A + \\Delta A$\n$\\delta b_j = \\tilde b_j + \\Delta b_j$"}
#: What follows from both sides.
RESULTS = {
    "$\\delta(A^{-1}) = \\hat A^{-1}\\;[\\,\\delta b_j - \\delta A\\,x_j\\,]$, (95)",
    "Bound $\\|\\delta(A^{-1})\\|$",
}


def test_flow_chart(ax):
    artists = figures.flow_chart(ax)
    boxes = {text.get_position(): text for text in artists if hasattr(text, "get_text")}
    arrows = [arrow for arrow in artists if isinstance(arrow, FancyArrowPatch)]
    ax.figure.canvas.draw()
    found = set()
    for arrow in arrows:
        start, end = (tuple(float(x) for x in place) for place in arrow._posA_posB)
        found.add((boxes[start].get_text(), boxes[end].get_text()))
        assert arrow.patchA is boxes[start].get_bbox_patch()
        assert arrow.patchB is boxes[end].get_bbox_patch()
        # The head is at the end alone.
        assert type(arrow.get_arrowstyle()) is ArrowStyle.CurveFilledB
        assert to_hex(arrow.get_edgecolor()).upper() == GREY
    assert found == ARROWS
    assert len(arrows) == len(ARROWS)
    assert len(boxes) == 10
    edges = {text.get_text(): to_hex(text.get_bbox_patch().get_edgecolor()).upper() for text in boxes.values()}
    assert {text for text, edge in edges.items() if edge == ORANGE} == ERRORS | RESULTS
    assert {edge for text, edge in edges.items() if text not in ERRORS | RESULTS} == {BLUE}
    # The computation runs downwards on the left, the errors on the right.
    assert all(x > 0.5 for (x, _), text in boxes.items() if text.get_text() in ERRORS)
    assert all(boxes_y(boxes, start) >= boxes_y(boxes, end) - 0.02 for start, end in ARROWS)


def boxes_y(boxes, words):
    return next(y for (_, y), text in boxes.items() if text.get_text() == words)


def test_table1(ax):
    def column(kind, *values):
        return PrintedColumn(kind, Wordlength("t = places", Rounding.NEAREST), "", "column sum", False, values)

    bounds = [column("bound", 5e-2, 5e-4, 5e-7), column("bound", 9e-2, 9e-4, 9e-7)]
    errors = [column("error", 2e-4, 2e-6, 2e-9)]
    first, printed_bound, second, printed_error = figures.table1(bounds, errors, ax)
    left, right = -0.16, 0.16
    expected = [(left, 5e-2), (left, 9e-2), (1 + left, 5e-4), (1 + left, 9e-4), (2 + left, 5e-7), (2 + left, 9e-7)]
    assert at(first, *expected)
    assert at(second, (right, 2e-4), (1 + right, 2e-6), (2 + right, 2e-9))
    # The numbers of Table 1 in hung1984, ch. II.
    assert at(printed_bound, (left, 3.706e-2), (1 + left, 3.706e-4), (2 + left, 3.706e-7))
    assert at(printed_error, (right, 7.782e-5), (1 + right, 4.530e-7), (2 + right, 4.672e-10))
    assert [to_hex(each.get_color()).upper() for each in (first, second)] == [ORANGE, BLUE]
    assert [look(each)[::2] for each in (printed_bound, printed_error)] == [(BLACK, "s"), (BLACK, "o")]
    names = named(ax)
    assert near(names.pop("all readings\nof the bound"), ORANGE, (left, 9e-2))
    assert near(names.pop("bound as\nprinted"), BLACK, (left, 3.706e-2))
    assert near(names.pop("all readings\nof the error"), BLUE, (right, 2e-4))
    assert near(names.pop("error as\nprinted"), BLACK, (right, 7.782e-5))
    assert not names
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["3", "5", "8"]


def test_violations(ax):
    rows = [
        {"family": family, "format": "all", "bound": bound, "regular": "40", "violations_regular": str(4 * k + i)}
        for i, family in enumerate(("random", "Kahan", "all"))
        for k, bound in enumerate(("one", "two", "three", "four"))
    ]
    points = figures.violations(Frozen({}, tuple(rows)), ("one", "two", "three", "four"), ax)
    for k, each in enumerate(points):
        assert at(each, (10 * k, 0.12 * (k - 1.5)), (10 * k + 2.5, 1 + 0.12 * (k - 1.5)))
    filled = [(each.get_marker(), each.get_markerfacecolor()) for each in points]
    assert filled == [("o", ORANGE), ("o", "none"), ("s", ORANGE), ("s", "none")]
    assert list(labelled(ax)) == ["one", "two", "three", "four"]
    assert [marker for _, _, marker in labelled(ax).values()] == ["o", "o", "s", "s"]
    assert [handle.get_markerfacecolor() for handle in ax.get_legend().legend_handles] == [ORANGE, "none"] * 2
    assert ax.yaxis_inverted()


class Matrix(NamedTuple):
    format: FloatFormat
    rows: int

    def __len__(self) -> int:
        return self.rows


def trial(n, condition, error, **bounds):
    matrix = Matrix(FloatFormat(2, 11), n)
    return InverseTrial("random", matrix, None, True, condition, Fraction(error), bounds)


def test_ratios_against_size(ax):
    trials = [
        trial(2, 3.0, "1/8", loose=4.0, tight=0.5),
        trial(2, 3.0, "1/8", loose=2.0, tight=0.25),
        trial(2, 3.0, "1/8", loose=1.0),
        trial(5, 3.0, "1/4", loose=8.0, tight=0.75),
        trial(5, 3.0, "0", loose=8.0, tight=0.75),  # no error: no ratio
    ]
    loose, tight, error = figures.ratios(trials, ("loose", "tight"), ax)
    assert at(loose, (2, 16), (5, 32))
    assert at(tight, (2, 3), (5, 3))
    assert [look(each) for each in (loose, tight)] == [(GREEN, "-", "o"), (GREEN, "-", "s")]
    assert [each.get_label() for each in (loose, tight)] == ["loose", "tight"]
    assert (set(error.get_ydata()), look(error)[:2]) == ({1}, (BLUE, "-"))
    names = named(ax)
    assert near(names.pop("loose"), GREEN, (1, 32))
    assert near(names.pop("tight"), GREEN, (1, 3))
    assert near(names.pop("error"), BLUE, (1, 1))
    assert not names


def test_ratios_against_condition(ax):
    trials = [
        trial(3, 90.0, "1/8", loose=4.0, middle=3.0, tight=0.5),
        trial(3, 10.0, "1/4", loose=2.0, middle=1.0, tight=0.25),
    ]
    loose, middle, tight, error, limit = figures.ratios(trials, ("loose", "middle", "tight"), ax, "condition")
    assert at(loose, (10, 8), (90, 32))
    assert at(middle, (10, 4), (90, 24))
    assert at(tight, (10, 1), (90, 4))
    assert [look(each) for each in (loose, middle, tight)] == [(GREEN, "", mark) for mark in "osD"]
    assert (set(error.get_ydata()), look(error)[0]) == ({1}, BLUE)
    assert (set(limit.get_xdata()), look(limit)[:2]) == ({2**11}, (GREY, ":"))  # one over the unit roundoff
    names = named(ax)
    assert near(names.pop("loose"), GREEN, (90, 32))
    assert near(names.pop("middle"), GREEN, (10, 4))
    assert near(names.pop("tight"), GREEN, (10, 1))
    assert near(names.pop(r"$1/\beta$"), GREY, (2**11, ax.get_ylim()[1]))
    assert near(names.pop("error"), BLUE, (10, 1))
    assert not names
    assert np.isclose(ax.get_ylim()[0], 0.4)
