"""Decimal numbers in float64 and double-double, against fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.filters.pairs import double_doubles_near, nearest_double_doubles, nearest_floats


@pytest.mark.parametrize("largest", [5, 22, 60, 200])
def test_each_22_powers_of_ten_round_once(largest):
    rng = np.random.default_rng(largest)
    m, e = rng.integers(-(10**18), 10**18, 300) // 10 ** rng.integers(0, 18, 300), rng.integers(-largest, largest, 300)
    near, roundings = double_doubles_near(np.stack([m, e], axis=-1)), 1 + largest // 22
    for (high, low), m_of, e_of in zip(near.tolist(), m.tolist(), e.tolist(), strict=True):
        true = m_of * Fraction(10) ** e_of
        # With a second operand of one float64, a product or quotient has a relative error of at most 4 u**2 = 2**-104.
        assert abs(Fraction(high) + Fraction(low) - true) <= abs(true) * roundings * Fraction(2) ** -103


def test_the_nearest_are_those_of_fractions():
    pairs = np.array([[123, -2], [2**53 - 1, 22], [2**53 + 1, 0], [-(10**18) + 1, -41], [1, 23], [7, -290], [0, -300]])
    true = np.array([m * Fraction(10) ** e for m, e in pairs.tolist()])
    assert nearest_floats(pairs).tolist() == true.astype(float).tolist()
    assert nearest_double_doubles(pairs).tolist() == double_doubles(true).tolist()
    assert nearest_floats(np.array([[-1, 400], [1, -400]])).tolist() == [-np.inf, 0]


def test_what_double_double_does_not_hold_is_not_a_number():
    near = double_doubles_near(np.array([[1, 310], [1, -310], [0, -310], [7, -(2**60)]]))
    assert np.isnan(near).all(axis=-1).tolist() == [True, True, False, True]
    assert near[2].tolist() == [0.0, 0.0]
