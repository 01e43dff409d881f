"""gpbnb.report.gravity_probe_b.answers: by how many bits a choice moves the answer, for errors that are known."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.gravity_probe_b import answers, year
from gpbnb.report.gravity_probe_b.answers import Moved, median_precision, sensitivity, single_record
from gpbnb.report.gravity_probe_b.threshold import Share


def share(precision, error, setting="simple", states="deviation", form="hung", rounding=Rounding.NEAREST, records=3):
    errors = np.full(records, error)
    return Share(setting, states, form, FloatFormat(2, precision, rounding), errors, 0, 0.0, 1.0, 1.0)


def test_the_nearest_format_says_where_the_median_meets_the_tolerance():
    assert median_precision([share(24, 4.0)]) == 26
    assert median_precision([share(27, 0.5), share(30, 0.01)]) == 26
    assert median_precision([share(24, 4.0)], tolerance=0.25) == 28
    decimal = share(24, 0.01)._replace(fmt=FloatFormat(10, 9))
    assert median_precision([decimal]) == pytest.approx(7)
    with pytest.raises(ValueError, match="got no formats"):
        median_precision([])


def test_between_two_formats_the_logarithm_of_the_median_is_interpolated():
    assert median_precision([share(24, 64.0), share(27, 0.125), share(30, 0.01)]) == 26
    assert median_precision([share(30, 0.25), share(26, 0.5), share(27, 4.0), share(28, 0.25)]) == 27.5
    assert median_precision([share(24, 2.0), share(25, 1.0)]) == 25


def test_two_kinds_that_meet_the_tolerance_are_compared_where_they_do():
    usual = [share(24, 4.0), share(25, 0.25), share(29, 0.001)]
    chopped = [share(29, 2.0, rounding=Rounding.CHOP), share(30, 0.5, rounding=Rounding.CHOP, records=2)]
    assert sensitivity([*usual, *chopped]) == (Moved("rounding, simple model", "nearest", "chop", 5, 2),)


def test_what_is_stored_of_one_record():
    runs = year.load()
    found = {(each.choice, each.after): each for each in single_record(runs)}
    by = {run.case: run for run in runs}
    usual = year.YearCase(year.MODELS[0], 2, 24, Rounding.NEAREST, Form.HUNG)
    chopped = answers.largest(by[usual._replace(rounding=Rounding.CHOP)]) / answers.largest(by[usual])
    assert 2 ** found["rounding", "chop"].bits == pytest.approx(chopped)
    assert found["rounding", "chop"].bits > 1 > abs(found["form", "innovation"].bits)
    assert len(found) == 5
    with pytest.raises(KeyError):
        single_record(runs, precision=23)
