"""gpbnb.ledger.checks.inversion: each entry of the sections has a check, and each check can come out otherwise."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace as changed
from fractions import Fraction

import faults
import numpy as np
import pytest
from faults import all_of, always, breaks, finding, replace

from gpbnb import ledger
from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.inversion import derivation, example, experiment, procedure, theory
from gpbnb.inversion.theory import Perturbation, Reduction
from gpbnb.ledger.checks import inversion as checks
from gpbnb.ledger.finding import Verdict, compare

INVENTORY = faults.INVENTORY
ENTRIES = (
    *ledger.select(INVENTORY, "hung1984", "II", (10, 11)),
    *ledger.select(INVENTORY, "hung1982", "III", (10, 11)),
)
PRINTED = {entry.id: entry.printed for entry in ENTRIES}
FUNCTIONS = faults.functions(checks.CHECKS)


@pytest.fixture(scope="module")
def rows():
    return faults.examined(ENTRIES)


# -- the present state ----------------------------------------------------------------------------


def test_every_entry_of_the_sections_has_a_check_here_and_none_is_elsewhere():
    assert set(checks.CHECKS) == set(PRINTED)
    assert len(PRINTED) == 197


def test_each_numbered_equation_has_its_entry():
    def numbers(document, chapter):
        for key in PRINTED:
            place = key.removeprefix(f"{document}.{chapter}.eq")
            if place != key:
                ends = [int(end) for end in place.split("-")[:2] if end.isdecimal()]
                yield from range(ends[0], ends[-1] + 1)

    assert set(numbers("hung1984", "II")) == set(numbers("hung1982", "III")) == set(range(33, 98))


def test_verdicts_by_document(rows):
    """The present state: to be changed knowingly."""
    counts = {
        document: Counter(row.outcome for row in rows if row.statement.document == document)
        for document in ("hung1984", "hung1982")
    }
    assert counts["hung1984"] == {"verified": 80, "misprint": 19, "wrong": 23, "ocr": 1}
    assert counts["hung1982"] == {
        "verified": 45,
        "misprint": 8,
        "wrong": 16,
        "inconsistent": 2,
        "ocr": 2,
        "unverifiable": 1,
    }


def test_which_are_wrong(rows):
    found = {row.statement.id.split(".", 2)[2] for row in rows if row.finding.verdict is Verdict.WRONG}
    one_epsilon = {"s11.claim-one-epsilon", *(f"eq{number}" for number in (47, 48, 49, 51, 52, 53, 54, 59, 60))}
    sums = {"s11-3.claim-two-sets", "eq90", "eq91", "eq92", "eq96"}
    table = {"s11-4.table-1", *(f"s11-4.table-1-{c}-{n}-places" for c in ("proposed", "actual") for n in (3, 5, 8))}
    of_1982 = {"eq53-54", "eq59-60", "eq91-92", "eq95-97", "s11-4.table-i"}
    of_1982 |= {f"s11-4.table-i-row-{n}-places" for n in (3, 5, 8)}
    assert found == one_epsilon | sums | table | of_1982 | {"s10.practicality-of-44"}


def test_no_finding_is_without_a_note_where_it_differs(rows):
    faults.check_texts(rows)
    assert all(row.finding.recomputed for row in rows)


def test_findings_quote_the_computed_numbers(rows):
    assert "1/9 and (43) 1/10" in finding(rows, "hung1984.II.eq43").recomputed
    assert "leaves $- a_{23}" in finding(rows, "hung1984.II.eq77").recomputed
    assert "6, 5, 4 in place of 5, 4, 3" in finding(rows, "hung1982.III.eq89-first-form").recomputed
    assert "1.5 times (96)" in finding(rows, "hung1984.II.eq96").recomputed
    assert "4 times the last box" in finding(rows, "hung1984.II.eq96").recomputed
    assert "-5.235, 2.12 to -4.845, 2.63" in finding(rows, "hung1982.III.s11-1.matrix-after-first-step").recomputed
    assert "out 6% and 22%" in finding(rows, "hung1984.II.eq91").recomputed


def test_the_counterexamples_are_not_due_to_bad_matrices():
    """Condition 2.2 in three digits, without pivoting; and below 3000 in six, with it. Sizes leave much room."""
    for form, largest, room in (("(96)", 2.3, 2), ("chart", 3000, 50)):
        trial, name = checks.counterexample(form)
        assert trial.condition < largest
        assert trial.violates(name)
        assert trial.error > trial.bounds[name]
        assert trial.ratio(str(procedure.Reading(False, form))) > room


# -- each check can come out otherwise ------------------------------------------------------------


ALL = checks.samples()
FEW = (ALL[0], ALL[9], ALL[12], ALL[33], ALL[36], ALL[67])


@pytest.fixture
def patch(monkeypatch):
    """Change the code, with a few samples and nothing remembered; undone, and forgotten, afterwards."""
    with faults.forgetting(monkeypatch, checks):
        fresh = tuple(checks.Sample(sample.matrix, sample.pivot) for sample in FEW)
        monkeypatch.setattr(checks, "samples", lambda: fresh)
        yield monkeypatch


def scaled(name, factor):
    """A function of theory, its result, or each of two, times a factor."""
    function = getattr(theory, name)

    def larger(*arguments):
        result = function(*arguments)
        return (
            Perturbation(*(part * factor for part in result)) if isinstance(result, Perturbation) else result * factor
        )

    return replace(theory, name, larger)


def derivation_fails(name):
    return breaks(derivation, name)


def disagrees(name):
    return replace(checks, name, always(compare(False, "otherwise")))


def nothing_is_zero(patch):
    patch.setattr(checks, "zero", always(False))


def all_is_zero(patch):
    patch.setattr(checks, "zero", always(True))


INVERSE_OF = checks.inverse_of
INV, SOLVE, REDUCE, RUN, CLAIMS = linalg.inv, linalg.solve, procedure.reduce, procedure.run, example.claims
TRIANGULARIZE = procedure.triangularize


def nothing_is_reduced(patch):
    """Every stage is the given one."""

    def reduce(a, pivot=False):
        stages, rights, solution = REDUCE(a, pivot)
        return Reduction([stages[0]] * len(stages), [rights[0] + rights[0]] + [rights[0]] * (len(stages) - 1), solution)

    patch.setattr(procedure, "reduce", reduce)


def no_errors(self, right=False):
    """Steps without errors."""
    parts = self.general if right else self.reduction.stages
    return [part * 0 for part in parts[1:]]


def huge_errors(self, right=False):
    parts = self.general if right else self.reduction.stages
    return [part * 1 for part in parts[1:]]


def claims_fail(word):
    found = tuple(changed(claim, holds=claim.holds - 1) if word in claim.name else claim for claim in CLAIMS())
    return replace(example, "claims", always(found))


def printed(**columns):
    return replace(example, "PRINTED", {**example.PRINTED, **columns})


FLAT = ("3.706e-2", "3.706e-2", "3.706e-7")
TENTH, HUNDREDTH = Fraction(1, 10), Fraction(1, 100)
LEFTOVER = replace(derivation, "leftover", lambda number, hats=True: derivation.EPSILON)
ONES = replace(theory, "back_substitution_weights", lambda n: np.ones((n, n), dtype=object))

#: For each check that agrees, changes of the code under which it must not.
DISAGREE = [
    ("columns_of_the_inverse", replace(checks, "inverse_of", lambda a: a)),
    ("columns_of_the_inverse", replace(linalg, "solve", lambda a, b, *pivot: SOLVE(a, b + b if b.ndim == 1 else b))),
    ("partial_pivoting", replace(linalg, "inv", lambda a, pivot=False: INV(a, True))),
    ("partial_pivoting", replace(checks.Sample, "error", property(lambda self: np.ones((2, 2), dtype=object)))),
    ("residuals", scaled("residual", 2)),
    ("residuals", derivation_fails("first_approach")),
    ("residual_norms", scaled("printed_first_bound", TENTH)),
    ("residual_norms", scaled("printed_first_relative_bound", TENTH)),
    ("residual_norms", derivation_fails("first_approach_norms")),
    ("first_approach_1982", disagrees("residuals")),
    ("first_approach_1982", disagrees("changed_residue")),
    ("changed_residue", nothing_is_zero),
    ("changed_error", derivation_fails("first_approach")),
    ("changed_matrix_error", derivation_fails("first_approach")),
    ("changed_norm", scaled("strict_first_bound", 2)),
    ("changed_norm", scaled("printed_first_bound", 2)),
    ("relative_error_1982", scaled("printed_first_relative_bound", TENTH)),
    ("relative_error_1982", derivation_fails("first_approach_norms")),
    ("special_case", replace(theory, "printed_first_relative_bound", lambda a, r, d=None: 1 if d is None else 2)),
    ("two_parts", replace(linalg, "inv", lambda a, pivot=False: INV(a + a, pivot))),
    ("first_multiplier", scaled("lower_factor", 2)),
    ("reduced_entry", nothing_is_zero),
    ("one_entry", nothing_is_zero),
    ("one_entry", derivation_fails("one_step")),
    ("one_entry", replace(derivation, "printed_entry_error", lambda: derivation.EPSILON)),
    ("blocks", replace(theory, "trailing", lambda a, k, columns=True: a)),
    ("blocks", replace(checks, "BLOCKS", {**checks.BLOCKS, 2: checks.BLOCKS[1]})),
    ("blocks", nothing_is_reduced),
    ("available", replace(checks.Sample, "step_errors", huge_errors)),
    ("right_side_step_1982", nothing_is_zero),
    ("after_the_first_step", nothing_is_reduced),
    ("compounded", scaled("lower_factor", 2)),
    ("compounded", derivation_fails("reductions")),
    ("second_step", replace(checks.Sample, "step_errors", no_errors)),
    ("second_step_1982", disagrees("one_entry")),
    ("second_step_1982", disagrees("second_step")),
    ("stages_defined", replace(procedure, "reduce", lambda a, pivot: REDUCE(a + a, pivot))),
    ("upper_triangular", nothing_is_reduced),
    ("triangular_right_side", nothing_is_reduced),
    ("perturbation_defined", replace(checks, "inverse_of", lambda a: a)),
    ("perturbation_defined", replace(checks, "inverse_of", lambda a: 2 * INVERSE_OF(a))),
    ("backward", scaled("strict_perturbation_bounds", HUNDREDTH)),
    ("before_68_1982", replace(derivation, "line_before_68", lambda brackets=True: derivation.A)),
    ("perturbed_solution", derivation_fails("perturbed_system")),
    ("only_back_substitution", replace(procedure, "transform", lambda triangular, right: (right + right,))),
    ("only_back_substitution", replace(procedure, "triangularize", lambda a, pivot=False: TRIANGULARIZE(a + a, pivot))),
    ("triangular_system", nothing_is_zero),
    ("last_row", nothing_is_zero),
    ("second_row", LEFTOVER),
    ("second_row", replace(derivation, "printed_75", lambda: derivation.EPSILON)),
    ("second_row_1982", disagrees("second_row")),
    ("second_equation_1982", LEFTOVER),
    ("first_row", replace(derivation, "printed_before_78", lambda: derivation.EPSILON)),
    ("first_row", replace(derivation, "first_row", lambda a, b, x, y: b)),
    ("first_equation", LEFTOVER),
    ("assembled_1982", LEFTOVER),
    ("assembled_1982", replace(checks, "_assembled", always(False))),
    ("right_side_three", replace(theory, "right_side_weights", lambda n: np.ones(n, dtype=object))),
    ("triangular_n", ONES),
    ("triangular_1982", disagrees("right_side_three")),
    ("weights_counted", ONES),
    ("weights_counted", derivation_fails("back_substitution_weights")),
    ("weights_counted", scaled("printed_back_substitution_error", HUNDREDTH)),
    ("weights_counted", scaled("right_side_weights", 2)),
    ("factored_1982", replace(checks, "_factored", always(False))),
    ("factored_1982", ONES),
    ("columns_again", disagrees("columns_of_the_inverse")),
    ("resultant_error", derivation_fails("two_systems")),
    ("resultant_error", derivation_fails("perturbed_system")),
    ("letter_d", replace(checks, "terms_of_96", lambda: (2.0, 1.0, 1.0))),
    ("letter_d", replace(checks, "terms_of_96", lambda: (1.0, 1.0, 4.0))),
    ("computation", replace(checks, "operations", lambda n: (n**3, n**2))),
    ("flow_chart", replace(procedure, "run", lambda a: changed(RUN(a), bound=0))),
    ("flow_chart", replace(procedure, "resultant_errors", lambda first, second: first)),
    ("matrix", replace(example, "MATRIX", (("1", "1", "1"), ("1", "1", "1.001"), ("0", "1", "2")))),
    ("matrix", replace(example, "MATRIX", (("1.0001", "0", "0"), ("0", "1", "0"), ("0", "0", "1")))),
    ("actual_norms", replace(checks, "FloatFormat", lambda base, t: FloatFormat(base, min(t, 10)))),
    ("conservative", claims_fail("above")),
    ("conservative", printed(error=example.PRINTED["bound"])),
    ("same_mantissa", printed(bound=("3.706e-2", "3.706e-4", "3.705e-7"))),
    ("same_mantissa", replace(example.Column, "same_digits", False)),
    ("decreasing", claims_fail("decreases")),
    ("decreasing", printed(bound=FLAT)),
    ("claims_1982", claims_fail("decreases")),
    ("claims_1982", printed(bound=FLAT)),
]


@pytest.mark.parametrize(("name", "change"), DISAGREE)
def test_a_check_that_agrees_can_disagree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {True}
    change(patch)
    faults.check_disagrees(FUNCTIONS[name])


def sizes_are_printed(patch):
    """Steps with sizes in place of signs."""
    steps = checks._printed_steps
    patch.setattr(
        checks, "_printed_steps", lambda sample, right: ((e, sizes, sizes) for e, _, sizes in steps(sample, right))
    )


def bounds_are_printed(patch):
    patch.setattr(theory, "printed_triangularization_error", theory.triangularization_bounds)
    patch.setattr(theory, "printed_right_side_error", theory.right_side_bounds)


def as_computed(column):
    """The first reading of a column is what is printed."""
    readings = example.bound_readings() if column == "bound" else example.error_readings()
    return {column: tuple(f"{value:.3e}" for value in readings[0].values)}


def reproduced(*columns):
    def apply(patch):
        printed(**{key: value for column in columns for key, value in as_computed(column).items()})(patch)

    return apply


EQUAL = replace(checks, "held", always(checks.Held(5, 0, 1.0, 1.0)))
ALREADY_TRIANGULAR = replace(
    checks, "samples", lambda: (checks.Sample(checks.FOUR.array([[2, 1, 5], [0, 3, 7], [0, 0, 4]]), False),)
)

#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("reference_33", replace(checks, "CHECKS", {"hung1984.II.eq29": FUNCTIONS["columns_of_the_inverse"]})),
    ("reference_33", replace(checks, "quote", always("obtained by solving (33) $n$ times"))),
    ("changed_error_1982", replace(checks, "CHECKS", {"hung1982.III.eq43": FUNCTIONS["changed_error_1982"]})),
    ("changed_error_1982", replace(checks, "quote", always("numbered (42)"))),
    ("relative_error", replace(checks, "_relative_equality", lambda: (5, 5, 5))),
    ("practicality", replace(experiment, "BETTER", ("Higham", "ball"))),
    ("practicality", scaled("residual", 2)),
    ("one_epsilon", all_of(sizes_are_printed, replace(derivation, "entry_error", lambda: derivation.EPSILON * 0))),
    ("errors_of_the_first_step", sizes_are_printed),
    ("error_matrix_of_the_first_step", sizes_are_printed),
    ("errors_of_the_second_step", sizes_are_printed),
    ("right_side_errors", sizes_are_printed),
    ("right_side_errors_of_the_second_step", sizes_are_printed),
    ("right_side_errors_of_the_second_step_1982", sizes_are_printed),
    ("errors_of_the_first_step_1982", all_is_zero),
    ("right_side_definition", all_is_zero),
    ("right_side_step", all_is_zero),
    ("right_side_second_step", all_is_zero),
    ("after_the_first_step_1982", nothing_is_reduced),
    ("triangularization_error", bounds_are_printed),
    ("right_side_error", bounds_are_printed),
    ("triangularization_errors_1982", bounds_are_printed),
    ("partial_matrix", replace(checks, "quote", always("$A_i(k)=diag(0,X)$, $X$ the $(n-i)$x$(n-i)$ block"))),
    ("partial_matrix_1982", replace(checks, "_partial_size", lambda n, k: n - 1)),
    ("triangularization_norm", EQUAL),
    ("right_side_norm", EQUAL),
    ("norms_1982", EQUAL),
    ("triangular_matrix", nothing_is_reduced),
    ("before_68", replace(derivation, "line_before_68", lambda brackets=True: derivation.A * 0)),
    ("computed_inverse", replace(checks, "inverse_of", lambda a: checks.samples()[0].reduction.solution)),
    ("first_row_with_hats", all_is_zero),
    ("second_equation", replace(derivation, "leftover", lambda number, hats=True: 0)),
    ("assembled", replace(checks, "_assembled", always(True))),
    ("factored_three", replace(checks, "_factored", always(True))),
    ("factored", replace(checks, "_factored", always(True))),
    ("weights", replace(checks, "_cases_85", lambda k, j, n: (k == j, k < j))),
    ("weights_1982", replace(theory, "printed_weights_1982", theory.back_substitution_weights)),
    (
        "right_side_inequality",
        replace(theory, "printed_back_substitution_right_error", lambda right, beta: np.zeros_like(right)),
    ),
    ("two_sets", replace(checks, "_adds", always(True))),
    ("error_norm", replace(checks, "COUNTEREXAMPLES", {"(96)": ([[2, 1], [1, 3]], checks.FOUR, False)})),
    ("letter_e", replace(checks, "of_example", lambda: (checks.samples()[0], 0.0))),
    ("number_of_the_chart", replace(ledger, "load_statements", lambda: [e for e in INVENTORY if e.chapter == "II"])),
    ("relative_error_norm", replace(checks, "column_sum_norm", always(Fraction(1)))),
    ("flow_chart_1982", ALREADY_TRIANGULAR),
    ("proposed_three", reproduced("bound")),
    ("proposed_five", reproduced("bound")),
    ("proposed_eight", reproduced("bound")),
    ("actual_three", reproduced("error")),
    ("actual_five", reproduced("error")),
    ("actual_eight", reproduced("error")),
    ("table_1", reproduced("bound", "error")),
    ("row_three", reproduced("bound", "error")),
    ("row_five", reproduced("bound", "error")),
    ("row_eight", reproduced("bound", "error")),
    ("reference_to_figure", replace(checks, "quote", always("procedure of Figure III-1"))),
]


@pytest.mark.parametrize(("name", "change"), AGREE)
def test_a_check_that_disagrees_can_agree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {False}
    change(patch)
    faults.check_agrees(FUNCTIONS[name])


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("table_1", reproduced("bound")),
        ("table_1", reproduced("error")),
        ("row_five", reproduced("bound")),
        ("one_epsilon", sizes_are_printed),
        ("one_epsilon", replace(derivation, "entry_error", lambda: derivation.EPSILON * 0)),
        ("flow_chart_1982", all_of(ALREADY_TRIANGULAR, replace(checks, "_by_boxes", lambda: (1, 2, 1)))),
    ],
)
def test_half_of_it_is_not_enough(patch, name, change):
    change(patch)
    assert FUNCTIONS[name]().agrees is False


@pytest.mark.parametrize(
    ("name", "change", "verdict"),
    [
        ("reference_33", replace(checks, "CHECKS", {}), Verdict.WRONG),
        ("changed_error_1982", derivation_fails("first_approach"), Verdict.WRONG),
        ("relative_error", replace(checks, "_relative_equality", lambda: (0, 4, 5)), Verdict.WRONG),
        ("errors_of_the_first_step_1982", nothing_is_zero, Verdict.WRONG),
        ("right_side_definition", nothing_is_zero, Verdict.WRONG),
        ("right_side_step", nothing_is_zero, Verdict.WRONG),
        ("right_side_second_step", nothing_is_zero, Verdict.WRONG),
        ("after_the_first_step_1982", replace(procedure, "reduce", lambda a, pivot: REDUCE(a, True)), Verdict.MISPRINT),
        ("partial_matrix", replace(checks, "_partial_size", lambda n, k: n), Verdict.WRONG),
        ("partial_matrix_1982", replace(checks, "_partial_size", lambda n, k: n), Verdict.WRONG),
        ("triangularization_norm", scaled("printed_triangularization_norm", HUNDREDTH), Verdict.WRONG),
        ("right_side_norm", scaled("printed_right_side_norms", HUNDREDTH), Verdict.WRONG),
        ("before_68", replace(derivation, "line_before_68", lambda brackets=True: derivation.A), Verdict.WRONG),
        ("computed_inverse", replace(theory, "bound", always(Fraction(0))), Verdict.WRONG),
        ("first_row_with_hats", nothing_is_zero, Verdict.WRONG),
        ("first_row_with_hats", all_of(disagrees("first_row")), Verdict.WRONG),
        ("letter_e", scaled("printed_bracket", HUNDREDTH), Verdict.WRONG),
        ("number_of_the_chart", replace(ledger, "load_statements", lambda: []), Verdict.INCONSISTENT),
        ("second_equation", LEFTOVER, Verdict.WRONG),
        ("assembled", replace(checks, "_assembled", always(False)), Verdict.WRONG),
        ("factored_three", replace(checks, "_factored", always(False)), Verdict.WRONG),
        ("factored", ONES, Verdict.WRONG),
        ("weights", derivation_fails("back_substitution_weights"), Verdict.WRONG),
        ("two_sets", derivation_fails("two_systems"), Verdict.INCONSISTENT),
        ("two_sets", derivation_fails("transfer_cost"), Verdict.INCONSISTENT),
        ("error_norm", scaled("perturbation_bounds", HUNDREDTH), Verdict.INCONSISTENT),
        ("relative_error_norm", scaled("printed_bracket", HUNDREDTH), Verdict.WRONG),
        ("flow_chart_1982", replace(checks.Sample, "step_errors", huge_errors), Verdict.WRONG),
        ("reference_to_figure", replace(checks, "CHECKS", {}), Verdict.INCONSISTENT),
    ],
)
def test_a_slip_is_one_only_if_what_follows_is_right(patch, name, change, verdict):
    change(patch)
    assert FUNCTIONS[name]().verdict is verdict


def test_every_check_is_among_those_that_can_come_out_otherwise():
    lost = {"right_side_definition_1982"}  # from the scan
    assert {name for name, _ in (*DISAGREE, *AGREE)} == set(FUNCTIONS) - lost


def test_findings_are_the_same_again(rows):
    faults.forget(checks)
    faults.check_again(rows, checks.CHECKS, "one_epsilon", "two_sets", "error_norm", "weights_counted")
