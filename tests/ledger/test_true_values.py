"""What the checks compare statements with: largest errors, eliminations and first-order arithmetic by hand."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from gpbnb.arithmetic.algebra import rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.report.integration import derivation
from gpbnb.report.inversion import procedure
from gpbnb.report.ledger.checks import budget, integration, inversion
from gpbnb.report.ledger.checks import kalman_errors as kalman
from gpbnb.report.ledger.first_order import EPSILON, FirstOrder, matrix
from gpbnb.report.ledger.judge import judge
from gpbnb.report.ledger.statements import Statement

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


# -- the largest errors of a filter -----------------------------------------------------------------------------------


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


def test_the_resultant_perturbations_belong_to_the_computed_inverse():
    printed = Statement(
        "hung1984.II.x", "hung1984", "II", "1", "x", "equation", "x", "A_hat*x_hat[j] == u[j] + deltab[j]"
    )
    assert judge(printed, inversion.inverses()).holds
    assert not judge(replace(printed, form="A_hat*x_hat[j] == u[j]"), inversion.inverses()).holds


# -- other chapters ---------------------------------------------------------------------------------------------------


def test_a_filter_of_white_noise_is_a_mean():
    """After N readings the error of a constant is 1/√N of that of one reading, to four standard errors."""
    left, expected, trials = budget.filtered_noise()
    assert expected == pytest.approx(0.05)
    assert abs(left / expected - 1) < 4 / (2 * trials) ** 0.5


def test_the_walk_is_that_of_the_derivation():
    for case in integration.cases():
        expected = derivation.walk().subs(derivation.MU, case.omega * case.period) * case.steady * case.period
        assert abs(sp.N(integration.walk_rate(case) - expected, 40)) < 1e-38
