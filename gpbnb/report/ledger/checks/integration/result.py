"""Checks of savage2016, (30)-(39): the steady state, the random walk and its approximation."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.report.integration import derivation, theory
from gpbnb.report.integration.derivation import MU
from gpbnb.report.ledger.agreement import hold, vanishes
from gpbnb.report.ledger.checks.integration.cases import Case, Names, cases, constants, steady, walk_rate
from gpbnb.report.ledger.checks.integration.covariance import if_used
from gpbnb.report.ledger.checks.integration.registry import CHECKS, MAIN, eq
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.statements import Statement, statement

# -- the steady state, (30)-(34) ------------------------------------------------------------------


@CHECKS.add(*eq("30", "31"))
def steady_covariances(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(steady(case))) for case in cases())
    return compare(
        agrees,
        "the steady-state values are $P_{12\\infty}=P_{11\\infty}/\\omega_{bw}$, "
        "$P_{31\\infty}=\\frac12\\frac{1+\\phi_{11}}{1-\\phi_{11}}P_{11\\infty}T$",
    )


@CHECKS.add(*eq("32"))
def steady_changes(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(steady(case))) for case in cases())
    return compare(agrees, "all expressions equal the change of the covariance matrix over a cycle in the steady state")


@CHECKS.add(*eq("33"))
def steady_rate(printed: Statement) -> Finding:
    agrees = True
    for case in cases():
        names = constants(case)
        names["P_dot_ee"] = {names["n"]: walk_rate(case)}
        agrees = agrees and hold(printed.links(names))
    return compare(agrees, "the errors of single cycles give the same result without (10)-(32)")


@CHECKS.add(MAIN + "sanalysis.substitution-33")
def substituted_rate(printed: Statement) -> Finding:
    number = printed.says("equations").strip("()")
    relations = [part for part in statement(f"{MAIN}eq{number}").parts if isinstance(part, Relation)]
    changes = {each.sides[0].value(): each.value() for each in relations}
    rate, stated = (statement(f"{MAIN}eq{each}").relation().value() for each in ("14", "33"))
    return compare(
        bool(sp.simplify(rate.subs(changes) - stated) == 0),
        "with the three changes of (32), (14) is the last side of (33)",
    )


@CHECKS.add(*eq("34"))
def rate_in_mu(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(constants(case))) for case in cases())
    ends = all(vanishes(links[0].left - links[-1].right) for links in (printed.links(constants(c)) for c in cases()))
    return compare(
        agrees,
        (
            "the second expression must be $(1+\\phi_{11})T-\\frac2{\\omega_{bw}}(1-\\phi_{11})$ divided "
            "by $1-\\phi_{11}$"
        ),
        Verdict.MISPRINT if ends else Verdict.WRONG,
        otherwise_note="the factor $T$ is missing, which the third expression has again; "
        f"{if_used('(34)')}; with $T=1$ the misprint has no effect",
    )


# -- the random walk, (35) ------------------------------------------------------------------------


@CHECKS.add(*eq("35"))
def random_walk(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(_with_walk(case))) for case in cases())
    return compare(
        agrees,
        "$\\sigma_x\\sqrt{L(\\mu/2)/f_c}$, with Langevin's function $L(x)=\\coth x-1/x$",
        note="we derived the result from the errors of single cycles, without (10)-(34)",
    )


def _with_walk(case: Case) -> Names:
    return {**constants(case), "sigma_e_rw": sp.sqrt(walk_rate(case))}


@CHECKS.add(MAIN + "sanalysis.35-exact")
def exact(printed: Statement) -> Finding:
    folded = _folded()
    found = "an exact" if folded < _SUMMED and derivation.independent().holds else "an approximate"
    return compare(
        printed.says("kind") == found,
        "the errors of single cycles give the same rate; the sum of the spectrum over the multiples "
        f"of $f_c$ agrees to {_SUMMED:.0e}",
        note=(
            "the rate is exact; after many cycles the variance itself is smaller than the rate times the "
            "time by $\\frac12\\sigma_x^2T^2L^2$"
        ),
    )


_SUMMED = 1e-12


@cache
def _folded() -> float:
    """Return the largest relative difference of (35) squared from the sum of the spectrum over the multiples of f_c."""
    return max(abs(_summed(mu) / float(theory.walk_factor(mu)) - 1) for mu in (1e-4, 0.1, 1.0, 30.0))


def _summed(mu: float) -> float:
    """Return (35) squared over σ_x² T from the spectrum at the multiples of f_c; an integral replaces distant ones."""
    k = np.arange(1, 20_001)
    near = float(np.sum(theory.first_order(1.0, mu).psd(2 * np.pi * k)))
    return 2 * (near + float(np.arctan(mu / (2 * np.pi * (len(k) + 0.5)))) / np.pi)


_CYCLES = {"for very large n": 10_000, "for any n": 2, "for n = 1": 1}


@CHECKS.add(MAIN + "sanalysis.large-n")
def large_n(printed: Statement) -> Finding:
    n = _CYCLES[printed.says("n")]
    away = max(
        abs(float(theory.error_variance(n, mu)) / (n * float(theory.walk_factor(mu))) - 1) for mu in (0.01, 1.0, 100.0)
    )
    begins = {mu: theory.settling_cycles(mu, 0.01) for mu in (0.1, 1.0, 100.0)}
    return compare(
        away < 1e-3,
        "the variance agrees with that of the random walk to 1 % from cycle "
        + ", ".join(f"{np.ceil(k):.0f} on at $\\mu={mu:g}$" for mu, k in begins.items()),
        note="the relative difference is $L(1-e^{-n\\mu})/2n$, so $n$ need not be very large",
    )


_UNITS = {"per square-root-of-secs": 0.5, "per second": 1.0, "per hour": None}


@CHECKS.add(MAIN + "sanalysis.unit-of-35")
def units(printed: Statement) -> Finding:
    base = theory.random_walk(2.0, 3.0, 7.0)
    per_minute = theory.random_walk(2.0 * 60, 3.0 * 60, 7.0 * 60)
    power = float(np.log(per_minute / base) / np.log(60))
    expected = _UNITS[printed.says("unit")]
    agrees = all(hold(printed.links(constants(case))) for case in cases())
    return compare(
        agrees and expected is not None and abs(power - expected) < 1e-12,
        f"with minutes in place of seconds throughout, the number is {per_minute / base:.4f} times as "
        "large, which is $\\sqrt{60}$; $\\mu=\\omega_{bw}T$",
        note="the unit is that of the integral, per √s",
    )


# -- small μ, (36)-(39) ---------------------------------------------------------------------------


@CHECKS.add(*eq("36"))
def exponential(printed: Statement) -> Finding:
    (link,) = printed.links({"mu": MU, "dots": sp.O(MU**4)})
    ours = sp.series(link.left, MU, 0, 4).removeO()
    agrees = printed.equates and link.right.has(sp.Order) and vanishes(link.right.removeO() - ours)
    return compare(bool(agrees), f"${sp.latex(ours, order='rev-lex')}$, plus terms of order $\\mu^4$ and higher")


@CHECKS.add(*eq("37"))
def series(printed: Statement) -> Finding:
    links = printed.links({"mu": MU, "dots": sp.S.Zero})
    # The second step only divides by 2 and μ, so it is exact, like the last one. The others omit terms from μ² on.
    first, second, third, fourth, last = (sp.cancel(sp.together(_rational(link))) for link in links)
    others = all(_order(gap) >= 2 for gap in (first, third, fourth)) and last == 0
    return compare(
        bool(printed.equates and others and second == 0),
        (
            "the cubic term of the numerator must be $\\frac1{12}\\mu^3$; everything else, including the "
            "result $\\frac16\\mu$, is right"
        ),
        Verdict.MISPRINT if others else Verdict.WRONG,
        otherwise_note="the factor 2 in front halves the quadratic term but was not applied to the cubic term; "
        "the next line drops the cubic term, so nothing depends on it. If "
        f"kept, it would add a term ${sp.latex(derivation.printed_37(sp.Rational(1, 6)) - MU / 6)}$ to an odd "
        "function of $\\mu$",
    )


def _rational(link: Any) -> sp.Expr:
    """Return left minus right side, with the exponential replaced by its series up to μ⁶."""
    cut = sum(((-MU) ** k / sp.factorial(k) for k in range(7)), start=sp.S.Zero)
    return (link.left - link.right).subs(sp.exp(-MU), cut)


def _order(gap: sp.Expr) -> float:
    """Return the lowest exponent of μ in a quotient of polynomials."""
    if gap == 0:
        return float("inf")
    numerator, denominator = (sp.Poly(part, MU) for part in sp.fraction(gap))
    return float(min(m for (m,) in numerator.monoms()) - min(m for (m,) in denominator.monoms()))


@CHECKS.add(*eq("38", "39"))
def approximation(printed: Statement) -> Finding:
    mu = np.array([0.01, 0.03, 0.1])
    excess = theory.approximation_ratio(mu) - 1
    next_term = bool(np.all(abs(excess / (mu**2 / 120) - 1) < 0.01))
    return compare(
        _in_the_limit(printed) and next_term,
        "the approximation is too large by a fraction $\\mu^2/120$: by 1 % at "
        f"$\\mu={theory.validity(0.01):.2f}$, by 10 % at $\\mu={theory.validity(0.1):.2f}$",
        note="the approximation holds for small $\\mu$, as the document says",
    )


def _in_the_limit(printed: Statement) -> bool:
    """Whether both sides of an approximation agree for a very small μ."""
    omega, sigma, mu = sp.Rational(7, 3), sp.Rational(5, 2), sp.Rational(1, 10**12)
    f_c = omega / mu
    walk = (1 + sp.exp(-mu)) / (1 - sp.exp(-mu)) - 2 / mu
    names = {
        "sigma_e_rw": sp.N(sigma * sp.sqrt(walk / f_c), 60),
        "sigma_x": sigma,
        "mu": mu,
        "f_c": f_c,
        "omega_bw": omega,
    }
    (link,) = printed.links(names)
    return bool(link.symbol == "≈" and abs(sp.N(link.left / link.right, 60) - 1) < sp.Rational(1, 10**20))


@CHECKS.add(MAIN + "sanalysis.small-mu")
def small_mu(printed: Statement) -> Finding:
    mu = {"small": 1e-3, "large": 1e3}[printed.says("mu")]
    away = abs(float(theory.approximation_ratio(mu)) - 1)
    return compare(
        away < 1e-6,
        f"(39) over (35) is 1 + {float(theory.approximation_ratio(1e-3)) - 1:.1g} at $\\mu=10^{{-3}}$ and "
        f"{float(theory.approximation_ratio(1e3)):.0f} at $\\mu=10^3$",
    )
