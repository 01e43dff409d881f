"""Exact matrices: definiteness as elimination decides it, products in order, and inverses."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import numpy as np
import pytest

from gpbnb.arithmetic.algebra import EXACT, inverse_in_order, product_in_order
from gpbnb.arithmetic.definiteness import factor, is_definite
from gpbnb.arithmetic.rational import exact, inverse_of

pytestmark = pytest.mark.usefixtures("loops_at_once")


def eliminated(matrix, strictly):
    try:
        return bool(np.all(factor(matrix)[1] > 0)) or not strictly
    except ValueError:
        return False


def test_it_decides_as_elimination_does():
    """Of semidefinite matrices of every rank, and of those that differ from them by the least or the most."""
    random, decided = Random(1), set()
    for _ in range(200):
        n = random.randint(1, 5)
        rank = random.randint(0, n)
        drawn = (Fraction(random.randint(-21, 21), random.randint(1, 7)) for _ in range(n * rank))
        entries = [random.choice([0, 0, 1, -1, x, x]) for x in drawn]
        G = np.array(entries, dtype=object).reshape(n, rank)
        matrix = G @ G.T + exact(np.zeros((n, n), dtype=int))
        i = random.randrange(n)
        matrix[i, i] += Fraction(random.choice([0, 1, -1, "1e-60", "-1e-60", "-1e-8"]))
        units = [Fraction(10) ** random.randint(-40, 40) for _ in range(n)]
        matrix = matrix * np.multiply.outer(units, units)
        found = tuple(is_definite(matrix, strictly) for strictly in (False, True))
        assert found == tuple(eliminated(matrix, strictly) for strictly in (False, True))
        decided.add(found)
    assert len(decided) == 3


def hilbert(n):
    return np.array([[Fraction(1, i + j + 1) for j in range(n)] for i in range(n)], dtype=object)


def test_definite_matrices_are_told_from_those_that_miss_it_by_the_least():
    """The least eigenvalue of Hilbert's matrix of 30 rows is near 1e-44; less 1 from a sum of squares is negative."""
    n = 30
    assert is_definite(hilbert(n), strictly=True)
    G = exact(np.random.default_rng(n).integers(-9, 9, (n, n - 1)))
    singular = G @ G.T
    assert is_definite(singular)
    assert not is_definite(singular, strictly=True)
    path = 2 * exact(np.eye(n, dtype=int)) - exact(np.eye(n, k=1, dtype=int)) - exact(np.eye(n, k=-1, dtype=int))
    path[0, 0] = path[-1, -1] = Fraction(1)  # each row adds up to zero: no diagonal is larger than its row
    assert is_definite(path)
    assert not is_definite(path, strictly=True)
    for change, definite in ((Fraction(1, 10**50), True), (-Fraction(1, 10**50), False)):
        changed = singular + change * exact(np.eye(n, dtype=int))
        assert is_definite(changed, strictly=True) is is_definite(changed) is definite


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_product_is_summed_from_left_to_right(dtype):
    rng = np.random.default_rng(7)
    a, b = rng.standard_normal((3, 9)).astype(dtype), rng.standard_normal((9, 2)).astype(dtype)
    found = product_in_order(a, b)
    assert found.dtype == dtype
    for i in range(3):
        for j in range(2):
            total = a[i, 0] * b[0, j]
            for k in range(1, 9):
                total = total + a[i, k] * b[k, j]
            assert found[i, j] == total


def test_an_inverse_over_fractions_is_exact_and_its_pivots_multiply_to_the_determinant():
    rng = np.random.default_rng(8)
    a = exact(rng.integers(-9, 10, (4, 4)) + 20 * np.eye(4, dtype=int))
    found, pivots = inverse_in_order(a, EXACT.identity(4))
    assert (found == inverse_of(a)).all()
    assert (product_in_order(a, found) == EXACT.identity(4)).all()
    product = Fraction(1)
    for pivot in pivots:
        product *= pivot
    assert abs(float(product) / np.linalg.det(a.astype(float)) - 1) < 1e-12  # float64 determinant of a 4 × 4 matrix
