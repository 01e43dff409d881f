"""gpbnb.report.rounding.theory: each bound as printed or derived, and whether it is one."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import cache

import numpy as np
import oracles
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import theory

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
BETA = Fraction(1, 2000)
A = np.array([[1, -2, 3], [4, 5, -6]], dtype=object)


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
