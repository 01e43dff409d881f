"""gravity_probe_b.threshold: confidence intervals against their definition, and the precision they give."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report import confidence
from gpbnb.report.confidence import interval, quantile_limit
from gpbnb.report.gravity_probe_b import threshold
from gpbnb.report.gravity_probe_b.threshold import Needed, Share, needed, shares
from gpbnb.sweeps import StoredTable


@pytest.mark.parametrize(("within", "records"), [(0, 5), (1, 5), (91, 100), (99, 100), (100, 100), (300, 300)])
def test_the_limits_are_where_the_tails_have_five_percent(within, records):
    low, high = interval(within, records)
    if within:
        assert stats.binom.sf(within - 1, records, low) == pytest.approx(0.05, rel=1e-9)
    else:
        assert low == 0
    if within < records:
        assert stats.binom.cdf(within, records, high) == pytest.approx(0.05, rel=1e-9)
    else:
        assert high == 1


def test_the_limit_of_a_quantile_covers_it_in_95_percent_of_samples():
    rng = np.random.default_rng(8)
    true = math.exp(0.5 * stats.norm.ppf(0.99))
    trials = 2000
    covered = sum(quantile_limit(np.exp(0.5 * rng.standard_normal(30))) >= true for _ in range(trials))
    # Four standard errors of a share of 0.95.
    assert abs(covered / trials - 0.95) < 4 * math.sqrt(0.95 * 0.05 / trials)
    assert quantile_limit(np.array([1.0])) == math.inf
    assert quantile_limit(np.array([1.0, np.inf])) == math.inf
    with pytest.raises(ValueError, match="not positive"):
        quantile_limit(np.array([1.0, 0.0]))


def rows(precision, drifts, rates):
    head = ("absolute", "2", "nearest", "hung", str(precision))
    return [
        (*head, str(i), str(drift), str(rate), "0", "0")
        for i, (drift, rate) in enumerate(zip(drifts, rates, strict=True))
    ]


def test_a_precision_qualifies_only_if_all_larger_ones_do():
    good, bad, edge = [0.1] * 300, [0.1] * 290 + [2.0] * 10, [0.1] * 298 + [2.0] * 2
    table = [*rows(30, good, good), *rows(31, bad, bad), *rows(32, edge, edge), *rows(33, good, good)]
    found = shares(StoredTable(threshold.COLUMNS, tuple(table), {}))
    # A few large errors among equal ones are not lognormal, and that limit overlooks them.
    assert needed(found) == Needed(32, 30, 33)
    assert needed(found[:2]) == Needed(None, 30, None)
    few = shares(StoredTable(threshold.COLUMNS, tuple(rows(33, good[:100], good[:100])), {}))
    assert needed(few) == Needed(33, 33, None)
    # A larger precision with fewer records, all of which pass, refutes nothing.
    more = [*rows(33, good, good), *rows(34, good[:100], good[:100])]
    assert needed(shares(StoredTable(threshold.COLUMNS, tuple(more), {}))) == Needed(33, 33, 33)
    with pytest.raises(ValueError, match="got formats of 2 kinds"):
        needed([few[0], few[0]._replace(form="innovation")])


@pytest.mark.parametrize("sweep", [threshold.SWEEP, threshold.MISSION_SWEEP], ids=lambda each: each.name)
def test_every_answer_is_shown_from_both_sides(sweep):
    groups: dict[tuple[object, ...], list[Share]] = {}
    for share in shares(sweep.load()):
        if share.records >= 30:  # settings with fewer records only show how the precision changes
            fmt = share.fmt
            groups.setdefault((share.setting, share.states, share.form, fmt.base, fmt.rounding), []).append(share)
    assert len(groups) >= 2
    for group in groups.values():
        by_precision = {share.fmt.precision: share for share in group}
        answer = needed(group).observed
        assert answer is not None
        assert by_precision[answer - 1].high < 0.99


def test_what_is_stored_answers():
    found = shares(threshold.SWEEP.load())
    assert all(share.records >= 100 for share in found)
    by = {(share.states, share.fmt, share.form): share for share in found}
    thirty_two = by["absolute", FloatFormat(2, 32), "hung"]
    # One record in eleven exceeds the tolerance, which one record of a year could not show.
    assert 0 < thirty_two.records - thirty_two.within < thirty_two.records // 5
    assert thirty_two.high < 0.99
    kind = ("absolute", 2, "hung", "nearest")
    nearest = [s for s in found if (s.states, s.fmt.base, s.form, s.fmt.rounding.value) == kind]
    assert needed(nearest).lognormal == 33
    assert confidence.CONFIDENCE == 0.95
