"""Short runs replay a list of operations: with the digits and the notes of the compiled loops."""

from __future__ import annotations

import numpy as np
import pytest
from small_filter import FORMATS, FORMATS_OF_ALL_FORMS, STEPS, measurements, model

from gpbnb import BINARY32, BINARY64, FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.bounded_run import emulate_with_bound
from gpbnb.filters import replayed
from gpbnb.filters.forms import Form
from gpbnb.filters.replayed import ReplayBudget, only_compiled
from gpbnb.filters.run import Run, Sums

OTHERS = (
    None,
    BINARY32,
    BINARY64,
    FixedFormat(8, 20),
    FloatFormat(2, 20, "even", -60, 60),
    FloatFormat(10, 9, "even"),
)
HUNG = (Form.HUNG, Form.HUNG_SECOND_GAIN)


@pytest.fixture(autouse=True)
def afresh(monkeypatch):
    """Nothing has been replayed yet."""
    monkeypatch.setattr(replayed, "BUDGET", ReplayBudget())


@pytest.fixture
def replays(monkeypatch):
    """The number of calls that took their steps by replay."""
    found = []
    original = replayed.replay

    def counted(*arguments):
        found.append(arguments[3])
        return original(*arguments)

    monkeypatch.setattr(replayed, "replay", counted)
    return found


def both(take, *arguments, **options):
    """The same run twice, by replay and in the compiled loops."""
    runs = [Run(*arguments, **options) for _ in range(2)]
    take(runs[0])
    with only_compiled():
        take(runs[1])
    return runs


def assert_same(one, other):
    for name in ("x", "P", "X", "G", "C", "notes"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.reason == other.reason


@pytest.mark.parametrize(
    ("fmt", "form"),
    [
        (fmt, form)
        for fmt in (*FORMATS, *OTHERS)
        for form in (Form.INNOVATION, Form.JOSEPH, Form.UD, *HUNG)
        if form is not Form.HUNG_SECOND_GAIN or fmt in FORMATS_OF_ALL_FORMS
    ],
)
def test_a_replayed_run_has_every_digit_of_the_compiled_loops(fmt, form, replays):
    z = measurements()
    one, other = both(lambda run: run.take(z), model(), fmt, form, (1, 2, STEPS))
    assert_same(one, other)
    # In double-double the order of factors matters, and only that of the innovation form is that of the loops.
    assert len(replays) == (STEPS if fmt is not None or form is Form.INNOVATION else 0)


@pytest.mark.parametrize("fmt", [None, FloatFormat(2, 11), FloatFormat(10, 4, "chop")])
def test_many_measurements_and_states_have_the_same_digits(fmt, replays):
    rng = np.random.default_rng(3)
    for n, m in ((1, 1), (5, 3), (2, 4)):
        given = model(
            Phi=np.round(np.eye(n) + 0.2 * rng.standard_normal((n, n)), 2),
            H=np.round(rng.standard_normal((m, n)), 2),
            Q=0.25 * np.eye(n, dtype=int),
            R=np.eye(m, dtype=int),
            x0=np.zeros(n, int),
            P0=np.eye(n, dtype=int),
        )
        z = np.round(rng.standard_normal((STEPS, m)), 2)
        assert_same(*both(lambda run, z=z: run.take(z), given, fmt, "innovation", range(1, STEPS + 1)))
    assert len(replays) == 3 * STEPS


def test_the_ud_form_leaves_unchanged_what_a_measurement_does_not_see(replays):
    """Each state is by itself, and only two are measured."""
    given = model(Phi=np.diag([0.5, 0.75, 0.25]), H=[[1, 0, 0], [0, 0, 1]], Q=np.eye(3), R=np.eye(2), P0=np.eye(3))
    one, other = both(lambda run: run.take(measurements()), given, FloatFormat(2, 11), "UD", range(1, STEPS + 1))
    assert_same(one, other)
    assert len(replays) == STEPS


def test_a_run_goes_on_where_it_stood(replays):
    z = measurements()
    one, other = both(lambda run: [run.take(z[:2]), run.take(z[2:])], model(), FloatFormat(2, 11), "Joseph", (3, STEPS))
    assert_same(one, other)
    assert len(replays) == STEPS


@pytest.mark.parametrize(
    ("fmt", "changed"),
    [
        (FloatFormat(2, 11, "even", -8, 4), {"Phi": np.diag([4, 1, 1])}),  # beyond the largest number
        (FloatFormat(2, 6), {"R": [["1e-6", 0], [0, "1e-6"]], "H": [[1, 0, 0], [1, 0, 0]]}),  # a pivot of zero
        (FloatFormat(10, 2, "chop"), {"P0": 1000 * np.eye(3, dtype=int)}),  # a variance below zero
    ],
)
def test_what_ends_a_run_or_makes_it_indefinite_is_noted_alike(fmt, changed):
    z = measurements()
    one, other = both(lambda run: run.take(z), model(**changed), fmt, "innovation", range(1, STEPS + 1))
    assert_same(one, other)
    assert one.stopped or one.indefinite


def test_the_bound_of_a_run_is_the_same(replays):
    arguments = model(), measurements(), FloatFormat(2, 20), "innovation", (1, STEPS)
    one = emulate_with_bound(*arguments)
    assert len(replays) >= 3 * STEPS  # the run, its repetition and the reference
    with only_compiled():
        other = emulate_with_bound(*arguments)
    for name in ("state", "gain", "covariance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        np.testing.assert_array_equal(getattr(one.history, name), getattr(other.history, name))


@pytest.mark.parametrize(
    "options",
    [
        {"fmt": FloatFormat(2, 12, "stochastic")},
        {"fmt": FloatFormat(2, 12), "sums": Sums(fused=True)},
        {"fmt": FloatFormat(2, 12), "compensated": True},
    ],
)
def test_other_arithmetic_runs_in_the_compiled_loops(options, replays):
    run = Run(**{"model": model(), "form": "innovation", "checkpoint_steps": (), **options})
    run.take(measurements())
    assert run.steps == STEPS
    assert not replays


def test_many_steps_run_in_the_compiled_loops_and_so_do_all_later_ones(replays, monkeypatch):
    monkeypatch.setattr(replayed, "BUDGET", ReplayBudget(1e-3, 1e-3))
    fmt = FloatFormat(2, 11)
    for steps, replayed_steps in ((6, 6), (200, 6), (6, 6)):
        run = Run(model(), fmt, "innovation", ())
        run.take(measurements(steps))
        assert (run.steps, len(replays)) == (steps, replayed_steps)


def test_blocks_of_several_threads_overlap_and_the_time_that_was_left_is_kept():
    budget = ReplayBudget(before_compiling=1.0)

    def allowed(seconds):
        return budget.allows("kind", seconds, lambda: False)

    assert allowed(0.5)
    first, second = budget.closed(), budget.closed()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)  # not the one that was entered last
    assert not allowed(0.1)
    second.__exit__(None, None, None)
    assert [allowed(seconds) for seconds in (0.4, 0.4, 0.0)] == [True, False, False]
