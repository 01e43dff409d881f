"""Every term of the bounds on an inverse that hold strictly, against their formulas in exact fractions."""

from __future__ import annotations

import math
from fractions import Fraction as F

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm
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
    for rounding in ("nearest", "even", "half up", "odd", "chop"):
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
