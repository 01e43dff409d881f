"""Bounds of inverses hold and are their formulas in exact fractions, or say that they prove nothing."""

from __future__ import annotations

import math
from fractions import Fraction
from fractions import Fraction as F

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.rational import column_sum_norm, true_inverse
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.inverse import a_posteriori, true_error
from gpbnb.report.inversion import bounds

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
FORMATS = [
    FloatFormat(2, 11),
    FloatFormat(2, 24),
    FloatFormat(2, 24, CHOP),
    FloatFormat(3, 12),
    FloatFormat(10, 6, CHOP),
    FloatFormat(10, 20),
    FloatFormat(16, 6),
]


@pytest.fixture(autouse=True)
def _without_loops(monkeypatch):
    """Bounds are the same with loops, which take seconds to compile."""
    monkeypatch.setattr(backends, "LOOPS_AFTER", 10**9)


each_format = pytest.mark.parametrize("fmt", FORMATS, ids=str)


def inverted(fmt, sizes=(1, 2, 3, 5, 8), repeats=4):
    """Matrices that a format can invert, their factors and inverses, and the true error."""
    rng = np.random.default_rng([fmt.base, fmt.precision])
    for n in sizes:
        for _ in range(repeats):
            a = fmt.array(rng.integers(-(2**20), 2**20, (n, n)) * 2.0**-20)
            x = linalg.inv(a, pivot=True)
            yield a, linalg.lu(a, pivot=True), x, true_error(x, true_inverse(a))


def fractions_of(matrix):
    return np.array([[Fraction(int(v.p), int(v.q)) for v in row] for row in matrix.tolist()], dtype=object)


def column_sum(a):
    return max(abs(a).sum(axis=0))


def value(bound, *arguments):
    try:
        return Fraction(bound(*arguments))
    except ValueError:
        return None


class TestHold:
    @each_format
    def test_no_bound_is_below_the_error(self, fmt):
        held = dict.fromkeys(("wilkinson", "higham", "ball", "a_posteriori"), 0)
        for a, factors, x, error in inverted(fmt):
            found = {
                "wilkinson": value(bounds.wilkinson, factors, x),
                "higham": value(bounds.higham, factors, x),
                "ball": value(bounds.ball, a, x),
                "a_posteriori": value(a_posteriori, a, x),
            }
            for name, bound in found.items():
                if bound is not None:
                    assert bound >= error, name
                    held[name] += 1
            if found["wilkinson"] is not None:
                # Larger term by term; both carry a slack for the rounding of their own evaluation.
                assert found["wilkinson"] * (1 + Fraction(1, 2**40)) >= found["higham"]
        assert held["a_posteriori"] == 20
        assert held["higham"] >= (10 if fmt.precision > 11 or fmt.base > 2 else 5)
        assert min(held.values()) >= 4

    @each_format
    def test_a_posteriori_is_its_formula_rounded_up(self, fmt):
        for a, _, x, error in inverted(fmt, repeats=2):
            exact, guess = a.to_fractions(), x.to_fractions()
            residual = np.eye(len(a), dtype=int) - exact @ guess
            size = column_sum(residual)
            formula = column_sum(guess @ residual) / (1 - size)
            found = Fraction(a_posteriori(a, x))
            # Above by no more than the rounding to float64.
            assert formula <= found <= formula * (1 + Fraction(1, 2**51))
            # ‖XR‖ is at most (1 + ‖R‖) times the error.
            assert found <= error * (1 + size) / (1 - size) * (1 + Fraction(1, 2**51))


class TestFormulas:
    A = FloatFormat(10, 8).array([[2, 1], [1, 3]])

    def parts(self):
        return linalg.lu(self.A), linalg.inv(self.A)

    def test_rows_in_the_order_of_the_matrix(self):
        # With rows interchanged, the rows of |L||U| must go back: A has rows of very different size.
        fmt = FloatFormat(2, 24)
        a = fmt.array([[1, 2], [1000, 3000]])
        factors, x = linalg.lu(a, pivot=True), linalg.inv(a, pivot=True)
        assert factors.permutation.tolist() == [1, 0]
        product = abs(factors.lower.to_float()) @ abs(factors.upper.to_float())
        sizes = abs(x.to_float())
        g = product[[1, 0]] @ sizes
        weight = gamma(6, fmt.unit_roundoff)
        assert bounds.higham(factors, x) == pytest.approx(float(weight) * (sizes @ g).sum(axis=0).max(), rel=1e-2)


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
        for n in [2, 3] * 10:
            scale = rng.choice([2.0**-4, 2.0**-9, 2.0**-15])
            try:
                a = fmt.array((rng.uniform(-1, 1, (n, n)) + 2 * np.eye(n)) * scale)
                factors, x = linalg.lu(a, pivot=True), linalg.inv(a, pivot=True)
                error = true_error(x, true_inverse(a))
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
