"""gpbnb.report.kalman.figures: what is drawn is the result; axes, legends and colours say what it is."""

from __future__ import annotations

import numpy as np
import pytest
from drawn import colour

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.display import style
from gpbnb.report.gravity_probe_b import figures as gravity_probe_b_figures
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.answers import decimal_digits
from gpbnb.report.kalman import figures, report_bounds

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
