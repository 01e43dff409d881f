"""Every term of what a guarantee adds up, in exact fractions: sums, limits from measurements, caps, blocks."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction as F
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_terms import Distance, fractions, same

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import load
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds import gains
from gpbnb.bounds import guarantee as bound
from gpbnb.bounds.envelope import GAIN, LOOP, ROUNDING, Certificate, Columns, Disturbances, FilterLimits, Steps, units
from gpbnb.bounds.guarantee import from_schedule, limits
from gpbnb.bounds.linear import filter_schedule
from gpbnb.filters import bounded_steps
from gpbnb.filters.bounded_steps import Bounds
from gpbnb.filters.factors import covariance_of_factors
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.bounded import widened
from gpbnb.filters.model import LinearModel
from gpbnb.filters.program import Builder, Program
from gpbnb.filters.run import Run
from gpbnb.filters.system import LinearFilter, state_space
from gpbnb.report.gravity_probe_b import horizon
from tests.plain_program import steps_in_python

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
    given = filter_schedule(state_space([["1/2"]], [["1"]]), FMT)
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
    bound._sums(one_state(2), disturbances(2, G=G, limits=limit), np.zeros(1), 50, 0.5, 10, 1e6)
    given = seen[0][0]
    assert np.array_equal(given.G, G[:, :, [0, 2]])
    assert np.array_equal(given.limits, limit[:, [0, 2]])
    assert list(given.part) == [ROUNDING, LOOP]


def test_rows_allow_for_the_sums_of_all_states(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is carried on is a sum over all states, 64 here; without any of it, the allowance is left."""
    n = 64
    sums, none = np.zeros((n, 4)), np.zeros((n, n))
    sums[:, ROUNDING] = 1.0
    schedule = filter_schedule(state_space(np.eye(n, dtype=int) / F(2), np.ones((n, 1), dtype=int)), FMT)
    monkeypatch.setattr(bound, "certify", lambda *_: Certificate(sums, none, none, none, 9))
    monkeypatch.setattr(bound, "_radius", lambda _: 0.5)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(2, dtype=np.int64))
    given = disturbances(1, slack=np.zeros((1, n)))
    history, _, _ = bound._sums(schedule, given, np.full(n, 2.0), 50, 0.5, 10, 1e6)
    assert (1 + F(1, 2**53)) ** (n + 7) < F(history[0, 0]) < 1 + F(2 * n, 2**53)
    assert (history == history[0, 0]).all()


def test_the_first_steps_count_among_the_earlier_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds of 9 at first and of 10 after that, above the 8 assumed: what is carried on is a share of the largest."""
    sums, residual, tail = [F(3), F(1, 2), F(1, 4), F(0)], F(1, 8), F(1, 16)
    known, parts, raised = [], np.zeros((1, 1, 4)), F(10) * (1 + F(1, 2**30))

    def onward(*arguments: Any) -> Any:
        known.append(float(arguments[5][0]))
        return np.array([[10.0]]), parts

    monkeypatch.setattr(bound, "certify", lambda *_: certificate(sums, residual, tail))
    monkeypatch.setattr(bound, "forward", lambda *_: (np.array([[9.0]]), parts))
    monkeypatch.setattr(bound, "onward", onward)
    monkeypatch.setattr(bound, "_radius", lambda _: 0.5)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(2, dtype=np.int64))
    history, _, _ = bound._sums(one_state(2, first=1), disturbances(2), np.array([8.0]), 50, 0.5, 10, 1e6)
    assert known == [9.0, float(raised)]
    exactly = (sum(sums) + (residual + tail) * F(known[-1])) * (1 + F(1, 2**48))
    assert exactly < raised
    assert list(history[:2, 0]) == [9.0, 10.0]
    assert abs(F(float(history[2, 0])) / exactly - 1) < F(1, 2**51)


def test_what_one_state_needs_takes_nothing_from_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first state begins with an error of 9 and carries a quarter of it on; its later errors are at most 3.25.

    The second state's error is 7.25 later, then 20 in some step: the bound is raised twice, but for this state only.
    """
    sums, share, none = np.zeros((2, 4)), np.array([[0.25, 0.0]] * 2), np.zeros((2, 2))
    sums[:, GAIN] = 1.0, 5.0
    given = one_state(2, first=1, program=state_space(np.eye(2, dtype=int), np.ones((2, 1), dtype=int)).program)
    found, parts, known = disturbances(2, slack=np.zeros((2, 2))), np.zeros((1, 2, 4)), []
    monkeypatch.setattr(bound, "certify", lambda *_: Certificate(sums, share, none, none, 9))
    monkeypatch.setattr(bound, "forward", lambda *_: (np.array([[9.0, 1.0]]), parts))
    monkeypatch.setattr(
        bound, "onward", lambda *given: (known.append(given[5].copy()), (np.array([[2.0, 20.0]]), parts))[1]
    )
    monkeypatch.setattr(bound, "_radius", lambda _: 0.5)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(2, dtype=np.int64))
    history, _, _ = bound._sums(given, found, np.zeros(2), 50, 0.5, 10, 1e6)
    assert history[:2].tolist() == [[9, 1], [2, 20]]
    same(history[2], [F(13, 4), F(29, 4)], 1e-14)
    assert known[-1].tolist() == [9, 20 * (1 + 2.0**-30)]


def test_a_filter_that_is_not_stable_repeats_its_period_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three rows, of which the last two repeat; a bound that is no number is infinite."""
    slack = np.array([[1.0], [2.0], [4.0]])
    seen = []

    def forward(*arguments: Any) -> Any:
        seen.append(arguments[4][:, 0])
        return np.full((7, 1), np.nan), np.zeros((7, 1, 4))

    monkeypatch.setattr(bound, "forward", forward)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(2, dtype=np.int64))
    history, _, lags = bound._sums(one_state(3, first=1), disturbances(3, slack=slack), np.zeros(1), 7, None, 7, 1e6)
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


@pytest.mark.parametrize(("measurement", "bounded"), [(1.5, True), (3.0, False)])
def test_an_exact_sum_may_leave_the_range(measurement: float, bounded: bool) -> None:
    """Fixed point up to 4: products stay within 3 and sums are exact, but a sum may reach 6."""
    given = filter_schedule(state_space([["1/2"]], [["1"]]), FixedFormat(2, 8))
    found = from_schedule(given, limits(1, 1, measurement=measurement))
    assert np.isfinite(found.bound).all() == bounded == found.for_ever


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
    within = FilterLimits(np.array([3.0]), np.array([np.inf]), np.array([2.0]))
    for for_ever, early in ((True, 1 + 9), (False, 5)):
        found = bound._from_measurements(given, within, 9, for_ever, 5)
        given_columns, HPhi, (X, Z, x0), row, examined, steady, end = seen[-1]
        assert F(1, 3) < F(x0[0]) < F(1, 3) * (1 + F(1, 2**49))
        assert np.array_equal(HPhi, given.HPhi[..., 0])
        assert (examined, row, steady, end.most) == (early, 1, for_ever, 9)
        assert np.array_equal(given_columns.G, [[[1.0, 0.125, 0.0]]] * 2)
        assert np.array_equal(given_columns.limits, [[2.0, X[0], found.innovation[0]]] * 2)
        assert list(given_columns.part) == [ROUNDING, LOOP, GAIN]
        assert X[0] == found.state[0] == 3 * (1 + 2.0**-30)
        assert found.innovation[0] == 7 * (1 + 2.0**-30)
        assert Z[0] == 2
    rest = replace(given, first=0, x0=np.array([F(0)]))
    bound._from_measurements(rest, within, 9, True, 5)
    assert seen[-1][4] == 0  # without a first estimate, the past of the first steps is a part of the infinite one


def test_limits_from_measurements_allow_for_longer_products(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two states, so that a product of a row with a column has two terms; one term after the other is seen."""
    schedule = filter_schedule(state_space([["1/2", "0"], ["0", "1/4"]], [["1"], ["1"]]), FMT)
    nothing, seen = np.zeros((1, 2, 2)), []

    def peaks(columns: Columns, *_: Any) -> Any:
        seen.append((columns.slack.copy(), columns.part))
        return np.array([5.0, 6.0]), np.ones(1)

    monkeypatch.setattr(bound, "peaks", peaks)
    tiny, up = F(2 * 2 + 30, 2**53), 1 + F(1, 2**30)
    one = np.array([[[-0.5], [3.0]]])
    for changed, exactly in (
        ({"K": one}, [tiny / 2 * 2, tiny * 3 * 2]),
        ({"K": 0 * one, "gain": one}, [tiny / 2 * 2, tiny * 3 * 2]),  # the innovation's limit is the measurement's
        ({"K": 0 * one, "loop": nothing - 0.25}, [tiny / 4 * 11 * up] * 2),
    ):
        found = disturbances(1, **({"loop": nothing, "gain": 0 * one, "spread": nothing} | changed))
        monkeypatch.setattr(bound, "unit_disturbances", lambda _, found=found: found)
        bound._from_measurements(
            schedule, FilterLimits(np.full(2, np.inf), np.full(1, np.inf), np.array([2.0])), 9, True, 5
        )
        same(seen[-1][0], [exactly], 1e-14)
        assert list(seen[-1][1]) == [ROUNDING, LOOP, LOOP, GAIN]


def caps_case() -> tuple[Program, gains.Schedule, Any, FilterLimits]:
    """Two states; the functions of the operations differ in every entry."""
    build = Builder(2, 1)
    x, y = build.states
    (z,) = build.inputs
    a = build.add(build.multiply(0, x), build.multiply(1, z))
    program = build.finish([build.subtract(a, build.multiply(2, y)), build.multiply(3, a)], 4)
    filter_ = LinearFilter(program, np.array([F(1, 2), F(-3, 4), F(-3, 8), F(5, 4)], dtype=object))
    two = np.zeros((1, 2, 2))
    found = disturbances(
        1, F=two + 0.25, K=np.array([[[-0.5], [2.0]]]), spread=np.array([[[2.0**-45, 2.0**-46], [0, 2.0**-44]]])
    )
    return (
        program,
        filter_schedule(filter_, FMT),
        found,
        FilterLimits(np.array([3.0, 5.0]), np.array([np.inf]), np.array([7.0])),
    )


def test_caps_of_operations(monkeypatch: pytest.MonkeyPatch) -> None:
    program, given, found, within = caps_case()
    # Each operation is a function of the states before the step and of the measurement.
    a, b, c = F(1, 2), F(-3, 4), F(-3, 8)
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
    arrays, starts, k, first, steady, end = seen[0]
    same(starts, of_state)
    assert np.array_equal(arrays.G, found.K)
    assert np.array_equal(arrays.limits, [[7.0]])
    assert (k, first, steady, end.most) == (1, 0, True, 50)
    K, spread = fractions(found.K[0, :, 0]), fractions(found.spread[0])
    same(arrays.slack, [F(2 * 2 + 30, 2**53) * abs(K) * Z + spread @ X], 1e-15)
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
    given = replace(
        filter_schedule(state_space([["0.9"]], [["1"]]), FloatFormat(2, 9)), x0=np.array([F(1000)], dtype=object)
    )
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
        steps, C, bounds, P = 3, np.full((3, 1, 1), 10.0), Bounds("", "dK", ""), np.array([[10.0]])

        def __init__(self, *_: Any, bounded: bool = False) -> None:
            self.bound = Distance(np.array([[2.0]]), 3.0)

        def take(self, z: Any) -> None:
            tried.append(self.bound.zeta)
            if len(tried) == 2:
                self.bound = Distance(np.array([[2.0]]), 0.25)

        def exactly(self, x: Any) -> Any:
            return fractions(x)

    monkeypatch.setattr(gains, "Run", Run)
    stored: Any = SimpleNamespace(m=1)
    run: Any = Run()
    gains._closes(stored, run, 0, 2, larger, 100)
    assert tried == [3.0, trial]


def test_the_error_of_the_exact_gain_reaches_the_schedule(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until the gain settles, that of the run; from then on, that of the period which was tried."""
    model = LinearModel(Phi=[["1/2"]], H=[["1"]], Q=[["1"]], R=[["1"]], x0=["0"], P0=[["1"]])
    given = gains.schedule(model, FMT, Form.INNOVATION)
    run = Run(model.rounded(FMT), None, Form.INNOVATION, range(1, given.steps + 1), bounded=True)
    run.take(np.zeros((given.steps, 1)))
    assert given.settled
    assert (run.bounds[1] > 0).all()
    assert (given.dK >= run.bounds[1]).all()
    assert given.dK[-1] > run.bounds[1][-1]
    late = gains.schedule(model, FMT, Form.INNOVATION, most=5)
    assert not late.settled
    assert np.array_equal(late.dK, run.bounds[1][: late.steps])


# -- blocks of steps --------------------------------------------------------------------------------------------------


def test_a_column_that_is_zero_in_the_first_block_joins_the_slack_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two states: the second column has a limit of zero at first, so that it gets no segment of its own."""
    G = np.array([[[1.0, -3.0], [2.0, 0.5]], [[0.25, -5.0], [-1.0, 7.0]]])
    both = np.zeros((2, 2, 2))
    given = disturbances(2, F=both, spread=both, G=G, slack=np.array([[0.5, 0.25], [1.0, 2.0]]))
    first, later = given._replace(limits=np.array([[2.0, 0.0]] * 2)), given._replace(limits=np.array([[2.0, 3.0]] * 2))
    seen, none = [], np.zeros(2)

    def forward(*arguments: Any) -> Any:
        seen.append(arguments)
        return next(bounds), np.arange(16.0).reshape(2, 2, 4) + 100 * len(seen)

    bounds = iter([np.array([[1.0, 6.0], [4.0, 2.0]]), np.array([[3.0, 7.0], [2.0, np.nan]])])
    monkeypatch.setattr(horizon, "forward", forward)
    one = horizon._Carried(limits(2, 1, 1, 1), none, none, none, np.zeros((2, 4)))
    part = np.array([ROUNDING, GAIN])
    horizon._follow(one, first, part, 0, 2, 8)
    assert one.worst.tolist() == [4, 6]
    assert one.last.tolist() == [4, 2]
    assert one.parts.tolist() == [[108, 109, 110, 111], [104, 105, 106, 107]]
    horizon._follow(one, later, part, 2, 2, 8)
    assert one.worst.tolist() == [4, np.inf]
    assert one.parts.tolist() == [[108, 109, 110, 111], [212, 213, 214, 215]]
    same(seen[0][4], fractions(given.slack))
    same(seen[1][4], fractions(given.slack) + 3 * abs(fractions(G[:, :, 1])) * (1 + F(1, 2**40)), 1e-15)
    for arguments, before in zip(seen, ([0, 0], [4, 2]), strict=True):
        assert np.array_equal(arguments[2], G[:, :, :1])
        assert np.array_equal(arguments[3], [[2.0]] * 2)
        assert arguments[8].tolist() == before
        # The largest of all disturbances of a state in the first block: 2 + 1/2 and 0.5 + 1, then 4 + 1/4 and 2 + 2.
        assert arguments[9].tolist() == [2.5, 4.25]
    assert [arguments[6] for arguments in seen] == [0, 2]


def test_blocks_give_their_disturbances_all_that_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error of the exact gain, the assumed error, and no caps; coefficients are known exactly."""
    model = LinearModel(Phi=[["1/2"]], H=[[["1"]], [["2"]]], Q=[["1"]], R=[["1"]], x0=["0"], P0=[["1"]])
    seen, true = [], horizon.disturbances

    def disturbances_seen(*arguments: Any) -> Any:
        program, numbers, table, within, assumed, caps = arguments
        seen.append((program, Steps(*map(np.copy, numbers)), table, within, assumed.copy(), caps.copy()))
        return true(*arguments)

    monkeypatch.setattr(horizon, "disturbances", disturbances_seen)
    list(horizon.bounds_in_blocks(model, FMT, [limits(1, 1, 10, 5)], [[0.5]], 6, block=3))
    run = Run(model.rounded(FMT), None, Form.INNOVATION, range(1, 7), bounded=True)
    run.take(np.zeros((6, 1)))
    done = 0
    for _, (coefficients, offsets, Phi, HPhi, exact_gain, dK), table, within, assumed, caps in seen:
        count = len(coefficients)
        assert np.array_equal(dK, run.bounds[1][done : done + count])
        assert (dK > 0).all()
        assert np.array_equal(exact_gain, run.G[done : done + count].reshape(count, 1, 1, 2))
        assert not offsets.any()
        assert table == units(FMT)
        assert (Phi[..., 0] == 0.5).all()
        assert list(HPhi[:, 0, 0, 0]) == [0.5 + 0.5 * (k % 2) for k in range(done, done + count)]
        assert (within.state, within.innovation, assumed) == ([10], [5], [0.5])
        assert np.isinf(caps).all()
        done += count
    assert done == 6


# -- runs with the contraction bound ----------------------------------------------------------------------------------


def correlated() -> LinearModel:
    return LinearModel(
        Phi=[["0.9", "0.1"], ["-0.2", "0.8"]],
        H=[["1", "0.5"], ["0.3", "-1"]],
        Q=[["1", "0.1"], ["0.1", "2"]],
        R=[["2", "0.5"], ["0.5", "1"]],
        x0=["1", "-1"],
        P0=[["3", "1"], ["1", "3"]],
    )


def test_factors_of_the_first_covariance_may_be_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """The UD form begins with rounded factors: the bound takes in the distance of their product, rounded upwards."""
    seen, fmt = [], FloatFormat(10, 6, Rounding.CHOP)
    monkeypatch.setattr(bounded_steps, "contraction_start", lambda *given: seen.append(given))
    run = Run(correlated(), fmt, Form.UD, [1], bounded=True)
    off = abs(covariance_of_factors(run.exactly(run.P)) - correlated().rounded(fmt).P0).ravel()
    assert any(F(float(exactly)) < exactly for exactly in off)
    for found, exactly in zip(seen[0][2].ravel(), off, strict=True):
        assert exactly <= F(found) <= exactly * (1 + F(1, 2**49))
    Run(correlated(), fmt, Form.INNOVATION, [1], bounded=True)
    assert not seen[0][1].any()
    assert not seen[1][2].any()


@pytest.mark.parametrize("form", [Form.INNOVATION, Form.UD])
def test_each_step_has_the_errors_of_its_evaluation(form: Form, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the repeated step, in units of double-double; the bound and the gain's bound contain them."""
    errors, steps, used = [], [], []
    for name, seen in (("evaluation_errors", errors), ("contraction_steps", steps), ("gain_error_bound", used)):
        function = getattr(bounded_steps, name)

        def noted(*given: Any, function: Any = function, seen: list[Any] = seen) -> Any:
            found = function(*given)
            seen.append((given, found))
            return found

        monkeypatch.setattr(bounded_steps, name, noted)
    run = Run(correlated(), FMT, form, [1, 2, 3], bounded=True)
    first = covariance_of_factors(run.exactly(run.P)) * (1 + F(1, 2**51)) if form is Form.UD else run.exactly(run.P)
    z = np.array([[1.0, 0.5], [-2.0, 4.0], [3.0, -0.25]])
    run.take(z)
    model = correlated().rounded(FMT)
    before = [fractions(model.x0), *run.exactly(run.X)[:2, :, 0]]
    [(given, off)], [(taken, _)] = errors, steps
    assert all(F(given[2][0, i, i]) >= first[i, i] for i in range(2))
    assert given[6] == 2.0**-100
    assert taken[3] is off
    assert all((each > 0).all() for each in off)
    [(asked, _)] = used
    for k in range(3):
        same(taken[2].innovation[k], fractions(z[k]) - model.H[0] @ model.Phi[0] @ before[k], 1e-15)
        size = given[2][k]
        # Cancellation inside a product of factors goes by the standard deviations.
        root = np.sqrt(size[0, 0] * size[1, 1])
        assert (np.abs(size[0, 1]) > root * (1 - 1e-15)) == (form is Form.UD)
        assert np.abs(size[0, 1]) < root * (1 + 1e-15)
        assert np.array_equal(asked[3][k], off.gain[k])


@compiled
def _widen(fmt: Any, x: Any, found: Any) -> None:
    for k in range(len(found)):
        wide = widened(fmt, load(fmt, x, k))
        found[k, 0], found[k, 1] = wide[0], wide[1]


@pytest.mark.parametrize("precision", [7, 17])
def test_decimals_of_any_size_become_double_doubles_of_four_roundings(precision: int) -> None:
    fmt = FloatFormat(10, precision)
    x = fmt.array(["1234567", "2e22", "-1.5e30", "7.25e50", "3e-40", "-9.75e-22", "0"])
    found = np.zeros((7, 2))
    _widen(fmt.backend.tag, fmt.backend.pack(x.components), found)
    for (high, low), true in zip(found.tolist(), x.to_fractions(), strict=True):
        assert abs(F(high) + F(low) - true) <= 4 * abs(true) / 2**102
