"""Random Kalman filters against their guarantees: emulation without the package, the survey, and scalar filters."""

from __future__ import annotations

from collections import Counter
from copy import copy
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.guarantees import filters, scalar
from gpbnb.report.guarantees.random_filters import DETERMINISTIC, KINDS, RANGES, draw
from tests.oracles import EXACT, rounds
from tests.plain_filters import Filter, Refused


def compared(drawn, steps, rng):
    """Run a filter without the package and with it, compare all numbers by ==, and return how the run ends."""
    fmt = drawn.fmt
    z = rng.standard_normal((steps, drawn.model.m)) * 10.0 ** rng.uniform(-2, 3)
    r = rounds(fmt)
    measured = [[Fraction(each) for each in row] for row in z.tolist()]

    def stored():
        return Filter.of(drawn.model, fmt, drawn.form), [[r(each) for each in row] for row in measured]

    try:
        run = Run(drawn.model, fmt, drawn.form, range(1, steps + 1))
        run.take(z)
    except ValueError as error:
        if "compiled loops" in str(error):
            return "no compiled loops"
        with pytest.raises(Refused):
            stored()
        return "refused"
    except OverflowError:  # of the model or of a measurement
        with pytest.raises(OverflowError):
            stored()
        return "not stored"
    found, _ = stored()
    gains, covariances = run.exactly(run.G).tolist(), run.exactly(run.C).tolist()
    for k, row in enumerate(measured):
        if run.stopped == k + 1:
            with pytest.raises(ArithmeticError):
                found.step(row)
            return "stopped"
        assert found.step(row) == run.exactly(run.X[k])[:, 0].tolist()
        assert covariances[k] == found.P
        assert gains[k] == found.K
    return "equal"


def test_a_filter_in_integers_gives_the_digits_of_a_run():
    """In every form, rounding, kind of model and range, in bases 2, 10 and 16, from the model as given."""
    rng = np.random.default_rng(8)
    ends, seen = Counter(), set()
    for seed in range(30):
        drawn = draw(seed)
        end = compared(drawn, 8, rng)
        ends[end] += 1
        if end == "equal":
            limited = "unlimited" if drawn.fmt.emin is None else ("subnormal" if drawn.fmt.subnormal else "flushed")
            seen |= {drawn.form, drawn.kind, drawn.fmt.rounding, drawn.fmt.base, limited, drawn.model.n}
    assert ends["equal"] > 25, ends
    assert seen >= {*WITH_PROGRAM, *KINDS, *DETERMINISTIC, 2, 10, 16, *RANGES, 1, 3, 4}


# -- the survey -------------------------------------------------------------------------------------------------------


SLICE = (2, 3, 20, 47)
examined = cache(filters.examine)


@pytest.mark.long  # rows of the survey with all their runs
@pytest.mark.parametrize("seed", SLICE)
def test_no_run_of_a_slice_exceeds_its_bound(seed):
    row = examined(seed)
    assert (row.result, row.runs) == ("for ever", 8)
    assert 0.3 < row.largest <= 1
    assert not row.wrong
    assert row in filters.load()


@pytest.mark.long  # rows of the survey with all their runs, three times
@pytest.mark.parametrize("seed", SLICE)
def test_the_survey_finds_a_guarantee_that_is_too_small(seed):
    """A bound below the largest error is found to be exceeded, by as much."""
    row = examined(seed)
    smaller = filters.examine(seed, smaller=0.95 * row.largest)
    assert smaller.largest == pytest.approx(1 / 0.95, rel=1e-3)  # four digits are stored
    largest = filters.examine(seed, smaller=0.5 * row.largest).largest * 0.5 * row.largest
    assert 1 < filters.examine(seed, smaller=(1 - 1e-9) * largest).largest < 1 + 1e-8


@pytest.mark.long  # all runs of a row repeated in Fractions
@pytest.mark.parametrize("seed", [3, 47])
def test_errors_are_those_of_filters_without_the_package(seed):
    """The run is repeated in integers, and the exact filter in Fractions; both for as long as Fractions stay short."""
    drawn = draw(seed)
    found = guarantee(drawn.model, drawn.fmt, drawn.within, form=drawn.form, most=filters.MOST, horizon=filters.STEPS)
    compared_steps = 0
    for _, z in filters.inputs(drawn, found, np.random.default_rng(seed)):
        off, _ = filters.errors(drawn, z)
        rounded = Filter.of(drawn.model, drawn.fmt, drawn.form)
        true = Filter(rounded.model(), EXACT, "innovation")
        for k, row in enumerate(z[:25].tolist()):
            measured = [rounded.numbers.r(Fraction(each)) for each in row]
            errors = [float(a - b) for a, b in zip(rounded.step(measured), true.step(measured), strict=True)]
            if k >= len(off):
                sizes = [abs(float(v)) for (v,) in true.innovation_found]
                assert any(size > X for size, X in zip(sizes, drawn.within.innovation, strict=True))
                break
            # Double-double has 31 digits, of which at most 10 cancel here.
            assert errors == pytest.approx(off[k].tolist(), rel=1e-12, abs=1e-20 * float(np.abs(found.bound).max()))
            assert all(abs(e) <= b for e, b in zip(errors, found.bound, strict=True))
            compared_steps += 1
    assert compared_steps > 100


def test_no_stored_run_exceeds_its_bound():
    rows = filters.load()
    assert sum(row.runs for row in rows) >= 20_000
    assert [row for row in rows if row.wrong] == []
    for name in ("form", "base", "rounding", "kind", "range", "limited"):
        groups = filters.groups(rows, name)
        assert sum(map(len, groups.values())) == len(rows)
        for value, chosen in groups.items():
            enough = sum(row.runs for row in chosen) > 1_000 and max(row.largest for row in chosen) > 0.8
            assert enough or name == "base", value


# -- scalar filters ---------------------------------------------------------------------------------------------------


@pytest.mark.long  # thousands of runs in integers
@pytest.mark.parametrize(("form", "steps"), [(Form.INNOVATION, 3), (Form.HUNG, 2)], ids=str)
def test_the_worst_error_is_that_of_all_sequences(form, steps):
    """Every sequence of some measurements in three bits, each run in integers."""
    model = LinearModel(*(exact([[each]]) for each in ("-3/4", "5/4", "1/2", "3/4")), exact([0]), exact([[1]]))
    fmt = FloatFormat(2, 3, "nearest", -1, 5)
    given = scalar.ScalarFilter(model, fmt, form, fmt.round(1))
    z = [Fraction(each) for each in scalar.numbers(fmt, given.limit).tolist()]
    assert z == [Fraction(k, 8) for k in (-8, -7, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 7, 8)]
    largest = [0.0] * steps

    def follow(rounded, true, k):
        for each in z:
            one, other = copy(rounded), copy(true)
            largest[k] = max(largest[k], abs(float(one.step([each])[0] - other.step([each])[0])))
            if k + 1 < steps:
                follow(one, other, k + 1)

    rounded = Filter.of(model, fmt, form)
    follow(rounded, Filter(rounded.model(), EXACT, "innovation"), 0)
    found = scalar.worst_error(given)
    assert found.history[:steps].tolist() == pytest.approx(largest, rel=1e-14)
    assert found.error == found.history.max() > largest[-1]


@pytest.mark.parametrize("seed", [2, 3, 105, 174, 416])
def test_the_worst_error_is_within_the_bound_and_stored(seed):
    given = scalar.draw(seed)
    found = scalar.worst_error(given)
    bound = guarantee(given.model, given.fmt, limits(measurement=float(given.limit)), form=given.form).bound[0]
    assert found.error + found.later <= bound
    assert scalar.examine(seed) in scalar.load()


def test_no_stored_worst_error_exceeds_its_bound():
    rows = [row for row in scalar.load() if row.result == "compared"]
    assert len(rows) > 300
    ratios = [float(row.ratio) for row in rows]
    assert max(ratios) <= 1
    assert max(ratios) > 0.75
    assert {(row.form, row.rounding) for row in rows} == {
        (f.name.lower(), r.value) for f in WITH_PROGRAM for r in DETERMINISTIC
    }
    assert {row.precision for row in rows} == {3, 4, 5, 6}
