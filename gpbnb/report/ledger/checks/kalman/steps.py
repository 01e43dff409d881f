"""One rounded step of the filter, (102)-(117)."""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache

import numpy as np
import sympy as sp

from gpbnb.report.kalman import derivation, exact_step, report_bounds, smallest
from gpbnb.report.ledger.checks.kalman import algebra, worst_case
from gpbnb.report.ledger.checks.kalman.judging import bounded, judge, right_form
from gpbnb.report.ledger.checks.kalman.registry import CHECKS, FOUR
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, statement

#: Root errors; see roots.csv.
PRODUCT, DROPPED, EXACT_GAIN, SIGNS, TWICE = (
    "product-error-relative-to-product",
    "earlier-covariance-error-dropped",
    "gain-taken-as-exact",
    "one-signed-epsilon",
    "roundings-counted-twice",
)
_CANCELS = (
    "as in (30), the error of a product is not a multiple of the product: the product may cancel while "
    "the error remains"
)


@cache
def dropped_error() -> tuple[float, float]:
    """Return what the error of P_{k-1} makes of (103), and of the growth of (125) when k is doubled.

    The first is the error of P_kp in the second step of a filter with one state, over (2n + 1)β P_kp. One state has no
    sums that could cancel, so this error comes from the first step alone.
    """
    case = smallest.scalar(FOUR)
    _, _, rounded = smallest.rounded_step(FOUR, case, second=True)
    true = exact_step.exact_step(*case).P
    allowed = FOUR.unit_roundoff * report_bounds.prediction_count(1) * (true + case.Q)
    k, n, m = report_bounds.EXAMPLE
    growth = [report_bounds.coefficients(i * k, n, m, **report_bounds.ALL_CORRECTED).second for i in (1, 2)]
    return float((abs(rounded - true) / allowed)[0, 0]), growth[1] / growth[0]


def _prediction(printed: Statement, note: str, root: str) -> Finding:
    instances = (*worst_case.second_prediction(), *worst_case.tight_prediction())
    return bounded(printed, instances, algebra.prediction(), note, root)


@CHECKS.add(*both("eq102"))
def rounded_prediction(printed: Statement) -> Finding:
    times, growth = dropped_error()
    return _prediction(
        printed,
        "$P_{k-1}$ stands here without a hat, so the error that earlier steps left in it is dropped. With one state it "
        f"makes the error of $P_{{kp}}$ {times:.3g} times $(2n+1)\\beta P_{{kp}}$ in the second step. If it "
        f"is carried on, the bound grows as $k^3$: twice as many steps multiply it by {growth:.2g}. Also, {_CANCELS}",
        DROPPED,
    )


@CHECKS.add(*both("eq103"))
def error_of_the_prediction(printed: Statement) -> Finding:
    return _prediction(printed, f"{_CANCELS}; the inequality also assumes that $\\epsilon$ is positive", PRODUCT)


def _covariance(printed: Statement, note: str, root: str, otherwise: str) -> Finding:
    instances = (*worst_case.one_step("K"), *worst_case.tight_covariance())
    return bounded(printed, instances, algebra.covariance(), note, root, otherwise)


@CHECKS.add(*both("eq104"), *both("s12.unnumbered-p-k-before-107"))
def rounded_covariance(printed: Statement) -> Finding:
    return _covariance(
        printed,
        "the equation assumes that the gain has no error, but the gain is computed, and $I-KH$ "
        "magnifies its error by $KP_{kp}/P_k$",
        EXACT_GAIN,
        "; the hat on $P_{kp}$, missing in the first line of (104), is printed in the second",
    )


@CHECKS.add(*both("eq105"))
def covariance_bound(printed: Statement) -> Finding:
    return _covariance(
        printed,
        "the report drops $-m\\epsilon P_{kp}$ as if $\\epsilon$ were positive; but "
        "$P_{kp}/P_k=1/(1-KH)$ is unbounded, and with $P=H=1$ and $R$ below the last digit the error "
        "is $1/(6\\beta)$ times the bound in every format",
        SIGNS,
        "; the second line also has $K_kP_k$ for $K_kH_k$ and lacks an $\\epsilon$",
    )


def _gain(printed: Statement, note: str, root: str) -> Finding:
    return bounded(printed, (*worst_case.one_step(), *worst_case.tight_gain()), algebra.gain(), note, root)


@CHECKS.add(*both("eq106"))
def rounded_gain(printed: Statement) -> Finding:
    instances = (*worst_case.local_gain(), *worst_case.tight_gain(local=True))
    return bounded(printed, instances, algebra.gain(), _CANCELS, PRODUCT)


@cache
def division_errors() -> tuple[Fraction, int]:
    """Return the largest relative error of 1/r in four digits, in units of β, and the count of numbers tried."""
    rng = np.random.default_rng(99)
    numbers = [Fraction(int(d), 1000) for d in rng.integers(1000, 10000, 200)]
    return max(abs(FOUR.round(1 / r) * r - 1) for r in numbers) / FOUR.unit_roundoff, len(numbers)


@CHECKS.add(*both("s12.r-1-rounding"))
def inverse_of_r(printed: Statement) -> Finding:
    largest, count = division_errors()
    roundings = int(np.ceil(float(largest)))
    names = algebra.COMMON | {"R_hat_k": algebra.R / (1 + roundings * derivation.EPS)}
    return compare(
        algebra.holds(printed, names),
        f"each entry takes one division, whose error is at most {float(largest):.3g} β in {count} divisions",
        note="$R_k$ itself is exact; the exponents that the scan of hung1982 has lost are restored from hung1984",
    )


@CHECKS.add(*both("eq107"))
def gain_error(printed: Statement) -> Finding:
    return _gain(
        printed,
        "the equation starts from the covariance of (104), which ignores the error of the gain",
        EXACT_GAIN,
    )


@CHECKS.add(*both("eq108"))
def gain_bound(printed: Statement) -> Finding:
    later = smallest.ratios(FOUR, smallest.scalar(FOUR), steps=2).gain
    matrices = smallest.ratios(FOUR, smallest.correlated()).gain
    return _gain(
        printed,
        "the report drops $-m\\epsilon P_{kp}H^TR^{-1}$ as in (105); with the first form of the gain, "
        f"(108) holds for one state in the first step, but the error is {later:.3g} times "
        f"$9\\beta K_k$ in the second step, or {matrices:.3g} times (108) with two states",
        SIGNS,
    )


_LOOP = "the equation starts from bound (108) on the gain, which fails"


def _loop(printed: Statement, note: str, otherwise: str = "") -> Finding:
    instances = (*worst_case.one_step(), *worst_case.tight_loop())
    return bounded(printed, instances, algebra.loop(), note, SIGNS, otherwise)


@CHECKS.add("hung1984.II.eq112", "hung1984.II.eq113")
def rounded_loop(printed: Statement) -> Finding:
    return _loop(printed, _LOOP)


@CHECKS.add("hung1982.III.eq112")
def rounded_loop_1982(printed: Statement) -> Finding:
    return _loop(
        printed,
        f"{_LOOP}; illegible counts are restored from hung1984",
        "; the scan has $4n+3n+3$ for $4n+3m+3$, and $I$ for $\\phi_{k-1}$",
    )


@CHECKS.add("hung1982.III.eq113")
def rounded_input_1982(printed: Statement) -> Finding:
    return _loop(
        printed,
        f"{_LOOP}; the counts of the last two lines are not legible",
        "; the scan has $3n$ for the $4n$ of (108), with which (119) continues",
    )


@CHECKS.add(*both("eq114"))
def rounded_state(printed: Statement) -> Finding:
    return _loop(
        printed,
        "the report drops the term $-(4n+3m+3)\\epsilon\\Phi$ of (112) as if $\\epsilon$ were positive",
    )


@CHECKS.add(*both("eq115"), *both("eq116"))
def defined_again(printed: Statement) -> Finding:
    loop, entered = (derivation.transition_error().coeff(derivation.FK), derivation.input_error().coeff(derivation.U))
    return compare(
        judge(printed, (*worst_case.one_step(), *worst_case.tight_loop())).right,
        f"(112) and (113) give the counts ${sp.latex(loop)}$ and ${sp.latex(entered)}$",
        Verdict.INCONSISTENT,
        otherwise_note="the symbols of (112) and (113) are redefined and now include the roundings of $\\hat F x$ "
        f"and of the sum; with neither meaning does a count bound the error{right_form(printed)}",
        root=TWICE,
    )


@CHECKS.add(*both("eq117"))
def rewritten(printed: Statement) -> Finding:
    return compare(
        algebra.holds(printed, algebra.restated()),
        "(114) with the counts of (115) and (116)",
        note="with these redefined symbols, no further rounding remains to be counted",
    )


def _cited(printed: Statement, place: str, names: dict[str, sp.Expr] | None = None, side: int = -1) -> sp.Expr:
    """Return a side of an equation of the same document."""
    return statement(f"{printed.document}.{printed.chapter}.{place}").relation().sides[side].value(names)


@CHECKS.add(*both("s12.claim-114-written-as-117"))
def written_again(printed: Statement) -> Finding:
    names = {"F_hat_k": _cited(printed, "eq115"), "u_hat_k": _cited(printed, "eq116")}
    cited = _cited(printed, f"eq{printed.says('equation').strip('()')}")
    return compare(
        bool(sp.expand(_cited(printed, "eq117", names) - cited) == 0),
        "with (115) and (116), (117) is the last line of (114)",
    )


@CHECKS.add(*both("s12.claim-115-and-116-combined"))
def combined(printed: Statement) -> Finding:
    loop, entered = (f"eq{number}" for number in re.findall(r"\((\d+)\)", printed.says("equations")))
    names = {f"F_hat_{i}": _cited(printed, loop, {"F_k": sp.Symbol(f"F_{i}")}) for i in (1, 2, 3)}
    names |= {f"u_hat_{i}": _cited(printed, entered, {"u_k": sp.Symbol(f"u_{i}")}) for i in (1, 2, 3)}
    difference = _cited(printed, "s12.unnumbered-x-3", names) - _cited(printed, "eq119", side=1)
    epsilon = sp.Symbol("epsilon")
    first_order = [difference.subs(epsilon, 0), difference.diff(epsilon).subs(epsilon, 0)]
    return compare(
        all(sp.expand(each) == 0 for each in first_order),
        "to first order, the counts of the line before (119) and those of (115) and (116) add up to those of (119)",
    )


@CHECKS.add(*both("s12.unnumbered-x-3"))
def counted_twice(printed: Statement) -> Finding:
    more = tuple(sp.expand(again - once) for again, once in zip(derivation.TWICE, derivation.ONCE, strict=True))
    return compare(
        algebra.holds(printed, algebra.three_steps(twice=False)),
        f"after (117) no rounding remains to be counted, so ${sp.latex(more[0])}$ for the closed loop "
        f"and ${sp.latex(more[1])}$ for the input are counted twice",
        otherwise_note="(115) and (116) already contain these roundings: from here on, $7n+3m+6$ should be "
        "$6n+3m+5$. Illegible text in hung1982 is restored from hung1984",
        root=TWICE,
    )
