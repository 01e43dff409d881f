"""A bound block by block, against the bound of the same steps at once; the stored bounds of Gravity Probe B."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gpbnb import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.gravity_probe_b import horizon
from gpbnb.report.gravity_probe_b.horizon import bounds_in_blocks
from gpbnb.report.gravity_probe_b.model import YEAR

STEPS = 50


def constants() -> LinearModel:
    """Two constants without process noise, whose gain falls for ever, and a cycle of three measurements."""
    return LinearModel(
        Phi=exact([["1", "0.1"], ["0", "1"]]),
        H=np.array([exact([["1", "0.5"]]), exact([["0.3", "-1"]]), exact([["0", "1"]])]),
        Q=exact([["0", "0"], ["0", "0"]]),
        R=exact([["2"]]),
        x0=exact(["0", "0"]),
        P0=exact([["3", "1"], ["1", "2"]]),
    )


@pytest.mark.parametrize("block", [3, 7, STEPS])
def test_blocks_give_the_bound_of_all_steps_at_once(block: int) -> None:
    within = limits(state=[10, 20], innovation=5)
    found = guarantee(constants(), FloatFormat(2, 24), within, form=Form.INNOVATION, most=STEPS, horizon=STEPS)
    assert found.steps == STEPS
    blocks = list(bounds_in_blocks(constants(), 24, [within], [found.bound], STEPS, block, window=STEPS))
    done, (last,) = blocks[-1]
    assert done == STEPS
    assert np.allclose(last.worst, found.bound, rtol=1e-6, atol=0)
    assert np.allclose(last.parts.sum(axis=1), last.worst, rtol=1e-9, atol=0)
    worst = [bounds[0].worst for _, bounds in blocks]
    assert all((a <= b).all() for a, b in pairwise(worst))


def test_a_covariance_that_loses_definiteness_ends_it() -> None:
    model = replace(constants(), R=exact([["1e-12"]]), P0=exact([["1e4", "0"], ["0", "1e4"]]))
    fmt, within = FloatFormat(2, 11), limits(state=[10, 20], innovation=5)
    run = Run(model.rounded(fmt), fmt, Form.INNOVATION, range(1, 4))
    run.take(fmt.array(np.zeros((3, 1))))
    assert run.indefinite
    assert not run.stopped
    with pytest.raises(ArithmeticError, match="the filter stopped or its covariance lost definiteness by step 3"):
        next(bounds_in_blocks(model, 11, [within], [[9, 9]], 3))


def test_stored_bounds_of_gravity_probe_b() -> None:
    rows = horizon.load()
    assert {row.states for row in rows} == {"absolute", "deviation"}
    for states in ("absolute", "deviation"):
        each = [row for row in rows if row.states == states]
        assert all(a.steps < b.steps <= YEAR for a, b in pairwise(each))
        bounds = np.array([row.bounds for row in each])
        assert (np.diff(bounds, axis=0) >= 0).all()
        assert each[-1].steps == YEAR
    last = {row.states: np.array(row.bounds) for row in rows}
    narrower = np.array(horizon.DEVIATION) < horizon.ABSOLUTE
    assert narrower.sum() == 2  # drift and rate of one axis
    assert (last["deviation"][narrower] < last["absolute"][narrower] / 3).all()


@pytest.mark.long  # 2,340 steps of ten states, in double-double
def test_the_first_cycle_of_gravity_probe_b_again() -> None:
    first = {row.states: row for row in horizon.load()[:2]}
    assert {row.steps for row in first.values()} == {2340}
    done, found = next(horizon.gravity_probe_b_bounds(53))
    assert done == 2340
    for name, each in zip(("absolute", "deviation"), found, strict=True):
        assert np.allclose(each.worst, first[name].bounds, rtol=1e-5, atol=0)
