"""gpbnb.report.kalman.figures: what is drawn is the result; axes, legends and colours say what it is."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
from drawn import colour, legend_of

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.bounded_run import emulate_with_bound
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.report.display import style
from gpbnb.report.gravity_probe_b import figures as gravity_probe_b_figures
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.answers import decimal_digits
from gpbnb.report.kalman import ensembles, figures, report_bounds, smallest

USUAL = year.MODELS[0]
TWENTY_FOUR = year.YearCase(USUAL, 2, 24, Rounding.NEAREST, Form.HUNG)


@pytest.fixture(scope="module")
def runs():
    return {run.case: run for run in year.load()}


@pytest.mark.parametrize(
    ("fmt", "number"),
    [(FloatFormat(10, 7), 7), (FloatFormat(10, 7, Rounding.CHOP), 7 - np.log10(2)), (FloatFormat(2, 1), 1)],
)
def test_decimal_digits_invert_8(fmt, number):
    found = decimal_digits(fmt)
    assert found == pytest.approx(number, abs=1e-12)
    assert 0.5 * 10 ** (1 - found) == pytest.approx(float(fmt.unit_roundoff), rel=1e-12)


def test_years(ax, runs):
    chosen = [runs[TWENTY_FOUR], runs[TWENTY_FOUR._replace(form=Form.UD, rounding=Rounding.CHOP)]]
    *curves, tolerance = gravity_probe_b_figures.years(chosen, "rate", ax, tolerance=1.0)
    for curve, run in zip(curves, chosen, strict=True):
        assert np.array_equal(curve.get_xdata(), run.steps)
        assert np.array_equal(curve.get_ydata(), np.maximum(*np.abs(run.rate).T))
    assert {colour(curve) for curve in curves} == {style.bits_colour(TWENTY_FOUR.fmt)}
    assert [curve.get_markerfacecolor() == "none" for curve in curves] == [False, True]
    assert list(tolerance.get_ydata()) == [1, 1]
    assert [curve.get_label() for curve in curves] == ["24 bits", "24 bits, chopped, UD"]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("step $k$", "error of the drift rate (mas/yr)")


@pytest.mark.parametrize("quantity", ["gain", "covariance"])
def test_years_of_a_norm(ax, runs, quantity):
    (curve,) = gravity_probe_b_figures.years([runs[TWENTY_FOUR]], quantity, ax)
    assert np.array_equal(curve.get_ydata(), getattr(runs[TWENTY_FOUR], quantity))
    assert ax.get_ylabel() == f"relative error of the {quantity}"


def test_years_refuse_what_they_cannot_draw(ax, runs):
    run = runs[TWENTY_FOUR]
    with pytest.raises(ValueError, match="got quantity 'speed'; needed one of drift, rate"):
        gravity_probe_b_figures.years([run], "speed", ax)
    reference = year.Year(run.case.reference, *(getattr(run, name) for name in list(vars(run))[1:]))
    with pytest.raises(ValueError, match="got the reference among the runs"):
        gravity_probe_b_figures.years([reference], "rate", ax)


def test_where_the_bound_is_as_large_as_the_drift_the_digits_are_those_of_the_example(ax):
    (line,) = figures.bound_by_digits(ax, {}, ls="--")
    size = report_bounds.YEAR_SIZE
    crossing = float(np.interp(-np.log10(float(size)), -np.log10(line.get_ydata()), line.get_xdata()))
    counts = report_bounds.coefficients(*report_bounds.EXAMPLE)
    assert int(np.ceil(crossing)) == report_bounds.precision_for_coefficient(sum(counts))


def test_contraction(ax):
    case = smallest.scalar(FloatFormat(2, 24), r="0.5", z="1")
    model = LinearModel(case.Phi, case.H, case.Q, case.R, case.x, case.P)
    found = emulate_with_bound(
        model, np.arange(1.0, 9.0).reshape(8, 1) / 3, FloatFormat(2, 24), checkpoint_steps=range(1, 9)
    )
    points, line, *labels = figures.contraction(found, 0, ax, "x (m)")
    error = np.abs(found.history.state[:, 0])
    assert list(points.get_ydata()) == [e for e in error if e > 0]
    assert np.array_equal(line.get_ydata(), found.state[:, 0])
    assert points.get_linestyle() == "None"
    assert (colour(points), colour(line)) == (style.OBSERVED, style.VALID)
    assert [(each.get_text(), each.get_color(), each.xy) for each in labels] == [
        ("contraction bound", style.VALID, (6, found.state[5, 0])),
        ("observed", style.OBSERVED, (6, error[5])),
    ]
    assert ax.get_ylabel() == "error of x (m)"


def summary(**numbers):
    names = ensembles.Summary._fields
    filled = {name: "" if name in ("kind", "form") else 0 for name in names}
    return ensembles.Summary(**{**filled, **numbers})


def test_violations(ax):
    found = [
        summary(kind="a", form="hung", trials=10, violations_105=10, violations_108=5, violations_125=0),
        summary(kind="b", form="hung", trials=30, violations_105=10, violations_108=5, violations_125=1),
        summary(kind="a", form="ud", trials=20, violations_105=5, violations_108=0, violations_125=2),
    ]
    bars = figures.violations(found, ax)
    assert [bar.get_height() for bar in bars] == pytest.approx([50, 25, 25, 0, 2.5, 10])
    assert [label.get_text() for label in ax.get_xticklabels()] == ["Hung (1984)", "UD"]
    assert legend_of(ax) == ["(105)", "(108)", "(125)"]
    assert ax.get_ylabel() == "filters that violate the bound (%)"


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 2), (10, 2)])
def test_the_blocks_of_a_step_count_the_operations_of_matrix_products(n, m):
    """An n × k times k × p product takes np(2k - 1) operations, a sum of matrices one for each entry."""

    def product(rows, inner, columns):
        return rows * columns * (2 * inner - 1)

    found = [part.operations for part in figures.step_parts(n, m)]
    covariance = 2 * product(n, n, n) + n * n
    update = product(n, m, n) + n * n + product(n, n, n)
    state = [product(n, n, 1), product(m, n, 1) + m, product(n, m, 1) + n]
    assert found[:1] + found[2:] == [covariance, update, *state]
    # The gain inverts a matrix: with one measurement by one division, with two by elimination.
    without_inverse = product(n, n, m) + product(m, n, m) + m * m + product(n, m, m)
    assert found[1] - without_inverse == {1: 1, 2: 15}[m]


def test_the_block_diagram_shows_each_part_with_its_share():
    parts = figures.step_parts(10, 2)
    fig, (ax,) = style.figure(height=2.9)
    words = [text.get_text() for text in figures.block_diagram(parts, ax)]
    fig.canvas.draw()
    assert style.defects(fig) == []
    total = sum(part.operations for part in parts)
    for part, text in zip(parts, words, strict=False):
        assert text.splitlines()[0] == part.name
        assert text.splitlines()[2] == f"{part.operations:,}, {100 * part.operations / total:.1f} %"


def test_the_waterfall_leads_from_the_printed_digits_to_the_corrected_ones():
    fig, (ax,) = style.figure(height=3.6)
    bars = figures.waterfall(ax, Fraction(1, 6606), observed=10.3)
    fig.canvas.draw()
    assert style.defects(fig) == []
    ends = [bar.get_x() + bar.get_width() for bar in bars]
    # What is written adds up, and is right to its last place.
    written = [text.get_text().replace("−", "-") for text in ax.texts if "year" not in text.get_text()]
    numbers = [[float(each) for each in re.findall(r"[-+]?\d+\.\d\d", words)] for words in written]
    assert [each[0] for each in numbers] == [round(end, 2) for end in ends]
    assert np.cumsum([each[-1] for each in numbers]) == pytest.approx([each[0] for each in numbers], abs=1e-9)
    # Each bar begins where the last one ended.
    assert [bar.get_x() for bar in bars] == pytest.approx([0, *ends[:-1]])
    # β = 1/coefficient = 0.5 × 10^(1-t), as printed and by the counts of the chapter.
    k, n, m = 3_153_600, 10, 2
    second = k * (3 * n + 1) + k * (k - 1) // 2 * (7 * n + 3 * m + 6)
    coefficients = [2.6490e8, 1.2949e16, second, second * 6606]
    assert ends[:4] == pytest.approx([1 + np.log10(each / 2) for each in coefficients], rel=1e-12)
    last = report_bounds.coefficients(k, n, m, **report_bounds.ALL_CORRECTED)
    assert ends[-1] == pytest.approx(1 + np.log10(float(last.second) * 6606 / 2), rel=1e-12)


def test_the_ladder_shows_angles_and_last_places_at_their_size():
    fig, (ax,) = style.figure(height=4.4)
    formats = [FloatFormat(2, 24), FloatFormat(10, 9)]
    drawn = gravity_probe_b_figures.ladder(formats, ax)
    fig.canvas.draw()
    assert style.defects(fig) == []
    heights = {note.get_text(): float(note.xy[1]) for note in drawn[len(drawn) // 2 :]}
    assert [float(line.get_ydata()[0]) for line in drawn[: len(drawn) // 2]] == list(heights.values())
    assert heights["aberration of starlight, Earth"] == pytest.approx(20_500)
    assert heights["geodetic drift in a step"] == pytest.approx(6606.1 / 3_153_600)
    # 6606.1 has thirteen bits, or four digits, before the point.
    assert heights["last place, 24 bits"] == pytest.approx(2.0**-11)
    assert heights["last place, 9 decimal digits"] == pytest.approx(1e-5)
