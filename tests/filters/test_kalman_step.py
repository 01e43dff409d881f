"""The step over numbers of any kind: the compiled steps have its digits, in every form."""

from __future__ import annotations

import operator
from fractions import Fraction
from functools import total_ordering

import numpy as np
import pytest

from gpbnb.arithmetic.algebra import EXACT, inverse_in_order, product_in_order
from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, kalman_step


@total_ordering
class Number:
    """A number that rounds the result of each operation to a format."""

    def __init__(self, value, fmt):
        self.value, self.fmt = Fraction(value), fmt

    def _done(self, operation, other):
        if isinstance(other, np.ndarray):
            return NotImplemented  # NumPy takes the entries one by one
        value = operation(self.value, getattr(other, "value", other))
        return Number(self.fmt.round(value), self.fmt)

    def __add__(self, other):
        return self._done(operator.add, other)

    def __sub__(self, other):
        return self._done(operator.sub, other)

    def __mul__(self, other):
        return self._done(operator.mul, other)

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, other):
        return -self + other

    def __truediv__(self, other):
        return self._done(operator.truediv, other)

    def __neg__(self):
        return Number(-self.value, self.fmt)

    def __eq__(self, other):
        return self.value == getattr(other, "value", other)

    def __lt__(self, other):
        return self.value < getattr(other, "value", other)

    __hash__ = None


def numbers(values, fmt):
    return np.vectorize(lambda value: Number(value, fmt), otypes=[object])(exact(values))


def values(numbers_):
    return np.vectorize(lambda each: each.value, otypes=[object])(numbers_).tolist()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_product_is_summed_from_left_to_right(dtype):
    rng = np.random.default_rng(7)
    a, b = rng.standard_normal((3, 9)).astype(dtype), rng.standard_normal((9, 2)).astype(dtype)
    found = product_in_order(a, b)
    assert found.dtype == dtype
    for i in range(3):
        for j in range(2):
            total = a[i, 0] * b[0, j]
            for k in range(1, 9):
                total = total + a[i, k] * b[k, j]
            assert found[i, j] == total


def test_an_inverse_over_fractions_is_exact_and_its_pivots_multiply_to_the_determinant():
    rng = np.random.default_rng(8)
    a = exact(rng.integers(-9, 10, (4, 4)) + 20 * np.eye(4, dtype=int))
    found, pivots = inverse_in_order(a, EXACT.identity(4))
    assert (found == inverse_of(a)).all()
    assert (product_in_order(a, found) == EXACT.identity(4)).all()
    product = Fraction(1)
    for pivot in pivots:
        product *= pivot
    assert abs(float(product) / np.linalg.det(a.astype(float)) - 1) < 1e-12  # float64 determinant of a 4 × 4 matrix


def test_the_step_refuses_factors():
    with pytest.raises(ValueError, match="got the UD form"):
        kalman_step(EXACT, Form.UD, StepModel(*[exact([[1]])] * 4), *[exact([[1]])] * 3)
