"""The same filters on different processors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import BFLOAT16, BINARY16, BINARY32
from gpbnb.kalman.filter_run import Run
from gpbnb.kalman.forms import Form
from gpbnb.wordlength import examples, processors
from gpbnb.wordlength.processors import Processor

STEPS = 60
MEASURED = examples.tilt_measurements(STEPS)


@pytest.mark.parametrize(
    "processor",
    [
        Processor("bfloat16", BFLOAT16),
        Processor("wide", BFLOAT16, sums=BINARY32),
        Processor("fused", BFLOAT16, fused=True),
        Processor("compensated", BFLOAT16, compensated=True),
    ],
    ids=lambda each: each.name,
)
def test_arrays_and_compiled_runs_give_the_same_digits(processor: Processor) -> None:
    model = examples.tilt()
    run = Run(
        model,
        processor.fmt,
        Form.INNOVATION,
        range(1, STEPS + 1),
        processor.fused,
        processor.sums,
        processor.compensated,
    )
    run.take(MEASURED)
    assert np.array_equal(processors.by_arrays(model, MEASURED, processor), run.checkpoints().x)


def test_the_order_of_sums_changes_digits_and_little_else() -> None:
    single = Processor("binary32", BINARY32)
    left, pairwise = (
        processors.by_arrays(examples.tilt(), MEASURED, single, order).astype(float) for order in ("left", "pairwise")
    )
    assert 0 < np.abs(left - pairwise).max() < 1e-3


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


def test_typical_errors_are_root_mean_squares() -> None:
    model, chosen = examples.tilt(), (Processor("bfloat16", BFLOAT16), Processor("fused", BFLOAT16, fused=True))
    records = [examples.tilt_measurements(STEPS, seed) for seed in (1, 2)]
    each = np.array([[processors.outcome(model, z, p).error for p in chosen] for z in records])
    assert np.allclose(processors.typical_errors(model, records, chosen), np.sqrt((each**2).mean(axis=0)))


def test_a_compensated_sum_is_better_and_a_stochastic_one_unbiased() -> None:
    x = np.full((1500, 2), 2.0**-10)
    found = {each.name: each.add(x)[0] for each in processors.integrators()}
    exact = 1500 * 2.0**-10
    assert found["bfloat16 alone"] < 0.4 * exact
    assert abs(found["bfloat16 alone, compensated"] / exact - 1) < 0.01
    assert abs(found["bfloat16 alone, stochastic rounding"] / exact - 1) < 0.3
    assert found["Cortex-M4F, binary32"] == exact


def test_variants_differ_in_one_property_each() -> None:
    names = [each.name for each in processors.variants(8)]
    assert len(names) == len(set(names)) == 7
    assert len(processors.variants(24)) == 6
