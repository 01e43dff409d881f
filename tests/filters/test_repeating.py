"""A step that is recorded and repeated gives the digits of the step itself, run operation by operation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, NonlinearModel
from gpbnb.filters import repeating
from gpbnb.filters.nonlinear_run import NonlinearRun
from gpbnb.filters.repeating import RepeatedStep
from gpbnb.filters.steps import StepTaken, if_holds
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
    return run._step._repeated is not None


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


def random_step(rng):
    """A step on two states and cycles, of which only the first state, at random, depends on the step's own numbers."""

    def mixed(numbers, count):
        numbers = list(numbers)
        for _ in range(count):
            a, b, c = (numbers[i] for i in rng.integers(len(numbers), size=3))
            numbers.append(
                [
                    lambda a, b, c: a * b + c,
                    lambda a, b, c: (a - b) / (c * c + 1),
                    lambda a, b, c: np.where(a > b, c, a),
                    lambda a, b, c: np.where((a > b) & (b > c), b - a, c),
                    lambda a, b, c: np.sqrt(abs(a)) * 0.5,
                    lambda a, b, c: if_holds(a > b, lambda: c / (b * b + 1), c * 0.25),
                ][rng.integers(6)](a, b, c)
            )
        return numbers[-1], numbers[-2], numbers[-1] > numbers[-2]

    seed = rng.integers(1 << 32)

    def step(formats, states, given):
        nonlocal rng
        rng = np.random.default_rng(seed)
        (a, b), (z, c, d) = states, given
        b1, b2, early = mixed([*b, *c], 6)
        a1, a2, late = mixed([*a, *z, *b, *c, *d, b1], 8)
        a1 = np.where(d[0] > d[1], a1, -a1)
        a1, b1, b2 = (each / (abs(each) + 1) for each in (a1, b1, b2))
        return StepTaken((np.stack([a1, b1]), np.stack([b1, b2])), [np.stack([a2, b1]), np.stack([b2])], early & late)

    return step


KINDS = {
    FloatFormat(2, 24): "RunningStep",
    FloatFormat(10, 8, "even"): "RunningStep",
    FloatFormat(2, 99): "RunningStep",
    FloatFormat(2, 130): "_OneByOne",
    FloatFormat(2, 20, "stochastic"): "NoneType",
}


@pytest.mark.parametrize("fmt", KINDS, ids=str)
def test_what_does_not_depend_on_the_own_numbers_of_a_step_runs_apart(fmt, monkeypatch):
    monkeypatch.setattr(repeating, "FEW_OPERATIONS", 0)
    seeds, pieces = (8, [0, 1, 8, 28, 60]) if fmt == FloatFormat(2, 24) else (4, [0, 1, 8, 24])
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        step = random_step(rng)
        z, c, d = (fmt.array(rng.standard_normal((count, 2))) for count in (pieces[-1], 3, 1))
        start = fmt.array([0.5, -0.25]), fmt.array([0.125, 1])
        fmt.restart()
        repeated = RepeatedStep(step, [fmt], start, [c, d])
        parts = [part for i, j in pairwise(pieces) for part in repeated.take(z[i:j])]
        assert type(repeated._repeated).__name__ == KINDS[fmt]
        fmt.restart()
        states, k = start, 0
        for part in parts:
            for i in range(len(part.definite)):
                taken = step([fmt], states, [z[k], c[k % 3], d[0]])
                states, k = taken.states, k + 1
                for mine, right in zip((*part.states, *part.gain), (*taken.states, *taken.gain), strict=True):
                    assert np.array_equal(mine[i], right), (seed, k)
                assert part.definite[i] == bool(taken.definite), (seed, k)
        assert k == pieces[-1]
