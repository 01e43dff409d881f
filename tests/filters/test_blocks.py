"""gpbnb.filters.blocks: filters whose blocks have formats of their own, against plain loops over fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from plain_blocks import Filter, Rounds

from gpbnb import BINARY32, BINARY64, FixedFormat, FloatFormat, Form, LinearModel
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.emulation import emulate
from gpbnb.filters.run import Run, Sums
from tests.plain_structures import floating

GIVEN = {
    "Phi": [["1", "0.1", "0"], ["0", "0.9", "0.3"], ["0", "0", "0.7"]],
    "H": [["1", "0", "0.2"], ["0.5", "1", "0"]],
    "Q": [["0.01", "0.002", "0"], ["0.002", "0.03", "0"], ["0", "0", "0.02"]],
    "R": [["0.3", "0.1"], ["0.1", "0.4"]],
    "x0": ["0.3", "1", "-0.2"],
    "P0": [["1", "0.1", "0"], ["0.1", "2", "0"], ["0", "0", "0.5"]],
}
MODEL = LinearModel(*GIVEN.values())
FRACTIONS = {
    key: [Fraction(a) for a in rows] if key == "x0" else [[Fraction(a) for a in row] for row in rows]
    for key, rows in GIVEN.items()
}
Z = np.random.default_rng(8).normal(size=(12, 2))
Z[3] = Z[5, 0] = Z[8:10] = np.nan
"""Measurements, of which some are missing: rows of K H are then zero, and rows of I - K H the identity's."""


@pytest.mark.parametrize("form", list(Form), ids=str)
@pytest.mark.parametrize(
    ("base", "digits", "sums", "rounding"),
    [
        (2, {"state": 11, "gain": 7, "covariance": 24, "innovation": 9}, None, "nearest"),
        (2, {"state": 24, "gain": 30, "covariance": 9, "innovation": 53}, None, "nearest"),
        (2, {"state": 8, "gain": 12, "covariance": 16, "innovation": 10}, 20, "even"),
        (10, {"state": 4, "gain": 3, "covariance": 9, "innovation": 5}, None, "chop"),
        (10, {"state": 8, "gain": 7, "covariance": 4, "innovation": 6}, None, "nearest"),
        (10, {"state": 12, "gain": 7, "covariance": 10, "innovation": 11}, None, "even"),
        (16, {"state": 6, "gain": 5, "covariance": 3, "innovation": 13}, None, "chop"),
    ],
)
def test_each_block_computes_in_its_own_format_as_plain_loops_do(form, base, digits, sums, rounding):
    formats = {name: FloatFormat(base, each, rounding) for name, each in digits.items()}
    blocks = BlockFormats(**formats, sums=None if sums is None else FloatFormat(base, sums, rounding))
    rounds = {name: floating(base, each, rounding) for name, each in digits.items()}
    within = None if sums is None else floating(base, sums, rounding)
    slow = Filter(
        FRACTIONS,
        form,
        floating(base, max(digits.values()), rounding),
        {name: Rounds(r, r if within is None else within) for name, r in rounds.items()},
    )
    x, K, P = taken(blocks, form)
    for k, z in enumerate(Z):
        slow.step(z)
        assert (x[k].tolist(), P[k].tolist(), K[k].tolist()) == (slow.x, slow.P, slow.K)


def taken(blocks, form):
    """Estimates, gains and covariances, or factors, after each step of a run of the package."""
    model, z = MODEL.without_missing(Z)
    run = Run(model, blocks, form, range(1, len(Z) + 1))
    run.take(z)
    return run.exactly(run.X), run.exactly(run.G), run.exactly(run.C)


def test_a_covariance_in_binary64_beside_binary32_is_that_of_plain_loops():
    single, double = floating(2, 24, "even", -126), floating(2, 53, "even", -1022)
    rounds = dict.fromkeys(BLOCKS, Rounds(single, single)) | {"covariance": Rounds(double, double)}
    slow = Filter(FRACTIONS, Form.UD, double, rounds)
    blocks = BlockFormats.uniform(BINARY32).with_block("covariance", BINARY64)
    assert blocks.model == FloatFormat(2, 53, "even")
    x, _, U = taken(blocks, Form.UD)
    for k, z in enumerate(Z):
        slow.step(z)
        assert (x[k].tolist(), U[k].tolist()) == (slow.x, slow.P)


@pytest.mark.parametrize("form", list(Form), ids=str)
@pytest.mark.parametrize("fmt", [FloatFormat(2, 12), FloatFormat(2, 24, "even", -126, 127), FloatFormat(10, 6, "chop")])
def test_equal_blocks_are_one_format(form, fmt):
    for one, blocks in zip(taken(fmt, form), taken(BlockFormats.uniform(fmt), form), strict=True):
        assert one.tolist() == blocks.tolist()


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


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"gain": FixedFormat(2, 8)}, TypeError, "got gain FixedFormat"),
        ({"gain": FloatFormat(10, 5)}, ValueError, "got base 10 for gain and 2 for state; needed one base"),
        ({"gain": FloatFormat(2, 8, "stochastic")}, ValueError, "got stochastic rounding for gain"),
        ({"gain": FloatFormat(2, 60)}, ValueError, "60 bits"),
        ({"sums": FloatFormat(2, 20)}, ValueError, "needed at least as many digits"),
    ],
)
def test_formats_that_do_not_fit_are_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        BlockFormats(**(dict.fromkeys(BLOCKS, BINARY32) | arguments))


@pytest.mark.parametrize("options", [{"sums": Sums(fmt=BINARY32)}, {"compensated": True}, {"bounded": True}])
def test_blocks_go_with_no_other_sums_and_no_bound(options):
    with pytest.raises(ValueError, match="got formats of blocks with sums, compensated, bounded or many records"):
        Run(MODEL, BlockFormats.uniform(BINARY32), Form.INNOVATION, [], **options)


def test_errors_of_a_run_with_blocks_are_those_from_the_reference():
    blocks = BlockFormats.uniform(FloatFormat(2, 40)).with_block("state", FloatFormat(2, 12))
    model, z = MODEL.without_missing(Z)
    found = emulate(model, z, blocks, checkpoint_steps=[12])
    run = Run(model, blocks, Form.INNOVATION, [12])
    run.take(z)
    difference = run.checkpoints().x[0] - found.reference.x[0]
    assert found.state[0].tolist() == pytest.approx(difference.astype(float).tolist(), rel=1e-12)
    assert found.fmt is blocks
