"""gpbnb.ledger.checks.rounding: each entry of the sections has a check, and each check can come out otherwise."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import cache

import faults
import numpy as np
import pytest
from faults import all_of, always, breaks, finding, replace, times

from gpbnb import ledger
from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.arithmetic.rational import row_sum_norm
from gpbnb.ledger.checks import rounding as checks
from gpbnb.ledger.finding import Verdict
from gpbnb.rounding import derivation, experiment, theory

INVENTORY = faults.INVENTORY
ENTRIES = (
    *ledger.select(INVENTORY, "hung1984", "II", range(1, 10)),
    *ledger.select(INVENTORY, "hung1982", "III", (1, 2, 3, 4, 6, 7, 8, 9)),
)
PRINTED = {entry.id: entry.printed for entry in ENTRIES}
FUNCTIONS = faults.functions(checks.CHECKS)
REMEMBERING = (checks, experiment)


@pytest.fixture(scope="module")
def rows():
    return faults.examined(ENTRIES)


# -- the present state ----------------------------------------------------------------------------


def test_every_entry_of_the_sections_has_a_check_here_and_none_is_elsewhere():
    assert set(checks.CHECKS) == set(PRINTED)
    assert len(PRINTED) == 143
    # Sections are numbered as in the documents; the entry of (5)-(16) of 1982 spans sections 3 to 5.
    later = [entry for entry in INVENTORY if entry.id.startswith(("hung1984.II.", "hung1982.III."))]
    assert all(int(entry.section.split(".")[0]) > 9 for entry in later if entry.id not in PRINTED)


def test_verdicts_by_document(rows):
    """The present state: to be changed knowingly."""
    counts = {
        document: Counter(row.outcome for row in rows if row.statement.document == document)
        for document in ("hung1984", "hung1982")
    }
    assert counts["hung1984"] == {
        "verified": 60,
        "misprint": 8,
        "wrong": 7,
        "inconsistent": 1,
        "ocr": 1,
        "unverifiable": 4,
        "answered": 1,
    }
    assert counts["hung1982"] == {
        "verified": 38,
        "misprint": 10,
        "wrong": 7,
        "ocr": 2,
        "unverifiable": 3,
        "answered": 1,
    }


def test_which_are_not_right_as_printed(rows):
    found = {verdict: {row.statement.id for row in rows if row.finding.verdict is verdict} for verdict in Verdict}
    implied = {"s9-2.claim-28-implies", "s9-2.unnumbered-p2-p3"}
    chain = {*implied, "eq30", "eq31"}
    built_on_it = {"s9-2.claim-24-and-31", "s9-2.example-1", "s9-2.example-2"}
    assert found[Verdict.WRONG] == {f"hung1984.II.{place}" for place in chain | built_on_it} | {
        f"hung1982.III.{place}"
        for place in ("s6.unnumbered-4-term-bound", "eq18", "eq30-31", "s9-2.claim-24-and-31", "s9-2.examples-1-2")
    } | {f"hung1982.III.{place}" for place in implied}
    assert found[Verdict.INCONSISTENT] == {"hung1984.II.eq20"}
    assert found[Verdict.OCR] == {"hung1984.II.s8.text-after-24", "hung1982.III.eq2", "hung1982.III.s7.norm-property-v"}
    assert found[Verdict.UNVERIFIABLE] == {
        "hung1984.II.s1.claim-background",
        "hung1984.II.s1.claim-main-activity",
        "hung1984.II.s1.claim-only-rounding",
        "hung1982.III.s1.claim-only-rounding",
        "hung1982.III.s1.claim-background",
        "hung1982.III.s1.claim-main-activity",
        "hung1984.II.eq27",
    }
    assert found[Verdict.OPEN] == set()


def test_no_finding_is_without_a_note_where_it_differs(rows):
    faults.check_texts(rows)


def test_findings_are_the_same_again(rows):
    faults.forget(*REMEMBERING)
    faults.check_again(rows, checks.CHECKS, "relative_dot", "sum_bound_1984", "entry_bound", "example_8_x")


# -- numbers in the findings ----------------------------------------------------------------------


def test_findings_quote_the_computed_numbers(rows):
    assert ".56568" in finding(rows, "hung1984.II.s3.example-8-eps").recomputed
    assert ".74073" in finding(rows, "hung1984.II.s4.example-13-eps-c").recomputed
    assert "1000 times" in finding(rows, "hung1984.II.eq31").recomputed
    assert "factor of 400" in finding(rows, "hung1984.II.s9-2.example-1").recomputed
    assert "2.5%" in finding(rows, "hung1984.II.eq18").note
    assert "1.13 times" in finding(rows, "hung1984.II.eq20").note
    assert "1.25 times" in finding(rows, "hung1982.III.eq20").note
    assert r"\|Ax\|=2" in finding(rows, "hung1984.II.eq22").note.replace("$", "")
    assert "$u=0.7655$, $v=-0.433$" in finding(rows, "hung1984.II.s2.claim-u-v-same-sign").note


# -- each check can come out otherwise ------------------------------------------------------------


@pytest.fixture
def patch(monkeypatch):
    """Change the code, with small surveys and nothing remembered; undone, and forgotten, afterwards."""
    with faults.forgetting(monkeypatch, *REMEMBERING):
        survey = experiment.survey.__wrapped__
        monkeypatch.setattr(experiment, "SURVEYED", experiment.SURVEYED[:2] + experiment.SURVEYED[8:12])
        monkeypatch.setattr(experiment, "survey", cache(lambda trial: survey(trial, repeats=3)))
        yield monkeypatch


FIVE = FloatFormat(10, 5)
SPLIT, ROUND = FloatFormat.split, FloatFormat.round


def five(patch):
    patch.setattr(checks, "FOUR", FIVE)


def five_chopped(patch):
    patch.setattr(checks, "FOUR_CHOPPED", FloatFormat(10, 5, Rounding.CHOP))


def chop_is_round(patch):
    patch.setattr(checks, "FOUR_CHOPPED", checks.FOUR)


def round_is_chop(patch):
    patch.setattr(checks, "FOUR", checks.FOUR_CHOPPED)


def coarse(patch):
    """Round to a digit less."""
    patch.setattr(FloatFormat, "round", lambda fmt, x: ROUND(FloatFormat(fmt.base, fmt.precision - 1, fmt.rounding), x))


def split_too_low(patch):
    """u = 0.0ddd: the exponent one too high."""

    def low(fmt, x):
        u, v, e = SPLIT(fmt, x)
        return u / fmt.base, v / fmt.base, e + 1

    patch.setattr(FloatFormat, "split", low)


def split_up(patch):
    """v of the other sign."""

    def up(fmt, x):
        u, v, e = SPLIT(fmt, x)
        unit = Fraction(1 if u > 0 else -1)
        return (u + unit / fmt.base**fmt.precision, v - unit, e) if v else (u, v, e)

    patch.setattr(FloatFormat, "split", up)


def half_unit(patch):
    patch.setattr(FloatFormat, "unit_roundoff", property(lambda fmt: Fraction(1, 4 * fmt.base ** (fmt.precision - 1))))


def derivation_fails(name):
    return breaks(derivation, name)


def scaled(name, factor):
    return times(theory, name, factor)


def huge_claim(*given):
    return theory.chain_bound(*given) * 10**9


ROUNDED_SUM, QUOTIENT = derivation.rounded_sum, derivation.quotient_error


def wrongly_rounded_sum(n):
    """The last term added without rounding."""
    total, x, eps = ROUNDED_SUM(n)
    return total - x[-1] * eps[-1], x, eps


TENTH = Fraction(1, 10)
NO_VIOLATION = experiment.Tally("(31)", 5, 0, 0.5, 0.1, checks.cancelling_product())
#: For each check that agrees, changes of the code under which it must not.
DISAGREE = [
    ("approach", replace(experiment.theory, "probabilistic_sum_factor", lambda n, beta, failure=0.01: n * beta)),
    ("approach", scaled("strict_dot_bound", TENTH)),
    ("rounding_or_chopping", half_unit),
    ("rounding_or_chopping", five_chopped),
    ("small_sample", replace(checks, "GYROS", 100)),
    ("more_reliable", scaled("strict_dot_bound", TENTH)),
    ("more_reliable", replace(checks, "beyond_the_law", lambda: (0.0, 0.01))),
    ("infinite_digits", replace(checks, "RADICAND", 4)),
    ("representation", split_too_low),
    ("example_2a", five),
    ("example_2a", split_too_low),
    ("example_2b", five),
    ("example_2b", split_up),
    ("rounding_rule", round_is_chop),
    ("rounding_rule", coarse),
    ("same_sign", split_up),
    ("example_3a", round_is_chop),
    ("example_3a", five),
    ("example_3b", coarse),
    ("errors_defined", round_is_chop),
    ("absolute_bound", round_is_chop),
    ("absolute_bound", coarse),
    ("least_size", split_too_low),
    ("least_size", split_up),
    ("unit_error", half_unit),
    ("unit_error", round_is_chop),
    ("unit_error", coarse),
    ("unit_error", derivation_fails("one_rounding")),
    ("example_8_beta", five),
    ("example_8_beta", half_unit),
    ("example_8_rounded", round_is_chop),
    ("example_8_errors", round_is_chop),
    ("example_8_errors", five),
    ("chopping_rule", chop_is_round),
    ("chopping_error", chop_is_round),
    ("chopping_error", five_chopped),
    ("chopping_error_defined", chop_is_round),
    ("unit_chopping_error", five_chopped),
    ("unit_chopping_error", coarse),
    ("unit_chopping_error", derivation_fails("one_rounding")),
    ("chopping_doubles", half_unit),
    ("example_13_beta", five_chopped),
    ("example_13_x", chop_is_round),
    ("example_13_x", five),
    ("example_13_errors", five_chopped),
    ("one_operation", half_unit),
    ("as_1984", all_of(half_unit, replace(checks, "_one_operation", lambda: (1, TENTH)))),
    ("as_1984", all_of(chop_is_round, replace(checks, "_one_operation", lambda: (1, TENTH)))),
    ("as_1984", replace(checks, "_one_operation", lambda: (1, Fraction(2)))),
    ("four_terms", replace(derivation, "rounded_sum", wrongly_rounded_sum)),
    ("four_terms_error", replace(derivation, "printed_sum_error", lambda n: derivation.N)),
    ("sum_bound_1984", scaled("printed_sum_bound", TENTH)),
    ("sum_bound_1984", scaled("printed_sum_bound_coarse", TENTH)),
    ("sum_bound_1984", derivation_fails("sums")),
    ("sum_defined", replace(checks, "FloatFormat", lambda base, t: FloatFormat(base, 2))),
    ("quotient_example", replace(derivation, "quotient_error", lambda n, m: QUOTIENT(n, m + 1))),
    ("quotient_defined", replace(checks, "FloatFormat", lambda base, t: FloatFormat(base, 2))),
    ("product_bound_1982", scaled("product_bound", TENTH)),
    ("product_bound_1982", replace(checks, "_count_of", lambda n, m: n + m)),
    ("vector_norm", replace(checks, "max_norm", lambda x: min(abs(x)) if hasattr(x, "ndim") else 7)),
    ("vector_norm", replace(checks, "max_norm", lambda x: sum(map(abs, x)))),
    ("matrix_norm", replace(checks, "column_sum_norm", row_sum_norm)),
    ("matrix_norm_1982", replace(checks, "column_sum_norm", row_sum_norm)),
    ("matrix_norm_1982", replace(checks, "row_sum_norm", lambda a: abs(checks.exact(a)).max())),
    ("matrix_norm_properties", replace(checks, "column_sum_norm", lambda a: abs(a).max())),
    ("matrix_norm_properties", replace(checks, "column_sum_norm", lambda a: (a**2).sum())),
    ("matrix_sum", scaled("matrix_sum_bound", TENTH)),
    ("matrix_sum_1982", scaled("matrix_sum_bound", TENTH)),
    ("matrix_sum_1982", half_unit),
    ("three_products", derivation_fails("dots")),
    ("dot_bound", scaled("dot_bound", TENTH)),
    ("dot_bound", derivation_fails("dots")),
    ("dot_bound", replace(theory, "dot_weights", lambda n: [n] * n)),
    ("relative_dot", scaled("relative_dot_bound", Fraction(1, 100))),
    ("entry_bound", scaled("matmul_entry_bounds", TENTH)),
    ("entry_bound", derivation_fails("dots")),
    ("entry_bound", replace(theory, "dot_weights", lambda n: [n + 1] * n)),
    ("matmul_bound", scaled("chain_bound", Fraction(1, 100))),
    ("matmul_bound", replace(theory, "dot_weights", lambda n: [n + 1] * n)),
    ("matmul_bound", half_unit),
    ("chain_defined", replace(theory, "interfaces", lambda matrices: [1, 1])),
    ("chain_bound", scaled("chain_bound", Fraction(1, 100))),
    ("chain_bound", derivation_fails("chains")),
    ("closing_remark", scaled("chain_bound", 2)),
    (
        "closing_remark",
        replace(theory, "matrix_sum_bound", lambda a, b, beta: beta * a.shape[1]),
    ),
]


@pytest.mark.parametrize(("name", "change"), DISAGREE)
def test_a_check_that_agrees_can_disagree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {True}
    change(patch)
    faults.check_disagrees(FUNCTIONS[name])


def with_e(exponent):
    return replace(FloatFormat, "split", lambda fmt, x: (*SPLIT(fmt, x)[:2], exponent))


def one_left_over(patch):
    """An error with the term that the slip of 1982 leaves over."""
    error, products, eps = derivation.dot_error(3)
    patch.setattr(derivation, "dot_error", lambda n: (error + products[1], products, eps))


def another_left_over(patch):
    error, products, eps = derivation.dot_error(3)
    patch.setattr(derivation, "dot_error", lambda n: (error + products[0], products, eps))


def chains_never_cancel(patch):
    """(31) as large as one likes."""
    patch.setattr(theory, "printed_chain_claim", huge_claim)
    patch.setattr(derivation, "chain_shortcut", lambda: 0)


#: For each check that disagrees, changes under which print and code say the same.
AGREE = [
    ("split", replace(checks, "samples", lambda: (Fraction("765.4567"), Fraction("-0.0123456")))),
    ("split_1982", replace(checks, "splits", lambda x: [SPLIT(checks.FOUR, x)[:2]])),
    ("example_2b_1982", replace(checks, "split_is", always(True))),
    ("carry", round_is_chop),
    ("example_3c", replace(checks, "split_is", always(True))),
    ("examples_3_1982", replace(checks, "split_is", always(True))),
    ("claim_before_6", replace(checks, "samples", lambda: (Fraction(5), Fraction("0.1")))),
    ("reference_1", replace(checks, "forms_of_1", lambda x: [SPLIT(checks.FOUR, x)[::2]])),
    ("meaning_of_beta", replace(FloatFormat, "unit_roundoff", Fraction(1))),
    ("example_8_x", replace(checks, "split_is", always(True))),
    ("example_8_1982", replace(checks, "split_is", always(True))),
    ("example_13_parameters", with_e(4)),
    ("example_13_1982", with_e(4)),
    ("sum_bound_1982", replace(theory, "printed_sum_bound_1982", theory.printed_sum_bound)),
    ("product_bound_1984", replace(checks, "_count_of", lambda n, m: n + m + 1)),
    ("norm_property_v", replace(checks, "_submultiplicative", lambda: (5, 5, 5))),
    ("beta_after_24", replace(FloatFormat, "unit_roundoff", Fraction(1))),
    ("three_products_1982", one_left_over),
    ("chain_shortcut", chains_never_cancel),
    ("chain_error", chains_never_cancel),
    ("reference_28", replace(checks, "CHECKS", {"hung1982.III.eq38": FUNCTIONS["matmul_bound"]})),
    ("reference_28", replace(checks, "quote", always("the result of (28) implies"))),
    ("examples", replace(theory, "printed_example_bound", theory.example_bound)),
]


@pytest.mark.parametrize(("name", "change"), AGREE)
def test_a_check_that_disagrees_can_agree(rows, patch, name, change):
    assert {found.agrees for found in faults.findings_of(rows, checks.CHECKS, name)} == {False}
    change(patch)
    faults.check_agrees(FUNCTIONS[name])


@pytest.mark.parametrize(
    "change",
    [
        replace(theory, "printed_chain_claim", huge_claim),
        replace(derivation, "chain_shortcut", lambda: 0),
        all_of(
            replace(derivation, "chain_shortcut", lambda: 0),
            replace(checks, "tallies", lambda trial: {"(31)": NO_VIOLATION}),
        ),
    ],
)
def test_the_claim_on_chains_needs_the_algebra_the_sweep_and_the_worked_example(patch, change):
    change(patch)
    assert FUNCTIONS["chain_shortcut"]().verdict is Verdict.WRONG


@pytest.mark.parametrize("n", [2, 4, 50])
def test_the_scatter_of_a_standard_deviation(n):
    """Against simulation, to five standard errors."""
    found = np.random.default_rng(n).standard_normal((4000, n)).std(axis=1, ddof=1).std()
    assert checks.scatter(n) == pytest.approx(found, rel=5 / np.sqrt(2 * 4000) * 1.5)


def test_a_split_is_the_printed_one_in_all_its_parts():
    assert checks.split_is("765.4567", ".7654", ".567e-1", 3)
    assert not checks.split_is("765.4567", ".7655", ".567e-1", 3)
    assert not checks.split_is("765.4567", ".7654", ".568e-1", 3)
    assert not checks.split_is("765.4567", ".7654", ".567e-2", 2)
    assert not checks.split_is("765.4567", ".07654", ".567e-1", 4)


@pytest.mark.parametrize(
    ("name", "change", "verdict"),
    [
        ("split", split_too_low, Verdict.WRONG),
        ("example_3c", round_is_chop, Verdict.WRONG),
        ("examples_3_1982", five, Verdict.WRONG),
        ("claim_before_6", split_too_low, Verdict.WRONG),
        ("reference_1", replace(checks, "forms_of_1", lambda x: [(Fraction(1, 2), 4)]), Verdict.WRONG),
        ("meaning_of_beta", half_unit, Verdict.WRONG),
        ("example_8_x", round_is_chop, Verdict.WRONG),
        ("example_8_1982", round_is_chop, Verdict.WRONG),
        ("example_13_parameters", five_chopped, Verdict.WRONG),
        ("example_13_1982", five_chopped, Verdict.WRONG),
        ("norm_property_v", replace(checks, "_submultiplicative", lambda: (3, 0, 5)), Verdict.WRONG),
        ("reference_28", replace(checks, "CHECKS", {}), Verdict.WRONG),
        ("three_products_1982", another_left_over, Verdict.WRONG),
        ("relative_dot", scaled("relative_dot_bound", Fraction(1, 100)), Verdict.OPEN),
    ],
)
def test_a_slip_is_one_only_if_what_follows_is_right(patch, name, change, verdict):
    change(patch)
    assert FUNCTIONS[name]().verdict is verdict


def test_every_check_is_among_those_that_can_come_out_otherwise():
    tried = {name for name, _ in (*DISAGREE, *AGREE)}
    assert set(FUNCTIONS) - tried == {
        "background",
        "only_rounding",
        "lost_page",
    }  # nothing to compare: their data is not there
