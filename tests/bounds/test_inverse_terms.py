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


def close_above(found, exact):
    """The least float64 that is not below the exact value."""
    assert F(math.nextafter(found, 0)) < exact <= F(found)


def test_wilkinson():
    _, factors, x = computed()
    lower, upper, X = (abs(fractions(each)) for each in (factors.lower, factors.upper, x))
    norm = column_sum_norm(X)
    count = F(9, 2**16) / (1 - F(9, 2**16))  # of 3n roundings
    g = count * 3 * lower.max() * 3 * upper.max() * norm
    close_above(bounds.wilkinson(factors, x), norm * g / (1 - g))
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
        close_above(function(factors, x), expected)
    one = F(gamma_probabilistic(3, F(1, 2**16), 0.05 / 81))
    G = (3 * one + one * one) * rows @ X
    close_above(bounds.higham_probabilistic(factors, x, 0.05), column_sum_norm(X @ G) / (1 - column_sum_norm(G)))
    true = inverse_of(fractions(a))
    assert column_sum_norm(fractions(x) - true) < F(bounds.higham(factors, x))


def test_sizes_beyond_float64_count_in_full():
    """A column in a unit that is 2**-1100 times as large changes no digit, and hardly the bound."""
    a, factors, x = computed()
    other = FMT.array(fractions(a) * np.array([F(2) ** 1100, F(1), F(1)], dtype=object))
    found = bounds.higham(linalg.lu(other, pivot=True), linalg.inv(other, pivot=True))
    assert 0.3 < found / bounds.higham(factors, x) < 3


@pytest.mark.parametrize("subnormal", [True, False])
def test_bounds_from_the_factors_hold_where_results_underflow(subnormal):
    """Entries near the smallest number of a format, whose inverse is wrong by many times the unit roundoff."""
    rng, worst = np.random.default_rng(5), 0.0
    for rounding in ("nearest", "even", "odd", "chop"):
        fmt = FloatFormat(2, 16, rounding, emin=-10, emax=60, subnormal=subnormal)
        for n in [2, 3] * 30:
            scale = rng.choice([2.0**-4, 2.0**-9, 2.0**-15])
            try:
                a = fmt.array((rng.uniform(-1, 1, (n, n)) + 2 * np.eye(n)) * scale)
                factors, x = linalg.lu(a, pivot=True), linalg.inv(a, pivot=True)
                error = bounds.true_error(x, bounds.true_inverse(a))
            except np.linalg.LinAlgError:
                continue
            for bound in (bounds.wilkinson, bounds.higham):
                try:
                    found = F(bound(factors, x))
                except ValueError:
                    continue
                assert error <= found
                worst = max(worst, float(error / found))
    assert worst > 0.01


def test_bounds_from_the_factors_beside_the_smallest_number():
    """The same digits with and without limits: what underflow may add is written out, for η = 2**-40."""
    a, factors, x = computed()
    limited = FloatFormat(2, 16, emin=-25, emax=60)
    given = limited.array(fractions(a))
    lu, inv = linalg.lu(given, pivot=True), linalg.inv(given, pivot=True)
    assert fractions(inv).tolist() == fractions(x).tolist()
    lower, upper, X = (abs(fractions(each)) for each in (factors.lower, factors.upper, x))
    rows = np.array([lower[list(factors.permutation).index(i)] for i in range(3)])
    weight, eta, e = F(9, 2**16) / (1 - F(9, 2**16)), F(1, 2**40), 6 + upper.diagonal()
    more = np.array([[sum(e * X[:, j]) + sum(rows[i] * e) + 6 for j in range(3)] for i in range(3)])
    G = weight * rows @ upper @ X + (1 + weight) * eta * more
    close_above(bounds.higham(lu, inv), column_sum_norm(X @ G) / (1 - column_sum_norm(G)))
    norm, u = column_sum_norm(X), upper.max()
    g = weight * 9 * lower.max() * u * norm + (1 + weight) * eta * 3 * ((6 + u) * (norm + 3 * lower.max()) + 6)
    close_above(bounds.wilkinson(lu, inv), norm * g / (1 - g))


def test_bounds_from_the_factors_refuse_overflow_without_an_error():
    fmt = FloatFormat(2, 11, emin=-10, emax=60, overflow="saturate")
    a = fmt.array([[3, 1], [1, 2]])
    for bound in (bounds.wilkinson, bounds.higham, bounds.higham_probabilistic):
        with pytest.raises(ValueError, match=r"needs overflow 'raise'.* Use a_posteriori"):
            bound(linalg.lu(a), linalg.inv(a))


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


def test_wilkinson_takes_sizes_of_negative_factors():
    """Without pivoting, the largest entry of the lower factor is -12 here."""
    a = FMT.array([["0.25", "1.5"], ["-3", "0.5"]])
    factors, x = linalg.lu(a, pivot=False), linalg.inv(a, pivot=False)
    lower, upper, X = (fractions(each) for each in (factors.lower, factors.upper, x))
    assert lower.min() == -12
    norm = column_sum_norm(X)
    g = F(6, 2**16) / (1 - F(6, 2**16)) * 2 * 12 * 2 * abs(upper).max() * norm
    close_above(bounds.wilkinson(factors, x), norm * g / (1 - g))
