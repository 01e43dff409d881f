"""gpbnb.arithmetic.bounds: norms and error constants, exact."""

from __future__ import annotations

import itertools
import math
from decimal import Decimal
from fractions import Fraction

import numpy as np

from gpbnb.arithmetic.bounds import all_above, gamma
from gpbnb.arithmetic.rational import column_sum_norm, exact, max_norm, row_sum_norm


def matrices(seed, *shapes):
    rng = np.random.default_rng(seed)
    return [rng.integers(-9, 10, shape).astype(object) for shape in shapes]


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
