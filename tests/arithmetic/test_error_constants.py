"""gpbnb.arithmetic.bounds: norms and error constants, exact."""

from __future__ import annotations

import itertools
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.bounds import all_above, gamma, gamma_probabilistic
from gpbnb.arithmetic.rational import column_sum_norm, exact, inverse_of, max_norm, row_sum_norm


def matrices(seed, *shapes):
    rng = np.random.default_rng(seed)
    return [rng.integers(-9, 10, shape).astype(object) for shape in shapes]


def test_exact_keeps_every_digit():
    values = ["0.1", 0.1, Decimal("1e-30"), Fraction(1, 3), 7, np.float64(0.5), np.float32(0.1), np.int8(-3)]
    expected = [
        Fraction(1, 10),
        Fraction(0.1),
        Fraction(1, 10**30),
        Fraction(1, 3),
        7,
        Fraction(1, 2),
        Fraction(float(np.float32(0.1))),
        -3,
    ]
    found = exact(values)
    assert found.dtype == object
    assert found.tolist() == expected
    assert all(type(entry) is Fraction for entry in found)
    assert exact(0.1).shape == ()
    assert exact(np.float32(0.5)).item() == Fraction(1, 2)


def test_an_inverse_is_exact():
    a = exact([["0.1", "3", "-7"], ["2/3", 0, 1], [5, "1e-6", 4]])
    inverse = inverse_of(a)
    assert (a @ inverse == np.eye(3, dtype=int)).all()
    assert (inverse @ a == np.eye(3, dtype=int)).all()
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        inverse_of([[1, 2], [2, 4]])


def test_row_sums_go_with_21_and_are_the_least_that_do():
    for seed in range(100):
        a, x = matrices(seed, (3, 4), (4,))
        assert max_norm(a @ x) <= row_sum_norm(a) * max_norm(x)
    for (a,) in (matrices(seed, (3, 4)) for seed in range(20)):
        signs = itertools.product((-1, 1), repeat=4)
        assert max(max_norm(a @ np.array(x, dtype=object)) for x in signs) == row_sum_norm(a)


def test_column_sums_of_22_do_not_go_with_21():
    a, x = [[1, 1], [0, 0]], [1, 1]
    product = max_norm(np.array(a) @ np.array(x))
    assert product == 2 > column_sum_norm(a) * max_norm(x) == 1
    # The quotient is as large as the number of columns.
    row = np.ones((1, 9), dtype=int)
    assert max_norm(row @ np.ones(9, dtype=int)) == 9 * column_sum_norm(row)


def test_gamma_by_its_formula():
    assert gamma(0, Fraction(1, 2)) == 0
    assert gamma(3, Fraction(1, 2000)) == Fraction(3, 2000) / (1 - Fraction(3, 2000))
    assert gamma(1, Fraction(1, 2)) == 1
    assert gamma(2, 0.125) == Fraction(1, 3)


def test_gamma_bounds_every_product_of_errors_and_their_inverses():
    for beta in (Fraction(1, 20), Fraction(1, 8), Fraction(1, 3)):
        for n in range(1, math.ceil(1 / beta)):
            bound = gamma(n, beta)
            # The extremes: each factor is convex in its error, and errors are at an end of their interval.
            low, high = (1 - beta) ** n, 1 / (1 - beta) ** n
            assert 1 - low <= bound
            assert high - 1 <= bound
            assert (1 + beta) ** n - 1 <= bound
            assert gamma(n, beta) > n * beta
    assert gamma(1, Fraction(1, 3)) == 1 / (1 - Fraction(1, 3)) - 1  # reached for one division


def failure_of(n, u, bound):
    """The probability that the theorem gives to `bound`."""
    spread = (math.log1p(bound) - n * u * u / (1 - u)) / (math.sqrt(n) * u)
    return 2 * math.exp(-((spread * (1 - u)) ** 2) / 2)


@pytest.mark.parametrize("failure", [0.5, 0.01, 1e-6])
@pytest.mark.parametrize(("n", "u"), [(1, Fraction(1, 20)), (100, Fraction(1, 2**11)), (10**6, Fraction(1, 2**24))])
def test_probabilistic_gamma_fails_as_often_as_said(n, u, failure):
    # The logarithm undoes the exponential: a few units of 2**-53 times the condition of exp(-x**2/2), below 40 here.
    bound = gamma_probabilistic(n, u, failure)
    assert failure_of(n, float(u), bound) == pytest.approx(failure, rel=1e-9)


def test_probabilistic_gamma_in_a_simulation():
    """Errors of -u and u with equal chance are the worst of those with mean zero."""
    n, u, failure, trials = 400, 2.0**-8, 0.1, 4000
    eps = np.random.default_rng(5).choice([-u, u], (trials, n))
    size = np.sort(abs(np.expm1(np.log1p(eps).sum(axis=1))))
    share = np.mean(size > gamma_probabilistic(n, Fraction(u), failure))
    assert share <= failure + 4 * math.sqrt(failure * (1 - failure) / trials)  # four standard errors
    # Not vacuous: the error that a share of `failure` exceeds is above half of the bound (1.64 of 2.45 deviations).
    assert size[int((1 - failure) * trials)] > 0.5 * gamma_probabilistic(n, Fraction(u), failure)


def test_numbers_that_float64_does_not_hold_are_rounded_up():
    tiny = Fraction(1, 10**20)
    values = [
        1 + tiny,
        1 - tiny,
        -1 - tiny,
        "0.1",
        Decimal("0.3"),
        2**53 + 1,
        Fraction(1, 10**400),
        0.7,
        np.float32(0.1),
    ]
    found = all_above(np.array(values, dtype=object))
    for each, value in zip(found.tolist(), exact(values), strict=True):
        assert Fraction(math.nextafter(each, -math.inf)) < value <= Fraction(each)
    assert all_above(["0.1", math.inf])[1] == all_above(10**400) == math.inf
    assert np.isnan(all_above([Fraction(1), math.nan])[1])
    assert all_above(-(10**400)) == -np.finfo(float).max
    assert all_above(np.eye(2)).tolist() == [[1, 0], [0, 1]]
