"""gpbnb.report.gravity_probe_b.answers: the digits that a year asks for."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.display import style
from gpbnb.report.gravity_probe_b import answers, year
from gpbnb.report.gravity_probe_b import figures as gravity_probe_b_figures
from gpbnb.report.kalman import figures, report_bounds
from gpbnb.report.wordlengths import study


def test_the_answers_are_those_of_the_example_and_of_the_years():
    found = answers.find_answers()
    first, second = report_bounds.coefficients(*report_bounds.EXAMPLE)
    for digits, coefficient in zip(found.formula, (first, second), strict=True):
        assert coefficient * 0.5 * 10.0 ** (1 - digits) <= 1 < coefficient * 0.5 * 10.0 ** (2 - digits)
    assert found.printed == (9, 17)
    assert all(corrected > formula for corrected, formula in zip(found.corrected, found.formula, strict=True))
    for rounding, digits in found.observed.items():
        met = [run for run in found.runs if run.case.rounding is rounding and answers.largest(run) <= 1]
        assert digits == min(answers.decimal_digits(run.case.fmt) for run in met)
        fewer = [r for r in found.runs if r.case.rounding is rounding and answers.decimal_digits(r.case.fmt) < digits]
        assert fewer
        assert min(answers.largest(run) for run in fewer) > 1
    assert found.observed[Rounding.NEAREST] == 10


def test_what_counts_is_the_year_and_not_its_end_alone():
    """Nine decimal digits end within the tolerance, and were beyond it before."""
    (nine,) = (run for run in answers.find_answers().runs if (run.case.base, run.case.precision) == (10, 9))
    assert max(np.abs(nine.drift[-1]).max(), np.abs(nine.rate[-1]).max()) < 1 < answers.largest(nine)
    assert answers.largest(nine) == np.abs(np.hstack([nine.drift, nine.rate])).max()


@pytest.mark.parametrize("digits", [1, 9, 17])
def test_digits_are_those_of_the_format_and_chopping_costs_as_much_as_a_factor_of_two(digits):
    assert answers.decimal_digits(FloatFormat(10, digits)) == pytest.approx(digits, abs=1e-12)
    chopped = answers.decimal_digits(FloatFormat(10, digits, Rounding.CHOP))
    assert digits - chopped == pytest.approx(math.log10(2), abs=1e-12)
    # half a unit of the last of 53 bits is 2**-53, and 0.5 * 10**(1 - t) is that for t = 1 + 52 log10(2)
    assert answers.decimal_digits(FloatFormat(2, 53)) == pytest.approx(1 + 52 * math.log10(2), abs=1e-12)


@pytest.mark.parametrize("size", [5.0, -5.0])
@pytest.mark.parametrize("part", ["drift", "rate"])
@pytest.mark.parametrize("place", [(0, 0), (-1, -1)])
def test_the_largest_error_may_be_of_any_step_state_and_sign(part, place, size):
    run = year.load()[0]
    zeros = {name: np.zeros_like(getattr(run, name)) for name in ("drift", "rate")}
    zeros[part][place] = size
    zeros[part][-1, 0] = size / 2 if place == (0, 0) else zeros[part][-1, 0]
    assert answers.largest(replace(run, **zeros)) == 5.0


def test_a_looser_tolerance_asks_for_fewer_digits_and_an_impossible_one_is_refused():
    assert answers.find_answers(100.0).observed[Rounding.NEAREST] < answers.find_answers().observed[Rounding.NEAREST]
    runs = answers.find_answers().runs
    both = Rounding.documented()
    best = max(min(answers.largest(run) for run in runs if run.case.rounding is rounding) for rounding in both)
    with pytest.raises(
        ValueError, match=f"needed one that at least one run of a year meets: the smallest error is {best:.2g}"
    ):
        answers.find_answers(1e-12)


@pytest.mark.parametrize("rounding", Rounding.documented())
def test_the_tolerance_itself_is_met_and_what_is_just_below_is_not(rounding):
    found = answers.find_answers()
    digits = found.observed[rounding]
    enough = [run for run in found.runs if run.case.rounding is rounding]
    error = min(answers.largest(run) for run in enough if answers.decimal_digits(run.case.fmt) == digits)
    looser = max(error, min(answers.largest(run) for run in found.runs if run.case.rounding is not rounding))
    assert answers.find_answers(looser).observed[rounding] <= digits
    assert error > 0
    assert answers._good(next(run for run in enough if answers.largest(run) == error), rounding, error) is not None
    assert answers._good(next(run for run in enough if answers.largest(run) == error), rounding, 0.999 * error) is None


def test_only_the_usual_model_counts():
    assert {run.case.model for run in answers.find_answers().runs} == {year.MODELS[0]}


def test_the_picture_shows_each_answer_and_every_run():
    _, axes = style.figure(height=4.8)
    found = answers.find_answers()
    gravity_probe_b_figures.digits_needed(found, axes[0], others=True)
    shown = {line.get_label(): line for line in axes[0].lines}
    marked = {
        "asked for in print": found.printed,
        "by the printed formula": found.formula,
        "by the corrected formula": found.corrected,
    }
    for name, places in marked.items():
        assert list(shown[name].get_xdata()) == list(places)
        # The report grants an error as large as the estimate.
        assert set(shown[name].get_ydata()) == {6606}
    drawn = sum(len(shown[f"emulated, {word}"].get_xdata()) for word in ("chopped", "rounded"))
    assert drawn == sum(run.case.fmt is not None for run in found.runs)
    axes[0].figure.canvas.draw()
    assert style.defects(axes[0].figure) == []


def test_the_ring_marks_the_fewest_bits_within_the_tolerance():
    found = answers.find_answers()
    usual = {
        run.case.precision: answers.largest(run)
        for run in found.runs
        if (run.case.base, run.case.form, run.case.rounding) == (2, Form.HUNG, Rounding.NEAREST)
    }
    within = {precision for precision, error in usual.items() if error <= 1}
    assert found.bits == min(within) == 32
    assert found.error == usual[32]
    _, axes = style.figure()
    gravity_probe_b_figures.digits_needed(found, axes[0])
    (ring,) = (line for line in axes[0].lines if line.get_markersize() == 13)
    assert ring.get_xdata()[0] == answers.decimal_digits(FloatFormat(2, 32))
    assert ring.get_ydata()[0] == found.error
    with pytest.raises(ValueError, match="needed one that a run in bits meets"):
        answers._fewest_bits(found.runs, 1e-20)


def test_every_figure_draws_the_same_bound(monkeypatch):
    """Front page, chapter on the filter, its year by steps, and the chapter on wordlength."""
    drawn = []
    exact = report_bounds.bound_for_size

    def spy(beta, *arguments, **faults):
        value = exact(beta, *arguments, **faults)
        drawn.append((beta, value))
        return value

    monkeypatch.setattr(report_bounds, "bound_for_size", spy)
    found = answers.find_answers()
    counts = report_bounds.coefficients(*report_bounds.EXAMPLE)
    lines = []
    for others in (False, True):
        _, axes = style.figure()
        drawn.clear()
        gravity_probe_b_figures.digits_needed(found, axes[0], others)
        heights = [float(value) for _, value in drawn]
        assert len(heights) == 100  # two lines of fifty points
        lines.append(
            [list(line.get_ydata()) for line in axes[0].lines if list(line.get_ydata()) in (heights[:50], heights[50:])]
        )
    assert lines[0] == lines[1]
    assert len(lines[0]) == 2
    fmt = FloatFormat(2, 24)
    drawn.clear()
    (year_end,) = figures.bound_by_steps([report_bounds.EXAMPLE[0]], fmt, {})
    assert drawn == [(fmt.unit_roundoff, year_end)]
    assert year_end == pytest.approx(6606 * 2.0**-24 * (counts.first + counts.second), rel=1e-15)
    # The chapter on wordlength draws the bits at which the same bound meets the tolerance.
    drawn.clear()
    bits = study.printed_precision(*report_bounds.EXAMPLE, Fraction(1), report_bounds.YEAR_SIZE)
    met = {beta: value <= 1 for beta, value in drawn}
    assert met[FloatFormat(2, bits).unit_roundoff]
    assert not met[FloatFormat(2, bits - 1).unit_roundoff]
