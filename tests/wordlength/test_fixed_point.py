"""Constant-coefficient filters in fixed point: emulation, guarantee, scaling."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from small_filter import unscaled

from gpbnb import BINARY64, FloatFormat, LinearSystem, WordFormats, emulate, guarantee, limits, required_precision
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.words import largest_rounding
from gpbnb.filters.simulation import Simulation
from gpbnb.filters.system import biquad, controller, state_space
from gpbnb.report.processors import scaled as fixed_point
from gpbnb.report.processors.scaled import ScaledFilter
from gpbnb.wordlength import examples
from tests.plain_program import steps_in_python


def stored_coefficients(made, bits):
    return FloatFormat(2, bits).array(made.coefficients).to_fractions()


MODES = [mode for mode in Rounding if mode is not Rounding.STOCHASTIC]


def tracked() -> tuple[ScaledFilter, np.ndarray[Any, Any]]:
    model = examples.tracker()
    z = Simulation(model, (5.0, 1.0), 0, resolution=2.0**-12).measurements(300)
    return fixed_point.constant_gain(model, z), z


def guaranteed(given: ScaledFilter, fmt: FixedFormat, wide: bool = False) -> np.ndarray[Any, Any]:
    """The bound of each state's error in a format."""
    return fixed_point.bound_per_unit(given, wide=wide) * largest_rounding(fmt.rounding) * float(fmt.unit)


@pytest.mark.parametrize("mode", MODES)
def test_every_step_is_that_of_the_fixed_point_kernel(mode: Rounding) -> None:
    """The integers against the correctly rounded scalar operations of the format."""
    given, z = tracked()
    fmt = FixedFormat(fixed_point.integer_bits(given, z), 12, mode)
    coefficients = stored_coefficients(given.filter, 9)
    program, unit = given.filter.program, fmt.unit
    state, true = [Fraction(0)] * program.n, [Fraction(0)] * program.n
    errors = fixed_point.emulated(given, z[:40], fmt, 9)
    for k, row in enumerate(z[:40]):
        seen = [
            Fraction(math.floor(float(v) / 2.0**e / float(unit) + 0.5)) * unit
            for v, e in zip(row, given.measurement, strict=True)
        ]
        state = steps_in_python(program, fmt.round, coefficients, state, seen)
        true = steps_in_python(program, lambda x: x, coefficients, true, seen)
        expected = [float(a - b) * 2.0 ** float(e) for a, b, e in zip(state, true, given.state, strict=True)]
        assert np.allclose(errors[k], expected, rtol=1e-9, atol=1e-12)
    assert np.abs(errors).max() > 0


def test_a_long_accumulator_rounds_each_sum_once() -> None:
    """A section whose two products are rounded together instead of one by one."""
    given = unscaled(biquad("0.3", "0.2", "0.1", "-0.5", "0.25"))
    z = np.random.default_rng(1).uniform(-1, 1, (50, 1))
    fmt = FixedFormat(2, 8)
    coefficients = stored_coefficients(given.filter, 15)
    b0, b1, b2, a1, a2 = coefficients
    s1 = s2 = t1 = t2 = Fraction(0)
    errors = fixed_point.emulated(given, z, fmt, wide=True)
    for k, (value,) in enumerate(z.tolist()):
        u = Fraction(math.floor(value / float(fmt.unit) + 0.5)) * fmt.unit
        y = fmt.round(b0 * u + s1)
        s1, s2 = fmt.round(b1 * u + s2 - a1 * y), fmt.round(b2 * u - a2 * y)
        exact_y = b0 * u + t1
        t1, t2 = b1 * u + t2 - a1 * exact_y, b2 * u - a2 * exact_y
        assert np.allclose(errors[k], [float(s1 - t1), float(s2 - t2), float(y - exact_y)], atol=1e-12)


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("mode", [Rounding.NEAREST, Rounding.DOWN])
def test_the_guarantee_holds_and_is_not_far_off(mode: Rounding, wide: bool) -> None:
    given, z = tracked()
    fmt = FixedFormat(fixed_point.integer_bits(given, z), 14, mode)
    bound = guaranteed(given, fmt, wide=wide)
    worst = np.abs(fixed_point.emulated(given, z, fmt, wide=wide)).max(axis=0)
    assert (worst <= bound).all()
    assert (worst > bound / 40).all()


def test_the_bound_of_one_state_is_its_geometric_series() -> None:
    """s <- s / 2 + z: one product a step, half a unit each, halved from step to step."""
    given = unscaled(controller("0.5", "1", "0", "0"))
    fmt = FixedFormat(2, 10)
    bound = guaranteed(given, fmt)
    exact = float(fmt.unit) / 2 / (1 - 0.5)
    assert exact <= bound[0] <= exact * (1 + 2.0**-19)  # a claim leaves the checker a margin of 2**-20
    chopped = guaranteed(given, FixedFormat(2, 10, Rounding.CHOP))
    assert np.allclose(chopped, 2 * bound)


def test_answers_count_fraction_bits() -> None:
    given, z = tracked()
    tolerance = [0.1, math.inf]
    observed = fixed_point.required_bits(given, z, tolerance)
    proved = fixed_point.required_bits(given, z, tolerance, "guarantee")
    assert observed.format is not None
    assert (observed.basis, proved.basis) == ("emulation", "guarantee")
    assert observed.digits <= proved.digits
    for answer in (observed, proved):
        ratios = dict(answer.tried)
        bits = answer.digits  # type: ignore[union-attr]
        assert ratios[bits] <= 1 >= ratios[bits + 1]
        assert ratios[bits - 1] > 1
        assert f"{bits} fraction bits in a word of" in str(answer)
        assert f"{bits - 1} fraction bits give" in answer.why


@pytest.mark.parametrize(
    ("b", "z", "place"), [("3", [1, 1.5], "a product, operation 2 of 3"), ("0.9", [3, 3], "a sum, operation 3 of 3")]
)
def test_overflow_is_in_a_product_or_in_a_sum(b: str, z: list[float], place: str) -> None:
    """x = 0.9 x + b z, with numbers below four."""
    given = unscaled(state_space([["0.9"]], [[b]]))
    with pytest.raises(OverflowError, match=f"overflow in {place}, at step 2"):
        fixed_point.emulated(given, np.array(z).reshape(-1, 1), FixedFormat(2, 8))


def test_overflow_names_operation_and_step() -> None:
    given, z = tracked()
    narrow = FixedFormat(fixed_point.integer_bits(given, z) - 2, 15)
    with pytest.raises(OverflowError, match=r"overflow in a (sum|product), operation \d+ of \d+, at step \d+"):
        fixed_point.emulated(given, z, narrow)
    for overflow in ("saturate", "wrap"):
        fmt = FixedFormat(narrow.integer_bits, 15, overflow=overflow)
        assert np.isfinite(fixed_point.emulated(given, z, fmt)).all()


def test_scaling_keeps_what_occurs_below_one() -> None:
    given, z = tracked()
    assert fixed_point.integer_bits(given, z) <= 0
    assert (np.abs(z).max(axis=0) * 2 < 2.0 ** given.measurement.astype(float)).all()


def near_a_power_of_two(seed):
    """A stable system and inputs whose largest number, without rounding, is just below a power of two."""
    rng = np.random.default_rng(seed)
    system = LinearSystem([["0.9", "0.1"], ["0", "0.8"]], [[0], [rng.choice(["0.2", "0.5", "0.7"])]], [[1, 0]], [[0]])
    u = np.sin(rng.uniform(0.1, 0.5) * np.arange(60))[:, None]
    sizes = [np.abs(u).max(), np.abs(system.states(u, BINARY64)[..., 0]).max()]
    return system, u * ((1 - 2.0**-12) / max(sizes) * 2.0 ** rng.integers(-2, 3))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_no_other_integer_bits_give_a_shorter_word(seed, basis):
    system, u = near_a_power_of_two(seed)
    tolerance = 0.02 * np.abs(system.outputs(u)[..., 0]).max()
    found = required_precision(system, u, tolerance, kind="fixed", basis=basis)
    for integer_bits in range(found.format.data.integer_bits - 2, found.format.data.integer_bits + 3):
        like = WordFormats(FixedFormat(integer_bits, 20), 15, None)
        other = required_precision(system, u, tolerance, kind="fixed", basis=basis, like=like)
        assert not other.met or other.digits >= found.digits


def test_limits_that_a_run_never_reaches_need_integer_bits_too():
    controller = LinearSystem.pid("0.8", "0.05", limits=(-1, 1))
    u = 0.05 * np.sin(0.3 * np.arange(60))[:, None]
    given = required_precision(controller, u, 0.01, kind="fixed", like=FixedFormat(1, 14))
    found = required_precision(controller, u, 0.01, kind="fixed")
    assert found.format.data == given.format
    assert required_precision(controller, u, 0.01, kind="words").format.data == found.format.data


def test_a_scaled_filter_gets_the_integer_bits_of_its_run_in_the_format():
    z = np.ones((60, 1))
    given = ScaledFilter(state_space([["0.5"]], [["0.4999"]]), np.zeros(1, int), np.zeros(1, int), np.zeros((1, 1)))
    found = fixed_point.required_bits(given, z * 0.9999, 0.02)
    assert found.met
    assert np.abs(fixed_point.emulated(given, z * 0.9999, found.format)).max() <= 0.02


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
