"""Checks of savage2016, (12)-(28): variances and covariances from cycle to cycle."""

from __future__ import annotations

import re
from functools import cache
from itertools import product

import numpy as np
import sympy as sp

from gpbnb.report.integration import derivation, theory
from gpbnb.report.integration.derivation import MU, OMEGA, P22, TIME, X2, X3, P, T
from gpbnb.report.ledger.agreement import hold, vanishes
from gpbnb.report.ledger.checks.integration.cases import (
    Case,
    N,
    Names,
    arbitrary,
    at,
    cases,
    closed_form,
    constants,
    from_zero,
    states,
    steady,
)
from gpbnb.report.ledger.checks.integration.registry import CHECKS, MAIN, eq
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.statements import Statement, statement

CLOSE = 1e-10
"""Relative error allowed for the recursion (18), which subtracts numbers that are 12/μ² times the result."""


@cache
def _misprints() -> dict[str, sp.Expr]:
    return derivation.misprints()


def if_used(place: str) -> str:
    """Return the rate that a misprint would give, for μ = 0.1, T = 0.01 s and an input of variance 1."""
    values = {MU: sp.Rational(1, 10), T: sp.Rational(1, 100)}
    found, right = (float((e * T).subs(values)) for e in (_misprints()[place], derivation.walk()))
    return (
        f"if the printed form were used, the rate $\\dot P_{{ee}}$ for $\\mu=0.1$, $T=0.01$ s and $\\sigma_x=1$ would "
        f"be {found:.4g} instead of {right:.4g} per second"
    )


@cache
def later_uses_are_right() -> bool:
    """Whether (32), which continues from (18) and (25), holds as printed."""
    after = statement(MAIN + "eq32")
    return all(hold(after.links(steady(case))) for case in cases())


@cache
def errors_of_the_set() -> tuple[float, float]:
    """Return the largest relative error of P_ee by (18) and (25), corrected and as printed, over some μ and n."""
    errors = {True: 0.0, False: 0.0}
    for mu in (0.5, 2.0, 10.0):
        exact = theory.error_variance(np.arange(1, 41), mu)
        for right in errors:
            found = theory.savage_recursion(40, mu) if right else theory.savage_recursion(40, mu, 1.0, True)
            errors[right] = max(errors[right], float(np.max(abs(found.pee[1:] / exact - 1))))
    return errors[True], errors[False]


# -- the variance of the error, (12)-(15) ---------------------------------------------------------


@CHECKS.add(*eq("12"))
def squared_mean(printed: Statement) -> Finding:
    variance = derivation.P33 + P22 - 2 * derivation.P32
    names = {
        "n": N,
        "E": derivation.expected,
        "e": at(X3 - X2, None),
        "x_2": at(X2, None),
        "x_3": at(X3, None),
        "P_ee": at(variance, None),
    }
    return compare(
        hold(printed.links(names)),
        "the mean of the square, $E(x_{2n}^2)$, is meant; the printed square of the mean is zero",
        Verdict.MISPRINT,
        otherwise_note=f"(13) again has $P_{{22}}$, so nothing depends on the misprint; {if_used('(12)')}",
    )


@CHECKS.add(*eq("13"))
def error_variance(printed: Statement) -> Finding:
    agrees = True
    for case in cases():
        names = {**from_zero(case), "P_ee": at(closed_form(case, case.cycle), None)}
        agrees = agrees and hold(printed.links(names))
    return compare(
        agrees,
        ("with the covariances of cycle $n$, the equation gives the total variance of the errors of single cycles"),
    )


@CHECKS.add(*eq("14"))
def rate(printed: Statement) -> Finding:
    indices = ("11", "22", "32", "33", "31", "21")

    def every_index(case: Case) -> list[Names]:
        names = arbitrary(case)
        return [{**names, "DeltaP_ij": names[f"DeltaP_{pair}"]} for pair in indices]

    agrees = all(any(hold(printed.links(names)) for names in every_index(case)) for case in cases())
    return compare(
        agrees,
        "the rate is $\\Delta P_{ee_n}/T$; no $\\Delta P_{ij}$ with $i,j\\le3$ equals $\\Delta P_{ee_n}$",
        Verdict.MISPRINT,
        otherwise_note="$ij$ stands for $ee$, in (15) below as well; the last expression, "
        "which is used later, is right",
    )


@CHECKS.add(*eq("29"))
def changes_of_covariances(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(arbitrary(case))) for case in cases())
    return compare(agrees, "each change is that of the covariance over the cycle, as (15) defines it")


# -- products and their expected values, (16)-(18) ------------------------------------------------


@CHECKS.add(*eq("16", "17"))
def products(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(states(case))) for case in cases())
    return compare(agrees, "(10) was used to expand each product")


@CHECKS.add(*eq("18-p31", "18-p33"))
def covariance_step(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(arbitrary(case))) for case in cases())
    return compare(
        agrees, "(4) and (2) propagate the covariance matrix of $(x_1,x_2,x_3)$ through a cycle to this result"
    )


@CHECKS.add(*eq("18-p32"))
def p32(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(arbitrary(case))) for case in cases())
    return compare(
        agrees,
        "the last term must be $\\frac12\\phi_{21}P_{11_{n-1}}T$",
        Verdict.MISPRINT if later_uses_are_right() else Verdict.WRONG,
        otherwise_note="(16) and (17) give the factor $\\frac12$ and (32) has it again, so nothing later depends on "
        f"the misprint. Whoever evaluates (18) before the steady state needs the factor; {if_used('(18)')}, "
        "which would be a negative variance",
    )


@CHECKS.add(MAIN + "sanalysis.substitution-32")
def substituted(printed: Statement) -> Finding:
    before, step = Relation("P_32[n-1]"), statement(MAIN + "eq18-p32").relation()
    change = statement(MAIN + "eq32").relation()
    found = []
    for case in cases():
        names = steady(case)
        found.append(vanishes(step.value(names) - before.value(names) - change.value(names)))
    return compare(
        printed.claims("result", {"(32)": all(found), "a result other than (32)": not all(found)}),
        f"the change of $P_{{32}}$ by (18) as printed agrees with (32) in {sum(found)} of {len(found)} cases",
        Verdict.MISPRINT,
        otherwise_note="the last term of the second equation of (18) lacks the factor $\\frac12$, which (32) has",
    )


# -- the continuous covariances, (19)-(23) --------------------------------------------------------


@cache
def _in_time(case: Case, entries: tuple[sp.Rational, ...]) -> Names:
    """Return the covariance matrix of (x_1, x_2) at a time, and its derivative, from the matrix exponential."""
    p11, p12, p22 = entries
    phi = derivation.transition_matrix().applyfunc(lambda e: e.subs(OMEGA, case.omega))
    added = derivation.noise().applyfunc(lambda e: e.subs({OMEGA: case.omega, P: case.steady}))
    matrix = phi * sp.Matrix([[p11, p12], [p12, p22]]) * phi.T + added
    now, slope = (m.subs(T, sp.Rational(6, 5)) for m in (matrix, matrix.diff(T)))
    density = 2 * case.omega * case.steady  # keeps P_11 at its steady value
    names: Names = {
        **constants(case),
        "t": sp.Rational(6, 5),
        "P": now,
        "P_dot": slope,
        "A": sp.Matrix([[-case.omega, 0], [1, 0]]),
        "N_p": sp.Matrix([[density, 0], [0, 0]]),
        "N_P11": density,
    }
    del names["T"]  # a symmetric matrix would hide the transpose
    for i, j in product(range(2), repeat=2):
        names[f"P_{i + 1}{j + 1}"], names[f"P_dot_{i + 1}{j + 1}"] = now[i, j], slope[i, j]
    return names


_ANY = (sp.Rational(7, 2), sp.Rational(-2, 3), sp.Rational(5, 4))


def _from_any(case: Case) -> Names:
    return _in_time(case, _ANY)


def _from_steady(case: Case) -> Names:
    return _in_time(case, (case.steady, sp.S.Zero, sp.S.Zero))


@CHECKS.add(*eq("19"))
def covariance_equation(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(_from_any(case))) for case in cases())
    return compare(
        agrees,
        (
            "$\\Phi P\\Phi^T+E(\\underline q\\,\\underline q^T)$ solves the equation, with "
            "$N_{P_{11}}=2\\omega_{bw}P_{11\\infty}$"
        ),
    )


@CHECKS.add(MAIN + "sanalysis.substitution-21")
def expanded(printed: Statement) -> Finding:
    cited = [statement(MAIN + f"eq{number}") for number in re.findall(r"\((\d+)\)", printed.says("equations"))]
    parts = [part for each in cited for part in each.parts if isinstance(part, Relation) and part.equates]
    given = {part.sides[0].text: part.sides[-1].text for part in parts}
    missing = [name for name in ("P", "A_underline", "N_p") if not given.get(name, "").startswith("[[")]
    return compare(
        not missing,
        "(19) contains $P$, $A$ and $N_p$; (20) gives the entries of $P$ and $N_p$, and (4) those of $A$",
        Verdict.MISPRINT,
        otherwise_note="(4) is meant: (3) names the matrix $A$ but does not give its entries",
    )


@CHECKS.add(*eq("21"))
def covariance_components(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(_from_any(case))) for case in cases())
    same_letter = all(hold(printed.links({**_from_any(case), "omega_BW": case.omega})) for case in cases())
    return compare(
        agrees,
        "$\\dot P_{12}=P_{11}-\\omega_{bw}P_{12}$; the others as printed",
        Verdict.MISPRINT if same_letter else Verdict.WRONG,
        otherwise_note="the subscript has capitals only here",
    )


@CHECKS.add(*eq("22"))
def simplified(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(_from_steady(case))) for case in cases())
    return compare(agrees, "this is (21) with $P_{11}$ at its steady-state value")


@CHECKS.add(*eq("23"))
def continuous_solution(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(_from_steady(case))) for case in cases())
    return compare(
        agrees, "the matrix $E(\\underline x\\,\\underline x^T)$ follows from $P_{12}=P_{22}=0$ at the start"
    )


_STARTS = {"at its steady state value": 1, "zero": 0, "twice its steady state value": 2}


@CHECKS.add(MAIN + "sanalysis.steady-start")
def steady_start(printed: Statement) -> Finding:
    start = _STARTS[printed.says("start")]
    carried = {"zero": 0, "steady": 1}[printed.says("conditions")]
    agrees = True
    for case in cases():
        steady12 = case.steady / case.omega
        names = _in_time(case, (start * case.steady, carried * steady12, carried * steady12 * case.period))
        expected = derivation.p12(TIME), derivation.p22(TIME)  # (23)
        values = {OMEGA: case.omega, P: case.steady, TIME: names["t"]}
        agrees = agrees and all(
            vanishes(names[key] - e.subs(values)) for key, e in zip(("P_12", "P_22"), expected, strict=True)
        )
    late = [float(np.diff(theory.error_variance([5000, 5001], 0.5, s))[0]) for s in (1.0, 0.0)]
    return compare(
        agrees,
        "(22) and (23) follow only from this initial value",
        note="after many cycles the rate does not depend on the initial value of $P_{11}$"
        if abs(late[0] / late[1] - 1) < 1e-9
        else "",
    )


# -- at the cycles, (24)-(28) ---------------------------------------------------------------------


@CHECKS.add(*eq("24", "27", "28"))
def at_cycles(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(from_zero(case))) for case in cases())
    return compare(agrees, "the covariances were propagated from zero, cycle by cycle, to $t_{n-1}$ and $t_n$")


@CHECKS.add(*eq("25"))
def p22_recursion(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(from_zero(case))) for case in cases())
    values = {P: 1, OMEGA: 10, T: sp.Rational(1, 100), TIME: 0}
    found, right = (float(derivation.p22_change(printed=wrong).subs(values)) for wrong in (True, False))
    return compare(
        agrees,
        "$\\frac2{\\omega_{bw}}[T-\\frac1{\\omega_{bw}}(1-e^{-\\omega_{bw}T})e^{-\\omega_{bw}t_{n-1}}]P_{11\\infty}$",
        Verdict.MISPRINT if later_uses_are_right() else Verdict.WRONG,
        otherwise_note="the printed term subtracts a pure number from a time, where (24) has "
        "$\\frac1{\\omega_{bw}}$; for large $n$ the term vanishes, so nothing later depends on the misprint. Whoever "
        "evaluates (25) for the first cycles needs the factor: the first change of $P_{22}$ for "
        f"$\\omega_{{bw}}=10$, $T=0.01$ is {found:.3g} as printed, not {right:.3g}",
    )


@CHECKS.add(MAIN + "sanalysis.complete-set")
def complete_set(printed: Statement) -> Finding:
    right, wrong = errors_of_the_set()
    complete = right < CLOSE
    fit = f"accurate to {CLOSE:.0e}" if complete else f"wrong by {right:.1e}"
    return compare(
        printed.says("set")
        == ("comprise a complete set for evaluating" if complete else "lack an equation for evaluating"),
        f"with the misprints of (18) and (25) corrected, no equation is missing: $P_{{ee_n}}$ is {fit}",
        note="the initial values $P_{31}=P_{32}=P_{33}=0$ are needed as well, and with the misprints the error is "
        f"up to {wrong:.2g} times the value",
    )
