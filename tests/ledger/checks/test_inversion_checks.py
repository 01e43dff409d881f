"""ledger.checks.inversion: each statement has a check, and the true values it is compared with are right."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from statistics import median

import faults
import numpy as np
import pytest
from faults import finding

from gpbnb.arithmetic.rational import exact
from gpbnb.report import ledger
from gpbnb.report.inversion import example, procedure
from gpbnb.report.ledger.checks import inversion, inversion_table
from gpbnb.report.ledger.checks.inversion import CHECKS
from gpbnb.report.ledger.elimination import Elimination
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.first_order import EPSILON, FirstOrder, matrix
from gpbnb.report.ledger.judge import judge
from gpbnb.report.ledger.statements import Statement, statement

INVENTORY = faults.INVENTORY
ENTRIES = (
    *ledger.select(INVENTORY, "hung1984", "II", (10, 11)),
    *ledger.select(INVENTORY, "hung1982", "III", (10, 11)),
)
PRINTED = {entry.id: entry for entry in ENTRIES}


def test_the_norm_of_a_column_is_its_largest_entry_and_of_others_the_largest_column_sum():
    """(21) and (22) of hung1984."""
    assert matrix([[1], [-3], [2]]).norm() == FirstOrder(Fraction(3))
    assert matrix([[1, 2], [-3, 4]]).norm() == FirstOrder(Fraction(6))
    assert matrix([[1, -5]]).norm() == FirstOrder(Fraction(5))


# -- the present state ----------------------------------------------------------------------------


def test_findings_quote_the_computed_numbers(rows):
    assert "6, 5, 4 in place of 5, 4, 3" in finding(rows, "hung1982.III.eq89-first-form").recomputed
    assert "1.5 times bound (96)" in finding(rows, "hung1984.II.eq96").note
    assert "4 times the bound in the last box" in finding(rows, "hung1984.II.eq96").note
    assert "omit 6% of the size of $\\delta A$ and 22%" in finding(rows, "hung1984.II.eq91").recomputed
    assert "in 13 of 24 eliminations" in finding(rows, "hung1984.II.eq59").recomputed
    # 12 + 5 to reduce and 18 to solve; 2(10 + 4) for (59) and (60), 3 for (89), 9, 27 and 1 for (90), (95) and (96)
    computation = finding(rows, "hung1984.II.s11-3.computation").note
    assert "for $n=3$ the bound takes 68 multiplications and the inverse 35" in computation
    unchanged = finding(rows, "hung1984.II.s11-2.claim-only-back-substitution").recomputed
    assert re.search(r"does not change (\d+) of \1 triangular systems and 0 of \1 full systems", unchanged)
    assert "48 of 48" in finding(rows, "hung1984.II.eq59").recomputed


def test_the_counterexamples_are_not_due_to_bad_matrices():
    """Condition 2.2 in three digits, without pivoting; and below 3000 in six, with it. Sizes leave much room."""
    for form, largest, room in (("(96)", 2.3, 2), ("chart", 3000, 50)):
        trial, name = inversion.counterexample(form)
        assert trial.condition < largest
        assert trial.violates(name)
        assert trial.error > trial.bounds[name]
        assert trial.overestimation(str(procedure.Reading(False, form))) > room
        assert not trial.violates("corrected")


def test_the_example_computes_with_the_printed_matrix_and_numbers():
    for key in ("hung1984.II.s11-4.matrix-a", "hung1982.III.s11-4.matrix-a"):
        (link,) = statement(key).links({"matrix": lambda rows: rows}, Fraction)
        assert link.right == [[Fraction(x) for x in row] for row in example.MATRIX]
    for key in ("hung1984.II.s11-4.table-1", "hung1982.III.s11-4.table-i"):
        printed = {(part.label, part.literal) for part in statement(key).parts}
        names = {"proposed": "bound", "actual": "error"}
        assert printed == {
            (f"{column} {places}", example.PRINTED[name][i])
            for column, name in names.items()
            for i, places in enumerate(example.PLACES)
        }


# -- what disagrees can agree ---------------------------------------------------------------------


COLUMNS = ("proposed", "actual")


def as_computed(column):
    """The numbers of a column of Table 1 as one of the readings gives them."""
    return [f"{value:.3e}" for value in inversion_table.readings(column)[0].values]


def test_a_number_that_a_reading_gives_is_verified():
    numbers = {column: as_computed(column) for column in COLUMNS}
    for column, found in numbers.items():
        for places, literal in zip(example.PLACES, found, strict=True):
            printed = statement(f"hung1984.II.s11-4.table-1-{column}-{places}-places")
            assert CHECKS.run(replace(printed, form=f"{column} {places}: {literal}")).verdict is Verdict.VERIFIED
    parts = [f"{c} {p}: {numbers[c][i]}" for c in numbers for i, p in enumerate(example.PLACES)]
    table = statement("hung1984.II.s11-4.table-1")
    assert CHECKS.run(replace(table, form="; ".join(parts))).verdict is Verdict.VERIFIED
    one_column = [*parts[:3], *(part.text for part in table.parts if part.label.startswith("actual"))]
    assert CHECKS.run(replace(table, form="; ".join(one_column))).verdict is Verdict.NOT_REPRODUCED


def test_readings_belong_to_the_columns_of_the_table():
    """Errors are far below bounds."""
    proposed, actual = (median(each.values[0] for each in inversion_table.readings(c)) for c in COLUMNS)
    assert proposed > 10 * actual


def test_a_bound_near_the_printed_error_is_not_conservative(monkeypatch):
    numbers = inversion_table._numbers
    with faults.forgetting(monkeypatch, inversion_table):
        monkeypatch.setattr(inversion_table, "_numbers", lambda printed, column: numbers(printed, "actual"))
        assert inversion_table.claims()["margin"] == "are not conservative"
    assert inversion_table.claims()["margin"] == "are indeed very conservative"


@pytest.mark.parametrize("key", ["hung1984.II.s10.practicality-of-44", "hung1982.III.s10.practicality-of-44"])
def test_a_residue_that_is_hard_to_obtain_is_verified(monkeypatch, key):
    found = inversion.residue_of_example()
    assert CHECKS.run(statement(key)).verdict is Verdict.WRONG
    hard = {**found, "residue": "cannot easily be obtained"}
    monkeypatch.setattr(inversion, "residue_of_example", lambda: hard)
    assert CHECKS.run(statement(key)).verdict is Verdict.VERIFIED


def test_without_rounding_no_error_is_compounded(monkeypatch):
    given, right = ([[Fraction(x) for x in row] for row in rows] for rows in (example.MATRIX, [[1], [2], [3]]))
    run = Elimination(np.array(given), np.array(right), lambda x: x)
    with faults.forgetting(monkeypatch, inversion):
        monkeypatch.setattr(inversion, "runs", lambda n: [(run, None, None)])
        assert inversion.compounded() == {"verb": {"will not affect"}, "adds": 1, "changes": 0}


def test_sizes_in_place_of_signs_are_verified():
    """(59) and (60) with sums of sizes bound the errors that occurred in every elimination."""
    for run, _, beta in (*inversion.runs(3), *inversion.runs(4)):
        for right in (False, True):
            error = sum(each.value for each in run.errors(right))
            assert (abs(error) <= beta * run.sizes(right)).all()


def test_the_right_side_is_judged_in_every_row():
    printed = statement("hung1984.II.eq88")
    for row in ("1", "n"):
        other = printed.form.replace("*epsilon", f"*epsilon*cases((2, k == {row}), (1, k != {row}))")
        assert CHECKS.run(replace(printed, form=other)).verdict is Verdict.WRONG


# -- the true values ------------------------------------------------------------------------------


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
    assert matrix([x, y, 2]).value.tolist() == [[3, 7, 2]]
    assert (a * a).T == a.T * a.T
    assert abs(matrix([[x, -x, -EPSILON]])) == matrix([[x, x, EPSILON]])
    assert abs(-x) == x


def test_stages_and_solution_are_those_of_the_procedure():
    run, _, _ = inversion.runs(3)[0]
    fmt = inversion.FORMATS[0]
    triangular = procedure.triangularize(fmt.array(run.a.tolist()))
    rights = procedure.transform(triangular, fmt.array(run.b.tolist()))
    for k, stage in enumerate(run.stages[1]):
        assert (run.part(stage, False).value == exact(triangular.stages[k])).all()
        assert (run.part(stage, True).value == exact(rights[k])).all()
    solution = exact(procedure.substitute(triangular.upper, rights[-1]))
    assert [[x.value for x in row] for row in run.solution] == solution.tolist()


@pytest.mark.parametrize("n", [3, 4])
def test_the_lower_factor_carries_the_errors_to_the_given_matrix(n):
    for run, _, _ in inversion.runs(n):
        for right in (False, True):
            last, given = (run.part(stage, right) for stage in (run.stages[1][-1], run.stages[0][0]))
            errors = run.errors(right)
            assert run.lower * last == given + sum(errors[1:], start=errors[0])


@pytest.mark.parametrize("terms", range(5))
def test_a_row_of_back_substitution_has_the_weights_of_87_and_88(terms):
    assert inversion.back_row_weights(terms) == (terms + 1, tuple(range(terms + 2, 2, -1)))


def test_the_resultant_perturbations_belong_to_the_computed_inverse():
    printed = Statement(
        "hung1984.II.x", "hung1984", "II", "1", "x", "equation", "x", "A_hat*x_hat[j] == u[j] + deltab[j]"
    )
    assert judge(printed, inversion.inverses()).holds
    assert not judge(replace(printed, form="A_hat*x_hat[j] == u[j]"), inversion.inverses()).holds


def test_an_entry_is_named_by_the_last_step_that_changed_it():
    names = inversion.eliminations(3)[0]
    with pytest.raises(KeyError, match="last step"):
        names["a"](1, 2, 1)
    with pytest.raises(KeyError, match="last step"):
        names["b_hat"](2, 2)


def test_pivoting_is_not_needed_if_it_does_not_mend_what_fails(monkeypatch):
    """Without a pivot the inversion fails as before; with one it now finds another matrix."""
    inv = inversion.linalg.inv

    def doubled(a, pivot=False):
        return inv(a, pivot=True) + inv(a, pivot=True) if pivot else inv(a)

    monkeypatch.setattr(inversion.linalg, "inv", doubled)
    for key in ("hung1984.II.s10.claim-partial-pivoting", "hung1982.III.s10.claim-partial-pivoting"):
        assert CHECKS.run(statement(key)).agrees is False
