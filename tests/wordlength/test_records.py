"""Many records in many formats at once."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from gpbnb import FloatFormat, Rounding
from gpbnb.wordlength import examples
from gpbnb.wordlength import records as module
from gpbnb.wordlength.judges import judge_for
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
        found = survey_records(TRACKER, z, 0.01, FORMATS, form="UD", executor=executor, chunk=2)
    assert np.array_equal(found.ratios, survey_records(TRACKER, z, 0.01, FORMATS, form="UD").ratios)


def test_an_interrupted_survey_goes_on(tmp_path, monkeypatch):
    calls = []

    def counted(asked, *rest):
        calls.append(asked.data.steps)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return judge_for(asked, *rest)

    monkeypatch.setattr(module, "judge_for", counted)
    z, formats = data(4), FORMATS[:1]
    with pytest.raises(KeyboardInterrupt):
        survey_records(TRACKER, z, 0.01, formats, directory=tmp_path)
    assert len(list(tmp_path.iterdir())) == 2
    found = survey_records(TRACKER, z, 0.01, formats, directory=tmp_path)
    assert calls == [25, 26, 27, 27, 28]  # the first two records were not computed again
    monkeypatch.undo()
    assert np.array_equal(found.ratios, survey_records(TRACKER, z, 0.01, formats).ratios)


def test_another_question_does_not_use_saved_records(tmp_path):
    z, formats = data(1), FORMATS[:1]
    first = survey_records(TRACKER, z, 0.01, formats, directory=tmp_path).ratios
    assert survey_records(TRACKER, z, 0.02, formats, directory=tmp_path).ratios == first / 2
    others = [
        survey_records(replace(TRACKER, R=TRACKER.R * 2), z, 0.01, formats, directory=tmp_path),
        survey_records(TRACKER, [z[0] * 2], 0.01, formats, directory=tmp_path),
        survey_records(TRACKER, z, 0.01, formats, form="UD", directory=tmp_path),
        survey_records(TRACKER, z, 0.01, formats, basis="bound", directory=tmp_path),
    ]
    assert all(each.ratios != first for each in others)
    assert len(list(tmp_path.iterdir())) == 6


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
    irregular = RecordSurvey(formats, np.array([[0.5, 0.5, 0.5, np.inf]]), (("",) * 4,))
    assert irregular.enough() == ()
