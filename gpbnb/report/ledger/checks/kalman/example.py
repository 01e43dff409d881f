"""The closing example of section 12: a year of steps of ten seconds."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

from gpbnb.arithmetic.formats import FloatFormat, prints_as
from gpbnb.report.display.tables import scientific
from gpbnb.report.kalman import derivation, report_bounds
from gpbnb.report.ledger.checks.kalman.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare, given
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, statement

YEAR, STEP = 365 * 24 * 3600, 10  # seconds
GOAL, SIGNAL = 1, 6606  # mas a year; the experiment's goal, and the larger of the two drifts that relativity predicts
N, M = 10, 2
_FIRST, _SECOND = "first-coefficient-misevaluated", "second-coefficient-misevaluated"


@cache
def coefficients() -> tuple[int, int]:
    """Return the factors of β‖x_k‖ and βB in (125), by the report's own algebra, for the example."""
    values = {derivation.K: Fraction(YEAR, STEP), derivation.N: N, derivation.M: M}
    derived = derivation.count_start(derivation.TWICE[0]), derivation.second_coefficient(*derivation.TWICE)
    first, second = (int(each.subs(values)) for each in derived)
    return first, second


@CHECKS.add(*both("s12.example-k"))
def steps_of_a_year(printed: Statement) -> Finding:
    k = Fraction(YEAR, STEP)
    links = printed.links({"k": k}, Fraction)
    return compare(all(link.symbol == "==" and link.left == link.right for link in links), f"${int(k)}$")


def _number(printed: Statement, label: str, value: Fraction | int) -> bool:
    """Whether the printed number is this value to the digits printed."""
    return prints_as(value, printed.number(label).literal)


def _terms(printed: Statement) -> Fraction:
    """Return the terms of the printed formula as numbers, with β = 1."""
    value = printed.relation().links({"k": Fraction(YEAR, STEP), "n": N, "m": M, "beta": 1}, Fraction)
    return Fraction(value[0].left if value else _value(printed))


def _value(printed: Statement) -> Fraction:
    return Fraction(printed.relation().value({"k": Fraction(YEAR, STEP), "n": N, "m": M, "beta": 1}, Fraction))


@CHECKS.add(*both("s12.example-first-coefficient"))
def first_coefficient(printed: Statement) -> Finding:
    value = coefficients()[0]
    misprints = report_bounds.one_digit_misprints(*report_bounds.EXAMPLE, printed.number("value").literal)
    ways = " or ".join(f"${a}n+{b}m+{c}$" for a, b, c in misprints) or "no change of a single digit"
    return compare(
        _value(printed) == value and _number(printed, "value", value),
        scientific(value, 5),
        otherwise_note=f"the printed number is $84k$, which results from {ways}; the scan of 1984 shows b for 6",
        root=_FIRST,
    )


@CHECKS.add(*both("s12.example-second-coefficient"))
def second_coefficient(printed: Statement) -> Finding:
    value = coefficients()[1]
    product = report_bounds.read_as_product(*report_bounds.EXAMPLE, 84)
    return compare(
        _value(printed) == value and _number(printed, "value", value),
        scientific(value, 5),
        otherwise_note=(
            "the printed number is $k(3n+1)\\cdot0.5(k-1)\\cdot84$: it multiplies where (125) adds, and "
            "it has 84 in place of 82"
        )
        if _number(printed, "value", product)
        else "no misprint was found that leads to the printed number",
        root=_SECOND,
    )


@CHECKS.add(*both("s12.example-formula-8"))
def formula_8(printed: Statement) -> Finding:
    """Return half the spacing of the decimal numbers above 1, the smallest β for which 1 + β rounds up."""
    precisions, same = range(1, 9), 0
    for t in precisions:
        fl = FloatFormat(10, t).round
        beta = Fraction(printed.relation().value({"t": t}, Fraction))
        same += fl(1 + beta) > 1 and fl(1 + beta * Fraction(999, 1000)) == 1
    return compare(
        printed.relation().text.count("==") == 1 and same == len(precisions),
        f"in {same} of {len(precisions)} precisions, β is the smallest number that changes 1 when added to it",
        note="the number of digits depends on the base, so a binary computer needs its own count",
    )


def _beta(printed: Statement, which: int, root: str, note: str) -> Finding:
    coefficient = coefficients()[which]
    beta = Fraction(1, coefficient)
    right = _number(printed, "beta", beta)
    if any(isinstance(part, Relation) for part in printed.parts):
        equation = printed.relation()
        right = right and equation.equates and _terms(printed) == coefficient and equation.value({}, Fraction) == 1
    return compare(right, scientific(beta, 4), otherwise_note=note, root=root)


@CHECKS.add("hung1984.II.s12.example-beta-first-term")
def first_beta(printed: Statement) -> Finding:
    return _beta(
        printed,
        0,
        _FIRST,
        "the reciprocal of the printed coefficient, which is wrong, is $.3775\\times10^{-8}$; the "
        "minus sign of the exponent, present in hung1982, is missing",
    )


@CHECKS.add("hung1982.III.s12.example-beta-first")
def first_beta_1982(printed: Statement) -> Finding:
    return _beta(printed, 0, _FIRST, "this is the reciprocal of the printed coefficient, which is wrong")


@CHECKS.add("hung1984.II.s12.example-beta-second-term", "hung1982.III.s12.example-beta-second")
def second_beta(printed: Statement) -> Finding:
    return _beta(printed, 1, _SECOND, "this is the reciprocal of the printed coefficient, which is wrong")


@cache
def _digits(which: int) -> tuple[int, int, float]:
    """Return the digits that the formula requires, those that the printed β requires, and the latter unrounded."""
    place = ("example-beta-first", "example-beta-second")[which]
    beta = statement(f"hung1982.III.s12.{place}").number("beta").value
    needed = report_bounds.precision_for_coefficient(coefficients()[which])
    by_printed = report_bounds.precision_for_coefficient(1 / beta)
    return needed, by_printed, 1 - math.log10(2 * float(beta))


@CHECKS.add(*both("s12.example-9-digits"))
def first_digits(printed: Statement) -> Finding:
    needed, by_printed, real = _digits(0)
    return compare(
        printed.number("t").value == needed,
        f"{needed}; for the printed β {by_printed}, since (8) gives $t={real:.2f}$",
        otherwise_note=(
            "the report rounds to the nearest integer instead of rounding up: nine digits violate its criterion"
        ),
        root="digits-not-rounded-up",
    )


@CHECKS.add(*both("s12.example-17-digits"))
def second_digits(printed: Statement) -> Finding:
    needed, by_printed, real = _digits(1)
    double = coefficients()[1] * FloatFormat(2, 53).unit_roundoff
    return compare(
        printed.number("t").value == needed,
        f"{needed}; for the printed β {by_printed}, since (8) gives $t={real:.2f}$",
        otherwise_note="the printed number rules out IEEE double precision, but the formula does not: in double "
        f"precision its second term is {float(double):.2g}",
        root=_SECOND,
    )


@CHECKS.add(*both("s12.example-one-term"))
def one_term(printed: Statement) -> Finding:
    first, second = coefficients()
    ratio = scientific(Fraction(second, first), 3).strip("$")
    return given(
        f"the report assumes this for the sake of discussion; the first term dominates where $\\|x_k\\|>{ratio}\\,B$"
    )


@CHECKS.add(*both("s12.example-criterion"), *both("s12.example-criterion-second"))
def criterion(printed: Statement) -> Finding:
    tolerance = Fraction(GOAL, SIGNAL)
    digits = [report_bounds.precision_for_coefficient(each, tolerance) for each in coefficients()]
    (link,) = printed.links({"k": Fraction(YEAR, STEP), "n": N, "m": M, "beta": 1}, Fraction)
    return compare(
        link.symbol == "==" and link.left in coefficients() and link.right <= tolerance,
        f"the criterion allows an error as large as $\\|x_k\\|$ or as $B$; an error of {GOAL} mas in "
        f"a signal of {SIGNAL} mas requires {digits[0]} digits for the first term and {digits[1]} for "
        "the second",
        otherwise_note="the goal of the experiment is one milliarcsecond a year",
        root="error-as-large-as-the-state-allowed",
    )


@CHECKS.add("hung1984.II.s12.example-ocr-gp-beta")
def name_of_the_experiment(printed: Statement) -> Finding:
    return compare(
        printed.claims("the experiment", {"GP-beta": False, "GP-B": True}),
        "GP-B",
        Verdict.MISPRINT,
        otherwise_note="the scan shows β for B here, and B for β in (122)",
    )
