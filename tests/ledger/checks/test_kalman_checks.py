"""ledger.checks.kalman: each entry of sections 12 to 14 has a check, and each check can come out otherwise."""

from __future__ import annotations

from dataclasses import replace as changed
from fractions import Fraction
from types import SimpleNamespace

import faults
import numpy as np
import pytest
import sympy as sp
from alterations import altered
from faults import always, breaks, finding, replace

from gpbnb.arithmetic.algebra import product_in_order, rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report import ledger
from gpbnb.report.kalman import derivation, report_bounds
from gpbnb.report.ledger.checks import kalman as checks
from gpbnb.report.ledger.checks import kalman_errors as worst_case
from gpbnb.report.ledger.finding import Verdict

INVENTORY = faults.INVENTORY
ENTRIES = (
    *ledger.select(INVENTORY, "hung1984", "II", (12, 13, 14)),
    *ledger.select(INVENTORY, "hung1982", "III", (12, 13)),
)
BY_ID = {entry.id: entry for entry in ENTRIES}
CACHING = (checks, worst_case)


def in_both(place):
    return f"hung1984.II.{place}", f"hung1982.III.{place}"


def judged(key, form=None):
    entry = BY_ID[key]
    return checks.CHECKS.run(entry if form is None else changed(entry, form=form))


def corrected(key, old, new):
    form = BY_ID[key].form
    assert old in form
    return judged(key, form.replace(old, new))


# -- the present state ----------------------------------------------------------------------------


def test_findings_quote_the_computed_numbers(rows):
    for place, number in (
        ("eq105", "5.02e+03 times"),
        ("eq108", "3.35e+03 times"),
        ("eq125", "125 times"),
        ("eq104", "2.14 times"),
        ("s12.assumptions-before-122", "1.62"),
        ("s12.example-first-coefficient", "2.5860"),
        ("s12.example-second-coefficient", "4.0775"),
        ("s12.example-9-digits", "10; for the printed β 10"),
        ("s12.example-17-digits", "16; for the printed β 17"),
        ("s12.example-criterion", "13 digits for the first term and 20"),
        ("s13.remark-2", "10 decimal digits or 32 bits"),
        ("eq121", "41.7 times"),
        # 1 - 1/(1 + 1e-5), which is lost in four digits
        ("s12.claim-asterisk", "in four digits gives 0; equation (111) gives 1e-05"),
        # 7n+3m+6 less 6n+3m+5, and an addition
        ("s12.unnumbered-x-3", "$n + 1$ for the closed loop and $1$ for the input"),
    ):
        assert number in finding(rows, f"hung1984.II.{place}").recomputed
    # |-60ε|, where the last state is zero, and 0 - 4ε - 20ε - 36ε
    assert r"the left side is $60\epsilon$ and the right side $-60\epsilon$" in finding(rows, "hung1984.II.eq121").note
    assert r"\cdot84$" in finding(rows, "hung1984.II.s12.example-second-coefficient").note
    in_double = finding(rows, "hung1984.II.s12.example-17-digits").note
    assert in_double.endswith(f" {4.0775e14 / 2**53:.2g}")
    assert "7n+4m+6$ or $7n+3m+8" in finding(rows, "hung1984.II.s12.example-first-coefficient").note


# -- what is wrong could be right -----------------------------------------------------------------


@pytest.mark.parametrize("key", in_both("s12.noises-uncorrelated"))
def test_noises_with_their_transpose_are_given(key):
    assert corrected(key, "w[k]*v[j]", "w[k]*v[j].T").verdict is Verdict.GIVEN


@pytest.mark.parametrize("key", ["hung1984.II.eq109", "hung1984.II.eq110"])
def test_another_definition_would_be_wrong(key):
    for name, other in altered(BY_ID[key]):
        try:
            verdict = checks.CHECKS.run(other).verdict
        except LookupError:  # an index beyond the run
            continue
        assert verdict is Verdict.MISPRINT, name


# -- the report's algebra ---------------------------------------------------------------------------

ALGEBRA_IS_RIGHT = [
    *in_both("eq102"), *in_both("eq103"), *in_both("eq106"), *in_both("eq107"), *in_both("eq108"),
    *in_both("s12.unnumbered-p-k-before-107"), "hung1984.II.eq112", "hung1984.II.eq113", *in_both("eq114"),
    "hung1982.III.eq120", *in_both("eq122"), *in_both("eq124"), *in_both("eq125"),
]  # fmt: skip
ALGEBRA_IS_MISPRINTED = [
    *((key, "*P_kp*(1+n*epsilon) ==", "*P_hat_kp*(1+n*epsilon) ==") for key in in_both("eq104")),
    *((key, "(I - K_k*P_k)*(2*n+1)*P_kp", "(I - K_k*H_k)*(2*n+1)*epsilon*P_kp") for key in in_both("eq105")),
    ("hung1982.III.eq112", "(4*n+3*n+3)*epsilon*I", "(4*n+3*m+3)*epsilon*phi[k-1]"),
    ("hung1982.III.eq113", "3*n+2*m+3", "4*n+2*m+3"),
    *((key, "(3*m+1)", "(3*n+1)") for key in (*in_both("eq119"), "hung1984.II.eq120")),
]


@pytest.mark.parametrize("key", ALGEBRA_IS_RIGHT)
def test_what_follows_from_the_reports_algebra_is_wrong_all_the_same(rows, key):
    found = finding(rows, key)
    assert found.verdict is Verdict.WRONG
    assert found.recomputed.startswith("the printed terms follow")


@pytest.mark.parametrize(("key", "old", "new"), ALGEBRA_IS_MISPRINTED)
def test_a_misprint_in_the_reports_algebra_is_found(rows, key, old, new):
    assert finding(rows, key).recomputed.startswith("the printed terms do not follow")
    assert corrected(key, old, new).recomputed.startswith("the printed terms follow")


# -- the largest errors -----------------------------------------------------------------------------


def test_an_inner_product_of_two_terms_has_two_roundings_of_each():
    a, b = worst_case.tracked([[3, 5]]), worst_case.tracked([[7], [11]])
    assert worst_case.largest(product_in_order(a, b, worst_case.rounded)) == [[2 * 3 * 7 + 2 * 5 * 11]]


def test_terms_of_opposite_sign_keep_their_own_roundings_but_share_a_smaller_sum():
    a, b = worst_case.tracked([[3, -5]]), worst_case.tracked([[7], [4]])
    assert worst_case.largest(product_in_order(a, b, worst_case.rounded)) == [[21 + 20 + abs(21 - 20)]]


def test_an_error_that_enters_twice_cancels():
    x = worst_case.tracked([[3]], [[1]])
    assert worst_case.largest(x - x) == [[0]]
    assert worst_case.largest(x * x) == [[6]]
    assert worst_case.largest(x / worst_case.tracked([[2]], [[1]])) == [[Fraction(1, 2) + Fraction(3, 4)]]


def test_no_error_in_many_digits_exceeds_the_largest_error():
    """In forty digits, second-order terms vanish; every error of a step is at most the largest to first order."""
    fmt = FloatFormat(10, 40)
    algebra = rounded_algebra(worst_case.exact, np.vectorize(fmt.round, otypes=[object]))
    share = Fraction(0)
    for case, true, kind, moved in worst_case._steps():
        if kind.emulated:
            continue
        computed = worst_case.Roundings(algebra, worst_case.exact, True).take(case)
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
def test_excesses_worked_by_hand(rows, place, by_hand):
    assert f"is {by_hand:.3g} times" in finding(rows, f"hung1984.II.{place}").recomputed


def test_a_larger_coefficient_is_judged_by_the_same_errors():
    """No multiple of (125) is a bound, but the filter in four digits exceeds it by less."""
    form = BY_ID["hung1984.II.eq125"].form
    found = judged("hung1984.II.eq125", form.replace("beta*(", "5*beta*("))
    assert found.verdict is Verdict.WRONG
    assert "is 25 times" in found.recomputed


def test_the_claim_of_a_bound_follows_it(patch):
    patch.setattr(checks, "judge", always(SimpleNamespace(right=True)))
    assert {judged(key).verdict for key in in_both("s12.claim-main-result")} == {Verdict.VERIFIED}


# -- what is right could be wrong -----------------------------------------------------------------


def summary(**changes):
    """The summary of the stored runs, with other results."""
    return always(checks.refined()._replace(**changes))


NOT_RIGHT = [
    ("hung1984.II.eq117", replace(derivation, "ONCE", derivation.TWICE)),
    ("hung1984.II.s12.r-1-rounding", replace(FloatFormat, "unit_roundoff", Fraction(1, 4000))),
    ("hung1984.II.s12.claim-similar-derivation", replace(derivation, "TWICE", derivation.ONCE)),
    ("hung1984.II.s12.125-found-from-pattern", replace(derivation, "TWICE", derivation.ONCE)),
    ("hung1984.II.s12.125-dependence", replace(report_bounds, "state_bound", lambda x, B, beta, c: beta * c.first * x)),
    ("hung1984.II.s12.125-dependence", replace(report_bounds, "state_bound", lambda x, B, beta, c: c.first * x + B)),
    ("hung1984.II.s12.example-k", replace(checks, "STEP", 20)),
    ("hung1984.II.s12.example-formula-8", replace(FloatFormat, "round", lambda self, value: Fraction(1))),
    ("hung1984.II.s13.remark-1", replace(checks, "refined", summary(contraction_violations=1))),
    ("hung1984.II.s13.remark-1", replace(checks, "refined", summary(typical=0.0005))),
    ("hung1984.II.s13.remark-1", breaks(derivation, "contraction")),
    ("hung1984.II.s13.remark-1", breaks(derivation, "recursion")),
    ("hung1984.II.s13.remark-2", replace(checks, "GOAL", Fraction(1, 10**20))),
]


@pytest.mark.parametrize(("key", "change"), NOT_RIGHT)
def test_a_check_that_agrees_can_disagree(rows, patch, key, change):
    assert finding(rows, key).agrees is True
    change(patch)
    assert judged(key).agrees is False


@pytest.mark.parametrize("letter", ["x", "P", "K", "F", "u", "prior"])
def test_exact_equations_depend_on_every_letter_of_the_run(patch, letter):
    """Where a letter of the reference run is off, the equations that contain it do not hold."""
    contain = {
        "x": ("eq98", "eq98-repeated", "eq111", "eq118", "eq123"),
        "P": ("eq99", "s12.eq100-recalled", "s12.eq101-recalled"),
        "K": ("eq98", "eq99", "s12.eq99-recalled", "s12.eq101-recalled"),
        "F": ("eq111", "eq118", "eq123"),
        "u": ("eq111", "eq118", "eq123"),
        "prior": ("eq99", "s12.eq100-recalled", "s12.eq101-recalled"),
    }[letter]
    run = {name: dict(values) for name, values in checks.least_squares_run().items()}
    run[letter] = {k: value + sp.ones(*value.shape) for k, value in run[letter].items()}
    patch.setattr(checks, "least_squares_run", lambda: run)
    for place in contain:
        assert judged(f"hung1984.II.{place}").verdict is Verdict.WRONG, place
