"""inversion.costs: operations are counted, ratios are those of single trials, and what is sharp is dear."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import costs, experiment


class Counted:
    """A number that counts the operations made with it."""

    count = 0

    def __init__(self, value):
        self.value = float(getattr(value, "value", value))

    def _with(self, result):
        Counted.count += 1
        return Counted(result)

    def __add__(self, other):
        return self._with(self.value + other.value)

    def __sub__(self, other):
        return self._with(self.value - other.value)

    def __mul__(self, other):
        return self._with(self.value * other.value)

    def __truediv__(self, other):
        return self._with(self.value / other.value)


def counted(n):
    """A random matrix of counted numbers, diagonally dominant."""
    entries = np.random.default_rng(n).uniform(-1, 1, (n, n)) + n * np.eye(n)
    return [[Counted(entry) for entry in row] for row in entries]


@pytest.mark.parametrize("n", [1, 2, 3, 7, 10])
def test_operations_of_an_inversion(n):
    a, given = counted(n), counted(n)
    x = [[Counted(i == j) for j in range(n)] for i in range(n)]
    Counted.count = 0
    for k in range(n):
        for i in range(k + 1, n):
            m = a[i][k] / a[k][k]
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - m * a[k][j]
            for j in range(n):
                x[i][j] = x[i][j] - m * x[k][j]
    for k in reversed(range(n)):
        for j in range(n):
            for i in range(k + 1, n):
                x[k][j] = x[k][j] - a[k][i] * x[i][j]
            x[k][j] = x[k][j] / a[k][k]
    assert Counted.count == costs.elimination(n)
    found = np.array([[entry.value for entry in row] for row in x])
    assert found @ np.array([[entry.value for entry in row] for row in given]) == pytest.approx(np.eye(n), abs=1e-12)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_operations_of_a_product(n):
    a, b = counted(n), counted(n)
    Counted.count = 0
    for i in range(n):
        for j in range(n):
            total = a[i][0] * b[0][j]
            for k in range(1, n):
                total = total + a[i][k] * b[k][j]
    assert Counted.count == costs.product(n)


@pytest.fixture(scope="module")
def found():
    return {one.bound: one for one in costs.prices((2, 4), 15, np.random.default_rng(3))}


def test_operations_of_known_bounds():
    """Of matrices with two rows and columns, for which a product takes 12 and an inverse 15."""
    assert (costs.product(2), costs.elimination(2)) == (12, 15)
    assert {name: count(2) for name, (_, count, _) in costs.KNOWN.items()} == {
        "Wilkinson": 8,
        "Higham": 36,
        "probabilistic, 99 %": 36,
        "the report's, corrected": 48,
        "ball arithmetic": 15,
        "preconditioned balls": 54,
    }


def test_every_bound_of_an_inverse_has_its_price(found):
    named = {name for name, _, _ in costs.KNOWN.values()}
    assert named | {"a posteriori", "rule of thumb", "strict"} == set(experiment.BETTER)
    assert len(found) == len(costs.KNOWN) + 5
    assert all(len(one.ratios) == 2 and one.operations > 0 and one.digits for one in found.values())


def test_no_bound_is_below_the_error(found):
    assert all(min(one.ratios) >= 1 for one in found.values())


def test_the_residual_is_sharp_with_twice_the_digits_and_not_without(found):
    assert max(found["residual, 2t"].ratios + found["residual, 4t"].ratios) < 1.001
    assert min(found["residual, t"].ratios) > 1.2
    assert min(found["(39), true inverse known"].ratios) > 1.2
    assert found["residual, 4t"].operations > found["(39), computed inverse"].operations


def test_ratios_are_medians_over_single_trials():
    fmt = FloatFormat(10, 6)
    found = {one.bound: one for one in costs.prices((3,), 5, np.random.default_rng(8), fmt)}
    rng = np.random.default_rng(8)
    ones = [experiment.trial(fmt.array(experiment.FAMILIES["random"](3, rng)), True, ("Higham",)) for _ in range(5)]
    assert found["Higham"].ratios[0] == pytest.approx(np.median([one.overestimation("Higham") for one in ones]))


def test_a_chopping_format_has_no_probabilistic_bound():
    found = costs.prices((2,), 2, np.random.default_rng(1), FloatFormat(2, 24, Rounding.CHOP))
    assert "probabilistic, 99 %" not in {one.bound for one in found}
