"""A check for each ledger entry of hung1984, ch. II, and hung1982, ch. III, sections 12 and 13."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat, Rounding, prints_as
from gpbnb.arithmetic.rational import column_sum_norm, exact, max_norm
from gpbnb.display.tables import scientific
from gpbnb.kalman import (
    contraction,
    derivation,
    emulation,
    exact_step,
    forms,
    report_bounds,
    smallest,
    year,
    year_cases,
)
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.registry import Check, Checks, both
from gpbnb.ledger.statements import quote

CHECKS = Checks()

FOUR = FloatFormat(10, 4)
CHAPTER = "chapter *Kalman bound*"
YEAR, STEP = 365 * 24 * 3600, 10  # seconds
GOAL, SIGNAL = 1, 6606  # mas a year: the experiment's goal, and the larger of the drifts that relativity predicts
N, M = derivation.N, derivation.M


# -- material -------------------------------------------------------------------------------------

DIMENSIONS = (3, 2)


@cache
def filtered() -> tuple[tuple[smallest.Case, exact_step.ExactStep], ...]:
    """Four exact steps of a filter with small random numbers: what each began with, and what came of it."""
    rng = np.random.default_rng(98)
    n, m = DIMENSIONS

    def numbers(*shape: int) -> NDArray[Any]:
        return exact(rng.integers(-9, 10, shape))

    half = numbers(n, n)
    Phi, H, Q, P = (
        numbers(n, n) / 10,
        numbers(m, n),
        exact(np.eye(n, dtype=int)),
        half @ half.T + 1 * np.eye(n, dtype=int),
    )
    R, x = exact(np.diag(range(2, 2 + m))), numbers(n)
    steps = []
    for _ in range(4):
        case = smallest.Case(Phi, H, Q, R, x, P, numbers(m))
        step = exact_step.exact_step(*case)
        steps.append((case, step))
        x, P = step.x, step.P
    return tuple(steps)


def matrix(entries: NDArray[Any]) -> sp.Matrix:
    """The same for sympy."""
    return sp.Matrix(entries.reshape(len(entries), -1).tolist())


@cache
def optimal() -> dict[str, bool]:
    """Which of (98)-(101) give what the least squares of prediction and measurement, solved otherwise, do."""
    found = {"(98)": True, "(99)": True, "second (99)": True, "(101)": True}
    for case, step in filtered():
        H, R, prior = matrix(case.H), matrix(case.R), matrix(step.predicted)
        information = prior.inv() + H.T * R.inv() * H
        P = information.inv()
        x = P * (prior.inv() * matrix(case.Phi) * matrix(case.x) + H.T * R.inv() * matrix(case.z))
        found["(98)"] &= x == matrix(step.x)
        found["(99)"] &= (sp.eye(len(P.col(0))) - matrix(step.gain) * H) * prior == P
        found["second (99)"] &= P * H.T * R.inv() == matrix(step.gain)
        found["(101)"] &= matrix(step.P) == P
    return found


@cache
def excess(statement: str) -> float:
    """How many times a rounded filter in four digits exceeds what a printed statement allows it; see the code."""
    scalar, beta = smallest.scalar(FOUR), FOUR.unit_roundoff
    fl = FOUR.round
    if statement in ("(105)", "(108)", "(125)"):
        place = ("(105)", "(108)", "(125)").index(statement)
        return smallest.ratios(FOUR, scalar, second=statement == "(108)")[place]
    if statement in ("(119)", "(124)"):
        return smallest.ratios(FOUR, scalar, steps={"(119)": 3, "(124)": 4}[statement]).state
    if statement == "(102)":
        A, B = FOUR.array([["1.001", 1], [1, 0]]), FOUR.array(smallest.correlated().P)
        product = exact(A) @ exact(B) @ exact(A.T)
        error = abs((A @ B @ A.T).to_fractions() - product)
        allowed = beta * report_bounds.prediction_count(2) * abs(product)
        return float(max(e / a for e, a in zip(error.flat, allowed.flat, strict=True) if a))
    if statement == "(106)":
        case = smallest.correlated()
        first = (case.P @ case.H.T)[0, 0]
        return float(abs(fl(fl(case.P[0, 0] * case.H[0, 0]) + case.P[0, 1]) - first) / (beta * (2 + 1) * abs(first)))
    if statement in ("(104)", "(107)"):
        case = smallest.scalar(FOUR, ".004", "7.5")
        true = exact_step.exact_step(*case)
        _, K, P = smallest.rounded_step(FOUR, case, second=True)
        if statement == "(104)":
            allowed = (1 + 1 + 1 + report_bounds.prediction_count(1)) * true.P + true.predicted
            return float(abs(P - true.P)[0, 0] / (beta * allowed[0, 0]))
        rest = abs(true.predicted @ case.H.T)[0, 0] / case.R[0, 0]
        return float(abs(K - true.gain)[0, 0] / (beta * (report_bounds.gain_count(1, 1) * abs(true.gain)[0, 0] + rest)))
    true = exact_step.exact_step(*scalar)
    F, K = true.transition[0, 0], true.gain[0, 0]
    x, rounded, _ = smallest.rounded_step(FOUR, scalar, second=statement != "(114)")
    if statement == "(112)":  # 5n + 3m + 4 and 4n + 3m + 3
        return float(abs(fl(1 - rounded[0, 0]) - F) / (beta * (12 * F + 10)))
    if statement == "(113)":  # 4n + 3m + 3, for z = 1
        return float(abs(rounded[0, 0] - K) / (beta * 10 * K))
    if statement == "(114)":
        return float(abs(x[0] - true.x[0]) / (beta * report_bounds.transition_count(1, 1) * F))
    raise KeyError(statement)


def printed(statement: str, algebra: bool, note: str, text: str = "", name: str = "") -> Finding:
    """Judge a statement by its coefficients in the report's own algebra and by what a rounded filter does."""
    times = excess(statement)
    right = "come out" if algebra else "do not come out"
    return compare(
        algebra and times <= 1,
        f"the coefficients {right} by the report's algebra{text}; in four digits a filter exceeds {name or statement} "
        f"{times:.3g} times",
        Verdict.WRONG,
        otherwise_note=note,
    )


# -- the filter, (98)-(101) -----------------------------------------------------------------------


@CHECKS.add(*both("s12.model-equations"))
def model_equations() -> Finding:
    n, m = DIMENSIONS
    conformable = np.zeros((n, 1)).shape[1] == np.zeros((m, 1)).shape[0]
    return compare(
        conformable,
        f"with $n={n}$, $m={m}$, $w_kv_j$ is no product; $w_kv_j^T$ is one, and with it (98)-(101) are optimal",
        Verdict.MISPRINT if all(optimal().values()) else Verdict.WRONG,
        otherwise_note="a transpose is missing in $E[w_kv_j]$; $\\omega$ and $w$ are one letter, as are $v$ and $V$",
    )


@CHECKS.add("hung1984.II.s12.claim-asterisk")
def asterisk() -> Finding:
    case = smallest.scalar(FOUR)
    true = exact_step.exact_step(*case)
    x, _, _ = smallest.rounded_step(FOUR, case)
    by_111 = true.transition @ case.x + true.gain @ case.z
    return compare(
        bool(np.all(x == by_111)),
        f"a step of one state in four digits gives {float(x[0]):g}, (111) {float(by_111[0]):.4g}",
        Verdict.MISPRINT if loops_close() else Verdict.WRONG,
        otherwise_note="from (111) on $x$ is the exact estimate, as (118) says, and $\\hat x$ the rounded one",
    )


@CHECKS.add("hung1982.III.s12.claim-asterisk")
def asterisk_1982() -> Finding:
    with_x = asterisk().agrees
    return compare(
        with_x is False and loops_close(),
        "a letter other than $x$ is needed, which from (111) on is the exact estimate",
        note="read as $\\hat x$, for which the scan has a g below (66) and (68) too; hung1984 prints $x$",
    )


@CHECKS.add("hung1984.II.eq98")
def estimate() -> Finding:
    return compare(
        optimal()["(98)"], "equals the weighted least squares of prediction and measurement, in exact arithmetic"
    )


@CHECKS.add("hung1984.II.eq99", "hung1984.II.s12.eq99-recalled")
def gains() -> Finding:
    cyclic = report_bounds.order(second=True) is None
    return compare(
        optimal()["(99)"] and optimal()["second (99)"] and derivation.contraction().holds,
        "both forms agree in exact arithmetic; with the second "
        + ("(99) needs (101) and (101) needs (99)" if cyclic else "an order exists"),
        note="the analysis (106) takes the second form, that of (104) a gain without error: no program has both",
    )


def variance(expression: sp.Expr, variances: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Variance of a sum of multiples of independent variables."""
    return sp.expand(sum(sp.expand(expression).coeff(symbol) ** 2 * value for symbol, value in variances.items()))


def predicted(index: int) -> bool:
    """Whether the variance of x_1 = phi x_0 + w_0 takes the Q of this index."""
    phi, x, w, p, *q = sp.symbols("phi x w p q_0 q_1")
    return bool(variance(phi * x + w, {x: p, w: q[0]}) == sp.expand(phi**2 * p + q[index]))


@CHECKS.add("hung1984.II.eq100", "hung1982.III.eq98-101")
def prediction() -> Finding:
    return compare(
        predicted(1),
        r"the covariance of $\Phi_{k-1}x_{k-1}+w_{k-1}$ has $Q_{k-1}$",
        Verdict.INCONSISTENT if predicted(0) else Verdict.WRONG,
        otherwise_note="(100) prints $Q_k$, though the scan of hung1982 runs letter and index together; (102), which "
        "recalls it, has $Q_{k-1}$ in both reports",
    )


@CHECKS.add("hung1984.II.s12.eq100-recalled")
def prediction_recalled() -> Finding:
    return compare(predicted(0), r"the covariance of $\Phi_{k-1}x_{k-1}+w_{k-1}$")


@CHECKS.add("hung1984.II.eq101")
def covariance() -> Finding:
    return compare(
        "K_kH_k" in quote("hung1984.II.eq101") and optimal()["(101)"],
        "with $K_k$ it is the covariance of the optimal estimate, in exact arithmetic",
        Verdict.MISPRINT if optimal()["(101)"] else Verdict.WRONG,
        otherwise_note="$K_p$ for $K_k$, which stands where (101) is recalled",
    )


@CHECKS.add("hung1984.II.s12.eq101-recalled", "hung1982.III.s12.recalled-98-101")
def recalled() -> Finding:
    return compare(
        all(optimal().values()) and predicted(0) and loops_close(), "all hold in exact arithmetic, for $n=3$, $m=2$"
    )


# -- covariance and gain, (102)-(108) -------------------------------------------------------------

_CANCELS = "as (30): the error of a product is no multiple of the product, which may cancel while the error stays"


@CHECKS.add(*both("eq102"), *both("eq103"))
def rounded_prediction() -> Finding:
    return printed(
        "(102)",
        derivation.report().holds_at(0),
        f"{_CANCELS}; the inequality of (103) also takes $\\epsilon$ for positive, and the error of $P_{{k-1}}$, which "
        "earlier steps made, is left out",
    )


@CHECKS.add("hung1984.II.eq104", "hung1982.III.eq104", *both("s12.unnumbered-p-k-before-107"))
def rounded_covariance() -> Finding:
    return printed(
        "(104)",
        derivation.report().holds_at(1),
        "the hat of $P_{kp}$, missing in the first line, is there in the second. Even with every term kept and signs "
        "free: the gain is taken to have no error, though it is computed, and "
        "$I-KH$ magnifies its error by $KP_{kp}/P_k$",
        " but for $-2n\\epsilon(I-KH)Q$, which is left out",
    )


@CHECKS.add(*both("eq105"))
def covariance_bound() -> Finding:
    return printed(
        "(105)",
        derivation.report().holds_at(1) and derivation.smallest().holds,
        "$-m\\epsilon P_{kp}$ is dropped as if $\\epsilon$ were positive; $P_{kp}/P_k=1/(1-KH)$ has no limit, and "
        "$P=H=1$ with $R$ below the last digit breaks the bound by $1/(6\\beta)$ in every format; also "
        "$K_kP_k$ for $K_kH_k$, and an $\\epsilon$ is missing in the second line",
    )


@CHECKS.add(*both("eq106"))
def rounded_gain() -> Finding:
    return printed("(106)", derivation.report().holds_at(2), _CANCELS, " of $n+m$ roundings")


@CHECKS.add(*both("s12.r-1-rounding"))
def inverse_of_r() -> Finding:
    rng = np.random.default_rng(99)
    numbers = [Fraction(int(d), 1000) for d in rng.integers(1000, 10000, 200)]
    largest = max(abs(FOUR.round(1 / r) * r - 1) for r in numbers) / FOUR.unit_roundoff
    return compare(
        largest <= 1, f"one division each: at most {float(largest):.3g} β in {len(numbers)}", note="R itself is exact"
    )


@CHECKS.add(*both("eq107"))
def gain_error() -> Finding:
    return printed("(107)", derivation.report().holds_at(2), "with the covariance of (104), whose gain has no error")


@CHECKS.add(*both("eq108"))
def gain_bound() -> Finding:
    later = smallest.ratios(FOUR, smallest.scalar(FOUR), steps=2).gain
    matrices = smallest.ratios(FOUR, smallest.correlated()).gain
    return printed(
        "(108)",
        derivation.report().holds_at(2) and derivation.smallest().holds,
        f"$-m\\epsilon P_{{kp}}H^TR^{{-1}}$ is dropped as in (105); with the first form of (99) it holds for one state "
        f"in the first step, and is exceeded {later:.3g} times in the second, or {matrices:.3g} times with two states",
    )


# -- the closed loop, (98) again and (109)-(117) --------------------------------------------------


@cache
def loops_close() -> bool:
    """Whether (109)-(111) give (98), exactly."""
    return all(np.all(step.transition @ case.x + step.gain @ case.z == step.x) for case, step in filtered())


@CHECKS.add(
    "hung1984.II.eq98-repeated",
    "hung1984.II.eq109",
    "hung1984.II.eq110",
    "hung1984.II.eq111",
    "hung1982.III.eq109-111",
)
def closed_loop() -> Finding:
    return compare(loops_close(), "the same estimate as (98), in exact arithmetic, for $n=3$, $m=2$")


@CHECKS.add("hung1984.II.eq112")
def rounded_loop() -> Finding:
    return printed("(112)", derivation.report().holds_at(3), "with the gain of (108), which fails")


#: What the last line of (112) in 1982 multiplies by the number it takes away.
LAST_OF_112 = sp.Integer(1)


@CHECKS.add("hung1982.III.eq112")
def rounded_loop_1982() -> Finding:
    found = derivation.transition_error()
    shown = (5 * N + 3 * M + 4) * derivation.FK - (4 * N + 3 * N + 3) * LAST_OF_112
    return printed(
        "(112)",
        bool(sp.expand(found - shown) == 0),
        "$4n+3n+3$ for $4n+3m+3$ and $I$ for $\\phi_{k-1}$, by print or scan; and with the gain of (108), which fails",
        f", which takes away ${sp.latex(-found.coeff(derivation.PHI))}$ times $\\phi_{{k-1}}$",
    )


@CHECKS.add("hung1984.II.eq113")
def rounded_input() -> Finding:
    return printed("(113)", derivation.report().holds_at(4), "with the gain of (108), which fails")


@CHECKS.add("hung1982.III.eq113")
def rounded_input_1982() -> Finding:
    gain = derivation.gain_error().coeff(derivation.KZ)
    shown = 3 * N + 2 * M + 3
    loop, entered = derivation.TWICE
    ways = [
        sp.expand(derivation.count_input(loop, entered + more).subs({derivation.K: 3, derivation.NTH: 1}))
        for more in (0, shown - gain)
    ]
    return printed(
        "(113)",
        bool(sp.expand(gain - shown) == 0) and derivation.report().holds_at(4),
        "with the gain of (108), which fails; $3n$ is the scan's or a slip for the $4n$ of (108), since (119) goes on "
        "with $4n$",
        f", which gives ${sp.latex(gain)}$ for the gain and ${sp.latex(ways[0])}$ in (119), as printed there; "
        f"$3n$ would give ${sp.latex(ways[1])}$",
    )


@CHECKS.add("hung1984.II.eq114")
def rounded_state() -> Finding:
    return printed(
        "(114)",
        derivation.report().holds_at(5),
        "$-(4n+3m+3)\\epsilon\\Phi$ of (112) is dropped as if $\\epsilon$ were positive",
    )


@CHECKS.add("hung1984.II.eq115", "hung1984.II.eq116")
def defined_again() -> Finding:
    loop, entered = (derivation.transition_error().coeff(derivation.FK), derivation.input_error().coeff(derivation.U))
    return compare(
        bool(loop == derivation.ONCE[0] and entered == derivation.ONCE[1]),
        f"by (112) and (113) the counts are ${sp.latex(loop)}$ and ${sp.latex(entered)}$",
        Verdict.INCONSISTENT,
        otherwise_note="the letters of (112) and (113) now include the roundings of $\\hat F x$ and of the sum",
    )


@CHECKS.add("hung1984.II.eq117")
def rewritten() -> Finding:
    loop, entered = derivation.ONCE
    error = derivation.state_error()
    return compare(
        bool(
            sp.expand(error - loop * derivation.FK * derivation.X - entered * derivation.U) == 0
            and derivation.report().holds_at(5)
        ),
        "(114) with the counts of (115) and (116)",
        note="with these letters no further rounding is due",
    )


def _twice() -> tuple[bool, str]:
    more = tuple(sp.expand(again - once) for again, once in zip(derivation.TWICE, derivation.ONCE, strict=True))
    return more == (0, 0), (
        f"(117) has none left to count: ${sp.latex(more[0])}$ a loop and ${sp.latex(more[1])}$ an input come twice"
    )


@CHECKS.add("hung1984.II.s12.unnumbered-x-3", "hung1982.III.eq114-117-and-rounded-x-3")
def counted_twice() -> Finding:
    agrees, text = _twice()
    return compare(
        agrees,
        text,
        Verdict.WRONG,
        otherwise_note="(115) and (116) have them already: $7n+3m+6$ in all that follows should be $6n+3m+5$",
    )


# -- three steps, four, and k, (118)-(125) --------------------------------------------------------


def unfolds(newest: bool = True) -> bool:
    """Whether sums like (118) are the estimates of the exact filter, with the last of their terms or without it."""
    x = filtered()[0][0].x
    ways: NDArray[Any] = exact(np.eye(len(x), dtype=int))
    total = x * 0
    agrees = True
    for case, step in filtered():
        ways, total, entered = step.transition @ ways, step.transition @ total, step.gain @ case.z
        agrees = agrees and bool(np.all(ways @ x + total + (entered if newest else 0) == step.x))
        total = total + entered
    return agrees


@CHECKS.add("hung1984.II.eq118", "hung1982.III.eq118", "hung1984.II.eq123")
def unrolled() -> Finding:
    return compare(
        unfolds() and derivation.propagated().holds,
        f"for every $k$ by induction; in exact arithmetic for {len(filtered())} steps",
    )


def inputs_of_124() -> list[int]:
    """How many inputs of (123) must be counted for the second coefficient of (124)."""
    start, entered = derivation.count_start(derivation.TWICE[0]), derivation.count_input(*derivation.TWICE)
    each = [(start - entered).subs({derivation.K: 4, derivation.NTH: i}) for i in range(1, 6)]
    printed = derivation.printed_coefficients()[1].subs(derivation.K, 4)
    return [count for count in range(1, 6) if sp.expand(sum(each[:count]) - printed) == 0]


@CHECKS.add("hung1982.III.eq123")
def unrolled_1982() -> Finding:
    counted = inputs_of_124()
    return compare(
        unfolds(newest=False),
        f"without $u_4$ it is not the estimate, with it it is; (124) has the roundings of "
        f"{counted[0] if counted else 'no number of'} inputs",
        Verdict.OCR if unfolds() and counted == [4] else Verdict.WRONG,
        otherwise_note="the last term is lost from the scan, not from the report: hung1984 has it, and (124), the same "
        "in both reports, counts it",
    )


def three_steps(print_3m: bool) -> Finding:
    steps = derivation.general().steps
    derived = sp.expand(derivation.count_start(derivation.TWICE[0]) - derivation.count_input(*derivation.TWICE))
    first = derived.subs({derivation.K: 3, derivation.NTH: 1})
    shown = 3 * M + 1 if print_3m else 3 * N + 1
    return printed(
        "(119)",
        bool(first == shown) and all(step.holds for step in steps[1:8]),
        "the terms of (118) have errors of their own, and what (114) rests on fails; they are counted twice"
        + ("; $3m+1$ for $3n+1$" if print_3m else ""),
        f", with ${sp.latex(first)}$",
    )


@CHECKS.add("hung1984.II.eq119", "hung1984.II.eq120", "hung1982.III.eq119")
def three_steps_3m() -> Finding:
    return three_steps(print_3m=True)


@CHECKS.add("hung1982.III.eq120")
def three_steps_3n() -> Finding:
    return three_steps(print_3m=False)


@CHECKS.add(*both("eq121"))
def norm_with_minus() -> Finding:
    less = derivation.count_start(derivation.TWICE[0]) - derivation.count_input(*derivation.TWICE)
    values = [int(less.subs({derivation.K: 3, derivation.NTH: i, N: 1, M: 1})) for i in (1, 2, 3)]
    sides = {sign: sign * sum(values) for sign in (-1, 1)}
    return compare(
        sides[-1] >= 0,
        f"where $x_3=0$ and each norm is 1, the right side is ${sides[-1]}\\epsilon$ for $n=m=1$; with plus signs "
        f"${sides[1]}\\epsilon$",
        Verdict.WRONG,
        otherwise_note="a norm of a difference is bounded by the sum of the norms; (122) has plus signs again",
    )


@CHECKS.add(*both("s12.assumptions-before-122"))
def assumptions() -> Finding:
    F, u = exact([["1/2", "1/2"], [0, 0]]), exact([1, 1])
    left, right = max_norm(F @ u), column_sum_norm(F) * max_norm(u)
    return compare(
        left <= right,
        f"$F=(\\frac12,\\frac12;0,0)$, $u=(1,1)$: $\\|Fu\\|={left}$, $\\|F\\|\\|u\\|={right}$",
        Verdict.WRONG,
        otherwise_note="the norms (21) and (22) do not go together; $\\|F_3F_2u_1\\|\\le F^2u$ needs the row sum",
    )


_NO_BOUND = (
    "one state, $P=H=\\Phi=x_0=1$, $z=0$, $R$ below the last digit: the estimate is lost altogether, in every format; "
    "the prefactor is $\\beta$, as the example has it, though the scans read B"
)


@CHECKS.add(*both("eq122"))
def three_steps_bounded() -> Finding:
    # Without inputs (119) and (122) allow the same.
    return printed("(119)", all(step.holds for step in derivation.general().steps[:9]), _NO_BOUND, name="(122)")


@CHECKS.add("hung1984.II.eq124")
def four_steps_bounded() -> Finding:
    return printed("(124)", derivation.general().holds_at(9), _NO_BOUND)


@CHECKS.add("hung1984.II.eq125", "hung1982.III.eq124-125", *both("s12.claim-main-result"))
def main_result() -> Finding:
    k, n, m = report_bounds.EXAMPLE
    counts = report_bounds.coefficients(k, n, m)
    symbolic = [int(c.subs({derivation.K: k, N: n, M: m})) for c in derivation.printed_coefficients()]
    return printed(
        "(125)",
        derivation.general().holds and symbolic == list(counts),
        _NO_BOUND,
        " for every $k$",
    )


@CHECKS.add(*both("s12.125-found-from-pattern"), *both("s12.claim-similar-derivation"))
def pattern() -> Finding:
    return compare(
        derivation.general().holds,
        "by summation for every $k$, $n$, $m$: the pattern is right",
        note="what it is the pattern of is not",
    )


@CHECKS.add(*both("s12.125-dependence"))
def dependence() -> Finding:
    def value(
        k: int = 3, n: int = 2, m: int = 1, x: int = 1, B: int = 1, beta: Fraction = FOUR.unit_roundoff
    ) -> Fraction:
        return report_bounds.state_bound(Fraction(x), Fraction(B), beta, report_bounds.coefficients(k, n, m))

    others = [value(k=4), value(n=3), value(m=2), value(x=2), value(B=2), value(beta=FOUR.unit_roundoff * 2)]
    return compare(
        all(other > value() for other in others),
        f"it grows with each of the {len(others)}",
        note="the error depends on more: on how far $I-KH$ cancels, which none of them shows",
    )


@CHECKS.add("hung1984.II.s12.word-interactions")
def word() -> Finding:
    return compare(
        "iterations" in quote("hung1984.II.s12.word-interactions"),
        f"$k$ counts the iterations of the filter, {Fraction(YEAR, STEP)} in a year",
        Verdict.MISPRINT,
        otherwise_note="iterations are meant, and an iteration period of ten seconds",
    )


@CHECKS.add(*both("s12.claim-usefulness"))
def usefulness() -> Finding:
    seventeen = FloatFormat(10, int(report_bounds.PRINTED["second digits"]))
    times = smallest.ratios(seventeen, smallest.scalar(seventeen)).state
    return compare(
        times <= 1,
        f"with 17 digits a filter of one state exceeds (125) {times:.2g} times in its first step",
        Verdict.WRONG,
        otherwise_note="digits that a bound asks for are of use if it is one",
    )


# -- the closing example --------------------------------------------------------------------------


@CHECKS.add("hung1984.II.s12.example-sampling", "hung1984.II.s12.example-k", "hung1982.III.s12.example-k")
def steps_of_a_year() -> Finding:
    k = Fraction(YEAR, STEP)
    return compare(k == report_bounds.EXAMPLE[0] and prints_as(k, "3.1536e6"), f"${int(k)}$")


@CHECKS.add("hung1984.II.s12.example-n-m", "hung1982.III.s12.example-n-m-and-sampling")
def dimensions() -> Finding:
    return unverifiable(
        f"with them $7n+3m+6={report_bounds.coefficients(1, *report_bounds.EXAMPLE[1:]).first}$",
        "an assumption: which ten states and two measurements is not said",
    )


def example_number(name: str, value: Fraction | int, text: str, note: str) -> Finding:
    shown = report_bounds.PRINTED[name]
    return compare(prints_as(value, shown), text, Verdict.WRONG, otherwise_note=note)


@CHECKS.add(*both("s12.example-first-coefficient"))
def first_coefficient() -> Finding:
    value = report_bounds.coefficients(*report_bounds.EXAMPLE).first
    slips = report_bounds.one_digit_misprints(*report_bounds.EXAMPLE, report_bounds.PRINTED["first coefficient"])
    ways = " or ".join(f"${a}n+{b}m+{c}$" for a, b, c in slips)
    return example_number(
        "first coefficient",
        value,
        scientific(value, 5),
        f"the printed one is $84k$, as by {ways}; b is the scan's for 6",
    )


@CHECKS.add(*both("s12.example-second-coefficient"))
def second_coefficient() -> Finding:
    value = report_bounds.coefficients(*report_bounds.EXAMPLE).second
    product = report_bounds.read_as_product(*report_bounds.EXAMPLE, 84)
    found = prints_as(product, report_bounds.PRINTED["second coefficient"])
    return example_number(
        "second coefficient",
        value,
        scientific(value, 5),
        "the printed one is $k(3n+1)\\cdot0.5(k-1)\\cdot84$: times for plus, and 84 for 82"
        if found
        else "no slip was found that leads to the printed one",
    )


@CHECKS.add(*both("s12.example-formula-8"))
def formula_8() -> Finding:
    precisions = range(1, 41)
    same = sum(FloatFormat(10, t).unit_roundoff == Fraction(1, 2) * Fraction(10) ** (1 - t) for t in precisions)
    return compare(
        same == len(precisions),
        f"(8) with $b=10$: the same for {same} of {len(precisions)} precisions",
        note="a computer of base 2 needs its own count: digits of other bases are worth different amounts",
    )


@CHECKS.add("hung1984.II.s12.example-beta-first-term")
def first_beta() -> Finding:
    beta = Fraction(1, report_bounds.coefficients(*report_bounds.EXAMPLE).first)
    return compare(
        prints_as(beta, ".3775e8"),
        scientific(beta, 4),
        Verdict.WRONG,
        otherwise_note="one over the printed coefficient, which is wrong, is $.3775\\times10^{-8}$; a sign is lost",
    )


@CHECKS.add("hung1982.III.s12.example-beta-first")
def first_beta_1982() -> Finding:
    beta = Fraction(1, report_bounds.coefficients(*report_bounds.EXAMPLE).first)
    return example_number("first beta", beta, scientific(beta, 4), "one over the printed coefficient, which is wrong")


@CHECKS.add("hung1984.II.s12.example-beta-second-term", "hung1982.III.s12.example-beta-second")
def second_beta() -> Finding:
    beta = Fraction(1, report_bounds.coefficients(*report_bounds.EXAMPLE).second)
    return example_number("second beta", beta, scientific(beta, 4), "one over the printed coefficient, which is wrong")


def _digits(which: str) -> tuple[int, int, float]:
    """Digits that the formula asks for, that the printed β does, and that β as a real number."""
    coefficient = getattr(report_bounds.coefficients(*report_bounds.EXAMPLE), which)
    beta = Fraction(report_bounds.PRINTED[f"{which} beta"])
    formula, printed = (
        report_bounds.precision_for_coefficient(coefficient),
        report_bounds.precision_for_coefficient(1 / beta),
    )
    return formula, printed, 1 - math.log10(2 * float(beta))


@CHECKS.add(*both("s12.example-9-digits"))
def first_digits() -> Finding:
    needed, by_printed, real = _digits("first")
    return compare(
        needed == int(report_bounds.PRINTED["first digits"]),
        f"{needed}; for the printed β {by_printed}, since (8) gives $t={real:.2f}$",
        Verdict.WRONG,
        otherwise_note="rounded to nearest where it must be rounded up: nine digits break the criterion",
    )


@CHECKS.add(*both("s12.example-17-digits"))
def second_digits() -> Finding:
    needed, by_printed, real = _digits("second")
    double = report_bounds.coefficients(*report_bounds.EXAMPLE).second * FloatFormat(2, 53).unit_roundoff
    return compare(
        needed == int(report_bounds.PRINTED["second digits"]),
        f"{needed}; for the printed β {by_printed}, since (8) gives $t={real:.2f}$",
        Verdict.WRONG,
        otherwise_note=f"the printed number rules IEEE double out, the formula does not: $b\\beta={float(double):.2g}$",
    )


@CHECKS.add(*both("s12.example-one-term"))
def one_term() -> Finding:
    k, n, m = report_bounds.EXAMPLE
    first, second = report_bounds.coefficients(k, n, m)
    return compare(
        second < k * first,
        f"the first term dominates where $\\|x_k\\|>{scientific(Fraction(second, first), 3).strip('$')}\\,B$",
        note="that is about $kB/2$, half of what (111) can add up to: in a filter that forgets, the second dominates",
    )


@CHECKS.add(*both("s12.example-criterion"), *both("s12.example-criterion-second"))
def criterion() -> Finding:
    counts = report_bounds.coefficients(*report_bounds.EXAMPLE)
    granted = [coefficient * Fraction(1, coefficient) for coefficient in counts]
    goal = Fraction(GOAL, SIGNAL)
    digits = [report_bounds.precision_for_coefficient(coefficient, goal) for coefficient in counts]
    return compare(
        all(grant <= goal for grant in granted),
        f"it grants an error of all of $\\|x_k\\|$, or of $B$; for {GOAL} mas in {SIGNAL} the terms ask for "
        f"{digits[0]} and {digits[1]} digits",
        Verdict.WRONG,
        otherwise_note="the experiment's goal is a milliarcsecond a year",
    )


@CHECKS.add("hung1984.II.s12.example-ocr-gp-beta")
def name_of_the_experiment() -> Finding:
    return compare(
        "GP-B" in quote("hung1984.II.s12.example-ocr-gp-beta"),
        "GP-B",
        Verdict.OCR,
        otherwise_note="the scan reads B as β here, and β as B in (122)",
    )


# -- what 1982 has in one entry -------------------------------------------------------------------


@CHECKS.add("hung1982.III.s12.all-other-numbered-eqs-23-25-29-33-41-43-45-49-5")
def others_of_1982() -> Finding:
    twins: list[Check] = [rounded_prediction, rounded_gain, closed_loop, unrolled]
    found = [twin().agrees for twin in twins]
    return compare(
        all(found),
        "of section 12, (109)-(111) and (123) are right as in 1984" if all(found[2:]) else "some of 1984 fail",
        Verdict.WRONG,
        otherwise_note="(102) and (106) fail as in 1984; all of section 12 are judged under their numbers, and "
        "the equations of sections 9-11 have their twins in hung1984",
    )


# -- section 13 -----------------------------------------------------------------------------------


@cache
def refined() -> tuple[int, int, float]:
    """Small filters in four and eight digits beside exact ones: bounds tried, violations, median of bound/error."""
    rng = np.random.default_rng(125)
    tried, violations, factors = 0, 0, []
    for fmt, second in ((FOUR, False), (FloatFormat(10, 8), True)):
        for _ in range(4):
            Phi, H = exact(rng.integers(-9, 10, (2, 2))) / 20, exact(rng.integers(1, 10, (1, 2)))
            Q, R, P = (exact(np.diag(rng.integers(1, 10, size))) / 8 for size in (2, 1, 2))
            run = truth = smallest.Case(Phi, H, Q, R, exact(rng.integers(-9, 10, 2)), P, exact([0]))
            model = [as_float(each) for each in (Phi, H, Q, R)]
            bound = contraction.contraction_start(as_float(P), np.zeros(2), np.zeros((2, 2)))
            for _ in range(5):
                z = exact(rng.integers(-9, 10, 1))
                run, truth = run._replace(z=z), truth._replace(z=z)
                here, true = exact_step.exact_step(*run), exact_step.exact_step(*truth)
                x, _, P = smallest.rounded_step(fmt, run, second)
                P = (P + P.T) / 2
                given = [as_float(each) for each in (run.x, run.P, z)]
                K, S = as_float(here.gain), as_float(here.innovation_covariance)
                dq, dT, dK, dv = contraction.evaluation_errors(*model, *given, K, S, 2.0**-102)
                bound = contraction.contraction_step(
                    bound,
                    *model,
                    K,
                    S,
                    as_float(here.innovation),
                    as_float(x - here.x),
                    as_float(P - here.P),
                    dq,
                    dT,
                    dK,
                    dv,
                )
                run, truth = run._replace(x=x, P=P), truth._replace(x=true.x, P=true.P)
                errors = np.abs(np.append(as_float(x - true.x), as_float(P - true.P)))
                bounds = np.append(contraction.state_error_bound(bound), contraction.covariance_error_bound(bound))
                tried += len(errors)
                violations += int((errors > bounds).sum())
                factors += (bounds[errors > 0] / errors[errors > 0]).tolist()
    return tried, violations, float(np.median(factors))


def as_float(entries: NDArray[Any]) -> NDArray[np.float64]:
    """Nearest float64 of Fractions."""
    return np.asarray(entries, dtype=object).astype(np.float64)


@CHECKS.add(*both("s13.remark-1"))
def remark_1() -> Finding:
    tried, violations, factor = refined()
    return answer(
        violations == 0 and factor < 1000 and derivation.contraction().holds and derivation.recursion().holds,
        f"(125) is no bound; the contraction bound is one, without first order: {violations} violations in {tried} "
        f"entries of small filters, median bound over error {factor:.2g}",
        note=f"{CHAPTER}, where a companion run makes it sharp over a year",
    )


@CHECKS.add(*both("s13.several-approaches"))
def several_approaches() -> Finding:
    return unverifiable("", "the other approaches are not in the documents")


@cache
def year_again() -> bool:
    """Whether ten steps of a stored year, emulated again, come out as stored."""
    stored = year.load()[0]
    case = stored.case
    if case.fmt is None:
        raise ValueError(f"got {case.name} first in year.csv; needed a run in a format")
    steps = tuple(int(step) for step in stored.steps if step <= 10)
    z = year_cases.simulation(case.model).measurements(max(steps))
    found = emulation.emulate(year_cases.model(case.model, case.base), z, case.fmt, case.form, steps)
    again = np.array([[float(f"{number:.6g}") for number in line] for line in found.state[:, 2:4]])
    return bool(np.array_equal(again, stored.rate[: len(steps)]))


@cache
def needed_precision(base: int) -> int | None:
    """Fewest digits, of those stored, from which on the drift rates, at all steps kept, stay within the goal."""
    needed = None
    for found in sorted(year.load(), key=lambda each: each.case.precision, reverse=True):
        usual = found.case._replace(precision=0) == year_cases.Case(
            year_cases.MODELS[0], base, 0, Rounding.NEAREST, forms.Form.HUNG
        )
        if usual:
            if found.steps[-1] != report_bounds.EXAMPLE[0] or np.abs(found.rate).max() > GOAL:
                break
            needed = found.case.precision
    return needed


@CHECKS.add(*both("s13.remark-2"))
def remark_2() -> Finding:
    again, decimal, binary = year_again(), needed_precision(10), needed_precision(2)
    _, n, m = report_bounds.EXAMPLE
    counts = report_bounds.coefficients(*report_bounds.EXAMPLE)
    asked = report_bounds.precision_for_coefficient(counts.second, Fraction(GOAL, SIGNAL))
    return answer(
        again and decimal is not None and binary is not None,
        f"a filter of our own with {n} states and {m} measurements, run for a year: "
        f"{decimal} decimal digits or {binary} bits keep the drift rates within {GOAL} mas a year, of those tried; "
        f"the second term of (125) asks for {asked} digits",
        note=f"{CHAPTER}; the reports print no matrices, noise and time constants are our choice",
    )


def left_open(note: str) -> Finding:
    return Finding("", None, Verdict.OPEN, note)


@CHECKS.add("hung1982.III.s13.remark-3")
def remark_3() -> Finding:
    return left_open("which computations the data reduction has besides is not in the documents; the book treats some")


@CHECKS.add("hung1982.III.s13.remark-4")
def remark_4() -> Finding:
    return left_open("the method of integration that was chosen is not in the documents")


@CHECKS.add("hung1982.III.s13.remark-5")
def remark_5() -> Finding:
    return left_open("the compensation data are not in the documents")


@CHECKS.add("hung1984.II.s14.references")
def references() -> Finding:
    return unverifiable(
        "",
        "six of the seven works cited are not among the documents, and the text refers to none of them; the seventh is "
        "the report of 1982",
    )


TITLES = {1: "Rounding Errors in Algebraic Processes", 5: "Introduction to Numerical Computations"}


def title(number: int) -> Finding:
    return compare(
        f", {TITLES[number]}, " in quote(f"hung1984.II.s14.reference-{number}"),
        f"the book is called {TITLES[number]}",
        Verdict.MISPRINT,
        otherwise_note="an s is missing",
    )


@CHECKS.add("hung1984.II.s14.reference-1")
def reference_1() -> Finding:
    return title(1)


@CHECKS.add("hung1984.II.s14.reference-5")
def reference_5() -> Finding:
    return title(5)


CONTRACT = "NAS8-34426"


@CHECKS.add("hung1984.II.s14.reference-7")
def reference_7() -> Finding:
    return compare(
        f"NASA Contract {CONTRACT}, " in quote("hung1984.II.s14.reference-7"),
        CONTRACT,
        Verdict.MISPRINT,
        otherwise_note="a 5 for the S that the title page has, as in chapter I; by the author or the scan. The date is "
        "a month after the end of the period that the report of 1982 covers",
    )
