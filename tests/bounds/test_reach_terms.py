"""Sets that contain the error, in exact fractions: no term can be dropped unseen."""

from __future__ import annotations

import math
from fractions import Fraction as F

import numpy as np
import pytest
from exact_terms import UNIT, UP, fractions, plain, same

from gpbnb.bounds import envelope, reach
from gpbnb.bounds.reach import Reach


@pytest.fixture
def as_python(monkeypatch):
    for name in ("take_in", "_length", "_move_ellipsoid", "support", "width", "_join", "_scale", "effect"):
        monkeypatch.setattr(reach, name, plain(getattr(reach, name)))


@pytest.fixture
def sets(as_python, monkeypatch):
    monkeypatch.setattr(reach, "_U", float(UNIT))
    monkeypatch.setattr(reach, "_UP", float(UP))
    return reach


SIZE = np.array([1.0, 2.0])


def test_an_ellipsoid_takes_in_segments(sets) -> None:
    """The lengths are 5 for the ellipsoid, in units of the scales, and 5 and 13 for the segments."""
    segments = np.array([[[3.0, 8.0], [9.0, 9.0]], [[0.0, 0.0], [5.0, -24.0]]])
    M = np.array([[[9.0, 1.5], [1.5, 64.0]], [[2.0, 0.5], [0.5, 3.0]]])
    ellipsoids = M.copy()
    # The second column of the first step belongs to no ellipsoid here.
    sets.take_in(segments[:, :1], np.array([0]), ellipsoids[:1], SIZE)
    total = 10 * UP
    first = total / 5 * fractions(M[0]) + total / 5 * np.outer(*[fractions([3, 8])] * 2)
    for i in range(2):
        first[i, i] *= 1 + 2 * (2 * 1 + 16) * 4 * UNIT
    same(ellipsoids[0], first, 1e-15)
    ellipsoids = M.copy()
    ellipsoids[1] = 0
    sets.take_in(segments[1:], np.array([0, 1]), ellipsoids, SIZE)
    assert (ellipsoids[0] == M[0]).all()
    second = UP * np.outer(*[fractions([5, -24])] * 2)
    for i in range(2):
        second[i, i] *= 1 + 2 * (1 * 2 + 16) * 4 * UNIT
    same(ellipsoids[1], second, 1e-15)


def test_an_ellipsoid_moves(sets) -> None:
    M, loop = np.array([[9.0, -3.0], [-3.0, 4.0]]), np.array([[0.5, -1.0], [2.0, 0.25]])
    moved = M.copy()
    sets._move_ellipsoid(loop, moved)
    exactly = fractions(loop) @ fractions(M) @ fractions(loop).T
    reached = abs(fractions(loop)) @ fractions([3, 2])
    for i in range(2):
        exactly[i, i] += 2 * (2 + 4) * 8 * UNIT * reached[i] ** 2
    same(moved, exactly, 1e-15)


def test_the_width_of_an_ellipsoid(sets, monkeypatch) -> None:
    M, a = np.array([[9.0, -3.0], [-3.0, 4.0]]), np.array([0.5, -2.0])
    reached = F(1, 2) * 3 + 2 * 2
    exactly = F(9, 4) + 6 + 16
    root = math.sqrt(exactly + (2 + 4) * 8 * UNIT * reached**2)
    assert sets.width(M, a) == pytest.approx(root * float(UP) + 2.0**-48 * float(reached), rel=1e-15)
    monkeypatch.setattr(sets, "_U", 0.0)
    flat = np.array([[4.0, -2.0], [-2.0, 1.0]])
    assert sets.width(flat, np.array([1.0, 2.0])) == 2.0**-48 * 4
    flat[0, 0] = np.nextafter(4.0, 0)  # a root of what rounding made negative
    assert sets.width(flat, np.array([1.0, 2.0])) == pytest.approx(2.0**-48 * 4, rel=1e-12, abs=0)


def test_two_ellipsoids_join(sets) -> None:
    M, other = np.array([[9.0, 1.5], [1.5, 64.0]]), np.array([[25.0, -2.0], [-2.0, 576.0]])
    joined = M.copy()
    sets._join(joined, np.zeros((2, 2)), SIZE)
    assert (joined == M).all()
    sets._join(joined, other, SIZE)  # 5 and 13
    exactly = 18 * UP * (fractions(M) / 5 + fractions(other) / 13)
    alone = np.zeros((2, 2))
    sets._join(alone, other, SIZE)
    only = UP * fractions(other)
    for i in range(2):
        exactly[i, i] *= 1 + 2 * 32 * UNIT
        only[i, i] *= 1 + 2 * 32 * UNIT
    same(joined, exactly, 1e-15)
    same(alone, only, 1e-15)


def test_the_support_of_a_set(sets) -> None:
    segments = np.array([[[1.0, 2.0], [0.5, 0.25]], [[-3.0, 1.0], [1.0, 1.0]]])
    ellipsoids = np.array([np.diag([9.0, 4.0]), np.diag([1.0, 16.0]), np.zeros((2, 2))])
    a, out = np.array([2.0, -0.5]), np.full(4, 0.125)
    sets.support(Reach(segments, np.array([2, 0]), ellipsoids), a, out)
    allowance = (2 + 4) * UNIT
    sums = {
        2: 1 + allowance * 3 + F(13, 2) + allowance * F(13, 2),
        0: F(7, 8) + F(3, 2) + allowance * (F(9, 8) + F(5, 2)),
    }
    widths = [sets.width(M, a) for M in ellipsoids]
    assert widths[0] > 6
    same(out, [0.125 + float(sums[0]) + widths[0], 0.125 + widths[1], 0.125 + float(sums[2]) + widths[2], 0.125], 1e-15)


def test_a_pass_forward(sets) -> None:
    """One state, two steps in the window: the first step's segments are in the ellipsoid from the third step on."""
    loop, spread, slack = (np.array(each) for each in ([0.5, -0.75, 0.25], [0.0625, 0.125, 0.25], [0.5, 0.25, 1.0]))
    G, limits = np.array([[2.0, -1.0], [1.0, 0.0], [-0.5, 4.0]]), np.array([[0.5, 0.25], [1.5, 1.0], [2.0, 0.5]])
    given = loop.reshape(3, 1, 1), spread.reshape(3, 1, 1), G.reshape(3, 1, 2), limits, slack.reshape(3, 1)
    kind = np.array([envelope.GAIN, envelope.LOOP])
    bounds, parts = plain(sets.forward)(*given, sets.nothing(2, kind, 1), 0, 3, np.array([0.125]), np.ones(1))
    last, history = F(1, 8), []
    allowance = 1 + (2 * 3 + 64) * 4 * UNIT
    old = [F(0)] * 3  # the radius of each ellipsoid
    for k in range(3):
        columns = abs(fractions(G[k]) * fractions(limits[k]))
        own = (F(slack[k]) + 2 * F(spread[k]) * last + 2 * UNIT * sum(columns)) * UP
        new = {envelope.GAIN: columns[0], envelope.LOOP: columns[1], envelope.ROUNDING: own}
        if k == 2:  # radii of one state: the roots of what take_in and _move_ellipsoid add to their squares
            grown = 1 + (1 * 3 + 16) * 4 * UNIT
            old = [
                math.sqrt(history[0][p] ** 2 * UP * grown * (F(loop[2]) ** 2) * (1 + 1 * 5 * 8 * UNIT))
                for p in range(3)
            ]
            # What was taken in had moved with the second step.
            old = [each * abs(loop[1]) for each in old]
            live = {p: new[p] + abs(F(loop[2])) * history[1][p] for p in range(3)}
        elif k == 1:
            live = {p: new[p] + abs(F(loop[1])) * history[0][p] for p in range(3)}
        else:
            live = dict(new)
        history.append(new)
        each = [float(live[p]) + float(old[p]) for p in range(3)]
        same(parts[k, 0], [*each, 0.0], 1e-14)
        same(bounds[k, 0], sum(each) * float(allowance), 1e-14)
        last = F(float(bounds[k, 0]))


def test_dropped_components_are_made_up_for(as_python) -> None:
    """A segment that halves falls below what is kept; without the slack of 1e-240, the bound would forget it."""
    one, tiny = np.ones((2, 1, 1)), 1.5e-250
    given = one / 2, 0 * one, one, np.full((2, 1), tiny), np.zeros((2, 1))
    bounds, _ = plain(reach.forward)(*given, reach.nothing(2, np.array([0]), 1), 0, 2, np.zeros(1), np.ones(1))
    assert bounds[1, 0] >= tiny * 3 / 2
    assert bounds[1, 0] < 1e-239


@pytest.mark.parametrize("loop", [0.5, -0.5, 1 - 2.0**-12])
def test_steps_after_the_gain_has_settled(sets, loop: float) -> None:
    """One state: sums over the period and over the set before it, asked for anew as long as the row changes."""
    spread, slack, b = 0.0625, 0.25, 3.0
    given = (np.full((1, 1, 1), loop), np.full((1, 1, 1), spread), np.array([[[2.0, -1.0]]]), np.array([[0.5, 0.25]]))
    before = Reach(np.array([[[4.0]]]), np.array([envelope.LOOP]), np.array([[[9.0]], [[1.0]], [[0.0]]]))
    part = np.array([envelope.GAIN, envelope.LOOP])
    bounds, parts = plain(sets.onward)(
        envelope.Columns(*given, np.full((1, 1), slack), part), 0, 6, before, np.ones(1), np.array([b])
    )
    whole = np.zeros((1, 1, 1))
    sets.take_in(before.segments, np.zeros(1, np.int64), whole, np.ones(1))
    for M in before.ellipsoids:
        sets._join(whole[0], M, np.ones(1))
    assert math.sqrt(whole[0, 0, 0]) > 4 + 3 + 1
    c, sums, residual, anchor, largest, carried = 1.0, np.zeros(4), 0.0, 0.0, 0.0, 0
    for lag in range(6):
        sums += abs(c) * np.array([slack, 0.25, 1.0, 0.0])
        residual += abs(c) * spread * b
        c *= loop
        between = sets.width(whole[0], np.array([c - anchor])) if lag else math.inf
        if not between <= 1e-3 * largest:
            anchor, value, between = c, np.zeros(4), 0.0
            sets.support(before, np.array([c]), value)
        carried += between > 0
        expected_parts = sums + value
        expected_parts[3] = residual + between
        largest = max(largest, expected_parts.sum())
        same(parts[lag, 0], expected_parts, 1e-14)
        # Six steps, one residual and two columns a step, one segment.
        same(bounds[lag, 0], expected_parts.sum() * (1 + (6 + 1 + 2 + 1 + 64) * 4 * float(UNIT)), 1e-14)
    assert bool(carried) is (loop > 0.5)


def test_steps_in_a_period_allow_for_each_addition(as_python) -> None:
    """As of a certificate: 1 in the last step, and half units of 1 from each column, lost if added to it one by one."""
    steps, columns, half = 50, 64, 2.0**-53
    slack, part = np.zeros((steps, 1)), np.full(columns, envelope.ROUNDING)
    slack[-1] = 1.0
    ones, none = np.ones((steps, 1, 1)), np.zeros((steps, 1, 1))
    given = ones, none, np.ones((steps, 1, columns)), np.full((steps, columns), half), slack, part
    before = reach.nothing(1, part, 1)
    bounds, _ = plain(reach.onward)(envelope.Columns(*given), 0, steps, before, np.ones(1), np.ones(1))
    assert F(float(bounds[-1, 0])) >= 1 + steps * columns * F(half)
