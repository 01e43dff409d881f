"""gpbnb.filters.blocks: filters whose blocks have formats of their own, against plain loops over fractions."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FloatFormat, Form, LinearModel
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.emulation import emulate
from gpbnb.filters.run import Run

GIVEN = {
    "Phi": [["1", "0.1", "0"], ["0", "0.9", "0.3"], ["0", "0", "0.7"]],
    "H": [["1", "0", "0.2"], ["0.5", "1", "0"]],
    "Q": [["0.01", "0.002", "0"], ["0.002", "0.03", "0"], ["0", "0", "0.02"]],
    "R": [["0.3", "0.1"], ["0.1", "0.4"]],
    "x0": ["0.3", "1", "-0.2"],
    "P0": [["1", "0.1", "0"], ["0.1", "2", "0"], ["0", "0", "0.5"]],
}
MODEL = LinearModel(*GIVEN.values())
Z = np.random.default_rng(8).normal(size=(12, 2))
Z[3] = Z[5, 0] = Z[8:10] = np.nan
"""Measurements, of which some are missing: rows of K H are then zero, and rows of I - K H the identity's."""


def test_an_overflow_names_the_quantity_of_the_block_whose_range_it_leaves():
    narrow = FloatFormat(2, 11, "even", -14, 3)
    wide, sums = FloatFormat(2, 11, "even"), FloatFormat(2, 20, "even")
    for name, quantity in (
        ("covariance", "covariance"),
        ("innovation", "innovation covariance"),
        ("state", "estimate"),
    ):
        grown = LinearModel([["4"]], [["1"]], [["900"]], [["900"]], ["0"], [["1"]])
        run = Run(grown, BlockFormats.uniform(wide, sums).with_block(name, narrow), Form.INNOVATION, [])
        run.take(np.full((3, 1), 9.0) if name == "state" else np.zeros((3, 1)))
        assert run.stopped is not None
        assert quantity in run.reason


def test_errors_of_a_run_with_blocks_are_those_from_the_reference():
    blocks = BlockFormats.uniform(FloatFormat(2, 40)).with_block("state", FloatFormat(2, 12))
    model, z = MODEL.without_missing(Z)
    found = emulate(model, z, blocks, checkpoint_steps=[12])
    run = Run(model, blocks, Form.INNOVATION, [12])
    run.take(z)
    difference = run.checkpoints().x[0] - found.reference.x[0]
    assert found.state[0].tolist() == pytest.approx(difference.astype(float).tolist(), rel=1e-12)
    assert found.fmt is blocks
