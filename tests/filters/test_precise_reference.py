"""gpbnb.filters.reference: filters whose reference double-double cannot compute."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from small_filter import exact_steps

from gpbnb import FloatFormat
from gpbnb.filters import reference as precise_reference
from gpbnb.filters import run as filter_run
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import reference, reference_states

Z = np.array([[1.5, 3.0], [-0.25, -0.5], [2.0, 4.0], [0.75, 1.5], [1.0, 2.0]])


def sensor(R, **inputs):
    """Two precise sensors of almost the same quantity; the innovation covariance is almost singular."""
    Phi, H, P0 = [[1, "0.1"], [0, 1]], [["0.3", "0.7"], ["0.6", "1.4"]], [[1, "0.4"], ["0.4", 2]]
    R2 = [[R, 0], [0, R]]
    return LinearModel(Phi, H, [["1e-3", 0], [0, "1e-3"]], R2, [0, 1], P0, "two precise sensors", **inputs)


def test_one_step_with_a_precise_sensor_is_enough_for_more_digits():
    P = np.zeros((2, 1, 1, 2))
    P[..., 0] = 1
    for variances, precise in ((["1", "1e-30"], True), (["1e-30", "1"], True), (["1", "1"], False)):
        model = LinearModel([[1]], [[1]], [[0]], [[[each]] for each in variances], [0], [[1]])
        assert filter_run._loses_digits(model, np.arange(2), P) is precise


@pytest.mark.parametrize(("share", "agree"), [(Fraction(1, 2), True), (Fraction(3, 2), False)])
@pytest.mark.parametrize("bits", [20, 104])
def test_results_agree_in_some_bits_of_the_largest_of_each_entry(bits, share, agree):
    fmt = FloatFormat(2, 120)
    x, P = ([[1, 2], [last, 2], [0, 2]] for last in (4, 4 + 4 * share / 2**bits)), fmt.array([[[1]]] * 3)
    some, other = (precise_reference.PreciseSteps(fmt.array(each), P, P) for each in x)
    assert precise_reference._agree(some, other, bits) is agree


def test_runs_that_agree_in_few_bits_are_repeated_in_more():
    """Errors of 1, 2**-30, 2**-60 and 2**-200: the first two runs agree in no bit, the next two in 29 of the 104."""
    fmt, asked = FloatFormat(2, 400), []

    def steps(bits):
        x = fmt.array([[1 + Fraction(1, 2 ** (0, 30, 60, 200, 200)[len(asked)])]])
        asked.append(bits)
        return precise_reference.PreciseSteps(x, x[None], x[None])

    found = precise_reference.agreed("model", 1, steps)
    assert asked == [40, 256, 512, 1024, 2048]
    assert found.x.tolist() == [[1 + Fraction(1, 2**200)]]


def states(model, z):
    return [step.x for step in exact_steps(model, z)]


def distance(states, expected):
    found = np.array([[Fraction(h) + Fraction(e) for h, e in row] for row in states.tolist()])
    return float(max(np.abs(found - np.array(expected)).ravel()))


@pytest.mark.parametrize("R", ["1e-20", "1e-30", "1e-60"])
def test_a_precise_sensor_has_the_exact_reference(R):
    model = sensor(R)
    expected, last = states(model, Z), exact_steps(model, Z)[-1]
    assert distance(reference_states(model, Z), expected) < 1e-30
    checkpoints = reference(model, Z, (2, 5))
    assert float(max(np.abs(checkpoints.x - np.array([expected[1], expected[4]])).ravel())) < 1e-30
    assert float(np.abs(checkpoints.K[1] - last.gain).max()) < 1e-29
    assert float(np.abs(checkpoints.P[1] - last.P).max()) < 1e-30
