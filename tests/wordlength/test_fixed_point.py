"""Constant-coefficient filters in fixed point: emulation, guarantee, integer bits."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY64, LinearSystem, WordFormats, emulate, guarantee, limits, required_precision
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.bounds.system import OutputBounds
from gpbnb.bounds.words import rounding_limits
from gpbnb.filters.structures import state_space
from gpbnb.filters.words import integer_program


def test_a_negative_product_reaches_as_far_as_its_rounded_operand() -> None:
    """w = u + 3/4 w_: 4 without rounding, and 7/4 more: 1/4 of the product in each step, and of storing before it."""
    words = WordFormats(FixedFormat(3, 1), FixedFormat(3, 2))
    system = LinearSystem.from_coefficients([-2, "0.5"], [1, "-0.75"], "direct form II")
    with pytest.raises(OverflowError, match=r"operation 3 of 5, may reach 11.5, beyond the 3 .* data; 4 hold it"):
        OutputBounds(system, 1).errors(words)


def test_a_sum_is_rounded_whichever_operand_has_more_bits() -> None:
    """x / 2 + z, and x + (z - x) / 2, where nothing before the sum is rounded."""
    words = WordFormats(FixedFormat(2, 10), 15, FixedFormat(4, 20))
    for made in (state_space([["0.5"]], [["1"]]), LinearSystem.smoother("0.5").as_filter()):
        assert rounding_limits(integer_program(made, words)).tolist() == [0, 0, 2.0**-11]


def near_a_power_of_two(seed):
    """A stable system and inputs whose largest number, without rounding, is just below a power of two."""
    rng = np.random.default_rng(seed)
    system = LinearSystem([["0.9", "0.1"], ["0", "0.8"]], [[0], [rng.choice(["0.2", "0.5", "0.7"])]], [[1, 0]], [[0]])
    u = np.sin(rng.uniform(0.1, 0.5) * np.arange(60))[:, None]
    sizes = [np.abs(u).max(), np.abs(system.states(u, BINARY64)[..., 0]).max()]
    return system, u * ((1 - 2.0**-12) / max(sizes) * 2.0 ** rng.integers(-2, 3))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_no_other_integer_bits_give_a_shorter_word(seed, basis):
    system, u = near_a_power_of_two(seed)
    tolerance = 0.02 * np.abs(system.outputs(u)[..., 0]).max()
    found = required_precision(system, u, tolerance, kind="fixed", basis=basis)
    for integer_bits in range(found.format.data.integer_bits - 2, found.format.data.integer_bits + 3):
        like = WordFormats(FixedFormat(integer_bits, 20), 15, None)
        other = required_precision(system, u, tolerance, kind="fixed", basis=basis, like=like)
        assert not other.met or other.digits >= found.digits


@pytest.mark.parametrize("a1", ["-0.9", "-1"])
def test_a_coefficient_of_one_is_not_multiplied_and_needs_no_integer_bits(a1):
    """y <- u - a1 y, in integers: u = 0.1 in Q15, and a product that is rounded only if it is one."""
    system, fmt = LinearSystem.from_coefficients([1], [1, a1], "direct form I"), FixedFormat(0, 15)
    u, y, seen = round(0.1 * 2**15), 0, []
    for _ in range(8):
        y = u + (y if a1 == "-1" else math.floor(Fraction(round(0.9 * 2**15) * y, 2**15) + Fraction(1, 2)))
        seen.append(y)
    run = emulate(system, [0.1] * 8, fmt)
    assert (run.y.to_float().ravel() * 2**15).tolist() == seen
    bound = guarantee(system, fmt, limits(measurement=0.05), horizon=8)
    assert np.abs(emulate(system, [0.05] * 8, fmt).errors).max() <= bound.bound[0] < 1e-3
