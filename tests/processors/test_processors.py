"""The same filters on different processors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import BFLOAT16, BINARY16, BINARY32
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.processors import experiment as processors
from gpbnb.report.processors.experiment import Processor
from gpbnb.wordlength import examples

STEPS = 60
MEASURED = examples.tilt_measurements(STEPS)


def test_what_does_not_fit_is_refused_and_named() -> None:
    model = examples.tilt()
    narrow = processors.outcome(model, MEASURED, Processor("narrow", FixedFormat(7, 8)))
    assert math.isinf(narrow.error[0])
    assert narrow.refused.startswith("overflow in the model or the measurements")
    tight = processors.outcome(model, MEASURED, Processor("tight", FixedFormat(8, 7)))
    assert "overflow" in tight.refused
    fits = processors.outcome(model, MEASURED, Processor("half", BINARY16))
    assert fits.refused == ""
    assert np.isfinite(fits.error).all()


def test_a_compensated_sum_is_better_and_a_stochastic_one_unbiased() -> None:
    x = np.full((1500, 2), 2.0**-10)
    found = {each.name: each.add(x)[0] for each in processors.integrators()}
    exact = 1500 * 2.0**-10
    assert found["bfloat16 alone"] < 0.4 * exact
    assert abs(found["bfloat16 alone, compensated"] / exact - 1) < 0.01
    assert abs(found["bfloat16 alone, stochastic rounding"] / exact - 1) < 0.3
    assert found["Cortex-M4F, binary32"] == exact


def test_processors_have_the_arithmetic_of_their_names() -> None:
    assert {each.name: (each.fmt, each.sums) for each in processors.PROCESSORS} == {
        "Cortex-M4F, binary32": (BINARY32, None),
        "accelerator, bfloat16 with binary32 sums": (BFLOAT16, BINARY32),
        "bfloat16 alone": (BFLOAT16, None),
        "16-bit fixed point, 9 bits before the point": (FixedFormat(9, 6, Rounding.EVEN), None),
    }


def test_increments_are_of_a_process_with_the_stated_bandwidth() -> None:
    """Half the period times the sum of two samples, each of 1 °/s, whose correlation is exp(-2π·50/1024)."""
    found = processors.increments(2, 100_000)
    assert found.shape == (2, 100_000)
    expected = 2 * (1 + math.exp(-2 * math.pi * 50 / 1024)) / (2 * 1024) ** 2
    assert found.var(axis=1) == pytest.approx(expected, rel=4 * math.sqrt(2 / 100_000))  # four standard errors


def test_the_first_turn_is_that_of_the_stated_rates() -> None:
    """0, 0.1 and 0.3 rad/s over 10 ms: 1048.576 and 3145.728 units of 2**-20 rad, rounded, and halved."""
    y, z = 1049 / 2**21, 3146 / 2**21
    assert examples.turns(1).tolist() == [[[0, 0, -y, -z], [0, 0, z, -y], [y, -z, 0, 0], [z, y, 0, 0]]]
