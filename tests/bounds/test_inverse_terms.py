"""Every term of the bounds on an inverse that hold strictly, against their formulas in exact fractions."""

from __future__ import annotations

import math
from fractions import Fraction as F

import flint
import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.bounds import gamma_probabilistic
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, inverse_of
from gpbnb.bounds import inverse as bounds

FMT = FloatFormat(2, 16)
ENTRIES = [["0.25", "1.5", "-0.75"], ["-3", "0.5", "1.25"], ["1", "-2.5", "2"]]


def computed():
    a = FMT.array(ENTRIES)
    return a, linalg.lu(a, pivot=True), linalg.inv(a, pivot=True)


def fractions(x):
    return np.vectorize(F, otypes=[object])(x.to_fractions() if hasattr(x, "to_fractions") else x)


def close_above(found, exact, n):
    """At least the exact value, and above it by no more than the allowance for roundings."""
    assert exact <= F(found) <= exact * (1 + F(100 * n, 2**53))


def test_wilkinson():
    _, factors, x = computed()
    lower, upper, X = (abs(fractions(each)) for each in (factors.lower, factors.upper, x))
    norm = column_sum_norm(X)
    count = F(9, 2**16) / (1 - F(9, 2**16))  # of 3n roundings
    g = count * 3 * lower.max() * 3 * upper.max() * norm
    close_above(bounds.wilkinson(factors, x), norm * g / (1 - g), 3)
    assert lower.max() == 1
    assert upper.max() > 1


def test_higham():
    a, factors, x = computed()
    lower, upper, X = (abs(fractions(each)) for each in (factors.lower, factors.upper, x))
    product = lower @ upper
    rows = np.empty_like(product)
    for place, row in zip(factors.permutation, product, strict=True):
        rows[place] = row
    assert list(factors.permutation) != [0, 1, 2]
    for function, weight in (
        (bounds.higham, F(9, 2**16) / (1 - F(9, 2**16))),
        (bounds.rule_of_thumb, F(math.sqrt(9) / 2**16)),
    ):
        G = weight * rows @ X
        expected = column_sum_norm(X @ G) / (1 - column_sum_norm(G))
        close_above(function(factors, x), expected, 3)
    one = F(gamma_probabilistic(3, F(1, 2**16), 0.05 / 81))
    G = (3 * one + one * one) * rows @ X
    close_above(bounds.higham_probabilistic(factors, x, 0.05), column_sum_norm(X @ G) / (1 - column_sum_norm(G)), 3)
    true = inverse_of(fractions(a))
    assert column_sum_norm(fractions(x) - true) < F(bounds.higham(factors, x))


@pytest.mark.parametrize("n", [1, 10**6])
def test_the_allowance_for_roundings_of_float64(n):
    """Each place of the allowance shows once n is large."""
    first, ratio = 0.1, 0.7
    slack = 1 + F(16 * n, 2**53)
    exact = F(first) * slack / (1 - F(ratio) * slack) * slack
    found = F(bounds._solved(first, ratio, n, 2))
    assert abs(found / exact - 1) < F(1, 2**49)
    # What it must cover: both numbers, each too small by 8n roundings.
    off = 1 + F(8 * n, 2**53)
    assert found >= F(first) * off / (1 - F(ratio) * off)


def test_a_ratio_that_may_be_one_proves_nothing():
    just_below = math.nextafter(1.0, 0.0)
    with pytest.raises(ValueError, match=r"must be below 1 .* Use more decimal digits"):
        bounds._solved(0.1, just_below, 1, 10)


def test_upper_ends_are_rounded_up():
    with bounds._working(200):
        third = flint.arb(1) / 3
        assert F(1, 3) < F(bounds._upper(third)) == F(math.nextafter(1 / 3, 1))
        assert bounds._upper(flint.arb(1, 0.5)) >= 1.5
        wide = flint.arb_mat([[flint.arb(-1, 0.5), flint.arb(2)], [flint.arb(0.25, 0.25), flint.arb(-0.25, 0.125)]])
        # The columns may reach 1.5 + 0.5 and 2 + 0.375.
        assert bounds._upper(bounds._column_sum(wide)) == pytest.approx(2.375, rel=1e-8)
        assert bounds._upper(bounds._column_sum(wide)) >= 2.375


def test_a_posteriori():
    a = FMT.array([["2", "0.5"], ["-0.25", "1.5"]])
    guess = FMT.array([["0.375", "-0.25"], ["0.125", "0.75"]])  # far off, so that every term shows
    A, X = fractions(a), fractions(guess)
    residual = np.array([[F(1), F(0)], [F(0), F(1)]], dtype=object) - A @ X
    size = column_sum_norm(residual)
    assert F(1, 10) < size < 1
    exact = column_sum_norm(X @ residual) / (1 - size)
    found = F(bounds.a_posteriori(a, guess))
    assert exact <= found <= exact * (1 + F(4, 2**50))
    assert column_sum_norm(X - inverse_of(A)) <= found


def test_a_ball_takes_in_the_distance_and_the_radius():
    a = FMT.array([["2", "0.5"], ["-0.25", "1.5"]])
    guess = FMT.array([["0.375", "-0.25"], ["0.125", "0.75"]])
    true = column_sum_norm(fractions(guess) - inverse_of(fractions(a)))
    for preconditioned in (False, True):
        exact, wide = (F(bounds.ball(a, guess, preconditioned, bits)) for bits in (300, 12))
        assert true <= exact <= true * (1 + F(4, 2**50))
        assert true < wide < true + F(1, 32)
        assert wide > exact * (1 + F(1, 2**14))  # the radii of 12 bits


def test_the_probabilistic_count_with_few_digits():
    u, n, failure = F(1, 8), 5, 0.03
    spread = math.sqrt(2 * math.log(2 / failure)) / (1 - 1 / 8)
    expected = math.exp(spread * math.sqrt(5) / 8 + 5 / 64 / (1 - 1 / 8)) - 1
    assert gamma_probabilistic(n, u, failure) == pytest.approx(expected, rel=1e-12)


def test_a_relative_bound_is_one_of_the_least_norm_that_the_true_inverse_may_have():
    x = FMT.array([["0.375", "-0.25"], ["0.125", "0.75"]])
    norm = column_sum_norm(fractions(x))
    for bound in (F(1, 8), F(1, 3)):
        given = float(bound)
        exact = F(given) / (norm - F(given))
        assert exact <= F(bounds._relative(given, x)) <= exact * (1 + F(1, 2**50))
    with pytest.raises(ValueError, match="exceeds the norm"):
        bounds._relative(1.0, x)
    assert norm == 1


def test_wilkinson_takes_sizes_of_negative_factors():
    """Without pivoting, the largest entry of the lower factor is -12 here."""
    a = FMT.array([["0.25", "1.5"], ["-3", "0.5"]])
    factors, x = linalg.lu(a, pivot=False), linalg.inv(a, pivot=False)
    lower, upper, X = (fractions(each) for each in (factors.lower, factors.upper, x))
    assert lower.min() == -12
    norm = column_sum_norm(X)
    g = F(6, 2**16) / (1 - F(6, 2**16)) * 2 * 12 * 2 * abs(upper).max() * norm
    close_above(bounds.wilkinson(factors, x), norm * g / (1 - g), 2)
