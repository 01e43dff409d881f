"""gpbnb.kalman.precision: the smallest precision that meets a goal is that, and says what it rests on."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from gpbnb.formats import FloatFormat, Rounding
from gpbnb.kalman.experiment import Form, Simulation, bounded, emulate, reference
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.precision import required_precision

STEPS = 60
MODEL = LinearModel(
    [["0.99", "0.1"], [0, "0.97"]], [[1, "0.3"]], [["1e-3", 0], [0, "2e-3"]], [["0.4"]], [3, -1], [[2, 0], [0, 1]]
)
Z = Simulation(MODEL, (3.0, -1.0), 0, resolution=2.0**-30).measurements(STEPS)


def error(fmt, form=Form.USUAL, z=Z):
    return np.abs(emulate(MODEL, z, fmt, form, range(1, STEPS + 1), reference(MODEL, z, range(1, STEPS + 1))).state)


@pytest.mark.parametrize("rounding", list(Rounding))
@pytest.mark.parametrize("base", [2, 10, 16])
def test_the_smallest_precision_meets_the_goal_and_one_less_does_not(base, rounding):
    goal = 1e-4
    found = required_precision(MODEL, STEPS, goal, base, rounding)
    assert found.fmt.base == base
    assert found.fmt.rounding is rounding
    t = found.fmt.precision
    ratios = dict(found.tried)
    assert list(ratios) == list(range(2, t + 2))
    assert ratios[t] <= 1
    assert ratios[t + 1] <= 1
    assert ratios[t - 1] > 1
    for precision in (t - 1, t, t + 1):  # here at every step, there at sixteen a decade
        seen = error(FloatFormat(base, precision, rounding)).max() / goal
        assert ratios[precision] <= seen <= 3 * ratios[precision]
    assert (found.basis, found.steps) == ("emulation", STEPS)
    assert str(found).startswith(f"{t} digits of base {base}, {rounding.value}: ")
    assert str(found).endswith("of the goal (emulation, 60 steps)")


def test_errors_of_storing_the_model_count():
    """With few digits, most of the error: the transition itself is off."""
    found = required_precision(MODEL, STEPS, 1e-3, 10, z=Z)
    alone = np.abs(emulate(MODEL, Z, found.fmt, Form.USUAL).state).max()
    assert dict(found.tried)[found.fmt.precision] * 1e-3 != alone
    assert error(found.fmt).max() <= 3e-3


def test_a_lucky_precision_does_not_count():
    """One that meets the goal while the next does not is passed over."""
    for goal in np.geomspace(1e-6, 1e-2, 30):
        tried = required_precision(MODEL, 4, goal, 2, z=Z[:4]).tried
        meets = [ratio <= 1 for _, ratio in tried]
        assert meets[-2:] == [True, True]
        assert not any(a and b for a, b in pairwise(meets[:-1]))


def test_the_bound_asks_for_more_digits_and_holds():
    goal = 1e-4
    by_bound = required_precision(MODEL, STEPS, goal, 2, basis="bound", z=Z)
    by_emulation = required_precision(MODEL, STEPS, goal, 2, z=Z)
    assert by_emulation.fmt.precision < by_bound.fmt.precision <= by_emulation.fmt.precision + 12
    found = bounded(MODEL, Z, by_bound.fmt, Form.USUAL)
    assert found.state.max() <= goal
    assert np.abs(found.history.state).max() <= found.state.max()
    assert "(bound, 60 steps)" in str(by_bound)
    assert math.isinf(by_bound.tried[0][1])


def test_a_goal_for_each_state():
    first = required_precision(MODEL, STEPS, (1e-6, math.inf), 2, z=Z).fmt
    second = required_precision(MODEL, STEPS, (math.inf, 1e-2), 2, z=Z).fmt
    assert second.precision < first.precision
    assert np.abs(error(first))[:, 0].max() < 3e-6
    assert required_precision(MODEL, STEPS, (1e-6, 1e-2), 2, z=Z).fmt == first
    # An infinite bound of a state that does not matter is no number of any kind.
    tried = required_precision(MODEL, STEPS, (1e-6, math.inf), 2, basis="bound", z=Z).tried
    assert math.isinf(tried[0][1])
    assert not any(math.isnan(ratio) for _, ratio in tried)


def test_no_precision_may_be_enough():
    found = required_precision(MODEL, 3, 1e-30, 16, z=Z[:3])
    assert found.fmt is None
    assert found.tried[-1][0] == 13
    assert str(found) == "no precision up to 13 digits meets the goal (emulation, 3 steps)"


def test_a_run_that_loses_its_covariance_does_not_meet_a_goal():
    """One state, R far below P: with few digits a variance comes out as zero, whatever the error of the state."""
    told = LinearModel([[1]], [[1]], [[0]], [["1e-6"]], [1], [[1]])
    tried = required_precision(told, 3, 10.0, 10, form=Form.REPORT).tried
    assert [math.isinf(ratio) for _, ratio in tried[:5]] == [True] * 5
    assert tried[-1][1] <= 1


def test_its_own_measurements_are_seeded():
    assert required_precision(MODEL, 5, 1e-3, seed=1) == required_precision(MODEL, 5, 1e-3, seed=1)
    assert required_precision(MODEL, 5, 1e-3, seed=1).tried != required_precision(MODEL, 5, 1e-3, seed=2).tried


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"goal": 0}, "got goal 0; needed an error above 0"),
        ({"goal": (1.0, -1.0)}, "got goal"),
        ({"goal": math.nan}, "got goal nan"),
        ({"goal": (math.inf, math.inf)}, "one finite"),
        ({"base": 3}, "got base 3; needed one with compiled loops"),
        ({"basis": "hope"}, 'got basis \'hope\'; needed "emulation" or "bound"'),
        ({"steps": 0}, "got 0 steps; needed at least 1"),
        ({"z": Z[:5]}, "got 5 measurements; needed one for each of the 60 steps"),
    ],
)
def test_what_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        required_precision(**({"model": MODEL, "steps": STEPS, "goal": 1e-3} | arguments))
