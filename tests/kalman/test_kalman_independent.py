"""gpbnb.report.kalman.independent: one model counts once."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.report.confidence import interval
from gpbnb.report.kalman import ensembles, independent
from gpbnb.report.kalman.independent import first_steps, stored_shares


def test_the_stored_sweep_has_170_models():
    found = stored_shares("105", Form.HUNG)
    assert found.models == len(ensembles.KINDS) * ensembles.REPEATS == 170
    assert 0 < found.low < found.share < found.high < 1
    assert found.share * 170 <= found.at_least_once <= 170
    # The mean of the shares by model is the share of all trials: each model has as many formats.
    whole = [each for each in ensembles.load() if each.form == "hung"]
    trials, exceeded = sum(each.trials for each in whole), sum(each.violations_105 for each in whole)
    assert found.share == pytest.approx(exceeded / trials, rel=1e-12)
    with pytest.raises(ValueError, match="needed 105, 108 or 125"):
        stored_shares("104", Form.HUNG)


def test_first_steps_count_each_model_once():
    fmt = FloatFormat(2, 24)
    (found,) = first_steps(fmt, 6, ("far scales",))
    seeds = range(ensembles.REPEATS, ensembles.REPEATS + 6)
    ratios = [
        ensembles.trial(ensembles.Task("far scales", fmt, Form.HUNG, seed, 1)).printed_covariance for seed in seeds
    ]
    assert found.exceeded == sum(ratio > 1 for ratio in ratios)
    assert (found.low, found.high) == interval(found.exceeded, 6)


def test_a_filter_that_stops_exceeds_no_bound(monkeypatch):
    stopped = SimpleNamespace(take=lambda z: None, stopped=1)
    monkeypatch.setattr(independent, "Run", lambda *_: stopped)
    (found,) = first_steps(FloatFormat(2, 24), 2, ("far scales",))
    assert (found.models, found.exceeded) == (2, 0)
