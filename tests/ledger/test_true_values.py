"""What the checks compare statements with: largest errors, eliminations and first-order arithmetic by hand."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from gpbnb.arithmetic.algebra import product_in_order, rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.report.integration import derivation
from gpbnb.report.inversion import procedure
from gpbnb.report.ledger.checks import budget, geometry, integration, inversion, rounding
from gpbnb.report.ledger.checks import kalman_errors as kalman
from gpbnb.report.ledger.first_order import EPSILON, FirstOrder, matrix
from gpbnb.report.ledger.judge import judge
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.ledger.stored import load_findings

# -- first-order arithmetic -------------------------------------------------------------------------------------------


def test_first_order_arithmetic_is_that_of_polynomials():
    x, y = FirstOrder(Fraction(3), Fraction(5)), FirstOrder(Fraction(7), Fraction(-2))
    assert x * y == FirstOrder(Fraction(21), Fraction(29))
    assert x / y * y == x
    assert 2 - x == FirstOrder(Fraction(-1), Fraction(-5))
    assert FirstOrder(Fraction(0), Fraction(1)) == EPSILON
    assert (1 + EPSILON) ** 3 == 1 + 3 * EPSILON
    assert 1 / (1 + EPSILON) == 1 - EPSILON
    assert Fraction(0) == EPSILON * EPSILON
    assert EPSILON <= 2 * EPSILON
    assert not 2 * EPSILON <= EPSILON
    a = matrix([[x, y], [2, x]])
    unit = FirstOrder(np.array([[Fraction(1), Fraction(0)], [Fraction(0), Fraction(1)]], dtype=object))
    assert a * a.inv() == unit
    assert (a * a).T == a.T * a.T
    assert abs(matrix([[x, -x, -EPSILON]])) == matrix([[x, x, EPSILON]])


def test_the_norm_of_a_column_is_its_largest_entry_and_of_others_the_largest_column_sum():
    """(21) and (22) of hung1984."""
    assert matrix([[1], [-3], [2]]).norm() == FirstOrder(Fraction(3))
    assert matrix([[1, 2], [-3, 4]]).norm() == FirstOrder(Fraction(6))
    assert matrix([[1, -5]]).norm() == FirstOrder(Fraction(5))


# -- the largest errors of a filter -----------------------------------------------------------------------------------


def test_an_inner_product_of_two_terms_has_two_roundings_of_each():
    a, b = kalman.tracked([[3, 5]]), kalman.tracked([[7], [11]])
    assert kalman.largest(product_in_order(a, b, kalman.rounded)) == [[2 * 3 * 7 + 2 * 5 * 11]]
    a, b = kalman.tracked([[3, -5]]), kalman.tracked([[7], [4]])  # of opposite sign, they share a smaller sum
    assert kalman.largest(product_in_order(a, b, kalman.rounded)) == [[21 + 20 + abs(21 - 20)]]


def test_an_error_that_enters_twice_cancels():
    x = kalman.tracked([[3]], [[1]])
    assert kalman.largest(x - x) == [[0]]
    assert kalman.largest(x * x) == [[6]]
    assert kalman.largest(x / kalman.tracked([[2]], [[1]])) == [[Fraction(1, 2) + Fraction(3, 4)]]


def test_no_error_in_many_digits_exceeds_the_largest_error():
    """In forty digits, second-order terms vanish; every error of a step is at most the largest to first order."""
    fmt = FloatFormat(10, 40)
    algebra = rounded_algebra(kalman.exact, np.vectorize(fmt.round, otypes=[object]))
    share = Fraction(0)
    for case, true, kind, moved in kalman._steps():
        if kind.emulated:
            continue
        computed = kalman.Roundings(algebra, kalman.exact, True).take(case)
        for name, bound in moved.items():
            error = abs(getattr(computed, name) - getattr(true, name)) / fmt.unit_roundoff
            assert (error <= bound * (1 + Fraction(1, 10**20))).all(), name
            share = max([share, *(e / b for e, b in zip(error.flat, bound.flat, strict=True) if b)])
    assert share > Fraction(1, 5)


BETA = 5e-4
# With H = 7.5 and R = .004, 1/S is rounded to .01778, K to .1334, KH to 1.001, P to -.001.
P = 0.004 / 56.254


@pytest.mark.parametrize(
    ("place", "by_hand"),
    [
        ("eq102", (0.001 + P) / (3 * BETA * P)),  # in the second step
        ("eq104", (0.001 + P) / (BETA * (1 - 6 * P))),
        ("eq106", 1 / (3 * BETA)),  # 1.001² - 1.002 is rounded to 0
        ("eq122", 1 / (3 * 16 * BETA)),  # 1 + 1e-5 is rounded to 1, so P, F and x to 0
        ("eq124", 1 / (4 * 16 * BETA)),
        ("eq125", 1 / (16 * BETA)),
    ],
)
def test_excesses_worked_by_hand(place, by_hand):
    assert f"is {by_hand:.3g} times" in load_findings()[f"hung1984.II.{place}"].recomputed


# -- elimination ------------------------------------------------------------------------------------------------------


def test_stages_and_solution_are_those_of_the_procedure():
    run, _, _ = inversion.runs(3)[0]
    fmt = inversion.FORMATS[0]
    stages, rights, solution = procedure.reduce(fmt.array(run.a.tolist()), right=fmt.array(run.b.tolist()))
    for k, stage in enumerate(run.stages[1]):
        assert (run.part(stage, False).value == exact(stages[k])).all()
        assert (run.part(stage, True).value == exact(rights[k])).all()
    assert [[x.value for x in row] for row in run.solution] == exact(solution).tolist()


def test_the_errors_of_elimination_change_the_given_matrix_and_their_sizes_bound_them():
    for run, _, beta in (*inversion.runs(3), *inversion.runs(4)):
        for right in (False, True):
            last, given = (run.part(stage, right) for stage in (run.stages[1][-1], run.stages[0][0]))
            errors = run.errors(right)
            assert run.lower * last == given + sum(errors[1:], start=errors[0])
            assert (abs(sum(each.value for each in errors)) <= beta * run.sizes(right)).all()


def test_a_row_of_back_substitution_has_the_weights_of_87_and_88():
    for terms in range(5):
        assert inversion.back_row_weights(terms) == (terms + 1, tuple(range(terms + 2, 2, -1)))


def test_the_resultant_perturbations_belong_to_the_computed_inverse():
    printed = Statement(
        "hung1984.II.x", "hung1984", "II", "1", "x", "equation", "x", "A_hat*x_hat[j] == u[j] + deltab[j]"
    )
    assert judge(printed, inversion.inverses()).holds
    assert not judge(replace(printed, form="A_hat*x_hat[j] == u[j]"), inversion.inverses()).holds


# -- other chapters ---------------------------------------------------------------------------------------------------


def test_spans_of_dates():
    assert budget.span(date(1981, 6, 24), date(1982, 8, 31)) == (14, 7)
    assert budget.span(date(2000, 1, 15), date(2000, 3, 14)) == (1, 28)
    assert budget.span(date(1999, 12, 1), date(2000, 1, 1)) == (1, 0)


def test_a_filter_of_white_noise_is_a_mean():
    """After N readings the error of a constant is 1/√N of that of one reading, to four standard errors."""
    left, expected, trials = budget.filtered_noise()
    assert expected == pytest.approx(0.05)
    assert abs(left / expected - 1) < 4 / (2 * trials) ** 0.5


def test_the_scatter_of_a_standard_deviation():
    """Against simulation, to five standard errors."""
    for n in (2, 4, 50):
        found = np.random.default_rng(n).standard_normal((4000, n)).std(axis=1, ddof=1).std()
        assert rounding.scatter(n) == pytest.approx(found, rel=5 / np.sqrt(2 * 4000) * 1.5)


def test_errors_of_the_printed_deroll_are_up_to_twice_the_angle():
    as_printed, corrected = geometry.deroll_errors()
    assert as_printed == pytest.approx(2 * 17, rel=0.01)
    assert corrected < 1e-12


def test_the_walk_is_that_of_the_derivation():
    for case in integration.cases():
        expected = derivation.walk().subs(derivation.MU, case.omega * case.period) * case.steady * case.period
        assert abs(sp.N(integration.walk_rate(case) - expected, 40)) < 1e-38
