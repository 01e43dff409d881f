"""gpbnb.report.gravity_probe_b.answers: the digits that a year asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.gravity_probe_b import answers, year
from gpbnb.report.kalman import report_bounds


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
    assert answers.find_answers(found.error).bits == found.bits
    assert answers._good(next(run for run in enough if answers.largest(run) == error), rounding, error) is not None
    assert answers._good(next(run for run in enough if answers.largest(run) == error), rounding, 0.999 * error) is None
