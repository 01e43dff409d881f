"""The searches for the worst sum and product, against all tuples; and what they find."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction
from functools import cache

import oracles
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import experiment

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP


def rounding_of(fmt: FloatFormat):
    return cache(lambda x: oracles.rounded(x, fmt.base, fmt.precision, fmt.rounding is NEAREST))


def significands(fmt: FloatFormat) -> range:
    return range(fmt.base ** (fmt.precision - 1), fmt.base**fmt.precision)


# -- exhaustive -----------------------------------------------------------------------------------


def worst_product_of_all(fmt: FloatFormat, n: int) -> Fraction:
    fl, worst = rounding_of(fmt), Fraction(0)
    for factors in itertools.product(map(Fraction, significands(fmt)), repeat=n):
        partial = factors[0]
        for factor in factors[1:]:
            partial = fl(partial * factor)
        worst = max(worst, abs(partial / math.prod(factors) - 1))
    return worst


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize(
    ("base", "precision", "lengths"),
    [(2, 2, (2, 3, 8)), (2, 3, (2, 3, 5)), (3, 1, (2, 7)), (3, 2, (4,)), (10, 1, (2, 4))],
)
def test_no_product_is_worse_than_the_one_found(base, precision, lengths, rounding):
    fmt = FloatFormat(base, precision, rounding)
    for n in lengths:
        found = experiment.worst_product(fmt, n)
        assert found.inputs[0].shape == (n,)
        assert found.error == worst_product_of_all(fmt, n)


def worst_sum_of_all(fmt: FloatFormat, n: int, exponents: range, products: bool) -> Fraction:
    """The largest error over the first-order bound of all sums of n terms, or of n products."""
    fl, beta = rounding_of(fmt), fmt.unit_roundoff
    factors = significands(fmt) if products else [1]
    sizes = {m * k * Fraction(fmt.base) ** e for e in exponents for m in significands(fmt) for k in factors}
    choices = [Fraction(0), *sizes, *(-size for size in sizes)]
    weights = [n - 1, *range(n - 1, 0, -1)]
    worst = Fraction(0)
    # A sum with all signs changed has the same error.
    for terms in itertools.product([Fraction(0), *sizes], *[choices] * (n - 1)):
        partial = fl(terms[0])
        for term in terms[1:]:
            partial = fl(partial + fl(term))
        error = abs(partial - sum(terms))
        if error:
            bound = beta * sum((w + products) * abs(x) for w, x in zip(weights, terms, strict=True))
            worst = max(worst, error / bound)
    return worst


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize(
    ("base", "precision", "n", "exponents", "products"),
    [
        (2, 1, 4, range(-3, 1), False),
        (2, 2, 2, range(-3, 2), False),
        (2, 2, 3, range(-2, 2), False),
        (2, 3, 3, range(-2, 0), False),
        (3, 1, 3, range(-2, 1), False),
        (3, 2, 2, range(-2, 2), False),
        (10, 1, 2, range(-1, 2), False),
        (10, 1, 3, range(-1, 0), False),
        (2, 2, 3, range(-3, 0), True),
        (2, 3, 2, range(-3, 1), True),
        (3, 1, 3, range(-2, 1), True),
    ],
)
def test_no_sum_is_worse_than_the_one_found(base, precision, n, exponents, products, rounding):
    fmt = FloatFormat(base, precision, rounding)
    found = experiment.worst_sum(fmt, n, exponents, products)
    worst = worst_sum_of_all(fmt, n, exponents, products)
    assert found.error == worst * found.bounds["(26)" if products else "weights"]
    assert (found.error > 0) == (worst > 0)


# -- what is found --------------------------------------------------------------------------------

BITS = [(FloatFormat(2, 2), range(-4, 5)), (FloatFormat(2, 3), range(-5, 4)), (FloatFormat(2, 4), range(-5, 2))]


@pytest.mark.parametrize(("fmt", "exponents"), BITS)
def test_the_weights_are_exceeded_from_eight_terms_on(fmt, exponents):
    found = {n: experiment.worst_sum(fmt, n, exponents) for n in range(2, 11)}
    assert [n for n, trial in found.items() if trial.violates("weights")] == [8, 9, 10]
    ratios = [trial.ratio("weights") for trial in found.values()]
    assert ratios == sorted(ratios)
    assert ratios[0] >= 0.8
    for n in (8, 9, 10):
        trial = found[n]
        assert all(x > 0 for x in trial.inputs[0].to_fractions())
        assert trial.error <= (n - 1) * fmt.unit_roundoff * trial.true  # equal weights are strict
        if "strict" in trial.bounds:
            assert not trial.violates("strict")
    assert "strict" in found[8].bounds or (fmt.precision == 2)


def test_26_is_exceeded_by_twelve_products_in_three_bits():
    fmt, exponents = FloatFormat(2, 3), range(-5, 4)
    found = experiment.worst_sum(fmt, 12, exponents, products=True)
    assert found.violates("(26)")
    assert found.ratio("(26)") > 1.02
    assert found.error <= 12 * fmt.unit_roundoff * found.true
    ten = experiment.worst_sum(fmt, 10, exponents, products=True)
    assert not ten.violates("(26)")
    assert 0.95 < ten.ratio("(26)") < 1
    assert not ten.violates("strict") if "strict" in ten.bounds else ten.fmt.unit_roundoff * 10 >= 1


def test_a_first_order_product_bound_is_exceeded_by_twelve_factors_and_n_plus_one_by_twenty():
    fmt = FloatFormat(10, 2)
    exceeded = {n: experiment.worst_product(fmt, n) for n in (2, 8, 11, 12, 19, 20)}
    assert [n for n, trial in exceeded.items() if trial.violates("1982 (20)")] == [11, 12, 19, 20]
    assert [n for n, trial in exceeded.items() if trial.violates("1984 (20)")] == [19, 20]
    assert not any(trial.violates("strict") for trial in exceeded.values())
    for n, trial in exceeded.items():
        assert trial.error <= (1 + fmt.unit_roundoff / (1 + fmt.unit_roundoff)) ** (n - 1) - 1
    assert exceeded[20].ratio("1982 (20)") > 1.2
