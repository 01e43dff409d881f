"""Check three steps, four steps and k steps: (119)-(125) and the claims about them."""

from __future__ import annotations

import math
import operator
from fractions import Fraction
from functools import cache
from typing import Any

import sympy as sp

from gpbnb.arithmetic.rational import exact, max_norm
from gpbnb.report.kalman import derivation, exact_step, report_bounds, smallest
from gpbnb.report.ledger.checks.kalman import algebra, worst_case
from gpbnb.report.ledger.checks.kalman.judging import bounded, judge
from gpbnb.report.ledger.checks.kalman.registry import CHECKS, FOUR
from gpbnb.report.ledger.checks.kalman.steps import SIGNS
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.first_order import FirstOrder
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, statement


@cache
def _no_bound() -> str:
    """Say what the smallest counterexample to (125) loses, and by how much it moves the estimate."""
    case = smallest.scalar(FOUR)
    true, (x, _, P) = exact_step.exact_step(*case), smallest.rounded_step(FOUR, case)
    kept = (
        "the computed covariance is zero, so all of its digits are lost" if P[0, 0] == 0 else "the covariance remains"
    )
    deviations = float(abs(x - true.x)[0]) / math.sqrt(true.P[0, 0])
    return (
        "the counterexample has one state with $P=H=\\Phi=x_0=1$, $z=0$ and $R$ below the last digit; in every format, "
        f"{kept}. In four digits, the error of the estimate is only {deviations:.2g} standard deviations of the exact "
        "estimate, but (125) does not allow it"
    )


_BETA = "; the prefactor is $\\beta$, as in the example, although the scans show B"


def _several_steps(printed: Statement, names: dict[str, Any], note: str, otherwise: str = "") -> Finding:
    instances = (*worst_case.several_steps(), *worst_case.tight_steps())
    return bounded(printed, instances, names, note, SIGNS, otherwise)


@CHECKS.add(*both("eq119"), *both("eq120"))
def three_steps(printed: Statement) -> Finding:
    return _several_steps(
        printed,
        algebra.three_steps(twice=True),
        "(114) rests on bounds that fail, and roundings are counted twice; each term of (118) has "
        "its own error, so the errors do not combine into one multiple of $x_3$",
        "; $3m+1$ is printed for $3n+1$",
    )


@CHECKS.add(*both("eq121"))
def norm_with_minus(printed: Statement) -> Finding:
    left, right = _signs(statement(printed.id))
    return bounded(
        printed,
        (*worst_case.several_steps(), *worst_case.tight_steps()),
        algebra.three_steps(twice=True),
        "the sum of the norms bounds the norm of a difference, so (121) must add, as (122) does. With the errors of "
        f"(120), $n=m=1$, $F_k=1$, $x_0=-3$ and $u_k=1$, the left side is ${left}\\epsilon$ and the right side "
        f"${right}\\epsilon$. With plus signs, (121) would still be no bound, because (120) is none",
        "minus-signs-in-a-norm-bound",
    )


def _signs(printed: Statement) -> tuple[sp.Expr, sp.Expr]:
    """Return both sides of (121) over ε in an example where the terms of (120) have different signs."""
    x_0, u = Fraction(-3), Fraction(1)
    counts = [derivation.count_start(derivation.TWICE[0])] + [
        derivation.count_input(*derivation.TWICE).subs(derivation.NTH, i) for i in (1, 2, 3)
    ]
    of_start, *of_inputs = (int(count.subs({derivation.K: 3, derivation.N: 1, derivation.M: 1})) for count in counts)
    names = {"n": 1, "m": 1, "epsilon": 1, "F_3": 1, "F_2": 1, "norm": abs}
    names |= {"u_1": u, "u_2": u, "u_3": u, "x_3": x_0 + 3 * u, "x_tilde_3": of_start * x_0 + sum(of_inputs) * u}
    link = printed.links(names, Fraction)[-1]
    return link.left, link.right


#: Closed loops and inputs: one for which the norms (21) and (22) are not compatible, and one number.
_LOOPS = (([["9/10", "9/10"], [0, 0]], [1, 1]), ([["3/2"]], [2]))


@CHECKS.add(*both("s12.assumptions-before-122"))
def assumptions(printed: Statement) -> Finding:
    """Whether the least F, u and B that meet the printed assumptions bound the terms of (122)."""
    right, terms, least = True, [], []
    for loop, entered in _LOOPS:
        F, u = exact(loop), exact(entered)
        names: dict[str, Any] = {"norm": FirstOrder.norm, "F_k": FirstOrder(F), "u_k": FirstOrder(u[:, None])}
        of_loop, of_input = (printed.relation(i).links(names, Fraction)[0] for i in (1, 2))
        norms = {"F": of_loop.left.value, "u": of_input.left.value}
        of_terms = [printed.relation(3).links(norms | {"i": i}, Fraction)[0] for i in range(3)]
        bounded_by = zip((of_loop, of_input, *of_terms), ("F", "u", "B", "B", "B"), strict=True)
        right = right and all(link.symbol == "<=" and link.right == sp.Symbol(name) for link, name in bounded_by)
        needed, powers = [max_norm(u), max_norm(F @ u), max_norm(F @ F @ u)], [link.left for link in of_terms]
        right = right and (needed == powers if len(u) == 1 else all(map(operator.le, needed, powers)))
        terms.append(needed[-1])
        least.append(max(powers))
    return compare(
        right,
        "for two steps with the closed loop $F=(0.9,0.9;0,0)$ and $u=(1,1)$, "
        f"$\\|FFu\\|={float(terms[0])}$; the smallest $B$ is {float(least[0])}",
        otherwise_note="the norms (21) and (22) are not compatible: $\\|Fu\\|\\le\\|F\\|\\|u\\|$ needs row sums",
        root="incompatible-norms",
    )


@CHECKS.add(*both("eq122"), *both("eq124"), *both("eq125"))
def norm_bounds(printed: Statement) -> Finding:
    return _several_steps(printed, algebra.norms(), _no_bound() + _BETA)


@CHECKS.add(*both("s12.claim-main-result"))
def claim_of_a_bound(printed: Statement) -> Finding:
    found = judge(statement("hung1984.II.eq125"), (*worst_case.several_steps(), *worst_case.tight_steps()))
    return compare(
        printed.claims("equation (125)", {"gives the bound": found.right, "does not give a bound": not found.right}),
        f"in four digits, the error of an example filter is {found.times:.3g} times what (125) allows",
        otherwise_note=_no_bound(),
        root=SIGNS,
    )


@CHECKS.add(*both("s12.125-found-from-pattern"))
def pattern(printed: Statement) -> Finding:
    found = algebra.holds(statement("hung1984.II.eq125"), algebra.norms())
    return compare(
        printed.claims("the general case", {"follows the pattern": found, "departs from the pattern": not found}),
        "summation gives the coefficients of (125) for every $k$, $n$, $m$",
        note="(125) continues the pattern of the preceding bounds correctly, but these bounds are wrong",
    )


@CHECKS.add(*both("s12.claim-similar-derivation"))
def similar_derivation(printed: Statement) -> Finding:
    found = algebra.holds(statement("hung1984.II.eq124"), algebra.norms())
    return compare(
        printed.claims("the same derivation", {"gives (124)": found, "does not give (124)": not found}),
        "the coefficients of (124) follow by the same sums for $k=4$",
        note="the derivation starts from bounds that fail",
    )


@CHECKS.add(*both("s12.125-dependence"))
def dependence(printed: Statement) -> Finding:
    def value(
        k: int = 3, n: int = 2, m: int = 1, x: int = 1, B: int = 1, beta: Fraction = FOUR.unit_roundoff
    ) -> Fraction:
        return report_bounds.state_bound(Fraction(x), Fraction(B), beta, report_bounds.coefficients(k, n, m))

    others = [value(k=4), value(n=3), value(m=2), value(x=2), value(B=2), value(beta=FOUR.unit_roundoff * 2)]
    grows = all(other > value() for other in others)
    return compare(
        printed.claims("the bound", {"depends on all six": grows, "is independent of some of the six": not grows}),
        f"the bound grows with each of the {len(others)}",
        note="the error also depends on how far $I-KH$ cancels, which none of the six quantities shows",
    )


@CHECKS.add("hung1984.II.s12.word-interactions")
def word(printed: Statement) -> Finding:
    return compare(
        printed.claims("k counts", {"interactions": False, "iterations": True}),
        "$k$ counts the iterations of the filter",
        Verdict.MISPRINT,
        otherwise_note="the text means iterations, with a period of ten seconds",
    )
