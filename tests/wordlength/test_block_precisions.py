"""The digits of each block, checked by runs of their own."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import BlockFormats, FloatFormat, Form, LinearModel, required_precision
from gpbnb.filters.blocks import BLOCKS
from gpbnb.filters.run import Run, reference_states
from gpbnb.filters.simulation import simulated_measurements

CART = LinearModel(
    [[1, "0.1"], [0, 1]], [[1, 0]], [["1e-6", "1e-5"], ["1e-5", "1e-3"]], [["1e-4"]], [0, 0], [[100, 0], [0, 100]]
)
STEPS, TOLERANCE = 60, 0.01
Z = simulated_measurements(CART, STEPS, 4)


def share(blocks, form=Form.INNOVATION):
    """Largest error of a state in any step over the tolerance."""
    run = Run(CART, blocks, form, ())
    states = run.states(Z)
    if run.stopped or run.indefinite or len(states) < STEPS:
        return np.inf
    return float(np.abs((states - reference_states(CART, Z)).sum(axis=2)).max() / TOLERANCE)


@pytest.mark.parametrize("form", [Form.INNOVATION, Form.JOSEPH, Form.UD])
def test_each_block_is_as_low_as_it_can_be_and_the_neediest_limits(form):
    found = required_precision(CART, Z, TOLERANCE, kind="blocks", form=form)
    assert share(found.format, form) == pytest.approx(found.ratio)
    assert found.ratio <= 1
    wide = BlockFormats.uniform(FloatFormat(2, 53))
    for name in BLOCKS:
        digits = found.alone[name]
        assert share(wide.with_block(name, FloatFormat(2, digits)), form) <= 1
        assert share(wide.with_block(name, FloatFormat(2, digits + 1)), form) <= 1
        assert (
            digits == 2
            or share(wide.with_block(name, FloatFormat(2, digits - 1)), form) > 1
            or share(wide.with_block(name, FloatFormat(2, digits)), form) > 1
        )
        assert getattr(found.format, name).precision <= required_precision(CART, Z, TOLERANCE, form=form).digits
    assert all(found.alone[name] == max(found.alone.values()) for name in found.limiting)
    assert found.limiting
    assert "limit" in str(found)
    # the block that is lowered last cannot be lowered any further
    last = max(BLOCKS, key=lambda name: (found.alone[name], BLOCKS.index(name)))
    lower = found.format.with_block(last, FloatFormat(2, getattr(found.format, last).precision - 1))
    assert share(lower, form) > 1


def test_without_an_answer_in_one_format_there_is_none_for_the_blocks():
    found = required_precision(CART, Z, 1e-30, kind="blocks")
    assert found.format is None
    assert str(found).startswith("no precision up to 53 bits")
