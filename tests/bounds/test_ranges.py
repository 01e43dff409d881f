"""Answers and guarantees for formats with a limited range: underflow is part of the bound."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY16
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.bounds.units import units
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, reference_states
from gpbnb.report.guarantees.adversary import attack

# Filters in other rounding modes take long to compile; tests/arithmetic compares every mode with Fractions.
EVEN = Rounding.EVEN


# -- guarantees -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("subnormal", "size"), [(True, 2.0**-9), (False, 2.0**-5)])
def test_underflow_is_part_of_the_guarantee(subnormal, size):
    """The errors of small numbers exceed the bound for an unlimited range."""
    small = limits(state=2 * size, innovation=2 * size)
    fmt = FloatFormat(2, 11, EVEN, -6, 15, subnormal)
    model = LinearModel([["0.9"]], [[1]], [["0.03125"]], [["0.125"]], [0], [[1]])
    z = np.random.default_rng(0).uniform(-size, size, (1000, 1))
    run = Run(model, fmt, "innovation", ())
    true = reference_states(model.rounded(fmt), fmt.array(z).to_fractions())
    error = np.abs((run.states(fmt.array(z)) - true).sum(axis=2)).max()
    assert guarantee(model, FloatFormat(2, 11, EVEN), small).bound[0] < error < guarantee(model, fmt, small).bound[0]


@pytest.mark.parametrize("fmt", [BINARY16, FloatFormat(2, 5, EVEN, -3, 4, False), FloatFormat(10, 3, emin=-2, emax=3)])
def test_no_rounding_error_exceeds_its_unit(fmt):
    """Against Fractions, for numbers below, at and above each entry of the table, down to the least and up."""
    table, kernel = units(fmt), fmt.round
    largest = float(fmt.limits.largest)
    rng = np.random.default_rng(1)
    sizes = np.concatenate([largest * 2.0 ** -rng.uniform(0, 60, 600), table.powers[table.powers <= largest]])
    for size in sizes:
        at = np.searchsorted(table.powers, size)
        assert abs(float(kernel(float(size))) - size) <= table.errors[at] * (1 + 2.0**-40)
    assert table.powers[-1] == largest
    assert table.exact.tolist() == [1.0]


CAR = LinearModel([[1, "0.5"], [0, 1]], [[1, 0]], [["0.01", 0], [0, "0.01"]], [["0.25"]], [0, 0], np.eye(2, dtype=int))
ROAD = limits(state=(100, 20), innovation=10)


@pytest.mark.parametrize("form", ["innovation", "Joseph", "UD"])
def test_a_filter_in_fixed_point_has_a_guarantee(form):
    """Covariance and gain are computed in fixed point, too."""
    found = guarantee(CAR, FixedFormat(8, 12, EVEN), ROAD, form=form)
    against = attack(found, 100, 20)
    assert found.for_ever
    assert against.admissible
    assert 0.1 < against.ratio <= 1
    finer = guarantee(CAR, FixedFormat(8, 20, EVEN), ROAD, form=form)
    assert (finer.bound < found.bound / 50).all()
