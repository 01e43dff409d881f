"""Each bound of rounding errors, as printed or derived, and whether it is one."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from flint import fmpq_mat

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import experiment
from tests import oracles

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
FOUR = FloatFormat(10, 4)
BETA = Fraction(1, 2000)
X = [3, -5, "3.5", -11]  # sum -19/2
A = FOUR.array([[1, -2, 3], [4, 5, -6]])
B = FOUR.array([[2, -1], [3, 7], [-4, 1]])
C = FOUR.array([[1, -3], [2, 5]])
D = FOUR.array([[100, -7], [1, 2]])


def g(n):
    return n * BETA / (1 - n * BETA)


# -- as printed -----------------------------------------------------------------------------------


def test_sums_as_printed():
    s = Fraction(19, 2)
    assert experiment.sum_trial(FOUR.array(X)).bounds == {
        "1982 (18)": 3 * BETA * s,
        "1984 (18)": 3 * BETA * s + BETA * Fraction(7, 2) + 2 * BETA * 11,
        "1984 (18), coarse": 3 * BETA * s + 3 * BETA * 11,
        "weights": BETA * (3 * 3 + 3 * 5 + 2 * Fraction(7, 2) + 11),
        "strict": g(3) * 3 + g(3) * 5 + g(2) * Fraction(7, 2) + g(1) * 11,
    }
    five = experiment.sum_trial(FOUR.array([*X, "0.25"])).bounds
    s = Fraction(37, 4)
    assert five["1982 (18)"] == 4 * BETA * s
    assert five["1984 (18)"] == BETA * (4 * s + Fraction(7, 2) + 2 * 11 + Fraction(3, 4))
    assert five["1984 (18), coarse"] == BETA * (4 * s + 6 * 11)


@pytest.mark.parametrize(("n", "m"), [(2, 1), (5, 3), (1, 0)])
def test_products_as_printed(n, m):
    bounds = experiment.product_trial(FOUR.array([3] * n), FOUR.array([7] * m)).bounds
    assert bounds == {"1982 (20)": (n + m - 1) * BETA, "1984 (20)": (n + m + 1) * BETA, "strict": g(n + m - 1)}


def test_inner_products_as_printed():
    bounds = experiment.dot_trial(FOUR.array([1, -2, 3]), FOUR.array([4, 5, -6])).bounds
    assert bounds == {"(26)": BETA * (3 * 4 + 3 * 10 + 2 * 18), "strict": g(3) * 32}
    assert experiment.dot_trial(FOUR.array([3]), FOUR.array([4])).bounds == {"(26)": BETA * 12, "strict": g(1) * 12}


def test_matrix_products_as_printed():
    norms = [9, 9, 8]  # of A, B and C
    assert [column_sum_norm(m) for m in (A, B, C)] == norms
    assert column_sum_norm(np.zeros((2, 0))) == column_sum_norm(fmpq_mat(2, 0)) == 0
    ab, abc = (experiment.chain_trial(factors) for factors in ([A, B], [A, B, C]))
    assert ab.bounds["(32)"] == 3 * BETA * 81
    assert abc.bounds["(32)"] == 5 * BETA * 648
    assert abc.bounds["strict"] == g(5) * 648
    assert abc.bounds["(31)"] == 5 * BETA * column_sum_norm(abc.true)
    assert experiment.chain_trial([A]).bounds == {"(31)": 0, "(32)": 0, "strict": 0}
    assert experiment.matrix_sum_trial(C, D).bounds == {"(24)": BETA * 104}


def test_examples_as_printed():
    a, b, c, d = (each.to_fractions() for each in (A, B, C, D))
    found = experiment.example_trial(A, B, C, D)
    product, whole = column_sum_norm(a @ b @ c), column_sum_norm(a @ b @ c + d)
    assert found.bounds == {
        "Examples": BETA * (6 * product + 101),
        "corrected": BETA * (5 * 648 + whole),
        "strict": (1 + BETA) * g(5) * 648 + BETA * whole,
    }
    square = experiment.example_trial(C, C, C, C)
    assert square.bounds["Examples"] == BETA * ((2 * 2 + 1) * column_sum_norm(c @ c @ c) + 8)


# -- exhaustive: all tuples of a small format -----------------------------------------------------

SMALL = [(2, 1, (-2, -1, 0, 1), 4), (2, 2, (-1, 0, 1), 3), (3, 1, (-1, 0, 1), 3), (10, 1, (0,), 3)]


def numbers(base, precision, exponents):
    digits = range(base ** (precision - 1), base**precision)
    return [Fraction(0), *(s * m * Fraction(base) ** e for e in exponents for m in digits for s in (1, -1))]


def all_sums(base, precision, exponents, n, rounding):
    """Every tuple of n terms and its computed sum."""
    fl = cache(oracles.floating(base, precision, rounding.value))
    for terms in itertools.product(numbers(base, precision, exponents), repeat=n):
        total = terms[0]
        for term in terms[1:]:
            total = fl(total + term)
        yield terms, total


@pytest.mark.parametrize(("base", "precision", "exponents", "n"), SMALL)
def test_chopping_makes_the_first_order_sum_bounds_strict(base, precision, exponents, n):
    beta = FloatFormat(base, precision, CHOP).unit_roundoff
    weights = [n - 1, *range(n - 1, 0, -1)]
    largest = Fraction(0)
    for terms, computed in all_sums(base, precision, exponents, n, CHOP):
        error = abs(computed - sum(terms))
        if error:
            bound = beta * sum(w * abs(x) for w, x in zip(weights, terms, strict=True))
            printed = beta * ((n - 1) * abs(sum(terms)) + sum((j - 2) * abs(terms[j - 1]) for j in range(3, n + 1)))
            assert error <= bound
            assert error <= printed
            largest = max(largest, error / bound)
    assert largest > Fraction(1, 5)


@pytest.mark.parametrize(("base", "precision", "exponents", "n"), SMALL)
def test_equal_weights_are_strict_for_rounding_to_nearest(base, precision, exponents, n):
    """(n - 1) β Σ|x_j| needs no second-order term (Jeannerod & Rump 2013)."""
    beta = FloatFormat(base, precision).unit_roundoff
    largest = Fraction(0)
    for terms, computed in all_sums(base, precision, exponents, n, NEAREST):
        error = abs(computed - sum(terms))
        if error:
            bound = (n - 1) * beta * sum(map(abs, terms))
            assert error <= bound
            largest = max(largest, error / bound)
    assert largest > Fraction(1, 4)


@pytest.mark.parametrize(
    ("base", "precision", "exponents", "n", "largest"),
    [
        (2, 2, (-1, 0, 1), 3, Fraction(8, 9)),
        (2, 1, (-3, -2, -1, 0, 1), 4, Fraction(1)),
        (2, 1, (-3, -2), 5, Fraction(4, 3)),
    ],
)
def test_18_of_1984_is_reached_with_four_terms_and_exceeded_with_five(base, precision, exponents, n, largest):
    beta = FloatFormat(base, precision).unit_roundoff
    ratios = []
    for terms, computed in all_sums(base, precision, exponents, n, NEAREST):
        if computed != sum(terms):
            printed = (n - 1) * abs(sum(terms)) + sum((j - 2) * abs(terms[j - 1]) for j in range(3, n + 1))
            ratios.append(abs(computed - sum(terms)) / (beta * printed))
    assert max(ratios) == largest


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize(("base", "precision", "n"), [(2, 2, 4), (2, 3, 3), (3, 1, 4), (10, 1, 3)])
def test_products_and_quotients_of_all_significands(base, precision, n, rounding):
    """n factors, of which the last is also tried as a divisor."""
    fmt = FloatFormat(base, precision, rounding)
    fl = cache(oracles.floating(base, precision, rounding.value))
    digits = range(base ** (precision - 1), base**precision)
    strict = (1 + fmt.unit_roundoff) ** (n - 1) - 1
    largest = Fraction(0)
    for factors in itertools.product(map(Fraction, digits), repeat=n):
        partial = factors[0]
        for factor in factors[1:-1]:
            partial = fl(partial * factor)
        for computed, true in (
            (fl(partial * factors[-1]), math.prod(factors)),
            (fl(partial / factors[-1]), math.prod(factors[:-1]) / factors[-1]),
        ):
            error = abs(computed / true - 1)
            assert error <= strict
            if rounding is CHOP:
                assert error <= (n - 1) * fmt.unit_roundoff
            largest = max(largest, error / ((n - 1) * fmt.unit_roundoff))
    assert largest > Fraction(1, 7)


@pytest.mark.parametrize("rounding", Rounding.documented())
def test_inner_products_of_all_small_vectors(rounding):
    """(26) with chopping, and nβ|a||b| in both, over all vectors of three in two bits."""
    fmt = FloatFormat(2, 2, rounding)
    fl = cache(oracles.floating(2, 2, rounding.value))
    # A product of two numbers of two bits is 4, 6 or 9 times a power of two, or zero.
    products = [Fraction(0), *(s * p * Fraction(2) ** e for p in (4, 6, 9) for e in (-2, -1, 0) for s in (1, -1))]
    largest = Fraction(0)
    for terms in itertools.product(products, repeat=3):
        total = fl(terms[0])
        for term in terms[1:]:
            total = fl(total + fl(term))
        error = abs(total - sum(terms))
        if error:
            coarse = 3 * fmt.unit_roundoff * sum(map(abs, terms))
            assert error <= coarse
            if rounding is CHOP:
                assert error <= fmt.unit_roundoff * sum(w * abs(p) for w, p in zip((3, 3, 2), terms, strict=True))
            largest = max(largest, error / coarse)
    assert largest > Fraction(3, 10)
