"""A year of Gravity Probe B: what is stored comes out again, digit for digit, and the digits that a year asks for."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters import contraction
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.simulation import BLOCK
from gpbnb.report.gravity_probe_b import answers, year
from gpbnb.report.gravity_probe_b.model import TRUTH, YEAR
from gpbnb.report.gravity_probe_b.year import BOUNDED_CASES, CASES, MODELS, YearCase

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
SINGLE = YearCase(MODELS[0], 2, 24, NEAREST, Form.HUNG)
MILLIARCSECOND = 1.0


@cache
def stored():
    return year.SWEEP.load().rows


# One precision of each base, rounding, form and model; `make verify-sweeps` takes a sample of all.
KINDS = {(case.model, case.base, case.rounding, case.form): case for case in CASES}


@pytest.mark.parametrize("case", KINDS.values(), ids=str)
def test_a_slice_of_a_year_of_each_kind_comes_out_digit_for_digit(case):
    again = year.rows(case, steps=464)
    assert len(again) == 9
    lines = [line for line in stored() if line[:5] == again[0][:5]]
    assert all(year.SWEEP.same(*both) for both in zip(lines[:9], again, strict=True))


@pytest.mark.parametrize("case", BOUNDED_CASES, ids=str)
def test_a_slice_of_the_bounds_comes_out_again(case):
    again = year.bound_rows(case, steps=464)
    lines = [line for line in year.BOUND_SWEEP.load().rows if line[1] == str(case.base)]
    assert again == lines[:9]


def test_every_case_is_stored_to_the_end_of_the_year():
    runs = year.load()
    assert [run.case for run in runs] == list(CASES)
    assert len(set(CASES)) == len(CASES) == 46
    for run in runs:
        assert run.steps.tolist() == list(year.checkpoint_steps())
        assert run.steps[-1] == YEAR == 3_153_600
        assert run.drift.shape == run.rate.shape == (len(run.steps), 2)
    covered = {(c.base, c.rounding) for c in CASES if c.form is Form.HUNG}
    assert covered == {(2, NEAREST), (2, CHOP), (10, NEAREST), (10, CHOP)}
    assert {c.form for c in CASES if c.base == 2 and c.precision == 24} == set(WITH_PROGRAM)


def at_end(base, precision, rounding=NEAREST, form=Form.HUNG, name=MODELS[0]):
    (run,) = (run for run in year.load() if run.case == YearCase(name, base, precision, rounding, form))
    return run


def worst(run):
    return max(np.abs(run.drift[-1]).max(), np.abs(run.rate[-1]).max())


def test_the_error_goes_from_useless_to_negligible():
    signal = TRUTH[2]
    errors = [worst(at_end(2, t)) for t in (14, 18, 24, 32, 40, 53)]
    assert errors[0] > signal
    assert errors[-1] < 1e-7 * MILLIARCSECOND
    assert errors == sorted(errors, reverse=True)
    decimal = [worst(at_end(10, t)) for t in (4, 6, 8, 10, 16)]
    assert decimal == sorted(decimal, reverse=True)
    # Known to the digit: the smallest that stay within the tolerance, the one before and the one after.
    most = {t: answers.largest(at_end(2, t)) for t in (31, 32, 33)}
    assert max(most[32], most[33]) < MILLIARCSECOND < most[31]
    assert answers.largest(at_end(10, 10)) < MILLIARCSECOND < answers.largest(at_end(10, 9))
    for t in (24, 28, 32):
        assert worst(at_end(2, t, CHOP)) > worst(at_end(2, t))
    # Joseph's form and the factors change little: what is lost is lost in the estimate.
    for form in (Form.INNOVATION, Form.JOSEPH, Form.UD):
        assert 0.5 < worst(at_end(2, 24, form=form)) / worst(at_end(2, 24)) < 2


def test_the_refined_bound_is_near_the_error_at_the_end_of_the_year():
    """By a companion, the reference: at most 100 times the error is asked for."""
    bounds = year.bounds()
    assert tuple(bounds) == BOUNDED_CASES
    ratios = []
    for run in year.load():
        if run.case.reference in bounds:
            of_reference = bounds[run.case.reference]
            assert of_reference.steps.tolist() == run.steps.tolist()
            for name in ("drift", "rate"):
                error, own = getattr(run, name)[-1], getattr(of_reference, name)[-1]
                total = contraction.companion_bound(error, own)
                assert (total >= np.abs(error)).all()
                ratios.append((total / np.abs(error)).max())
    assert len(ratios) == 2 * 44
    assert max(ratios) < 1.5
    assert max(bounds[SINGLE.reference].drift[-1]) < 1e-12 * MILLIARCSECOND


# -- what runs are given ---------------------------------------------------------------------------


def test_in_one_base_every_format_holds_the_model_and_the_measurements():
    """So one reference serves all: errors are those of the arithmetic alone."""
    assert {case.precision for case in CASES if case.base == 2} >= {14, 53}
    assert min(case.precision for case in CASES if case.base == 2) == 14
    assert min(case.precision for case in CASES if case.base == 10) == 4
    for name, base in {(case.model, case.base) for case in CASES}:
        given = year.model(name, base)
        stored_again = given.rounded(FloatFormat(base, 14 if base == 2 else 4, CHOP))
        for letter in ("Phi", "H", "Q", "R", "x0", "P0"):
            assert (getattr(given, letter) == getattr(stored_again, letter)).all()
    z = year.simulation(MODELS[0]).measurements(BLOCK)
    assert (z == np.rint(z)).all()
    assert np.abs(z).max() < 10**4  # four decimal digits


def test_what_counts_is_the_year_and_not_its_end_alone():
    """Nine decimal digits end within the tolerance, and were beyond it before."""
    (nine,) = (run for run in year.load() if (run.case.base, run.case.precision) == (10, 9))
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
    assert answers.largest(run._replace(**zeros)) == 5.0


def test_the_tolerance_itself_is_met_and_what_is_just_below_is_not():
    errors = answers.errors()
    for bits in (20, 32, 53):
        assert answers.fewest_bits(errors[bits]) == bits
        assert all(errors[fewer] > errors[bits] for fewer in errors if fewer < bits)
    with pytest.raises(ValueError, match=f"needed at least the least error, {errors[53]:.2g}"):
        answers.fewest_bits(0.999 * errors[53])
