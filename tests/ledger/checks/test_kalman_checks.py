"""gpbnb.ledger.checks.kalman: each entry of sections 12 and 13 has a check, and each check can come out otherwise."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import faults
import numpy as np
import pytest
import sympy as sp
from faults import all_of, always, breaks, finding, replace

from gpbnb import ledger
from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.display.derivation import Derivation, Step
from gpbnb.kalman import contraction, derivation, exact_step, report_bounds, smallest
from gpbnb.ledger.checks import kalman as checks
from gpbnb.ledger.finding import Verdict

INVENTORY = faults.INVENTORY
ENTRIES = (
    *ledger.select(INVENTORY, "hung1984", "II", (12, 13, 14)),
    *ledger.select(INVENTORY, "hung1982", "III", (12, 13)),
)
FUNCTIONS = faults.functions(checks.CHECKS)


@pytest.fixture(scope="module")
def rows():
    return faults.examined(ENTRIES)


# -- the present state ----------------------------------------------------------------------------


def test_every_entry_of_the_sections_has_a_check_here_and_no_other_has():
    assert set(checks.CHECKS) == {entry.id for entry in ENTRIES}
    assert len(ENTRIES) == 114


def test_verdicts_by_document(rows):
    """The present state: to be changed knowingly."""
    counts = {
        document: Counter(row.outcome for row in rows if row.statement.document == document)
        for document in ("hung1984", "hung1982")
    }
    assert counts["hung1984"] == {
        "verified": 20,
        "misprint": 7,
        "wrong": 29,
        "inconsistent": 3,
        "ocr": 1,
        "unverifiable": 3,
        "answered": 2,
    }
    assert counts["hung1982"] == {
        "verified": 11,
        "misprint": 1,
        "wrong": 28,
        "inconsistent": 1,
        "ocr": 1,
        "unverifiable": 2,
        "answered": 2,
        "open": 3,
    }


def test_no_finding_is_without_a_note_where_it_differs(rows):
    faults.check_texts(rows)


def test_findings_quote_the_computed_numbers(rows):
    for place, number in (
        ("eq105", "333 times"),
        ("eq108", "222 times"),
        ("eq125", "125 times"),
        ("eq104", "2.14 times"),
        ("s12.example-first-coefficient", "2.5860"),
        ("s12.example-second-coefficient", "4.0775"),
        ("s12.example-9-digits", "10; for the printed β 10"),
        ("s12.example-17-digits", "16; for the printed β 17"),
        ("s12.example-criterion", "13 and 20 digits"),
        ("s13.remark-2", "10 decimal digits or 32 bits"),
    ):
        assert number in finding(rows, f"hung1984.II.{place}").recomputed
    assert r"\cdot84$" in finding(rows, "hung1984.II.s12.example-second-coefficient").note
    assert "7n+4m+6$ or $7n+3m+8" in finding(rows, "hung1984.II.s12.example-first-coefficient").note


# -- each check can come out otherwise ------------------------------------------------------------


@pytest.fixture
def patch(monkeypatch):
    """Change the code, with nothing remembered; undone, and forgotten, afterwards."""
    with faults.forgetting(monkeypatch, checks):
        yield monkeypatch


RIGHT = Derivation((Step("right", sp.Integer(1), sp.Integer(1)),) * 12)


def fails(name):
    return breaks(derivation, name)


STEP = exact_step.exact_step
no_excess = replace(checks, "excess", always(0.5))
mild = replace(smallest, "ratios", always(smallest.Ratios(0.5, 0.5, 0.5)))


def other_step(**changed):
    """An exact step that errs in some of its parts."""

    def step(*arguments):
        found = STEP(*arguments)
        return found._replace(**{name: getattr(found, name) * factor for name, factor in changed.items()})

    return replace(exact_step, "exact_step", step)


#: For each check that agrees, changes of the code under which it must not.
DISAGREE = [
    ("estimate", other_step(x=2)),
    ("gains", other_step(gain=2)),
    ("gains", fails("contraction")),
    ("prediction_recalled", replace(checks, "variance", always(sp.Integer(0)))),
    ("recalled", other_step(P=2)),
    ("recalled", other_step(transition=2)),
    ("recalled", replace(checks, "predicted", always(False))),
    ("asterisk_1982", replace(checks, "loops_close", always(False))),
    ("asterisk_1982", replace(checks, "asterisk", lambda: checks.compare(True, "the same"))),
    ("inverse_of_r", replace(FloatFormat, "unit_roundoff", Fraction(1, 4000))),
    ("closed_loop", other_step(transition=2)),
    ("closed_loop", other_step(gain=2)),
    ("rewritten", replace(derivation, "ONCE", derivation.TWICE)),
    ("rewritten", fails("report")),
    ("unrolled", other_step(transition=2)),
    ("unrolled", replace(checks, "unfolds", always(False))),
    ("unrolled", fails("propagated")),
    ("pattern", fails("general")),
    ("dependence", replace(report_bounds, "state_bound", lambda x, B, beta, counts: beta * counts.first * x)),
    ("dependence", replace(report_bounds, "state_bound", lambda x, B, beta, counts: counts.first * x + B)),
    ("formula_8", replace(FloatFormat, "unit_roundoff", Fraction(1, 2000))),
    ("steps_of_a_year", replace(checks, "STEP", 20)),
    ("steps_of_a_year", replace(report_bounds, "EXAMPLE", (3_153_601, 10, 2))),
    ("one_term", replace(report_bounds, "coefficients", always(report_bounds.Coefficients(1, 10**9)))),
    ("remark_1", replace(checks, "refined", always((240, 1, 20.0)))),
    ("remark_1", replace(checks, "refined", always((240, 0, 2000.0)))),
    ("remark_1", replace(contraction, "state_error_bound", lambda bound: np.zeros(2))),
    ("remark_1", replace(contraction, "covariance_error_bound", lambda bound: np.full((2, 2), 1e9))),
    ("remark_1", fails("contraction")),
    ("remark_1", fails("recursion")),
    ("remark_2", replace(checks, "year_again", always(False))),
    ("remark_2", replace(checks, "GOAL", Fraction(1, 10**20))),
]


@pytest.mark.parametrize(("name", "change"), DISAGREE)
def test_a_check_that_agrees_can_disagree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {True}
    change(patch)
    faults.check_disagrees(FUNCTIONS[name])


#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("model_equations", replace(checks, "DIMENSIONS", (3, 1))),
    ("prediction", replace(checks, "predicted", always(True))),
    ("covariance", replace(checks, "quote", always("$P_k=P_{kp}-K_kH_kP_{kp}$"))),
    *(
        (name, no_excess)
        for name in (
            "rounded_prediction",
            "rounded_covariance",
            "covariance_bound",
            "rounded_gain",
            "gain_error",
            "gain_bound",
            "rounded_loop",
            "rounded_input",
            "rounded_state",
            "three_steps_3n",
            "three_steps_bounded",
            "four_steps_bounded",
            "main_result",
            "others_of_1982",
        )
    ),
    (
        "rounded_loop_1982",
        all_of(
            no_excess,
            replace(checks, "M", checks.N),
            replace(derivation, "M", derivation.N),
            replace(checks, "LAST_OF_112", derivation.PHI),
        ),
    ),
    (
        "rounded_input_1982",
        all_of(
            no_excess,
            replace(derivation, "gain_error", lambda: (3 * checks.N + 2 * checks.M + 3) * derivation.KZ),
            replace(derivation, "report", lambda: RIGHT),
        ),
    ),
    ("unrolled_1982", other_step(gain=0, x=0, transition=0)),
    ("defined_again", replace(derivation, "ONCE", (5 * checks.N + 3 * checks.M + 4, 4 * checks.N + 3 * checks.M + 3))),
    ("counted_twice", replace(derivation, "TWICE", derivation.ONCE)),
    (
        "three_steps_3m",
        all_of(
            no_excess,
            replace(derivation, "count_input", lambda c, d: sp.expand(3 * c) - 3 * checks.M - 1),
            replace(derivation, "general", lambda: RIGHT),
        ),
    ),
    ("norm_with_minus", replace(derivation, "count_input", lambda c, d: sp.expand(4 * derivation.K * c))),
    ("assumptions", replace(checks, "column_sum_norm", always(Fraction(1)))),
    ("usefulness", mild),
    (
        "first_coefficient",
        replace(report_bounds, "coefficients", always(report_bounds.Coefficients(84 * 3_153_600, 12949 * 10**12))),
    ),
    (
        "second_coefficient",
        replace(report_bounds, "coefficients", always(report_bounds.Coefficients(1, 12949 * 10**12))),
    ),
    (
        "first_beta",
        replace(report_bounds, "coefficients", always(report_bounds.Coefficients(Fraction(1, 37_750_000), 1))),
    ),
    ("first_beta_1982", replace(report_bounds, "coefficients", always(report_bounds.Coefficients(84 * 3_153_600, 1)))),
    ("second_beta", replace(report_bounds, "coefficients", always(report_bounds.Coefficients(1, 12949 * 10**12)))),
    ("first_digits", replace(report_bounds, "coefficients", always(report_bounds.Coefficients(10**8, 1)))),
    ("second_digits", replace(report_bounds, "coefficients", always(report_bounds.Coefficients(1, 12949 * 10**12)))),
    ("criterion", replace(checks, "GOAL", 6606)),
    ("asterisk", replace(smallest, "rounded_step", lambda fmt, case: (STEP(*case).x, None, None))),
    ("word", replace(checks, "quote", always("$k$, the number of iterations"))),
    ("reference_1", replace(checks, "TITLES", {1: "Rounding Errors in Algebraic Process"})),
    ("reference_5", replace(checks, "TITLES", {5: "Introduction to Numerical Computation"})),
    ("reference_7", replace(checks, "CONTRACT", "NA58-34426")),
    ("name_of_the_experiment", replace(checks, "quote", always("one year GP-B operation"))),
]


@pytest.mark.parametrize(("name", "change"), AGREE)
def test_a_check_that_disagrees_can_agree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {False}
    change(patch)
    faults.check_agrees(FUNCTIONS[name])


@pytest.mark.parametrize(
    ("name", "broken"),
    [
        ("rounded_prediction", "report"),
        ("rounded_covariance", "report"),
        ("covariance_bound", "report"),
        ("covariance_bound", "smallest"),
        ("rounded_gain", "report"),
        ("gain_error", "report"),
        ("gain_bound", "smallest"),
        ("rounded_loop", "report"),
        ("rounded_input_1982", "report"),
        ("rounded_input", "report"),
        ("rounded_state", "report"),
        ("three_steps_3n", "general"),
        ("three_steps_bounded", "general"),
        ("four_steps_bounded", "general"),
        ("main_result", "general"),
    ],
)
def test_a_printed_step_needs_its_algebra_too(patch, name, broken):
    no_excess(patch)
    fails(broken)(patch)
    assert FUNCTIONS[name]().verdict is Verdict.WRONG


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("model_equations", other_step(x=2)),
        ("prediction", replace(checks, "variance", always(sp.Integer(0)))),
        ("covariance", other_step(P=2)),
        ("unrolled_1982", other_step(transition=2)),
        ("unrolled_1982", replace(derivation, "TWICE", derivation.ONCE)),
        ("asterisk", other_step(gain=2, transition=3)),
    ],
)
def test_a_slip_is_one_only_if_what_follows_is_right(patch, name, change):
    change(patch)
    assert FUNCTIONS[name]().verdict is Verdict.WRONG


@pytest.mark.parametrize(
    "statement",
    ["(102)", "(104)", "(105)", "(106)", "(107)", "(108)", "(112)", "(113)", "(114)", "(119)", "(124)", "(125)"],
)
def test_every_excess_is_of_the_arithmetic(patch, statement):
    """Where products cancel exactly in forty digits, nothing is exceeded; the others are, in any format."""
    assert checks.excess(statement) > 1
    patch.setattr(checks, "FOUR", FloatFormat(10, 40, Rounding.NEAREST))
    checks.excess.cache_clear()
    assert (checks.excess(statement) > 1) == (statement not in ("(102)", "(106)"))


@pytest.mark.parametrize(
    "only",
    [
        all_of(replace(checks, "M", checks.N), replace(derivation, "M", derivation.N)),
        replace(checks, "LAST_OF_112", derivation.PHI),
    ],
)
def test_both_letters_of_112_count(patch, only):
    no_excess(patch)
    only(patch)
    assert FUNCTIONS["rounded_loop_1982"]().verdict is Verdict.WRONG


def test_the_sums_of_inputs_need_the_newest_one():
    assert checks.unfolds()
    assert not checks.unfolds(newest=False)
    assert checks.inputs_of_124() == [4]


def test_an_unknown_statement_has_no_excess():
    with pytest.raises(KeyError):
        checks.excess("(1)")


def test_every_check_is_among_those_that_can_come_out_otherwise():
    tried = {name for name, _ in (*DISAGREE, *AGREE)}
    # Nothing to compare: their data is not there.
    assert set(FUNCTIONS) - tried == {
        "dimensions",
        "several_approaches",
        "remark_3",
        "remark_4",
        "remark_5",
        "references",
    }
