"""Each bound of rounding errors, as printed or derived, and whether it is one."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq_mat

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import experiment

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
