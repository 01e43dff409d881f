"""Random Kalman filters against their guarantees: emulation without the package, the survey, and scalar filters."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import cache
from itertools import product

import numpy as np
import pytest
from independent_filter import Arithmetic, ExactFilter, Filter, Refused

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.guarantees import filters, scalar
from gpbnb.report.guarantees.random_filters import DETERMINISTIC, KINDS, LIMITED, RANGES, Drawn, draw
from gpbnb.sweeps.command import run


def compared(drawn, steps, rng):
    """Run a filter without the package and with it, compare all numbers by ==, and return how the run ends."""
    fmt = drawn.fmt
    z = rng.standard_normal((steps, drawn.model.m)) * 10.0 ** rng.uniform(-2, 3)
    # In base 10, the package's loops end where the result of an operation would be subnormal.
    mine = Arithmetic.of(fmt, ends_at_subnormal=fmt.base == 10 and fmt.emin is not None and fmt.subnormal)
    measured = [[Fraction(each) for each in row] for row in z.tolist()]

    def stored():
        return Filter.of(drawn.model, mine, drawn.form), [[mine.store(each) for each in row] for row in measured]

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
        assert mine.values(found.U if drawn.form is Form.UD else found.P) == covariances[k]
        assert mine.values(found.K) == gains[k]
    return "equal"


def test_a_filter_in_integers_gives_the_digits_of_a_run():
    """In every form, rounding, kind of model and range, in bases 2, 10 and 16, from the model as given."""
    rng = np.random.default_rng(8)
    ends, seen = Counter(), set()
    for seed in range(180):
        drawn = draw(seed)
        end = compared(drawn, 12, rng)
        ends[end] += 1
        if end == "equal":
            limited = "unlimited" if drawn.fmt.emin is None else ("subnormal" if drawn.fmt.subnormal else "flushed")
            seen |= {drawn.form, drawn.kind, drawn.fmt.rounding, drawn.fmt.base, limited, drawn.model.n}
    assert ends["equal"] > 150, ends
    assert seen >= {*Form, *KINDS, *DETERMINISTIC, 2, 10, 16, *RANGES, 1, 3, 4}


# -- the survey -------------------------------------------------------------------------------------------------------


def test_the_survey_draws_everything_that_it_names():
    drawn = [draw(seed) for seed in range(400)]
    assert {each.form for each in drawn} == set(Form)
    assert {each.kind for each in drawn} == set(KINDS)
    assert {each.fmt.rounding for each in drawn} == set(DETERMINISTIC)
    assert {each.fmt.base for each in drawn} == {2, 3, 10, 16}
    assert {each.limited for each in drawn} == set(LIMITED)
    assert {each.model.n for each in drawn} == {1, 2, 3, 4}
    assert {each.model.m for each in drawn} == {1, 2}
    assert {each.fmt.precision for each in drawn if each.fmt.base == 2} >= set(range(3, 31))
    kinds = {kind: [each.model for each in drawn if each.kind == kind] for kind in KINDS}
    assert all(not model.H.any() for model in kinds["unseen"])
    assert all(model.cycle > 1 for model in kinds["cycle"])
    assert all(np.linalg.matrix_rank(model.Q[0].astype(float)) < model.n for model in kinds["singular"])
    growths = [np.abs(np.linalg.eigvals(model.Phi[0].astype(float))).max() for model in kinds["unstable"]]
    assert min(growths) > 0.98
    assert max(growths) > 1.3


SLICE = (2, 3, 4, 20, 36, 47)
examined = cache(filters.examine)


@pytest.mark.parametrize("seed", SLICE)
def test_no_run_of_a_slice_exceeds_its_bound(seed):
    row = examined(seed)
    assert (row.result, row.runs) == ("for ever", 8)
    assert 0.3 < row.largest <= 1
    assert not row.wrong
    assert row in filters.load()


@pytest.mark.parametrize("seed", SLICE)
def test_the_survey_finds_a_guarantee_that_is_too_small(seed):
    """A bound below the largest error is found to be exceeded, by as much."""
    row = examined(seed)
    smaller = filters.examine(seed, smaller=0.95 * row.largest)
    assert smaller.largest == pytest.approx(1 / 0.95, rel=1e-3)  # four digits are stored
    largest = filters.examine(seed, smaller=0.5 * row.largest).largest * 0.5 * row.largest
    assert 1 < filters.examine(seed, smaller=(1 - 1e-9) * largest).largest < 1 + 1e-8


def given_singular():
    """A model whose Q loses its definiteness when it is factored in 9 bits."""
    G = exact([["160/101", "54/89"], ["2/101", "-38/97"], ["-151/89", "25/89"]])
    Phi, unit = exact(np.diag([0, 1, 1])) / 8, exact(np.eye(3, dtype=int))
    model = LinearModel(Phi, exact([["7/4", -2, "-5/4"]]), G @ G.T, exact([["1/4"]]), exact([0, 0, 0]), unit)
    within = limits(state=[19.6905, 1.21509, 19.40933], innovation=59.8751)
    return Drawn("singular", model, FloatFormat(2, 9), Form.UD, "reached", within, np.array([479 / 8]))


def test_the_survey_finds_factors_of_another_covariance():
    """A guarantee for the stored model in place of the model as given is one for a filter that nobody runs."""

    def of_the_stored_model(model, fmt, *arguments, **settings):
        return guarantee(model.rounded(fmt), fmt, *arguments, **settings)

    drawn = given_singular()
    found = filters.examine(0, drawn, of_the_stored_model)
    assert found.largest == pytest.approx(1.173, abs=1e-3)
    assert found.gains == filters.STEPS
    repaired = filters.examine(0, drawn)
    assert 0.5 < repaired.largest <= 1
    assert not repaired.wrong


@pytest.mark.parametrize("seed", [2, 3, 20, 47])
def test_errors_are_those_of_filters_without_the_package(seed):
    """The run is repeated in integers, and the exact filter in Fractions; both for as long as Fractions stay short."""
    drawn = draw(seed)
    found = guarantee(drawn.model, drawn.fmt, drawn.within, form=drawn.form, most=filters.MOST, horizon=filters.STEPS)
    compared_steps = 0
    for _, z in filters.inputs(drawn, found, np.random.default_rng(seed)):
        off, _ = filters.errors(drawn, z)
        rounded = Filter.of(drawn.model, Arithmetic.of(drawn.fmt), drawn.form)
        true = ExactFilter(rounded.model())
        for k, row in enumerate(z[:25].tolist()):
            measured = [rounded.fmt.value(rounded.fmt.store(Fraction(each))) for each in row]
            errors = [float(a - b) for a, b in zip(rounded.step(measured), true.step(measured), strict=True)]
            if k >= len(off):
                assert any(
                    abs(v) > X for v, X in zip(map(float, true.innovation), drawn.within.innovation, strict=True)
                )
                break
            # Double-double has 31 digits, of which at most 10 cancel here.
            assert errors == pytest.approx(off[k].tolist(), rel=1e-12, abs=1e-20 * float(np.abs(found.bound).max()))
            assert all(abs(e) <= b for e, b in zip(errors, found.bound, strict=True))
            compared_steps += 1
    assert compared_steps > 100


def test_a_run_counts_until_the_exact_filter_leaves_its_limits():
    model = LinearModel(*(exact([[each]]) for each in ("1/2", 1, 1, 1)), exact([0]), exact([[1]]))
    drawn = Drawn(
        "plain",
        model,
        FloatFormat(2, 8),
        Form.INNOVATION,
        "all",
        limits(state=2, innovation=3, measurement=4),
        np.array([4.0]),
    )
    for z, true, steps in (
        ([1, 1, 5, 1], [1, 1, 1, 1], 2),  # a measurement beyond 4
        ([1, 1, 1, 1], [1, 3, 1, 1], 1),  # a state beyond 2
        ([1, 1, -3, 1], [1, 1, 1, 1], 2),  # an innovation of -3.5
        ([1, 1, 1, 1], [1, 1, 1, 1], 4),
    ):
        columns = (np.array(each, dtype=float)[:, None] for each in (true, z, z))
        assert filters.first_outside(drawn, *columns) == steps


def test_an_error_that_explains_nothing_is_a_failure():
    def broken(*_, **settings):
        raise ZeroDivisionError("division by zero")

    def refusing(*_, **settings):
        raise ValueError("got 3; needed a format with compiled loops")

    assert filters.examine(1, bounded=broken).result == "failed"
    assert (filters.examine(1, bounded=refusing).result, filters.examine(1, bounded=refusing).reason) == (
        "refused",
        "no compiled loops",
    )


def test_the_command_fails_where_a_run_exceeds_its_bound(monkeypatch, tmp_path, capsys):
    row = filters.load()[1]
    found = {"0": row._replace(chosen="1.002"), "1": row._replace(result="failed"), "2": row._replace(gains=1)}
    for seed, status in (("0", 1), ("1", 1), ("2", 1), ("3", 0)):
        made = found.get(seed, row)._replace(seed=0)
        monkeypatch.setattr(filters, "examine", lambda _, made=made: made)
        folder = tmp_path / seed
        given = ["recompute", filters.SWEEP.name, "--cells", "1", "--output", str(folder)]
        assert run([filters.SWEEP], "python -m sweeps", given) == status
        assert filters.load(folder / "guarantees" / "filters.csv") == (made,)
        assert capsys.readouterr().out.splitlines()[1:] == [" ".join(filters.texts(made))] * status


def test_no_stored_run_exceeds_its_bound():
    rows = filters.load()
    assert sum(row.runs for row in rows) >= 20_000
    assert [row for row in rows if row.wrong] == []
    (whole,) = {sum(each.runs for each in filters.counts(rows, name)) for name in ("form", "base", "rounding", "kind")}
    assert whole == sum(row.runs for row in rows)
    for name in ("form", "rounding", "kind", "range", "limited"):
        assert all(each.runs > 1_000 and each.largest > 0.8 for each in filters.counts(rows, name)), name


# -- scalar filters ---------------------------------------------------------------------------------------------------


def test_the_worst_error_is_that_of_all_sequences():
    """Every sequence of three measurements in three bits, each run in integers."""
    model = LinearModel(*(exact([[each]]) for each in ("-3/4", "5/4", "1/2", "3/4")), exact([0]), exact([[1]]))
    fmt = FloatFormat(2, 3, "nearest", -1, 5)
    given = scalar.ScalarFilter(model, fmt, Form.INNOVATION, fmt.round(1))
    z = [Fraction(each) for each in scalar.numbers(fmt, given.limit).tolist()]
    assert z == [Fraction(k, 8) for k in (-8, -7, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 7, 8)]
    largest = [0.0] * 3
    for sequence in product(z, repeat=3):
        rounded = Filter.of(model, Arithmetic.of(fmt), Form.INNOVATION)
        true = ExactFilter(rounded.model())
        for k, each in enumerate(sequence):
            largest[k] = max(largest[k], abs(float(rounded.step([each])[0] - true.step([each])[0])))
    found = scalar.worst_error(given)
    assert found.history[:3].tolist() == pytest.approx(largest, rel=1e-14)
    assert found.error == found.history.max() > largest[2]


@pytest.mark.parametrize("seed", [2, 3, 105, 174, 416])
def test_the_worst_error_is_reached_and_within_the_bound(seed):
    given = scalar.draw(seed)
    found = scalar.worst_error(given)
    rounded = Filter.of(given.model, Arithmetic.of(given.fmt), given.form)
    true = ExactFilter(rounded.model())
    for each in found.z.tolist():
        error = rounded.step([Fraction(each)])[0] - true.step([Fraction(each)])[0]
    assert abs(float(error)) == pytest.approx(found.error, rel=1e-12)
    bound = guarantee(given.model, given.fmt, limits(measurement=float(given.limit)), form=given.form).bound[0]
    assert found.error + found.later <= bound
    assert scalar.examine(seed) in scalar.load()


def test_all_numbers_of_a_format_are_listed():
    assert scalar.numbers(FloatFormat(2, 3, "chop", 0, 1), Fraction(7, 2)).tolist() == [
        *(-k / 4 for k in (14, 12, 10, 8, 7, 6, 5, 4, 3, 2, 1)),
        *(k / 4 for k in (0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14)),
    ]
    flushed = scalar.numbers(FloatFormat(2, 3, "chop", 0, 1, False), Fraction(1))
    assert flushed.tolist() == [-1, 0, 1]
    with pytest.raises(ValueError, match="needed a format with a range"):
        scalar.numbers(FloatFormat(2, 3), Fraction(1))


def test_no_stored_worst_error_exceeds_its_bound():
    rows = [row for row in scalar.load() if row.result == "compared"]
    assert len(rows) > 300
    ratios = [float(row.ratio) for row in rows]
    assert max(ratios) <= 1
    assert max(ratios) > 0.75
    assert {(row.form, row.rounding) for row in rows} == {
        (f.name.lower(), r.value) for f in Form for r in DETERMINISTIC
    }
    assert {row.precision for row in rows} == {3, 4, 5, 6}
