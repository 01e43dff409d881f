"""What a guarantee assumes of roundings, limits and inputs, beside runs that come near it."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, LinearModel, LinearSystem, Rounding, required_precision
from gpbnb.bounds.gains import filter_schedule
from gpbnb.bounds.guarantee import from_schedule, guarantee, limits
from gpbnb.bounds.units import largest_errors, stored_sizes
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.run import Run, reference_states


def two_states(**changes: Any) -> LinearModel:
    given = {
        "Phi": [["1/2", 0], ["1/4", "1/3"]], "H": [[1, 1]], "Q": [[1, 0], [0, 1]], "R": [["0.75"]], "x0": [0, 0],
        "P0": [[1, 0], [0, 1]],
    }  # fmt: skip
    return LinearModel(**(given | changes))


# -- stochastic rounding ----------------------------------------------------------------------------------------------


def test_fixed_coefficients_may_be_rounded_at_random() -> None:
    """Each rounding is off by less than a unit; coefficients and their bound are those of the run's own seed."""
    system = LinearSystem([["0.9"]], [["0.3"]])
    for seed in range(8):
        fmt = FloatFormat(2, 6, Rounding.STOCHASTIC, seed=seed)
        made = filter_schedule(system.as_filter(), fmt)
        fmt.restart()
        assert [*made.packed[0]] == [*fmt.array(system.as_filter().coefficients).to_float()]
        again = filter_schedule(system.as_filter(), fmt)
        assert np.array_equal(made.packed, again.packed)
        found = from_schedule(made, limits(measurement=4))
        z = np.random.default_rng(seed).choice([-4.0, 4.0, 3.9375], (300, 1))
        A, B = made.packed[0, :2]
        x, exactly, worst = system.outputs(z, fmt)[:, 0, 0], 0.0, 0.0
        for k in range(len(z) - 1):  # an output is the state before the step
            exactly = A * exactly + B * z[k, 0]
            worst = max(worst, abs(x[k + 1] - exactly))
        assert 0.01 * found.bound[0] < worst <= found.bound[0]
    found = required_precision(system, 300, 0.1, rounding="stochastic", basis="guarantee", within=limits(measurement=4))
    assert found.format is not None


# -- nothing measured, nothing allowed --------------------------------------------------------------------------------


DETERMINISTIC = [each for each in Rounding if each is not Rounding.STOCHASTIC]


@pytest.mark.parametrize(("rounding", "form"), [*zip(DETERMINISTIC, itertools.cycle(WITH_PROGRAM))])
@pytest.mark.parametrize("x0", [[0, 0], ["0.3", "-0.7"]])
def test_a_filter_that_measures_nothing(rounding: Rounding, form: Form, x0: list[Any]) -> None:
    """Its estimate is the first one, predicted: from zero it stays zero, otherwise only roundings of that decay."""
    model, fmt = two_states(H=[[0, 0]], x0=x0), FloatFormat(2, 7, rounding)
    for within in (limits(measurement=10), limits(state=1, innovation=10)):
        found = guarantee(model, fmt, within, form=form)
        assert found.for_ever
        run = Run(model, fmt, form, ())
        z = fmt.array(np.full((30, 1), 10.0))
        error = np.abs((run.states(z) - reference_states(model.rounded(fmt), z.to_fractions())).sum(axis=2))
        assert (error.max(axis=0) <= found.bound).all()
        if within.state[0] > 1:
            assert (found.bound < 1e-9).all() == (x0 == [0, 0])  # the checker rounds outwards


# -- inputs of a linear system as a format stores them ----------------------------------------------------------------


@pytest.mark.parametrize("basis", ["guarantee", "bound"])
def test_inputs_that_underflow_count_among_the_errors_of_storing(basis: Any) -> None:
    """A delay line: 6e-5 is below the least normal number and stored as 0, whatever the precision."""
    delay = LinearSystem([[0]], [[1]], [[1]])
    u, within = np.full((5, 1), 0.05), limits(measurement=0.05) if basis == "guarantee" else None
    lost = np.full((3, 1), 6e-5)
    for rounding in ("nearest", "chop", "up", "stochastic"):
        like = FloatFormat(2, 2, rounding, -14, 15, subnormal=False)
        refused = required_precision(delay, u, 3e-5, basis=basis, within=within, like=like)
        assert refused.format is None
        found = required_precision(delay, u, 7e-5, basis=basis, within=within, like=like)
        assert found.format is not None
        error = abs(6e-5 - delay.outputs(lost, found.format)[-1, 0, 0])
        assert error == 6e-5 or rounding == "up"
        assert error <= 7e-5 * dict(found.tried)[found.digits]
    # With subnormal numbers, their spacing is the least error.
    gradual = required_precision(delay, u, 2e-6, basis=basis, within=within, range=(-14, 15))
    assert gradual.format is not None
    precision = gradual.digits
    assert 2.0 ** (-14 - precision + 1) / 2 <= 2e-6 * dict(gradual.tried)[precision]


@pytest.mark.parametrize(
    "fmt", [FloatFormat(2, 5), FloatFormat(10, 3, Rounding.UP), FloatFormat(2, 6, emin=-3, emax=4)]
)
def test_the_errors_of_storing_are_those_of_operations(fmt: FloatFormat) -> None:
    rng = np.random.default_rng(3)
    sizes = np.array([0.0, 0.01, 0.2, 1.0, 7.3])
    found = largest_errors(fmt, sizes)
    assert found[0] == 0
    for size, most in zip(sizes, found, strict=True):
        values = [float(v) for v in (*(size * rng.uniform(-1, 1, 300)), size, -size)]
        errors = [abs(fmt.round(v) - Fraction(v)) for v in values]
        assert max(errors) <= Fraction(float(most))
        assert max(errors) >= Fraction(float(most)) / 4
    assert (largest_errors(FixedFormat(2, 5), np.array([3.0, 4.0])) == [2.0**-6, np.inf]).all()


@pytest.mark.parametrize("rounding", Rounding)
def test_limits_of_measurements_are_for_those_before_storing(rounding: Rounding) -> None:
    """Three bits store 0.95 as 1, so that results above 1 occur, whose roundings are twice as large."""
    fmt, rng = FloatFormat(2, 3, rounding), np.random.default_rng(1)
    for size in (0.95, 1.0, 3.3, 0.0):
        (most,) = stored_sizes(fmt, np.array([size]))
        stored = [abs(float(fmt.round(float(v)))) for v in (*(size * rng.uniform(-1, 1, 500)), *([size, -size] * 9))]
        assert max(stored) <= most
        assert most in (size, max(stored)) or rounding is Rounding.STOCHASTIC
    assert stored_sizes(fmt, np.array([np.inf]))[0] == np.inf
    assert stored_sizes(FloatFormat(2, 3, rounding, -3, 3), np.array([99.0]))[0] == 99.0
    system = LinearSystem([["0.5"]], [["1"]]).as_filter()
    wide, narrow = (from_schedule(filter_schedule(system, fmt), limits(measurement=size)) for size in (1.0, 0.95))
    if rounding in (Rounding.NEAREST, Rounding.EVEN, Rounding.STOCHASTIC):
        assert np.array_equal(narrow.bound, wide.bound)
