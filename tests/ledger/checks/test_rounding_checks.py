"""ledger.checks.rounding: each statement of the sections has a check, and the check depends on the code."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace as changed
from fractions import Fraction
from functools import cache

import faults
import numpy as np
import pytest
from faults import all_of, breaks, finding, replace, times

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report import ledger
from gpbnb.report.ledger.checks import rounding as checks
from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.first_order import matrix
from gpbnb.report.ledger.quantities import BETA
from gpbnb.report.ledger.statements import statement
from gpbnb.report.rounding import derivation, experiment, theory

INVENTORY = faults.INVENTORY
ENTRIES = (
    *ledger.select(INVENTORY, "hung1984", "II", range(1, 10)),
    *ledger.select(INVENTORY, "hung1982", "III", range(1, 10)),
)
PRINTED = {entry.id: entry.printed for entry in ENTRIES}
CACHING = (checks, experiment)


# -- the present state ----------------------------------------------------------------------------


def test_findings_are_the_same_again(rows):
    faults.forget(*CACHING)
    for key in ("hung1984.II.eq18", "hung1982.III.eq27", "hung1984.II.s3.example-8-x"):
        assert checks.CHECKS.run(statement(key)) == finding(rows, key)


def test_findings_quote_the_computed_numbers(rows):
    assert ".56568" in finding(rows, "hung1984.II.s3.example-8-eps").recomputed
    assert ".74073" in finding(rows, "hung1984.II.s4.example-13-eps-c").recomputed
    assert "1000 times" in finding(rows, "hung1984.II.eq31").recomputed
    for place in ("vector-norm-properties-i-iv", "matrix-norm-properties-i-v"):
        assert "the norm is zero only for zero" in finding(rows, f"hung1984.II.s7.{place}").recomputed
    assert "factor of 400" in finding(rows, "hung1984.II.s9-2.example-1").recomputed
    assert "2.5%" in finding(rows, "hung1984.II.eq18").note
    assert "1.13 times" in finding(rows, "hung1984.II.eq20").note
    assert "1.25 times" in finding(rows, "hung1982.III.eq20").note
    assert r"\|Ax\|=2" in finding(rows, "hung1984.II.eq22").note.replace("$", "")
    # 95 + 10 = 105 is rounded to 110
    assert f"at most {(5 / 105) / 0.05:.4f} β" in finding(rows, "hung1984.II.eq16").recomputed
    assert "of $D$ is 5, 5, 4, 3, 2, and" in finding(rows, "hung1982.III.s9-2.unnumbered-c").recomputed
    # The relative error of a number just above 1 + β is nearly β/(1+β).
    largest = f"{1 / 1.0005:.4f} β"
    expected = f"relative error is {largest} for sums of matrices, and {largest} for single operations"
    assert expected in finding(rows, "hung1984.II.s8.claim-same-as-16").recomputed
    signs = Counter(names["x"] > 0 for names in checks.numbers())
    nearest = finding(rows, "hung1984.II.s2.claim-conventional").recomputed
    assert f"{signs[True]} positive and {signs[False]} negative" in nearest
    assert "$u=0.7655$, $v=-0.433$" in finding(rows, "hung1984.II.s2.claim-u-v-same-sign").note


@pytest.mark.parametrize(
    ("example", "before", "after"),
    [
        ("3a", "e == 3", "e == 4"),
        ("3a", "v >= 1/2", "v >= 1/3"),
        ("3a", "== u*b**e + b**(e-t) ==", "== u*b**e =="),
        ("3a", "10**(3-4)", "10**(3-3)"),
        ("3b", "== u*b**e ==", "== u*b**e + b**(e-t) =="),
        ("3b", "**e == .1234e3", "**e == .1235e3"),
        ("3c", "v < -(1/2)", "v < 1/2"),
    ],
)
def test_each_line_of_an_example_is_judged(example, before, after):
    printed = statement(f"hung1984.II.s2.example-{example}")
    assert printed.form.count(before) == 1
    verdict = checks.CHECKS.run(printed).verdict
    other = checks.CHECKS.run(changed(printed, form=printed.form.replace(before, after))).verdict
    assert verdict in (Verdict.VERIFIED, Verdict.MISPRINT)
    assert other is Verdict.MISPRINT


# -- numbers and formats --------------------------------------------------------------------------


@pytest.mark.parametrize(("base", "precision"), [(10, 2), (2, 5), (16, 2)])
def test_the_gap_above_one_is_a_unit_in_the_last_place(base, precision):
    assert checks.gap(base, precision) == Fraction(base) ** (1 - precision)


@pytest.mark.parametrize(("base", "precision"), checks.FORMATS)
def test_samples_lie_between_the_ends_of_a_power_of_the_base(base, precision):
    smallest = base ** (precision - 1)
    heads = set()
    for x in checks.samples(base, precision):
        size = abs(x)
        while size < smallest:
            size *= base
        while size >= base * smallest:
            size /= base
        heads.add(int(size))
    assert {smallest, smallest + 1, base * smallest - 1} <= heads


@pytest.mark.parametrize("n", [2, 4, 50])
def test_the_scatter_of_a_standard_deviation(n):
    """Against simulation, to five standard errors."""
    found = np.random.default_rng(n).standard_normal((4000, n)).std(axis=1, ddof=1).std()
    assert checks.scatter(n) == pytest.approx(found, rel=5 / np.sqrt(2 * 4000) * 1.5)


# -- each check depends on the code beneath it ----------------------------------------------------


@pytest.fixture
def patch(patch):
    """Change the code, with small surveys."""
    survey = experiment.survey.__wrapped__
    patch.setattr(experiment, "SURVEYED", experiment.SURVEYED[:2] + experiment.SURVEYED[8:12])
    patch.setattr(experiment, "survey", cache(lambda trial: survey(trial, repeats=3)))
    return patch


SPLIT, ROUND = FloatFormat.split, FloatFormat.round
TENTH = Fraction(1, 10)


def chops(patch):
    patch.setattr(FloatFormat, "round", lambda fmt, x: ROUND(FloatFormat(fmt.base, fmt.precision, Rounding.CHOP), x))


def coarse(patch):
    """Round to a digit less."""
    patch.setattr(FloatFormat, "round", lambda fmt, x: ROUND(FloatFormat(fmt.base, fmt.precision - 1, fmt.rounding), x))


def split_too_low(patch):
    """u = 0.0ddd: the exponent one too high."""

    def low(fmt, x):
        u, v, e = SPLIT(fmt, x)
        return u / fmt.base, v / fmt.base, e + 1

    patch.setattr(FloatFormat, "split", low)


def scaled(name, factor=TENTH):
    return times(theory, name, factor)


#: For some statements that are verified, changes of the code under which they must not be.
DISAGREE = [
    ("hung1984.II.s1.approach", scaled("strict_dot_bound")),
    ("hung1984.II.s1.claim-more-reliable", scaled("strict_dot_bound")),
    ("hung1984.II.eq3", chops),
    ("hung1984.II.eq3", coarse),
    ("hung1984.II.s2.example-2a", split_too_low),
    ("hung1984.II.s2.example-3a", chops),
    ("hung1984.II.eq5", chops),
    ("hung1984.II.eq6", split_too_low),
    ("hung1984.II.eq8", chops),
    ("hung1984.II.eq8", times(checks, "gap", 2)),
    ("hung1984.II.eq8", breaks(derivation, "one_rounding")),
    ("hung1984.II.s3.example-8-eps", chops),
    ("hung1984.II.eq11", coarse),
    ("hung1984.II.eq13", times(checks, "gap", 2)),
    ("hung1984.II.eq16", coarse),
    ("hung1982.III.eq16", coarse),
    ("hung1984.II.eq18", scaled("printed_sum_bound")),
    ("hung1984.II.eq18", breaks(derivation, "sums")),
    ("hung1982.III.eq20", scaled("product_bound")),
    ("hung1984.II.s7.vector-norm-properties-i-iv", replace(checks, "max_norm", lambda x: min(abs(x)))),
    ("hung1984.II.s7.matrix-norm-properties-i-v", replace(checks, "column_sum_norm", lambda a: abs(a).max())),
    ("hung1984.II.eq24", scaled("matrix_sum_bound")),
    ("hung1984.II.eq26", scaled("dot_bound")),
    ("hung1984.II.eq26", breaks(derivation, "dots")),
    ("hung1984.II.eq28", scaled("chain_bound", Fraction(1, 100))),
    ("hung1984.II.eq32", scaled("chain_bound", Fraction(1, 100))),
    ("hung1984.II.eq32", breaks(derivation, "chains")),
    ("hung1984.II.s9-2.closing-remark", scaled("chain_bound", 2)),
    ("hung1984.II.s9-1.relative-inner-product-error", scaled("relative_dot_bound", Fraction(1, 100))),
]


@pytest.mark.parametrize(("key", "change"), DISAGREE)
def test_a_statement_is_not_verified_if_the_code_says_otherwise(patch, key, change):
    change(patch)
    assert checks.CHECKS.run(statement(key)).verdict not in (Verdict.VERIFIED, Verdict.ANSWERED)


def only(module, name, condition):
    """Leave some of the instances out."""
    original = getattr(module, name)
    return replace(module, name, lambda *sizes: [names for names in original(*sizes) if condition(names)])


def chains_never_cancel(patch):
    """Matrices of one row and column, whose errors are all β, and a bound (31) that nothing exceeds."""
    scalar = [exact([[x]]) for x in ("1.5", "2.5", "-3")]
    patch.setattr(checks, "chains", lambda: [checks._chain_names(scalar, lambda k: [BETA] * k)])
    patch.setattr(theory, "printed_chain_claim", lambda *given: theory.chain_bound(*given) * 10**9)
    patch.setattr(derivation, "chain_shortcut", lambda: 0)


def examples_never_cancel(patch):
    scalar = [exact([[x]]) for x in ("1.5", "2.5", "3")]
    names = checks._example_names(scalar, exact([["7"]]), lambda k: [BETA] * k, 1)
    patch.setattr(checks, "example_instances", lambda rectangular: [names])
    patch.setattr(theory, "printed_example_bound", theory.example_bound)


def sums_of_one_sign(patch):
    terms = [Fraction(5), Fraction(5), Fraction(1, 1000)]
    patch.setattr(checks, "sums", lambda n=None: [checks._sum_names(terms, [BETA] * 2)])


#: For statements that are not right as printed, changes under which they are.
AGREE = [
    ("hung1984.II.eq2", only(checks, "numbers", lambda names: names["v"] != 0)),
    ("hung1984.II.s2.claim-t-digit-mantissa", replace(checks, "FOUR", checks.FOUR_CHOPPED)),
    ("hung1984.II.s3.claim-before-6", only(checks, "numbers", lambda names: names["u"] > 0)),
    (
        "hung1984.II.s3.claim-meaning-of-beta",
        replace(checks, "numbers", lambda: [checks.number_names("0.76546")]),
    ),
    (
        "hung1984.II.s4.example-13-parameters",
        replace(checks, "number_names", lambda x, true=checks.number_names: true("7654.567")),
    ),
    ("hung1982.III.eq18", sums_of_one_sign),
    ("hung1982.III.s7.norm-property-v", replace(checks, "norm_instances", lambda _: matrices_of_one())),
    ("hung1984.II.eq30", chains_never_cancel),
    ("hung1982.III.s9-2.p-2-line", chains_never_cancel),
    ("hung1982.III.s9-2.p-3-line", chains_never_cancel),
    ("hung1984.II.s9-2.claim-28-implies", chains_never_cancel),
    ("hung1984.II.s9-2.example-1", examples_never_cancel),
    (
        "hung1982.III.s9-2.cross-reference-to-28",
        replace(checks, "names_product_bound", lambda phrase: phrase == "(38)"),
    ),
]


def matrices_of_one():
    a, b = matrix([[2]]), matrix([[-3]])
    return [{"A": a, "B": b, "x": a, "y": b}]


@pytest.mark.parametrize(("key", "change"), AGREE)
def test_a_statement_is_verified_if_the_code_says_the_same(rows, patch, key, change):
    assert finding(rows, key).agrees is False
    change(patch)
    assert checks.CHECKS.run(statement(key)).verdict is Verdict.VERIFIED


@pytest.mark.parametrize(
    "change",
    [
        replace(theory, "printed_chain_claim", lambda *given: theory.chain_bound(*given) * 10**9),
        replace(derivation, "chain_shortcut", lambda: 0),
        all_of(
            chains_never_cancel,
            replace(derivation, "chain_shortcut", lambda: derivation.N),
        ),
    ],
)
def test_the_claim_on_chains_needs_the_algebra_the_survey_and_the_example(patch, change):
    change(patch)
    assert checks.CHECKS.run(statement("hung1984.II.s9-2.claim-28-implies")).verdict is Verdict.WRONG
