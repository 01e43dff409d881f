"""gravity_probe_b.threshold: the precision that shares of records give, and limits of confidence on both sides."""

from __future__ import annotations

import pytest
from scipy import stats

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.gravity_probe_b import threshold
from gpbnb.report.gravity_probe_b.threshold import Share, needed, shares
from gpbnb.report.stored_table import StoredTable


def most(share):
    """The upper limit of the probability with 95 % confidence, by Clopper and Pearson."""
    return stats.beta.ppf(0.95, share.within + 1, share.records - share.within)


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
    assert needed(found) == 32
    assert needed(found[:2]) is None
    with pytest.raises(ValueError, match="got formats of 2 kinds"):
        needed([found[0], found[0]._replace(form="innovation")])


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
        answer = needed(group)
        assert answer is not None
        below = by_precision[answer - 1]
        assert most(below) < 0.99


def test_what_is_stored_answers():
    found = shares(threshold.SWEEP.load())
    assert all(share.records >= 100 for share in found)
    by = {(share.states, share.fmt, share.form): share for share in found}
    thirty_two = by["absolute", FloatFormat(2, 32), "hung"]
    # One record in eleven exceeds the tolerance, which one record of a year could not show.
    assert 0 < thirty_two.records - thirty_two.within < thirty_two.records // 5
    assert most(thirty_two) < 0.99


@pytest.mark.parametrize("sweep", [threshold.SWEEP, threshold.MISSION_SWEEP], ids=lambda sweep: sweep.name)
def test_the_years_of_the_cells_are_stored_and_no_others(sweep):
    years = [(*head, str(cell.first + i)) for cell in sweep.cells() for head in cell.heads() for i in range(cell.count)]
    assert sorted(years) == sorted(row[: sweep.key] for row in sweep.load().rows)
