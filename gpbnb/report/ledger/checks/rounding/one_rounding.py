"""Sections 3 to 5: the error of one rounding, of chopping, and of one operation."""

from __future__ import annotations

import operator
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.ledger.checks.rounding.instances import (
    FORMATS,
    FOUR,
    FOUR_CHOPPED,
    Names,
    all_numbers,
    gap,
    judge,
    link_holds,
    number_names,
    power,
    relations,
    split_text,
)
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.checks.rounding.representation import split_is_printed
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, statement
from gpbnb.report.rounding import derivation


@cache
def derived() -> bool:
    """Whether SymPy confirms the derivation of (8), (13) and (14)."""
    return derivation.one_rounding().holds


@CHECKS.add(*both("eq4"), *both("eq7"), *both("eq12"))
def error_defined(printed: Statement) -> Finding:
    found = judge(relations(printed), all_numbers())
    return compare(
        found.right,
        f"the sides agree with the error computed from the rounded number: the line {found}",
        note="the line defines an error, and its sides follow from each other; the relative errors (7) and (12) "
        "require $x\\ne0$",
    )


@CHECKS.add(*both("eq5"), *both("eq6"), *both("eq8"))
def rounding_bound(printed: Statement) -> Finding:
    found = judge(relations(printed), all_numbers())
    return compare(
        found.right and derived(),
        f"{found}, and the largest error is within 1 % of the bound",
        note="the largest relative error is $\\beta/(1+\\beta)$, so (8) itself is never reached"
        if printed.id.endswith("eq8")
        else "",
    )


@CHECKS.add("hung1984.II.s3.claim-5-and-6")
def bounds_combined(printed: Statement) -> Finding:
    error, number = (statement(f"hung1984.II.eq{k}").relation().value() for k in (5, 6))
    bound = statement("hung1984.II.eq8").relation().sides[1].value()
    reasons = {"(5) and (6)": error / number, "(5) alone": error, "(6) alone": 1 / number}
    agree = {name: bool(sp.simplify(reason - bound) == 0) for name, reason in reasons.items()}
    return compare(printed.claims("bounds", agree), "bound (5) divided by bound (6) is bound (8)")


@CHECKS.add(*both("eq10"), *both("eq11"), *both("eq13"))
def chopping_bound(printed: Statement) -> Finding:
    found = judge(relations(printed), all_numbers())
    bounded = any("<=" in relation.text for relation in relations(printed))
    return compare(
        found.right and derived(),
        f"{found}{', and the largest error is within 1 % of the bound' if bounded else ''}",
    )


@CHECKS.add(*both("eq14"))
def chopping_doubles(printed: Statement) -> Finding:
    found = judge(relations(printed), all_numbers())
    return compare(
        found.right,
        (
            f"$\\beta_c/\\beta=2$ in {len(FORMATS)} formats, with $\\beta_c$ measured as the gap above 1 "
            "and β as half of this gap"
        ),
    )


@CHECKS.add(*both("s3.cross-reference-to-1"))
def reference_1(printed: Statement) -> Finding:
    forms = []
    for x in (Fraction(100), Fraction("765.4")):
        _, _, least = FOUR.split(x)
        forms += [(x / Fraction(10) ** e, Fraction(e)) for e in range(least, least + 3)]
    names = [{"u": u, "e": e, "b": Fraction(10)} for u, e in forms]
    splits = [each for each in names if abs(each["u"]) >= Fraction(1, 10)]
    by_1, by_2 = (judge(relations(printed), instances) for instances in (names, splits))
    cited = by_2 if printed.says("equation") == "(2)" else by_1
    u, e = forms[-1]
    return compare(
        cited.right,
        f"(1) alone would allow 765.4 to be written as ${float(u):g}\\times10^{{{e}}}$; the "
        f"inequality then {by_1.count}, but with the condition $|u|\\ge1/b$ below (2) it {by_2.count}",
        Verdict.MISPRINT if by_2.holds else Verdict.WRONG,
        otherwise_note="(2) is meant, because (1) has no $u$ and does not require $d_1\\ne0$",
    )


@CHECKS.add(*both("s3.claim-before-6"))
def claim_before_6(printed: Statement) -> Finding:
    first, reason, second = relations(printed)
    literal, meant = (
        judge([reason], instances)
        for instances in (all_numbers(), [{**names, "u": abs(names["u"])} for names in all_numbers()])
    )
    rest = judge([first, second], all_numbers())
    same = all(names["u"] * names["v"] >= 0 for names in all_numbers())
    sign = printed.says("sign") == ("similar" if same else "opposite")
    return compare(
        literal.right and rest.right and sign,
        f"$u\\ge1/b$ {literal}; $|u|\\ge1/b$ {meant}; each of the other two inequalities {rest}",
        Verdict.MISPRINT if meant.right and rest.right and sign else Verdict.WRONG,
        otherwise_note="absolute-value bars are missing: $u$ is negative for negative numbers",
    )


@CHECKS.add(*both("s3.claim-meaning-of-beta"))
def meaning_of_beta(printed: Statement) -> Finding:
    names = number_names(Fraction("765.4567"))
    absolute = max(abs(each["x_tilde"]) / each["beta"] for each in all_numbers())
    relative = max(each["epsilon"] / each["beta"] for each in all_numbers())
    meanings = {"absolute bound of": absolute <= 1, "mean of": False, "absolute bound of the relative": relative <= 1}
    return compare(
        printed.claims("bound", meanings),
        f"the absolute error of 765.4567 is {float(abs(names['x_tilde'])):g}, above "
        f"$\\beta={float(names['beta']):g}$; the largest relative error of all samples is {float(relative):.4f} β",
        Verdict.MISPRINT if relative <= 1 else Verdict.WRONG,
        otherwise_note="a word is missing: β bounds the absolute value of the *relative* error, as (7) and (8) say",
    )


# -- the numbers of the worked examples -----------------------------------------------------------


def _example_names() -> dict[str, Any]:
    return number_names(Fraction("765.4567"))


def _rounded_to_print(relation: Relation, names: Names, beta: str) -> bool:
    """Whether a chain of numbers is right and bounded by β; a long quotient is printed with five digits."""
    five = FloatFormat(10, 5)
    for link in relation.links(names, number=lambda q: q):
        if link.symbol == "==":
            if link.right not in (link.left, five.round(link.left)):
                return False
        elif link.right != names[beta] or not link_holds(link):
            return False
    return True


@CHECKS.add(
    "hung1984.II.s3.example-8-beta",
    "hung1984.II.s3.example-8-xhat",
    "hung1984.II.s3.example-8-abs-err",
    "hung1984.II.s4.example-13-beta-c",
    "hung1984.II.s4.example-13-abs-err",
)
def example_number(printed: Statement) -> Finding:
    names = _example_names()
    found = judge(relations(printed), [names])
    return compare(found.right, _example_text(names, "13" in printed.id))


@CHECKS.add("hung1984.II.s3.example-8-eps", "hung1984.II.s4.example-13-eps-c")
def example_relative_error(printed: Statement) -> Finding:
    names = _example_names()
    chopped = "13" in printed.id
    right = all(_rounded_to_print(each, names, "beta_c" if chopped else "beta") for each in relations(printed))
    return compare(right, _example_text(names, chopped), note="for 765.4567, with five digits")


def _example_text(names: Names, chopped: bool = False) -> str:
    five = FloatFormat(10, 5)
    if chopped:
        return (
            f"$\\beta_c={float(names['beta_c']):g}$, $x_c=$ {power(names['x_c'])}, "
            f"$|\\tilde x_c|={float(abs(names['x_tilde_c'])):g}$, "
            f"$\\epsilon_c=$ {power(five.round(names['epsilon_c']), 5)}"
        )
    return (
        f"$\\beta={float(names['beta']):g}$, $\\hat x=$ {power(names['x_hat'])}, "
        f"$|\\tilde x|={float(abs(names['x_tilde'])):g}$, $\\epsilon=$ {power(five.round(names['epsilon']), 5)}"
    )


@CHECKS.add("hung1984.II.s3.example-8-x")
def example_8_x(printed: Statement) -> Finding:
    names = _example_names()
    (number,) = relations(printed)
    terms = split_is_printed(number, names)
    return compare(
        terms and judge([number], [names]).holds,
        f"$.7654\\times10^3+.567\\times10^{{-1}}$ is 765.4567; with it {_example_text(names)}",
        Verdict.MISPRINT if terms else Verdict.WRONG,
        otherwise_note="767 is a misprint for 765; the lines that follow use 765",
    )


@CHECKS.add("hung1982.III.s3.example-8-numbers")
def example_8_1982(printed: Statement) -> Finding:
    names = _example_names()
    found = relations(printed)
    rest = judge([*found[:3], *found[4:6]], [names]).right and _rounded_to_print(found[6], names, "beta")
    rest = rest and split_is_printed(found[3], names)
    return compare(
        rest and judge(found[3:4], [names]).holds,
        _example_text(names),
        Verdict.MISPRINT if rest else Verdict.WRONG,
        otherwise_note="767 is a misprint for 765, as in hung1984; the other numbers are correct for 765.4567",
    )


@CHECKS.add("hung1984.II.s4.example-13-parameters")
def example_13_parameters(printed: Statement) -> Finding:
    names = _example_names()
    base, exponent = relations(printed)
    meant = judge([base], [names]).holds and judge([exponent], [names | {"e": names["t"]}]).holds
    return compare(
        judge(relations(printed), [names]).holds,
        f"the number in the example has $e={names['e']}$; $\\beta_c=10^{{1-4}}$ implies $t={names['t']}$",
        Verdict.MISPRINT if meant else Verdict.WRONG,
        otherwise_note="$t=4$ is meant",
    )


@CHECKS.add("hung1984.II.s4.example-13-x")
def example_13_x(printed: Statement) -> Finding:
    names = _example_names()
    found = relations(printed)
    chopped = FOUR_CHOPPED.round(names["x"])
    return compare(
        judge(found, [names]).right and split_is_printed(found[0], names),
        f"{split_text(names['x'])}; $x_c=$ {power(chopped)}",
    )


@CHECKS.add("hung1982.III.s4.example-13-numbers")
def example_13_1982(printed: Statement) -> Finding:
    names = _example_names()
    found = relations(printed)
    rest = judge([found[0], *found[2:6]], [names]).right and split_is_printed(found[3], names)
    rest = rest and _rounded_to_print(found[6], names, "beta_c")
    return compare(
        rest and judge(found[1:2], [names]).holds,
        f"$e={names['e']}$; {_example_text(names, chopped=True)}",
        Verdict.MISPRINT if rest and judge(found[1:2], [names | {"e": names["t"]}]).holds else Verdict.WRONG,
        otherwise_note="$t=4$ is meant, not $e=4$, which the scan shows as 6 = 4 and hung1984 repeats; the scan has "
        "changed $.7654$, printed in the next line, to $.7650$; the other numbers are right",
    )


# -- section 5: one operation ---------------------------------------------------------------------

OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv,
}  # fmt: skip


@cache
def operations() -> tuple[dict[str, Any], ...]:
    """Return single operations in four digits with their rounded results; some are ties just above a power of ten."""
    rng = np.random.default_rng(16)
    x = [Fraction(int(k), 1000) for k in rng.integers(1000, 9999, 40) * rng.choice([-1, 1], 40)]
    y = [Fraction(int(k), 1000) * Fraction(10) ** int(e) for k, e in rng.integers([1000, -2], [9999, 3], (40, 2))]
    pairs = [*zip(x, y, strict=True), (Fraction(1), Fraction(5, 10**4)), (Fraction("1.5"), Fraction("0.667"))]
    instances = []
    for a, b in pairs:
        left, right = FOUR.array([a]), FOUR.array([b])
        for op in OPERATIONS.values():
            true, computed = op(a, b), op(left, right).to_fractions()[0]
            if true:
                rounded = {true: computed}
                instances.append(
                    {"x": a, "y": b, "op": op, "fl": rounded.__getitem__, "beta": gap(10, 4) / 2,
                     "epsilon": computed / true - 1}
                )  # fmt: skip
    return tuple(instances)


@cache
def all_pairs() -> tuple[int, Fraction]:
    """Return the number of operations on all pairs of two-digit decimal numbers, and the largest relative error / β."""
    fmt = FloatFormat(10, 2)
    x = fmt.array([sign * m for m in range(10, 100) for sign in (1, -1)])
    y = fmt.array([m * Fraction(10) ** e for m in range(10, 100) for e in (0, -1)])
    a, b = x.to_fractions()[:, np.newaxis], y.to_fractions()
    largest, count = Fraction(0), 0
    for name, op in OPERATIONS.items():
        computed = getattr(np, name)(x[:, np.newaxis], y).to_fractions()
        true = op(a, b)
        some = true != 0
        count += true.size
        if not np.all(computed[~some] == 0):
            raise ArithmeticError("got a nonzero computed result; needed zero, as the exact result is zero")
        computed, true = computed[some], true[some]
        error = abs(computed.astype(np.float64) / true.astype(np.float64) - 1)
        nearly = error > error.max() - 1e-12  # far more than float64 can be wrong; exact errors of all would take long
        largest = max(largest, *abs(computed[nearly] / true[nearly] - 1))
    return count, largest / (gap(10, 2) / 2)


@CHECKS.add(*both("eq16"))
def one_operation(printed: Statement) -> Finding:
    found = judge(relations(printed), operations())
    count, largest = all_pairs()
    return compare(
        found.right and largest <= 1,
        f"{found}; in {count} operations on pairs of two-digit numbers, the error is at most {float(largest):.4f} β",
        note="where the exact result is zero, so is the computed result; the exponent range is unlimited",
    )
