"""Sets that hold the error after each step, against sums that go back from each step, and against trajectories."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gpbnb import FloatFormat
from gpbnb.bounds import guarantee as bound
from gpbnb.bounds.envelope import Columns
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.bounds.reach import Reach, forward, nothing, onward, support, take_in, width
from gpbnb.wordlength.examples import tracker

STEPS, N, COLUMNS = 60, 3, 4


def disturbed(seed: int, rows: int = STEPS) -> tuple[Any, ...]:
    """Closed loops, columns and limits of some steps: one slow mode, two that turn."""
    rng = np.random.default_rng(seed)
    turn = np.array([[0.99, 0, 0], [0, 0.6, -0.5], [0, 0.5, 0.6]])
    T = rng.standard_normal((N, N))
    F = np.array([T @ turn @ np.linalg.inv(T) * rng.uniform(0.98, 1.0) for _ in range(rows)])
    G, bounds = rng.standard_normal((rows, N, COLUMNS)), rng.uniform(0, 1, (rows, COLUMNS))
    bounds[::2, 1], bounds[1::2, 1], bounds[::3, 2] = 1, 0, 0
    return F, np.zeros((rows, N, N)), G, bounds, rng.uniform(0, 0.1, (rows, N)), np.array([0, 1, 2, 0])


def exactly(arrays: tuple[Any, ...], k: int, at: Any) -> np.ndarray:
    """Largest error of each state after step k: the sum over all earlier disturbances, going back from it."""
    F, _, G, bounds, slack, _ = arrays
    c, total = np.eye(N), np.zeros(N)
    for step in range(k, -1, -1):
        row = at(step)
        total += np.abs(c @ G[row]) @ bounds[row] + np.abs(c) @ slack[row]
        c = c @ F[row]
    return total


def pass_forward(
    arrays: tuple[Any, ...], steps: int, window: int, size: Any = (1.0, 1.0, 1.0)
) -> tuple[Any, Any, Reach]:
    """Bounds and their parts after each of the first steps, and the last set."""
    reach = nothing(window, arrays[5], N)
    return *forward(*arrays[:5], reach, 0, steps, np.zeros(N), np.array(size)), reach


@pytest.mark.parametrize("seed", range(4))
def test_with_all_segments_the_set_is_exact(seed: int) -> None:
    arrays = disturbed(seed)
    bounds, parts, _ = pass_forward(arrays, STEPS, STEPS)
    for k in range(STEPS):
        true = exactly(arrays, k, lambda step: step)
        assert (bounds[k] >= true * (1 - 1e-12)).all()
        assert (bounds[k] <= true * (1 + 1e-9)).all()
    assert np.allclose(parts.sum(axis=2), bounds, rtol=1e-9)


@pytest.mark.parametrize("window", [1, 3, 20])
@pytest.mark.parametrize("seed", range(4))
def test_ellipsoids_lose_little(seed: int, window: int) -> None:
    """Never below the exact sum, and above it by less than a factor of 4; measured: up to 3.2."""
    arrays = disturbed(seed)
    true = exactly(arrays, STEPS - 1, lambda step: step)
    bounds, _, _ = pass_forward(arrays, STEPS, window, true)
    assert (bounds[-1] >= true * (1 - 1e-12)).all()
    assert (bounds[-1] <= true * 4).all()


@pytest.mark.parametrize("period", [1, 3])
def test_steps_after_the_gain_has_settled(period: int) -> None:
    arrays, lags = disturbed(7, 20 + period), 90
    first = 20
    _, _, reach = pass_forward(arrays, first, 5)
    after, _ = onward(Columns(*arrays), first, lags, reach, np.ones(N), np.zeros(N))

    def at(step: int) -> int:
        return step if step < first else first + (step - first) % period

    rows = [at(step) for step in range(first + lags)]
    straight, _, _ = pass_forward((*(each[rows] for each in arrays[:5]), arrays[5]), first + lags, first + lags)
    for lag in (1, 2, 3, 10, 50, lags):
        true = exactly(arrays, first + lag - 1, at)
        assert np.allclose(straight[first + lag - 1], true, rtol=1e-9)
        assert (after[lag - 1] >= true * (1 - 1e-12)).all()
        assert (after[lag - 1] <= true * 1.5).all()


def test_rounding_errors_of_rows_meet_the_bound() -> None:
    F, spread, *rest = disturbed(7, 21)
    _, _, reach = pass_forward((F, spread, *rest), 20, 20)
    without, _ = onward(Columns(F, spread, *rest), 20, 30, reach, np.ones(N), np.full(N, 5.0))
    with_them, parts = onward(Columns(F, spread + 1e-3, *rest), 20, 30, reach, np.ones(N), np.full(N, 5.0))
    assert (with_them[0] >= without[0] + 5 * 3e-3 * (1 - 1e-9)).all()
    assert (parts[0, :, 3] >= 5 * 3e-3 * (1 - 1e-9)).all()


def test_no_trajectory_leaves_the_set() -> None:
    F, spread, G, bounds, slack, part = disturbed(11)
    found, _, reach = pass_forward((F, spread, G, bounds, slack, part), STEPS, 4)
    rng, nearest = np.random.default_rng(0), 0.0
    directions = rng.standard_normal((20, N))
    for a in directions:
        e, c = np.zeros(N), a
        rows = [*[(c := c @ F[k]) for k in range(STEPS - 1, 0, -1)][::-1], a]
        for k in range(STEPS):  # every disturbance pushes along the direction
            e = F[k] @ e + G[k] @ (bounds[k] * np.sign(rows[k] @ G[k])) + slack[k] * np.sign(rows[k])
            assert (np.abs(e) <= found[k] * (1 + 1e-12)).all()
        most = np.zeros(4)
        support(reach, a, most)
        assert a @ e <= most.sum() * (1 + 1e-12)
        nearest = max(nearest, a @ e / most.sum())
    assert nearest > 0.6


def test_a_run_in_blocks_is_the_same() -> None:
    *arrays, part = disturbed(5)
    whole, _, _ = pass_forward((*arrays, part), STEPS, 7)
    reach, last, blocks = nothing(7, part, N), np.zeros(N), []
    for begin, end in ((0, 4), (4, 25), (25, STEPS)):
        block, _ = forward(*(each[begin:end] for each in arrays), reach, begin, end - begin, last, np.ones(N))
        blocks.append(block)
        last = block[-1]
    assert np.array_equal(np.concatenate(blocks), whole)


def test_parallel_segments_lose_nothing_in_an_ellipsoid() -> None:
    segments, whole = np.outer([1.0, 2.0, 0.5], [3.0, -1.0]).reshape(1, 3, 2), np.zeros((1, 2, 2))
    take_in(segments, np.zeros(3, np.int64), whole, np.array([1.0, 10.0]))
    a = np.array([0.7, 0.4])
    assert width(whole[0], a) == pytest.approx(3.5 * abs(a @ [3.0, -1.0]), rel=1e-9)


def test_a_short_window_gives_nearly_the_same_guarantee(monkeypatch: pytest.MonkeyPatch) -> None:
    within = limits(2, 1, state=[1000, 30], innovation=8)
    full = guarantee(tracker(), FloatFormat(2, 24), within)
    monkeypatch.setattr(bound, "_window", lambda *_: 8)
    short = guarantee(tracker(), FloatFormat(2, 24), within)
    assert (short.bound >= full.bound * (1 - 1e-9)).all()
    assert (short.bound <= full.bound * 1.5).all()
