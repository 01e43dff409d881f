"""Constant-coefficient filters in fixed point: emulation, guarantee, integer bits."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY64, LinearSystem, WordFormats, emulate, guarantee, limits, required_precision
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.probable import probable_output_errors
from gpbnb.bounds.system import OutputBounds, bounded_rounding
from gpbnb.bounds.words import rounding_limits
from gpbnb.filters.structures import state_space
from gpbnb.filters.words import integer_program
from gpbnb.wordlength.required import judge


def test_a_negative_product_reaches_as_far_as_its_rounded_operand() -> None:
    """w = u + 3/4 w_: 4 without rounding, and 7/4 more: 1/4 of the product in each step, and of storing before it."""
    words = WordFormats(FixedFormat(3, 1), FixedFormat(3, 2))
    system = LinearSystem.from_coefficients([-2, "0.5"], [1, "-0.75"], "direct form II")
    with pytest.raises(OverflowError, match=r"operation 3 of 5, may reach 11.5, beyond the 3 .* data; 4 hold it"):
        OutputBounds(system, 1).errors(words)


def test_bits_that_hold_a_number_hold_it_below_their_largest() -> None:
    """3.875 is beyond 3.75, the largest number of 2 integer bits and 2 fraction bits."""
    words = WordFormats(FixedFormat(2, 2), FixedFormat(3, 2))
    system = LinearSystem.from_coefficients(["-1.5", "-0.5"], [1, "-0.75"], "direct form II")
    with pytest.raises(OverflowError, match=r"may reach 3.875, beyond the 2 integer bits of the data; 3 hold it"):
        OutputBounds(system, 1).errors(words)


def test_the_bound_of_one_state_is_its_geometric_series() -> None:
    """s <- s / 2 + z: one product a step, half a unit each, halved from step to step."""
    made = LinearSystem.pid("0", "1", "0", "0.5").as_filter()
    fmt = FixedFormat(2, 10)
    bound = bounded_rounding(made, WordFormats(fmt, 15))
    exact = float(fmt.unit) / 2 / (1 - 0.5)
    assert exact <= bound[0] <= exact * (1 + 2.0**-19)  # a claim leaves the checker a margin of 2**-20
    chopped = bounded_rounding(made, WordFormats(FixedFormat(2, 10, Rounding.CHOP), 15))
    assert np.allclose(chopped, 2 * bound)


def test_a_sum_is_rounded_whichever_operand_has_more_bits() -> None:
    """x / 2 + z, and x + (z - x) / 2, where nothing before the sum is rounded."""
    words = WordFormats(FixedFormat(2, 10), 15, FixedFormat(4, 20))
    for made in (state_space([["0.5"]], [["1"]]), LinearSystem.smoother("0.5").as_filter()):
        assert rounding_limits(integer_program(made, words)).tolist() == [0, 0, 2.0**-11]


@pytest.mark.parametrize(("b", "z"), [("3", [1, 1.5]), ("0.9", [3, 3])])
def test_overflow_is_in_a_product_or_in_a_sum(b: str, z: list[float]) -> None:
    """x = 0.9 x + b z, with numbers below four."""
    with pytest.raises(OverflowError, match="state 0 at step 2: got a number beyond the range of data of 11 bits"):
        LinearSystem([["0.9"]], [[b]]).outputs(np.array(z).reshape(-1, 1), WordFormats(FixedFormat(2, 8), 15))


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


def test_numbers_far_below_one_need_a_word_that_begins_after_the_point():
    found = required_precision(LinearSystem([["0.5"]], [["0.5"]]), [2.0**-10] * 9, 1, kind="fixed")
    assert found.met
    assert found.format.data.integer_bits < 0 < found.format.data.precision


def test_limits_that_a_run_never_reaches_need_integer_bits_too():
    controller = LinearSystem.pid("0.8", "0.05", limits=(-1, 1))
    u = 0.05 * np.sin(0.3 * np.arange(60))[:, None]
    given = required_precision(controller, u, 0.01, kind="fixed", like=FixedFormat(1, 14))
    found = required_precision(controller, u, 0.01, kind="fixed")
    assert found.format.data == given.format
    assert required_precision(controller, u, 0.01, kind="words").format.data == found.format.data


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


def test_a_probable_error_is_less_than_a_bound_and_refused_in_words() -> None:
    system, asked = LinearSystem([["0.9"]], [["0.1"]]), {"z": [0.5] * 20, "tolerance": "1/100"}
    given = asked | {"within": limits(measurement=1)}
    probable, bound = (judge(system, "Q3.12", **given, basis=basis).ratio for basis in ("probable", "guarantee"))
    assert probable == pytest.approx(probable_output_errors(system, np.ones(1), FixedFormat(3, 12))[0] * 100)
    assert probable < bound / 2
    found = required_precision(system, **given, kind="fixed", like="Q3.9", basis="probable")
    assert dict(found.tried)[found.digits] <= 1 < dict(found.tried)[found.digits - 1]
    for kind in ("fixed", "words"):
        with pytest.raises(ValueError, match="a linear system cannot have a probable error in words; ask with basis="):
            required_precision(system, **given, kind=kind, basis="probable")


def test_a_controller_with_limits_has_a_guarantee_in_one_format() -> None:
    system, within = LinearSystem.pid("0.5", "0.1", leak="0.9", limits=(-1, 1)), limits(measurement=1)
    asked = {"tolerance": "1/50", "kind": "fixed", "like": "Q3.4", "basis": "guarantee", "within": within}
    found = required_precision(system, 30, **asked)
    assert found.met
    assert found.ratio == pytest.approx(guarantee(system, found.format, within, horizon=30).bound[0] * 50)
    shares = []
    for u in np.random.default_rng(0).choice([-1.0, -0.5, 0.5, 1.0], (20, 30)):
        shares.append(emulate(system, u, found.format).largest[0] * 50 / found.ratio)
    assert 0.1 < max(shares) <= 1
    with pytest.raises(ValueError, match="cannot have a guarantee in fixed-point words; ask with one format for all"):
        required_precision(system, 30, **asked | {"like": None})
