"""gpbnb.report.rounding.theory: each bound as printed or derived, and whether it is one."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import cache

import numpy as np
import oracles
import pytest
from flint import fmpq_mat

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import theory

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
BETA = Fraction(1, 2000)
X = [Fraction(3), Fraction(-5), Fraction(7, 2), Fraction(-11)]  # sum -19/2
A = np.array([[1, -2, 3], [4, 5, -6]], dtype=object)
B = np.array([[2, -1], [3, 7], [-4, 1]], dtype=object)
C = np.array([[1, -3], [2, 5]], dtype=object)
D = np.array([[100, -7], [1, 2]], dtype=object)


def g(n):
    return n * BETA / (1 - n * BETA)


# -- as printed -----------------------------------------------------------------------------------


def test_sums_as_printed():
    s = Fraction(19, 2)
    assert theory.printed_sum_bound_1982(X, BETA) == 3 * BETA * s
    assert theory.printed_sum_bound(X, BETA) == 3 * BETA * s + BETA * Fraction(7, 2) + 2 * BETA * 11
    assert theory.printed_sum_bound_coarse(X, BETA) == 3 * BETA * s + 3 * BETA * 11
    five = [*X, Fraction(1, 4)]
    s = Fraction(37, 4)
    assert theory.printed_sum_bound_1982(five, BETA) == 4 * BETA * s
    assert theory.printed_sum_bound(five, BETA) == BETA * (4 * s + Fraction(7, 2) + 2 * 11 + Fraction(3, 4))
    assert theory.printed_sum_bound_coarse(five, BETA) == BETA * (4 * s + 6 * 11)


def test_products_as_printed():
    assert theory.printed_product_bound(2, 1, BETA) == 4 * BETA
    assert theory.product_bound(2, 1, BETA) == 2 * BETA
    assert theory.printed_product_bound(5, 3, BETA) == 9 * BETA
    assert theory.product_bound(5, 3, BETA) == 7 * BETA
    assert theory.strict_product_bound(5, 3, BETA) == g(7)
    assert theory.product_bound(1, 0, BETA) == theory.strict_product_bound(1, 0, BETA) == 0


def test_inner_products_as_printed():
    a, b = [1, -2, 3], [4, 5, -6]
    assert theory.dot_bound(a, b, BETA) == BETA * (3 * 4 + 3 * 10 + 2 * 18)
    assert theory.strict_dot_bound(a, b, BETA) == g(3) * 32
    assert theory.relative_dot_bound(a, b, BETA) == g(3) * Fraction(32, 24)
    assert theory.dot_weights(4) == [4, 4, 3, 2]
    assert theory.dot_weights(1) == [1]


def test_matrix_products_as_printed():
    norms = [9, 9, 8]  # of A, B and C
    assert [column_sum_norm(m) for m in (A, B, C)] == norms
    assert column_sum_norm(np.zeros((2, 0))) == column_sum_norm(fmpq_mat(2, 0)) == 0
    assert theory.chain_bound([A, B], BETA) == 3 * BETA * 81
    assert theory.chain_bound([A, B, C], BETA) == 5 * BETA * 648
    assert theory.strict_chain_bound([A, B, C], BETA) == g(5) * 648
    assert theory.chain_bound([A], BETA) == theory.strict_chain_bound([A], BETA) == 0
    assert theory.matrix_sum_bound(C, D, BETA) == BETA * 104


def test_chains_and_examples_as_printed():
    abc = A @ B @ C
    assert theory.printed_chain_claim([A, B, C], BETA) == 5 * BETA * column_sum_norm(abc)
    assert theory.printed_example_bound(A, B, C, D, BETA) == BETA * (6 * column_sum_norm(abc) + 101)
    whole = column_sum_norm(abc + D)
    assert theory.example_bound(A, B, C, D, BETA) == BETA * (5 * 648 + whole)
    assert theory.strict_example_bound(A, B, C, D, BETA) == (1 + BETA) * g(5) * 648 + BETA * whole
    square = [C, C, C, C]
    ccc = column_sum_norm(C @ C @ C)
    assert theory.printed_example_bound(*square, BETA) == BETA * ((2 * 2 + 1) * ccc + 8)


# -- what the weights mean ------------------------------------------------------------------------


@pytest.mark.parametrize("n", range(8))
def test_weights_count_the_roundings_of_each_term(n):
    """Add symbols: a term is the list of the additions that it went through."""
    passed = dict.fromkeys(range(n), 0)
    inside = [0] if n else []
    for j in range(1, n):
        inside.append(j)
        for term in inside:
            passed[term] += 1
    assert theory.sum_weights(n) == [passed[j] for j in range(n)]
    assert theory.dot_weights(n) == [passed[j] + 1 for j in range(n)]


# -- the root-n law -------------------------------------------------------------------------------


def test_the_probabilistic_factor_shares_its_failure_among_the_terms():
    n, failure, u = 100, 0.05, float(BETA)
    spread = math.sqrt(2 * math.log(2 * n / failure)) / (1 - u)
    exponent = spread * math.sqrt(n - 1) * u + (n - 1) * u * u / (1 - u)
    assert theory.probabilistic_sum_factor(n, BETA, failure) == pytest.approx(math.exp(exponent) - 1, rel=1e-12)
    assert theory.probabilistic_sum_factor(1, BETA) == 0


# -- exhaustive: all tuples of a small format -----------------------------------------------------

SMALL = [(2, 1, (-2, -1, 0, 1), 4), (2, 2, (-1, 0, 1), 3), (3, 1, (-1, 0, 1), 3), (10, 1, (0,), 3)]


def numbers(base, precision, exponents):
    digits = range(base ** (precision - 1), base**precision)
    return [Fraction(0), *(s * m * Fraction(base) ** e for e in exponents for m in digits for s in (1, -1))]


def all_sums(base, precision, exponents, n, rounding):
    """Every tuple of n terms and its computed sum."""
    fl = cache(lambda x: oracles.rounded(x, base, precision, rounding is NEAREST))
    for terms in itertools.product(numbers(base, precision, exponents), repeat=n):
        total = terms[0]
        for term in terms[1:]:
            total = fl(total + term)
        yield terms, total


@pytest.mark.parametrize(("base", "precision", "exponents", "n"), SMALL)
def test_chopping_makes_the_first_order_sum_bounds_strict(base, precision, exponents, n):
    beta = FloatFormat(base, precision, CHOP).unit_roundoff
    weights = theory.sum_weights(n)
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
            ratios.append(abs(computed - sum(terms)) / theory.printed_sum_bound(terms, beta))
    assert max(ratios) == largest


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize(("base", "precision", "n"), [(2, 2, 4), (2, 3, 3), (3, 1, 4), (10, 1, 3)])
def test_products_and_quotients_of_all_significands(base, precision, n, rounding):
    """n factors, of which the last is also tried as a divisor."""
    fmt = FloatFormat(base, precision, rounding)
    fl = cache(lambda x: oracles.rounded(x, base, precision, rounding is NEAREST))
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
                assert error <= theory.product_bound(n - 1, 1, fmt.unit_roundoff)
            largest = max(largest, error / ((n - 1) * fmt.unit_roundoff))
    assert largest > Fraction(1, 7)


@pytest.mark.parametrize("rounding", Rounding.documented())
def test_inner_products_of_all_small_vectors(rounding):
    """(26) with chopping, and nβ|a||b| in both, over all vectors of three in two bits."""
    fmt = FloatFormat(2, 2, rounding)
    fl = cache(lambda x: oracles.rounded(x, 2, 2, rounding is NEAREST))
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
