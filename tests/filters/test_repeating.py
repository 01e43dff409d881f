"""A step that is recorded and repeated gives the digits of the step itself, run operation by operation."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, NonlinearModel
from gpbnb.filters.nonlinear_run import NonlinearRun
from gpbnb.filters.repeating import RepeatedStep
from tests.step_functions import tracked_motion, tracked_sight

Z = [[5.0, 0.93], [5.6, 0.9], [None, 0.88], [6.9, 0.86], [7.5, None], [8.1, 0.83], [8.8, 0.81], [9.4, 0.8]]
PLANE = {"Q": np.diag([0, 0, 0.01, 0.01]), "R": np.diag([0.01, 0.0001]), "x0": [3, 4, 0.5, 0.5], "P0": np.eye(4)}


def sight(method="extended", **options):
    model = NonlinearModel(tracked_motion, None, tracked_sight, None, **PLANE, angles=[1], method=method, **options)
    return model.without_missing(np.array(Z, dtype=float))


def by_operations(monkeypatch, make, z):
    """States of a run whose steps are not repeated."""
    with monkeypatch.context() as patch:
        patch.setattr(RepeatedStep, "_opened", lambda self, given, steps: None)
        return make().states(z)


def repeats(run) -> bool:
    return run._step._inside is not None


FORMATS = [FloatFormat(2, 24), FloatFormat(10, 8, "even"), FloatFormat(2, 300), FixedFormat(8, 60, "chop", "wrap")]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_an_unscented_and_an_iterated_filter_in_each_kind_of_numbers(fmt, monkeypatch):
    for options in ({"method": "unscented"}, {"iterations": 2}):
        model, z = sight(**options)
        run = NonlinearRun(model, fmt)
        states = run.states(z)
        assert np.array_equal(states, by_operations(monkeypatch, lambda model=model: NonlinearRun(model, fmt), z))
        assert len(states) == len(Z)
        assert repeats(run)


def coasting(x):
    step = x.format.array("0.25")
    fast = np.where(x[2:] > x.format.array("0.6"), x.format.array("0.6"), x[2:])
    return np.concatenate([step * fast + x[:2], np.stack([step, x[2]])[1:], x[3:]])


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_functions_with_constants_on_the_left_and_choices_are_repeated_with_their_derivatives(fmt, monkeypatch):
    model = NonlinearModel(coasting, None, tracked_sight, None, **PLANE, angles=[1])
    model, z = model.without_missing(np.array(Z, dtype=float))
    run = NonlinearRun(model, fmt)
    states = run.states(z)
    assert np.array_equal(states, by_operations(monkeypatch, lambda: NonlinearRun(model, fmt), z))
    assert repeats(run)


def test_a_function_that_depends_on_more_than_its_arguments_is_called_in_each_step(monkeypatch):
    calls = []

    def turning(x):
        calls.append(len(calls))
        return tracked_motion(x) * (1 + len(calls))

    model, z = NonlinearModel(turning, None, tracked_sight, None, **PLANE), [[5, 1]] * 3
    run = NonlinearRun(model, FloatFormat(2, 24))
    states, begin = run.states(z), calls.index(2)
    assert not repeats(run)
    assert (len(calls), begin) == (5, 2)  # two of them to record it
    calls[:] = [0, 1]
    assert np.array_equal(states, by_operations(monkeypatch, lambda: NonlinearRun(model, FloatFormat(2, 24)), z))


def test_a_function_that_branches_on_a_number_is_called_in_each_step():
    def turning(x):
        return tracked_motion(x) if x[2] > 0 else x

    run = NonlinearRun(NonlinearModel(turning, None, tracked_sight, None, **PLANE), FloatFormat(2, 24))
    assert len(run.states([[5, 1]] * 3)) == 3
    assert not repeats(run)
