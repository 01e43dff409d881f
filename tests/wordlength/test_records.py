"""Many records in many formats at once."""

from dataclasses import replace

import numpy as np

from gpbnb import FloatFormat, Rounding
from gpbnb.report import examples
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


def test_simulated_records_differ_and_have_the_model_s_inputs():
    pushed = replace(TRACKER, B=[[0], ["0.1"]], u=[[1]] * 20)
    found = survey_records(pushed, 3, 0.01, [FloatFormat(2, 20)], steps=20)
    assert len(set(found.ratios[:, 0].tolist())) == 3
    assert np.isfinite(found.ratios).all()


def test_shares():
    ratios = np.array([[0.5, 2.0, 1.0, 0.1], [3.0, 0.5, 0.5, 0.1]])
    assert RecordSurvey(tuple(FORMATS), ratios, (("",) * 4,) * 2).shares == (0.5, 0.5, 1.0, 1.0)
