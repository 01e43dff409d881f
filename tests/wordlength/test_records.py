"""Many records in many formats at once."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, Rounding
from gpbnb.wordlength import examples
from gpbnb.wordlength.records import RecordSurvey, survey_records
from tests.surveying import survey

FORMATS = [FloatFormat(2, 10), FloatFormat(2, 24), FloatFormat(10, 5), FloatFormat(2, 12, Rounding.CHOP)]
TRACKER = examples.tracker()


def data(count=3, steps=25):
    rng = np.random.default_rng(1)
    return [np.round(rng.standard_normal((steps + k, 1)) * 2**20) / 2**20 for k in range(count)]


def test_it_is_the_survey_of_each_record():
    z = data()
    z[1][4] = np.nan
    found = survey_records(TRACKER, z, 0.01, FORMATS)
    expected = [
        [survey(TRACKER, each, 0.01, [fmt.precision], fmt.base, fmt.rounding)[0][1] for fmt in FORMATS] for each in z
    ]
    assert np.array_equal(found.ratios, expected)
    assert found.ratios.shape == (3, 4)


@pytest.mark.parametrize("kind", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_any_executor_gives_the_same(kind):
    z = data()
    with kind(2) as executor:
        found = survey_records(TRACKER, z, 0.01, FORMATS, form="UD", executor=executor)
    assert np.array_equal(found.ratios, survey_records(TRACKER, z, 0.01, FORMATS, form="UD").ratios)


def test_simulated_records_differ_and_have_the_model_s_inputs():
    pushed = replace(TRACKER, B=[[0], ["0.1"]], u=[[1]] * 20)
    found = survey_records(pushed, 3, 0.01, [FloatFormat(2, 20)], steps=20)
    assert len(set(found.ratios[:, 0].tolist())) == 3
    assert np.isfinite(found.ratios).all()


def test_shares_and_what_is_enough():
    formats = tuple(FloatFormat(2, digits) for digits in (10, 11, 12, 13))
    ratios = np.array([[0.5, 2.0, 1.0, 0.1], [3.0, 0.5, 0.5, 0.1]])
    found = RecordSurvey(formats, ratios, (("",) * 4,) * 2)
    assert found.shares == (0.5, 0.5, 1.0, 1.0)
    assert found.enough() == (formats[2],)
    words, floats = FixedFormat(1, 8), FloatFormat(2, 8, emin=-9, emax=9)
    others = [
        replace(words, **{name: new}) for name, new in (("integer_bits", 2), ("rounding", "up"), ("overflow", "wrap"))
    ]
    others += [
        replace(floats, **{name: new}) for name, new in (("emin", -8), ("rounding", "up"), ("overflow", "saturate"))
    ]
    for one, other in (*((words, each) for each in others[:3]), *((floats, each) for each in others[3:])):
        digits = "fraction_bits" if one is words else "precision"
        kinds = (one, replace(one, **{digits: 9}), replace(one, **{digits: 10}), other, replace(other, **{digits: 9}))
        kept = RecordSurvey(kinds, np.array([[0.5, 2, 0.5, 0.5, 0.5]]), (("",) * 5,)).enough()
        assert kept == (kinds[2], kinds[3]), other
    irregular = RecordSurvey(formats, np.array([[0.5, 0.5, 0.5, np.inf]]), (("",) * 4,))
    assert irregular.enough() == ()
