"""The same filters on different processors."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BFLOAT16, BINARY16, BINARY32
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run, Sums
from gpbnb.report.processors import experiment as processors
from gpbnb.report.processors.experiment import Processor
from gpbnb.wordlength import examples
from tests.array_filter import estimates

STEPS = 60
MEASURED = examples.tilt_measurements(STEPS)


@pytest.mark.parametrize(
    "processor",
    [
        Processor("bfloat16", BFLOAT16),
        Processor("wide", BFLOAT16, sums=BINARY32),
        Processor("fused", BFLOAT16, fused=True),
        Processor("compensated", BFLOAT16, compensated=True),
        Processor("in pairs", BFLOAT16, order="pairwise"),
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
        Sums(processor.fused, processor.sums, processor.order, 2),
        processor.compensated,
    )
    run.take(MEASURED)
    times = partial(linalg.matmul, order=processor.order, fused=processor.fused, block=2, sums=processor.sums)
    assert np.array_equal(estimates(model, MEASURED, processor.fmt, times, processor.compensated), run.checkpoints().x)


def test_the_error_is_the_largest_distance_from_the_exact_filter() -> None:
    model = examples.tilt()
    rounded, precise = (estimates(model, MEASURED, fmt, linalg.matmul) for fmt in (BINARY16, FloatFormat(2, 90)))
    expected = abs(rounded - precise).max(axis=0).astype(float)
    found = processors.outcome(model, MEASURED, Processor("half", BINARY16))
    assert found.error == pytest.approx(expected, rel=1e-9)
    assert found.refused == ""


def test_products_in_blocks_are_fused_in_the_wider_format() -> None:
    rng = np.random.default_rng(4)
    a, b = BFLOAT16.array(rng.normal(size=(2, 5))), BFLOAT16.array(rng.normal(size=(5, 3)))
    x, y = BINARY32.array(a.to_fractions()), BINARY32.array(b.to_fractions())
    found = linalg.matmul(a, b, "blocked", fused=True, block=2, sums=BINARY32)
    for i, j in np.ndindex(2, 3):
        first, second = (x[i, k + 1].multiply_add(y[k + 1, j], x[i, k] * y[k, j]) for k in (0, 2))
        total = (first + second) + x[i, 4] * y[4, j]
        assert found[i, j] == BFLOAT16.round(total.to_fractions())


def test_the_order_of_sums_changes_digits_and_little_else() -> None:
    left, pairwise = (
        processors.outcome(examples.tilt(), MEASURED, Processor("binary32", BINARY32, order=order)).error
        for order in ("left", "pairwise")
    )
    assert (left != pairwise).any()
    assert np.abs(np.log2(left / pairwise)).max() < 2


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


def test_a_compensated_sum_counts_each_term_once() -> None:
    x = BFLOAT16.array([[1.0, 3.0], *[[2.0**-9, 2.0**-8]] * 512])  # each is below half a unit of the sum
    assert processors.compensated_sum(x).tolist() == [2.0, 5.0]
    assert processors.compensated_sum(x[:1]).tolist() == [1.0, 3.0]
    assert processors.integrators()[2].add(x.to_float()).tolist() == [1.0, 3.0]


def test_processors_have_the_arithmetic_of_their_names() -> None:
    assert {each.name: (each.fmt, each.sums) for each in processors.PROCESSORS} == {
        "Cortex-M4F, binary32": (BINARY32, None),
        "accelerator, bfloat16 with binary32 sums": (BFLOAT16, BINARY32),
        "bfloat16 alone": (BFLOAT16, None),
        "16-bit fixed point, 9 bits before the point": (FixedFormat(9, 6, Rounding.EVEN), None),
    }


def test_variants_differ_in_one_property_each() -> None:
    names = [each.name for each in processors.variants(8)]
    assert len(names) == len(set(names)) == 8
    assert len(processors.variants(24)) == 7


def test_increments_are_of_a_process_with_the_stated_bandwidth() -> None:
    """Half the period times the sum of two samples, each of 1 °/s, whose correlation is exp(-2π·50/1024)."""
    found = processors.increments(2, 100_000)
    assert found.shape == (2, 100_000)
    expected = 2 * (1 + math.exp(-2 * math.pi * 50 / 1024)) / (2 * 1024) ** 2
    assert found.var(axis=1) == pytest.approx(expected, rel=4 * math.sqrt(2 / 100_000))  # four standard errors


def test_variants_are_what_their_names_say() -> None:
    found = {each.name: each for each in processors.variants(11)}
    assert found["and pairwise sums instead"].order == "pairwise"
    assert [name for name, each in found.items() if each.fused] == ["and fused multiply-add"]
    assert [name for name, each in found.items() if each.compensated] == ["and a compensated update instead"]
    assert [name for name, each in found.items() if each.sums == BINARY32] == ["and binary32 sums instead"]
    assert "and binary32 sums instead" not in {each.name for each in processors.variants(24)}


def test_the_first_turn_is_that_of_the_stated_rates() -> None:
    """0, 0.1 and 0.3 rad/s over 10 ms: 1048.576 and 3145.728 units of 2**-20 rad, rounded, and halved."""
    y, z = 1049 / 2**21, 3146 / 2**21
    assert examples.turns(1).tolist() == [[[0, 0, -y, -z], [0, 0, z, -y], [y, -z, 0, 0], [z, y, 0, 0]]]
