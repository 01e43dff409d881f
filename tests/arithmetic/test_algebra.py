"""gpbnb.arithmetic.algebra: products and inverses over numbers of any kind."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.algebra import EXACT, inverse_in_order, product_in_order
from gpbnb.arithmetic.rational import exact, inverse_of


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
