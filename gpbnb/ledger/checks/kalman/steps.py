"""One rounded step of the filter, (102)-(117)."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
import sympy as sp

from gpbnb.kalman import derivation, smallest
from gpbnb.ledger.checks.kalman import algebra
from gpbnb.ledger.checks.kalman.excess import exceeded
from gpbnb.ledger.checks.kalman.registry import CHECKS, FOUR
from gpbnb.ledger.finding import Finding, Verdict, compare
from gpbnb.ledger.registry import both
from gpbnb.ledger.statements import Statement

#: Root errors; see roots.csv.
PRODUCT, EXACT_GAIN, SIGNS, TWICE = (
    "product-error-relative-to-product",
    "gain-taken-as-exact",
    "one-signed-epsilon",
    "roundings-counted-twice",
)
_CANCELS = "as in (30): the error of a product is no multiple of the product, which may cancel while the error stays"


@CHECKS.add(*both("eq102"), *both("eq103"))
def rounded_prediction(printed: Statement) -> Finding:
    return exceeded(
        "(102)",
        algebra.holds(printed, algebra.prediction()),
        f"{_CANCELS}; the inequality of (103) also takes $\\epsilon$ for positive, and the error of $P_{{k-1}}$ from "
        "earlier steps is left out",
        PRODUCT,
    )


@CHECKS.add(*both("eq104"), *both("s12.unnumbered-p-k-before-107"))
def rounded_covariance(printed: Statement) -> Finding:
    return exceeded(
        "(104)",
        algebra.holds(printed, algebra.covariance()),
        "the gain is taken to have no error, though it is computed, and $I-KH$ magnifies its error by $KP_{kp}/P_k$; "
        "the hat of $P_{kp}$, missing in the first line of (104), is there in the second",
        EXACT_GAIN,
    )


@CHECKS.add(*both("eq105"))
def covariance_bound(printed: Statement) -> Finding:
    return exceeded(
        "(105)",
        algebra.holds(printed, algebra.covariance()),
        "$-m\\epsilon P_{kp}$ is dropped as if $\\epsilon$ were positive; $P_{kp}/P_k=1/(1-KH)$ has no limit, and "
        "$P=H=1$ with $R$ below the last digit violates the bound by $1/(6\\beta)$ in every format; the second line "
        "also has $K_kP_k$ for $K_kH_k$ and lacks an $\\epsilon$",
        SIGNS,
    )


@CHECKS.add(*both("eq106"))
def rounded_gain(printed: Statement) -> Finding:
    return exceeded("(106)", algebra.holds(printed, algebra.gain()), _CANCELS, PRODUCT)


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
        f"one division each: at most {float(largest):.3g} β in {count} divisions",
        note="$R_k$ itself is exact; the exponents lost from the scan of hung1982 are restored from hung1984",
    )


@CHECKS.add(*both("eq107"))
def gain_error(printed: Statement) -> Finding:
    return exceeded(
        "(107)",
        algebra.holds(printed, algebra.gain()),
        "it starts from the covariance of (104), whose gain has no error",
        EXACT_GAIN,
    )


@CHECKS.add(*both("eq108"))
def gain_bound(printed: Statement) -> Finding:
    later = smallest.ratios(FOUR, smallest.scalar(FOUR), steps=2).gain
    matrices = smallest.ratios(FOUR, smallest.correlated()).gain
    return exceeded(
        "(108)",
        algebra.holds(printed, algebra.gain()),
        f"$-m\\epsilon P_{{kp}}H^TR^{{-1}}$ is dropped as in (105); with the first form of (99) the bound holds for "
        f"one state in the first step, and is exceeded {later:.3g} times in the second, or {matrices:.3g} times with "
        "two states",
        SIGNS,
    )


@CHECKS.add("hung1984.II.eq112")
def rounded_loop(printed: Statement) -> Finding:
    return exceeded(
        "(112)", algebra.holds(printed, algebra.loop()), "it starts from the gain of (108), which fails", SIGNS
    )


@CHECKS.add("hung1982.III.eq112")
def rounded_loop_1982(printed: Statement) -> Finding:
    return exceeded(
        "(112)",
        algebra.holds(printed, algebra.loop()),
        "it starts from the gain of (108), which fails; $4n+3n+3$ is printed or scanned for $4n+3m+3$, and $I$ for "
        "$\\phi_{k-1}$. Counts that are not legible are restored from hung1984",
        SIGNS,
    )


@CHECKS.add("hung1984.II.eq113")
def rounded_input(printed: Statement) -> Finding:
    return exceeded(
        "(113)", algebra.holds(printed, algebra.loop()), "it starts from the gain of (108), which fails", SIGNS
    )


@CHECKS.add("hung1982.III.eq113")
def rounded_input_1982(printed: Statement) -> Finding:
    return exceeded(
        "(113)",
        algebra.holds(printed, algebra.loop()),
        "it starts from the gain of (108), which fails; $3n$ is printed or scanned for the $4n$ of (108), since (119) "
        "goes on with $4n$. The counts of the last two lines are not legible",
        SIGNS,
    )


@CHECKS.add("hung1984.II.eq114")
def rounded_state(printed: Statement) -> Finding:
    return exceeded(
        "(114)",
        algebra.holds(printed, algebra.loop()),
        "$-(4n+3m+3)\\epsilon\\Phi$ of (112) is dropped as if $\\epsilon$ were positive",
        SIGNS,
    )


@CHECKS.add("hung1984.II.eq115", "hung1984.II.eq116")
def defined_again(printed: Statement) -> Finding:
    loop, entered = (derivation.transition_error().coeff(derivation.FK), derivation.input_error().coeff(derivation.U))
    return compare(
        algebra.holds(printed, algebra.loop()),
        f"by (112) and (113) the counts are ${sp.latex(loop)}$ and ${sp.latex(entered)}$",
        Verdict.INCONSISTENT,
        otherwise_note="the letters of (112) and (113) are defined again and now include the roundings of $\\hat F x$ "
        "and of the sum",
        root=TWICE,
    )


@CHECKS.add("hung1984.II.eq117")
def rewritten(printed: Statement) -> Finding:
    return compare(
        algebra.holds(printed, algebra.restated()),
        "(114) with the counts of (115) and (116)",
        note="with these letters no further rounding is to be counted",
    )


@CHECKS.add("hung1984.II.s12.unnumbered-x-3", "hung1982.III.eq114-117-and-rounded-x-3")
def counted_twice(printed: Statement) -> Finding:
    more = tuple(sp.expand(again - once) for again, once in zip(derivation.TWICE, derivation.ONCE, strict=True))
    return compare(
        algebra.holds(printed, algebra.three_steps(twice=False)),
        f"by (117) no rounding is left to count: ${sp.latex(more[0])}$ per loop and ${sp.latex(more[1])}$ per input "
        "are counted twice",
        otherwise_note="(115) and (116) contain them already: $7n+3m+6$ in all that follows should be $6n+3m+5$. What "
        "is not legible in hung1982 is restored from hung1984",
        root=TWICE,
    )
