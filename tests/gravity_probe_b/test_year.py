"""gravity_probe_b.year: what is stored comes out again, digit for digit, and a run that is interrupted goes on."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters import contraction
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run, reference
from gpbnb.filters.simulation import BLOCK
from gpbnb.report.gravity_probe_b import answers, year
from gpbnb.report.gravity_probe_b.model import TRUTH, YEAR
from gpbnb.report.gravity_probe_b.year import (
    BOUNDED_CASES,
    CASES,
    MODELS,
    ResumableRun,
    YearCase,
    run_cases,
)
from gpbnb.sweeps import read

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
SINGLE = YearCase(MODELS[0], 2, 24, NEAREST, Form.HUNG)
MILLIARCSECOND = 1.0


def stored(name):
    columns = {"year": year.COLUMNS, "bounds": year.BOUND_COLUMNS}[name]
    rows = read(year._HERE / f"{name}.csv", columns, "").rows
    return [tuple(column.name for column in columns), *rows]


# -- what is stored -------------------------------------------------------------------------------


def slices():
    """The steps up to 464 of every case."""
    keys = dict.fromkeys(line[:5] for line in stored("year")[1:])
    return [pytest.param(key, id="-".join(key[1:]) + key[0]) for key in keys]


@pytest.mark.parametrize("key", slices())
def test_a_slice_of_every_year_comes_out_digit_for_digit(key):
    case = YearCase(key[0], int(key[1]), int(key[2]), Rounding(key[3]), Form[key[4].upper()])
    checkpoint_steps = tuple(mark for mark in year.checkpoint_steps() if mark <= 464)
    z = year.simulation(case.model).measurements(checkpoint_steps[-1])
    given = year.model(case.model, case.base)
    again = year.rows(case, emulate(given, z, case.fmt, case.form, checkpoint_steps, true(case.model, case.base)))
    lines = [line for line in stored("year") if line[:5] == key]
    # The last column is an eigenvalue, whose last digits are those of a machine's LAPACK.
    assert [line[:-1] for line in again] == [line[:-1] for line in lines[: len(checkpoint_steps)]]
    for line, other in zip(again, lines, strict=False):
        assert float(line[-1]) == pytest.approx(float(other[-1]), rel=1e-4, abs=1e-12)


REFERENCES = {}


def true(name, base):
    """The reference, once for all cases."""
    if (name, base) not in REFERENCES:
        checkpoint_steps = tuple(mark for mark in year.checkpoint_steps() if mark <= 464)
        z = year.simulation(name).measurements(464)
        REFERENCES[name, base] = reference(year.model(name, base), z, checkpoint_steps)
    return REFERENCES[name, base]


@pytest.mark.parametrize("base", [2, 10])
def test_a_slice_of_the_bounds_comes_out_again(base, tmp_path, monkeypatch):
    case = YearCase(MODELS[0], base, 0, NEAREST, Form.INNOVATION)
    assert case in BOUNDED_CASES
    run_cases([case], tmp_path, 464, progress=False)
    again = year.bound_rows(case, tmp_path, 464)
    lines = [line for line in stored("bounds") if line[1] == str(base)]
    assert again == lines[: len(again)]
    assert len(again) == 9


def test_every_case_is_stored_to_the_end_of_the_year():
    runs = year.load()
    assert [run.case for run in runs] == list(CASES)
    assert len(set(CASES)) == len(CASES) == 46
    for run in runs:
        assert run.steps.tolist() == list(year.checkpoint_steps())
        assert run.steps[-1] == YEAR == 3_153_600
        assert run.stopped is None
        assert run.drift.shape == run.rate.shape == (len(run.steps), 2)
        assert (np.maximum(np.abs(run.drift).max(axis=1), np.abs(run.rate).max(axis=1)) <= run.state).all()
    made = year.provenance()
    assert made["steps"] == YEAR
    assert set(made["cases"]) == {case.name for case in CASES}
    assert set(made["references"]) == {case.reference.name for case in CASES}
    assert {"machine", "versions", "command"} <= set(made)
    covered = {(c.base, c.rounding) for c in CASES if c.form is Form.HUNG}
    assert covered == {(2, NEAREST), (2, CHOP), (10, NEAREST), (10, CHOP)}
    assert {c.form for c in CASES if c.base == 2 and c.precision == 24} == set(Form)


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
    assert set(bounds) == set(BOUNDED_CASES)
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


def test_what_the_filter_knows_is_what_it_thinks():
    """The unrounded filter's errors, of the simulated truth, are of the size of its standard deviations."""
    for about in year.provenance()["references"].values():
        ratios = np.array(about["estimate minus truth"]) / np.array(about["standard deviation"])
        assert np.abs(ratios).max() < 4
        assert 0.1 < np.sqrt(np.mean(ratios**2)) < 2
        rate = about["standard deviation"][2]
        assert 0.05 < rate < MILLIARCSECOND


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


# -- interruption ---------------------------------------------------------------------------------

STEPS = 2 * BLOCK + 100


def results(directory):
    year.reference_checkpoints.cache_clear()
    run = ResumableRun(SINGLE, directory, STEPS).run
    return year.rows(SINGLE, year.history(SINGLE, directory, STEPS)), run.x.tolist(), run.P.tolist()


def test_a_year_that_is_interrupted_goes_on_where_it_was_saved(tmp_path, monkeypatch):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    run_cases([SINGLE], whole, STEPS, progress=False)
    save, saved = ResumableRun.save, []

    def save_and_stop(self):
        save(self)
        saved.append((self.case, self.run.steps))
        if self.run.steps == BLOCK:
            raise KeyboardInterrupt

    monkeypatch.setattr(ResumableRun, "save", save_and_stop)
    for _ in range(2):  # once in the reference, once in the run
        with pytest.raises(KeyboardInterrupt):
            run_cases([SINGLE], parts, STEPS, progress=False, each=1)
    run_cases([SINGLE], parts, STEPS, progress=False, each=1)
    ends = (BLOCK, 2 * BLOCK, STEPS)
    assert saved == [(case, steps) for case in (SINGLE.reference, SINGLE) for steps in ends]
    monkeypatch.undo()
    assert results(parts) == results(whole)
    once = Run(year.model(SINGLE.model, SINGLE.base), SINGLE.fmt, SINGLE.form, ())
    once.take(year.simulation(SINGLE.model).measurements(STEPS))
    assert results(whole)[1:] == (once.x.tolist(), once.P.tolist())
    assert year.bound_rows(SINGLE.reference, parts, STEPS) == year.bound_rows(SINGLE.reference, whole, STEPS)
    year.reference_checkpoints.cache_clear()
    assert sorted(file.name for file in parts.iterdir()) == [f"{SINGLE.reference.name}.npz", f"{SINGLE.name}.npz"]
    # Finished runs are not taken up again; those of another code are.
    monkeypatch.setattr(ResumableRun, "advance", lambda *_: pytest.fail("a finished run went on"))
    run_cases([SINGLE], parts, STEPS, progress=False)
    monkeypatch.setattr(year, "fingerprint", lambda case, steps: "other")
    assert ResumableRun(SINGLE, parts, STEPS).run.steps == 0


def test_a_year_that_lost_its_variance_says_when():
    run = at_end(2, 14)
    assert run.indefinite == year.provenance()["cases"][run.case.name]["indefinite"] == 504_566
    assert at_end(2, 24).indefinite is None
