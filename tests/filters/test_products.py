"""gpbnb.filters.kernels.products: the digits of the products of :mod:`gpbnb.arithmetic`, entry by entry."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.products import add_transposed, product_by_columns, product_with_units
from gpbnb.filters.model import LinearModel
from gpbnb.filters.opening import as_packed
from gpbnb.filters.run import Run


@compiled
def both(fmt, a, b, c, d):
    product_by_columns(fmt, a, b, c)
    product_with_units(fmt, a, b, d)


@compiled
def by_columns(fmt, a, b, c):
    product_by_columns(fmt, a, b, c)


@compiled
def add_into(fmt, a, c):
    add_transposed(fmt, a, c)


def run_of(fmt):
    one = [["1"]]
    return Run(LinearModel(one, one, one, one, ["0"], one), fmt, Form.INNOVATION, ())


def products(fmt, a, b):
    run = run_of(fmt)
    first, second = as_packed(run.fmt, a), as_packed(run.fmt, b)
    c, d = as_packed(run.fmt, np.ones((len(a), b.shape[1]))), as_packed(run.fmt, np.ones((len(a), b.shape[1])))
    both(run.tag, first, second, c, d)
    return run.exactly(c), run.exactly(d)


@pytest.mark.parametrize("precision", [1, 2, 8, 24, 25, 26, 53])
@pytest.mark.parametrize("exponent", [0, -390, 390, -430, 440])
def test_products_have_the_digits_of_the_arithmetic(precision, exponent):
    rng = np.random.default_rng([precision, abs(exponent)])
    a, b = rng.standard_normal((5, 6)), rng.standard_normal((6, 9)) * 2.0**exponent
    a[rng.random(a.shape) < 0.3] = 0
    a[rng.random(a.shape) < 0.3] = 1
    b[:, 3] = 0
    a[2] = 0
    for rounding in Rounding.documented():
        fmt = FloatFormat(2, precision, rounding)
        expected = (fmt.array(a) @ fmt.array(b)).to_fractions()
        for found in products(fmt, a, b):
            assert (found == expected).all(), rounding


@pytest.mark.parametrize("columns", range(1, 13))
@pytest.mark.parametrize("rows", [2, 10])
def test_products_of_any_width_have_them_too(columns, rows):
    for precision in (8, 24):
        fmt = FloatFormat(2, precision)
        rng = np.random.default_rng([rows, columns, precision])
        a, b = rng.standard_normal((rows, 10)), rng.standard_normal((10, columns))
        a[rng.random(a.shape) < 0.3] = 0
        expected = (fmt.array(a) @ fmt.array(b)).to_fractions()
        for found in products(fmt, a, b):
            assert (found == expected).all()


def test_decimal_products_too():
    fmt = FloatFormat(10, 4)
    rng = np.random.default_rng(10)
    a, b = rng.standard_normal((3, 4)), rng.standard_normal((4, 5))
    a[rng.random(a.shape) < 0.4] = 1
    expected = (fmt.array(a) @ fmt.array(b)).to_fractions()
    for found in products(fmt, a, b):
        assert (found == expected).all()


def test_what_leaves_the_range_is_reported():
    fmt = FloatFormat(2, 24)
    for sizes in ((2.0**-900, 2.0**-900), (2.0**900, 2.0**900)):
        with pytest.raises(OverflowError):
            products(fmt, np.full((2, 2), sizes[0]), np.full((2, 2), sizes[1]))
        run = run_of(fmt)
        with pytest.raises(OverflowError):
            by_columns(run.tag, *(as_packed(run.fmt, np.full((2, 2), size)) for size in (*sizes, 1.0)))


def test_a_sparse_matrix_is_added_transposed():
    fmt = FloatFormat(2, 5)
    run = run_of(fmt)
    a, c = np.array([[0.0, 3.0], [0.0, 1.0]]), np.array([[1.0, 2.0], [40.0, 0.25]])
    packed = as_packed(run.fmt, c)
    add_into(run.tag, as_packed(run.fmt, a), packed)
    assert run.exactly(packed).tolist() == (fmt.array(c) + fmt.array(a.T)).to_fractions().tolist()
