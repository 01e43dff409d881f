"""Every term of what a guarantee adds up, in exact fractions: sums, limits from measurements, caps, blocks, gains."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction as F
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_terms import fractions, same

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.kalman.bounded_run import BoundedRun
from gpbnb.kalman.forms import Form
from gpbnb.kalman.guarantee import bound, gains
from gpbnb.kalman.guarantee.bound import from_schedule, limits
from gpbnb.kalman.guarantee.envelope import GAIN, LOOP, ROUNDING, Certificate, Disturbances, Limits
from gpbnb.kalman.guarantee.linear import LinearFilter, state_space
from gpbnb.kalman.guarantee.program import Builder, Program, steps_in_python
from gpbnb.kalman.model import LinearModel

FMT = FloatFormat(2, 24)


def disturbances(steps: int, **changed: Any) -> Disturbances:
    """One state, two columns and one measurement; each array has a number of its own."""
    columns = np.full((steps, 1, 2), 1.0)
    given = {
        "F": np.full((steps, 1, 1), 0.5),
        "spread": np.full((steps, 1, 1), 0.0),
        "G": columns,
        "limits": columns[:, 0],
        "slack": np.zeros((steps, 1)),
        "K": np.ones((steps, 1, 1)),
        "loop": np.zeros((steps, 1, 1)),
        "gain": np.zeros((steps, 1, 1)),
    }
    return Disturbances(**(given | changed))


def one_state(steps: int = 1, **changed: Any) -> gains.Schedule:
    given = state_space([["1/2"]], [["1"]]).schedule(FMT)
    names = ("coefficients", "packed", "Phi", "HPhi", "exact", "dK")
    return replace(given, **{name: np.repeat(getattr(given, name), steps, axis=0) for name in names}, **changed)


def certificate(sums: Any, residual: F, tail: F) -> Certificate:
    one = np.ones((1, 1))
    return Certificate(np.array([sums], dtype=float), one * float(residual), one * float(tail), one * 0, 9)


# -- sums over earlier steps ------------------------------------------------------------------------------------------


def test_a_column_counts_whatever_its_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only columns that are zero, or whose limit is zero, at every step are left out."""
    G = np.array([[[-1.0, 1.0, 2.0, 0.0]], [[0.0, 1.0, 0.0, 0.0]]])
    limit = np.array([[3.0, 0.0, 0.0, 7.0], [3.0, 0.0, 5.0, 7.0]])
    limit[0, 2] = 0.25
    seen = []

    def certify(*arguments: Any) -> Certificate:
        seen.append(arguments)
        return certificate([1, 0, 0, 0], F(0), F(0))

    monkeypatch.setattr(bound, "certify", certify)
    monkeypatch.setattr(bound, "_radius", lambda _: 0.5)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.array([ROUNDING, GAIN, LOOP, GAIN]))
    bound._sums(one_state(2), disturbances(2, G=G, limits=limit), np.zeros(1), 50, True, 10, 1e6)
    assert np.array_equal(seen[0][2], G[:, :, [0, 2]])
    assert np.array_equal(seen[0][3], limit[:, [0, 2]])
    assert list(seen[0][5]) == [ROUNDING, LOOP]


def test_the_first_steps_count_among_the_earlier_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds of 9 at first and of 10 after that, above the 8 assumed: what is carried on is a share of the largest."""
    sums, residual, tail = [F(3), F(1, 2), F(1, 4), F(0)], F(1, 8), F(1, 16)
    known, parts, raised = [], np.zeros((1, 1, 4)), F(10) * (1 + F(1, 2**30))

    def onward(*arguments: Any) -> Any:
        known.append(float(arguments[10][0]))
        return np.array([[10.0]]), parts

    monkeypatch.setattr(bound, "certify", lambda *_: certificate(sums, residual, tail))
    monkeypatch.setattr(bound, "forward", lambda *_: (np.array([[9.0]]), parts))
    monkeypatch.setattr(bound, "onward", onward)
    monkeypatch.setattr(bound, "_radius", lambda _: 0.5)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(2, dtype=np.int64))
    history, _, _ = bound._sums(one_state(2, first=1), disturbances(2), np.array([8.0]), 50, True, 10, 1e6)
    assert known == [9.0, float(raised)]
    exactly = (sum(sums) + (residual + tail) * F(known[-1])) * (1 + F(1, 2**48))
    assert exactly < raised
    assert list(history[:2, 0]) == [9.0, 10.0]
    assert abs(F(float(history[2, 0])) / exactly - 1) < F(1, 2**51)


def test_a_filter_that_is_not_stable_repeats_its_period_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three rows, of which the last two repeat; a bound that is no number is infinite."""
    slack = np.array([[1.0], [2.0], [4.0]])
    seen = []

    def forward(*arguments: Any) -> Any:
        seen.append(arguments[4][:, 0])
        return np.full((7, 1), np.nan), np.zeros((7, 1, 4))

    monkeypatch.setattr(bound, "forward", forward)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(2, dtype=np.int64))
    history, _, lags = bound._sums(one_state(3, first=1), disturbances(3, slack=slack), np.zeros(1), 7, False, 7, 1e6)
    assert list(seen[0]) == [1, 2, 4, 2, 4, 2, 4]
    assert np.isinf(history).all()
    assert lags == 7


def test_the_bound_is_assumed_for_the_sizes_of_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bound of 1 + b/2 if errors stay within b: what is returned is enough for itself, and barely more than 2."""
    monkeypatch.setattr(bound, "_disturbances", lambda given, within, b, caps=None: b)
    monkeypatch.setattr(bound, "_radius", lambda _: 0.5)
    monkeypatch.setattr(bound, "_sums", lambda given, found, *_: (1 + found.reshape(1, 1) / 2, np.zeros((1, 1, 4)), 1))
    found = from_schedule(one_state(), limits(1, 1, state=1, innovation=1))
    assert 1 + F(found.bound[0]) / 2 <= F(found.bound[0]) < 2 * (1 + F(1, 2**29))
    assert found.for_ever


# -- limits from measurements -----------------------------------------------------------------------------------------


def test_limits_from_measurements_begin_with_the_first_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its size is rounded up, and the first steps are examined one by one; limits that are known stay in force."""
    first = F(-1, 3)
    assert F(float(first)) > first
    given = one_state(2, first=1, x0=np.array([first], dtype=object))
    given.HPhi[..., 0] = np.array([0.25, -0.75]).reshape(2, 1, 1)
    seen = []

    def peaks(*arguments: Any) -> Any:
        seen.append(arguments)
        return np.array([5.0]), np.array([7.0])

    monkeypatch.setattr(bound, "peaks", peaks)
    monkeypatch.setattr(bound, "unit_disturbances", lambda _: disturbances(2, loop=np.full((2, 1, 1), 0.125)))
    within = Limits(np.array([3.0]), np.array([np.inf]), np.array([2.0]))
    for for_ever, early in ((True, 1 + 9), (False, 5)):
        found = bound._from_measurements(given, within, 9, for_ever, 5)
        *arrays, HPhi, X, V, Z, x0, row, examined, steady, most, _, _ = seen[-1]
        assert F(1, 3) < F(x0[0]) < F(1, 3) * (1 + F(1, 2**49))
        assert np.array_equal(HPhi, given.HPhi[..., 0])
        assert (examined, row, steady, most) == (early, 1, for_ever, 9)
        assert np.array_equal(arrays[2], [[[1.0, 0.125, 0.0]]] * 2)
        assert np.array_equal(arrays[3], [[2.0, X[0], V[0]]] * 2)
        assert list(arrays[5]) == [ROUNDING, LOOP, GAIN]
        assert X[0] == found.state[0] == 3 * (1 + 2.0**-30)
        assert V[0] == found.innovation[0] == 7 * (1 + 2.0**-30)
        assert Z[0] == 2
    rest = replace(given, first=0, x0=np.array([F(0)]))
    bound._from_measurements(rest, within, 9, True, 5)
    assert seen[-1][11] == 0  # without a first estimate, the past of the first steps is a part of the infinite one


def caps_case() -> tuple[Program, gains.Schedule, Any, Limits]:
    """Two states; the functions of the operations differ in every entry."""
    build = Builder(2, 1)
    x, y = build.states
    (z,) = build.inputs
    a = build.add(build.multiply(0, x), build.multiply(1, z))
    program = build.finish([build.subtract(a, build.multiply(2, y)), build.multiply(3, a)], 4)
    filter_ = LinearFilter(program, np.array([F(1, 2), F(3, 4), F(-3, 8), F(5, 4)], dtype=object))
    two = np.zeros((1, 2, 2))
    found = disturbances(
        1, F=two + 0.25, K=np.array([[[-0.5], [2.0]]]), spread=np.array([[[2.0**-45, 2.0**-46], [0, 2.0**-44]]])
    )
    return program, filter_.schedule(FMT), found, Limits(np.array([3.0, 5.0]), np.array([np.inf]), np.array([7.0]))


def test_caps_of_operations(monkeypatch: pytest.MonkeyPatch) -> None:
    program, given, found, within = caps_case()
    # Each operation is a function of the states before the step and of the measurement.
    a, b, c = F(1, 2), F(3, 4), F(-3, 8)
    of_state = [[a, 0], [0, 0], [a, 0], [0, c], [a, -c], [a * F(5, 4), 0]]
    of_input = [0, b, b, 0, b, b * F(5, 4)]
    assert len(program.operations) == len(of_state)
    # Other numbers for each operation, as a certificate would return them.
    sums = np.arange(1, 25).reshape(6, 4) / 8
    residual, tail = np.arange(1, 13).reshape(6, 2) / 64, np.arange(13, 25).reshape(6, 2) / 128
    seen = []

    def certify(*arguments: Any) -> Certificate:
        seen.append(arguments)
        return Certificate(sums, residual, tail, tail * 0, 9)

    monkeypatch.setattr(bound, "certify", certify)
    monkeypatch.setattr(bound, "_disturbances", lambda *_: found)
    caps = bound._caps(given, within, 50)
    X, Z = [F(3), F(5)], F(7)
    _, _, columns, limit, slack, _, starts, k, first, steady, most, *_ = seen[0]
    same(starts, of_state)
    assert np.array_equal(columns, found.K)
    assert np.array_equal(limit, [[7.0]])
    assert (k, first, steady, most) == (1, 0, True, 50)
    K, spread = fractions(found.K[0, :, 0]), fractions(found.spread[0])
    same(slack, [F(1, 2**48) * abs(K) * Z + spread @ X], 1e-15)
    for o in range(6):
        exactly = sum(fractions(sums[o])) + (fractions(residual[o]) + fractions(tail[o])) @ X + abs(of_input[o]) * Z
        sizes = sum(abs(s) * x for s, x in zip(of_state[o], X, strict=True)) + abs(of_input[o]) * Z
        exactly = (exactly + F(1, 2**50) * sizes) * (1 + F(1, 2**40))
        assert abs(F(caps[o]) / exactly - 1) < F(1, 2**50)


def test_caps_make_up_for_the_low_parts_of_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where all other terms vanish, 2**-50 of the sizes is left."""
    _, given, found, within = caps_case()
    nothing = Certificate(np.zeros((6, 4)), np.zeros((6, 2)), np.zeros((6, 2)), np.zeros((6, 2)), 1)
    monkeypatch.setattr(bound, "certify", lambda *_: nothing)
    monkeypatch.setattr(bound, "_disturbances", lambda *_: found)
    caps = bound._caps(given, within, 50)
    same(caps[3], F(3, 8) * 5 / 2**50 * (1 + F(1, 2**40)), 1e-15)


def test_caps_need_a_filter_that_never_changes_and_starts_at_zero() -> None:
    _, given, _, within = caps_case()
    assert np.isfinite(bound._caps(given, within, 50)).all()
    for changed in (
        {"HPhi": given.HPhi + 1.0},
        {"coefficients": np.repeat(given.coefficients, 2, axis=0)},
        {"x0": np.array([F(0), F(1000)], dtype=object)},
    ):
        assert np.isinf(bound._caps(replace(given, **changed), within, 50)).all()


def test_a_first_estimate_is_not_forgotten() -> None:
    """A thousand at first and a measurement of one: the roundings of the first steps are as large as the estimate."""
    given = replace(state_space([["0.9"]], [["1"]]).schedule(FloatFormat(2, 9)), x0=np.array([F(1000)], dtype=object))
    found = from_schedule(given, limits(1, 1, measurement=1))
    coefficients = [F(float(c)) for c in given.coefficients[0, :, 0]]
    computed, true, largest = list(given.x0), list(given.x0), F(0)
    for _ in range(20):
        computed = steps_in_python(given.program, given.fmt.round, coefficients, computed, [F(1)])
        true = steps_in_python(given.program, lambda x: x, coefficients, true, [F(1)])
        largest = max(largest, abs(computed[0] - true[0]))
    assert 2 < largest <= F(found.bound[0]) < 10 * largest
    assert found.for_ever


# -- a gain that repeats ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("larger", "trial"), [(0.0, 3.0), (0.5, 3.0), (1.5, 4.5)])
def test_a_trial_distance_holds_at_the_beginning(larger: float, trial: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The exact covariance begins within 3 of the computed one; a smaller distance may shrink, but is never reached."""
    tried = []

    class Run:
        steps, C, bounds, P = 3, np.full((3, 1, 1), 10.0), (None, "dK"), np.array([[10.0]])

        def __init__(self, *_: Any) -> None:
            self.bound = contraction(2.0, 3.0)

        def take(self, z: Any) -> None:
            tried.append(self.bound.zeta)
            if len(tried) == 2:
                self.bound = contraction(2.0, 0.25)

        def exactly(self, x: Any) -> Any:
            return fractions(x)

    class Bound(SimpleNamespace):
        def _replace(self, zeta: float) -> Bound:
            return Bound(L=self.L, zeta=zeta)

    def contraction(L: float, zeta: float) -> Bound:
        return Bound(L=np.array([[L]]), zeta=zeta)

    monkeypatch.setattr(gains, "BoundedRun", Run)
    stored: Any = SimpleNamespace(m=1)
    run: Any = Run()
    gains._closes(stored, run, 0, 2, larger, 100)
    assert tried == [3.0, trial]


def test_the_error_of_the_exact_gain_reaches_the_schedule(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until the gain settles, that of the run; from then on, that of the period which was tried."""
    model = LinearModel(Phi=[["1/2"]], H=[["1"]], Q=[["1"]], R=[["1"]], x0=["0"], P0=[["1"]])
    given = gains.schedule(model, FMT, Form.INNOVATION)
    run = BoundedRun(model.rounded(FMT), None, Form.INNOVATION, range(1, given.steps + 1))
    run.take(np.zeros((given.steps, 1)))
    assert given.settled
    assert (run.bounds[1] > 0).all()
    assert (given.dK >= run.bounds[1]).all()
    assert given.dK[-1] > run.bounds[1][-1]
    late = gains.schedule(model, FMT, Form.INNOVATION, most=5)
    assert not late.settled
    assert np.array_equal(late.dK, run.bounds[1][: late.steps])
