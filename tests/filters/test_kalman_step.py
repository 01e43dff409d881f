"""The step over numbers of any kind: the compiled steps have its digits, in every form."""

from __future__ import annotations

import operator
from fractions import Fraction
from functools import total_ordering

import numpy as np
import pytest
from small_filter import FORMATS, FORMATS_OF_ALL_FORMS, STEPS, measurements, model, run

from gpbnb.arithmetic.algebra import EXACT, inverse_in_order, product_in_order, rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.filters.array_steps import decorrelated, observe_ud, predict_ud
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, kalman_step
from gpbnb.filters.opening import opening


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


@pytest.mark.parametrize("form", [form for form in Form if form is not Form.UD])
@pytest.mark.parametrize("fmt", FORMATS_OF_ALL_FORMS, ids=str)
def test_compiled_steps_have_the_digits_of_the_generic_step(fmt, form):
    """Once with numbers that round themselves, once with Fractions that a function rounds."""
    stored, z = model().rounded(fmt), exact(measurements())
    found = run(fmt, form).checkpoints()
    own = rounded_algebra(lambda a: numbers(a, fmt), lambda each: each)
    by_function = rounded_algebra(exact, np.vectorize(fmt.round, otypes=[object]))
    for algebra, make, read in (
        (own, lambda a: numbers(a, fmt), values),
        (by_function, exact, lambda a: a.tolist()),
    ):
        x, P = make(stored.x0[:, None]), make(stored.P0)
        for k in range(STEPS):
            parts = StepModel(*(make(each[k % len(each)]) for each in (stored.Phi, stored.H, stored.Q, stored.R)))
            measured = fmt.array(z[k]).to_fractions()
            x, K, P = kalman_step(algebra, form, parts, x, P, make(measured[:, None]))
            assert read(x) == found.x[k][:, None].tolist()
            assert read(K) == found.K[k].tolist()
            assert read(P) == found.P[k].tolist()


@pytest.mark.parametrize("fmt", FORMATS_OF_ALL_FORMS, ids=str)
def test_compiled_steps_of_factors_have_the_digits_of_the_generic_ones(fmt):
    stored, z = model().rounded(fmt), exact(measurements())
    start, found = opening(model(), fmt, Form.UD, fmt.run_tag()), run(fmt, Form.UD)
    U, UQ, UR = (numbers(found.exactly(each), fmt) for each in (start.U0, start.UQ, start.UR))
    x, factors, gains = numbers(stored.x0, fmt), found.exactly(found.C), found.exactly(found.G)
    for k in range(STEPS):
        Phi, H = (numbers(each[k % len(each)], fmt) for each in (stored.Phi, stored.H))
        R = UR[k % len(UR)]
        U, _ = predict_ud(Phi, U, UQ[k % len(UQ)])
        x = Phi @ x
        measured = numbers(fmt.array(z[k]).to_fractions(), fmt)
        rows, reduced = decorrelated(R, H), decorrelated(R, measured)
        for i in range(len(rows)):
            x, U, K, _ = observe_ud(rows[i], reduced[i], R[i, i], x, U)
            assert values(K) == gains[k][:, i].tolist()
        assert values(x) == found.exactly(found.X)[k, :, 0].tolist()
        assert values(U) == factors[k].tolist()


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


@pytest.mark.parametrize("fmt", [fmt for fmt in FORMATS if isinstance(fmt.backend, Compiled)][:3], ids=str)
def test_an_inverse_over_an_array_of_a_format_has_the_digits_of_its_numbers(fmt):
    a = fmt.array([["3.25", "-1.5", "0.75"], ["-1.5", "4.125", "1"], ["0.75", "1", "2.5"]])
    found, _ = inverse_in_order(a, fmt.array(np.eye(3, dtype=int)))
    slow, _ = inverse_in_order(numbers(a, fmt), numbers(np.eye(3, dtype=int), fmt))
    assert found.to_fractions().tolist() == values(slow)


def test_the_step_refuses_factors():
    with pytest.raises(ValueError, match="got the UD form"):
        kalman_step(EXACT, Form.UD, StepModel(*[exact([[1]])] * 4), *[exact([[1]])] * 3)


def test_an_order_of_sums_is_seen():
    """The products differ between orders, so that a test by == can fail."""
    fmt = FloatFormat(10, 3)
    row, ones = exact([["1", "0.003", "0.003"]]), exact([[1]] * 3)
    forward = values(product_in_order(numbers(row, fmt), numbers(ones, fmt)))
    backward = values(product_in_order(numbers(row[:, ::-1], fmt), numbers(ones, fmt)))
    assert forward != backward
