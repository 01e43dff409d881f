"""The process and the filter's equations, (98)-(101) and (109)-(111)."""

from __future__ import annotations

import sympy as sp

from gpbnb.report.kalman import exact_step, report_bounds, smallest
from gpbnb.report.ledger.checks.kalman.filter_run import MEASUREMENTS, STATES, holds_exactly
from gpbnb.report.ledger.checks.kalman.registry import CHECKS, FOUR
from gpbnb.report.ledger.finding import Finding, Verdict, compare, given
from gpbnb.report.ledger.formula import Undefined
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement

_EXACT = f"compared with weighted least squares in exact arithmetic for $n={STATES}$, $m={MEASUREMENTS}$"


@CHECKS.add(*both("s12.noises-uncorrelated"))
def uncorrelated(printed: Statement) -> Finding:
    w, v = sp.zeros(STATES, 1), sp.zeros(MEASUREMENTS, 1)
    try:
        printed.links({"E": lambda product: product, "w": lambda k: w, "v": lambda j: v})
    except Undefined:
        return compare(
            False,
            f"for $n={STATES}$, $m={MEASUREMENTS}$ the product $w_kv_j$ is undefined, while $w_kv_j^T$ is defined",
            Verdict.MISPRINT,
            note="a transpose is missing in $E[w_kv_j]$",
        )
    return given("states that the two noises are independent")


@CHECKS.add(*both("s12.claim-asterisk"))
def asterisk(printed: Statement) -> Finding:
    case = smallest.scalar(FOUR)
    true = exact_step.exact_step(*case)
    x, _, _ = smallest.rounded_step(FOUR, case)
    by_111 = true.transition @ case.x + true.gain @ case.z
    rounded = bool((x == by_111).all())
    return compare(
        printed.claims("x denotes", {"the rounded value of the estimate": rounded, "the exact estimate": not rounded}),
        (f"for one state, a step in four digits gives {float(x[0]):g}; equation (111) gives {float(by_111[0]):.4g}"),
        Verdict.MISPRINT,
        otherwise_note=(
            "from (111) on, $x$ is the exact estimate, as (118) says, and $\\hat x$ is the rounded estimate"
        ),
    )


@CHECKS.add(*both("eq98"), *both("eq98-repeated"), *both("eq111"))
def estimate(printed: Statement) -> Finding:
    return compare(holds_exactly(printed), f"the equation gives the same estimate; {_EXACT}")


@CHECKS.add(*both("eq99"), *both("s12.eq99-recalled"))
def gains(printed: Statement) -> Finding:
    cyclic = report_bounds.order(second=True) is None
    return compare(
        holds_exactly(printed),
        f"the equation gives the same gain; {_EXACT}; with the second form, "
        + ("(99) needs (101) and (101) needs (99)" if cyclic else "an order of the four equations exists"),
        note="analysis (106) uses the second form, while (104) uses a gain without error; no program can do both",
    )


@CHECKS.add(*both("eq100"))
def prediction(printed: Statement) -> Finding:
    return compare(
        holds_exactly(printed),
        r"the covariance of $\Phi_{k-1}x_{k-1}+w_{k-1}$ contains $Q_{k-1}$",
        Verdict.MISPRINT,
        otherwise_note="(100) prints $Q_k$; (102), which repeats it, has $Q_{k-1}$ in both reports; where the scan of "
        "hung1982 is not legible, we take the index from hung1984",
    )


@CHECKS.add(*both("eq101"))
def covariance(printed: Statement) -> Finding:
    return compare(
        holds_exactly(printed),
        "with $K_k$ the equation gives the covariance of the least-squares estimate",
        Verdict.MISPRINT,
        otherwise_note="$K_p$ is printed for $K_k$, which the report prints where it repeats (101)",
    )


@CHECKS.add(*both("s12.eq100-recalled"), *both("s12.eq101-recalled"))
def recalled(printed: Statement) -> Finding:
    return compare(holds_exactly(printed), _EXACT)


@CHECKS.add(*both("eq109"), *both("eq110"))
def defined(printed: Statement) -> Finding:
    if holds_exactly(printed):
        return given("this defines $F_k$ or $u_k$; with this definition (111) gives the estimate of (98)")
    return compare(False, "with this definition (111) does not give the estimate of (98)")


@CHECKS.add("hung1984.II.eq118", "hung1982.III.eq118", "hung1984.II.eq123")
def unrolled(printed: Statement) -> Finding:
    return compare(holds_exactly(printed), f"the equation gives the same estimate; {_EXACT}")


@CHECKS.add("hung1982.III.eq123")
def unrolled_1982(printed: Statement) -> Finding:
    return compare(
        holds_exactly(printed),
        "the equation gives the estimate only with the term $u_4$",
        Verdict.MISPRINT,
        otherwise_note="the scan has lost the last term, but the report must contain it: hung1984 prints it, and "
        "(124), which is the same in both reports, counts it",
    )
