"""gpbnb.filters.blocks: filters whose blocks have formats of their own, against plain loops over fractions."""

from __future__ import annotations

import numpy as np

from gpbnb import FloatFormat, Form, LinearModel
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.run import Run


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
