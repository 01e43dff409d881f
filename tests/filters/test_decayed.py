"""Estimates that decay below the range of the compiled loops become zero; nothing overflows."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import FloatFormat, LinearModel, required_precision
from gpbnb.filters.run import Run

MODEL = LinearModel([["0.9"]], [["1"]], [["0.01"]], [["1"]], ["0"], [["1"]])
STEPS = 5000


def impulse(steps):
    z = np.zeros((steps, 1))
    z[0] = 1
    return z


@pytest.mark.parametrize(
    "options",
    [{}, {"base": 10}, {"base": 16}, {"form": "UD"}, {"basis": "bound"}, {"basis": "bound", "base": 10}],
    ids=str,
)
def test_silence_after_a_record_changes_no_answer(options):
    """The errors are largest while the estimate is large, so that a short record has the same answer."""
    long, short = (required_precision(MODEL, impulse(steps), 1e-3, highest=12, **options) for steps in (STEPS, 100))
    assert long.met
    assert long.format == short.format
    assert dict(long.tried)[long.digits] == pytest.approx(dict(short.tried)[long.digits], rel=1e-9)


def test_an_estimate_has_its_digits_until_it_becomes_zero():
    fmt = FloatFormat(2, 20)
    run = Run(MODEL, fmt, "innovation", range(1, STEPS + 1))
    run.take(impulse(STEPS))
    x, K = (run.checkpoints().to_float(letter).reshape(-1) for letter in "xK")
    ended = int(np.argmax(x == 0))
    assert 2.0**-962 < x[ended - 1] < 2.0**-700
    assert not x[ended:].any()
    for k in range(1, ended):
        ahead = fmt.round(fmt.round("0.9") * Fraction(x[k - 1]))
        assert Fraction(x[k]) == fmt.round(ahead - fmt.round(Fraction(K[k]) * ahead))


def test_two_estimates_decay_at_their_own_time_and_a_late_measurement_counts():
    model = LinearModel(
        [["0.5", 0], [0, "0.9"]], np.eye(2), [["0.01", 0], [0, "0.01"]], np.eye(2), [1, 1], np.eye(2), name="two"
    )
    z = np.zeros((STEPS, 2))
    z[-1] = 1
    late = Run(model, FloatFormat(2, 20), "innovation", ()).states(z)
    first = int(np.argmax(late[:, 0, 0] == 0))
    assert first < int(np.argmax(late[:, 1, 0] == 0)) < STEPS - 1
    assert (late[-1, :, 0] > 0).all()
    checkpoints = Run(model, FloatFormat(2, 20), "innovation", (first, STEPS))
    checkpoints.take(z)
    assert (checkpoints.checkpoints().to_float("x") == late[[first - 1, -1], :, 0]).all()
