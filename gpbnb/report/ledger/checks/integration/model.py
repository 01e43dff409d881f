"""Checks of savage2016 up to (11): title, figure, model, transition matrix and states from cycle to cycle."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.report.integration import derivation, theory
from gpbnb.report.integration.derivation import OMEGA, TAU, TIME, P, T
from gpbnb.report.ledger.agreement import hold, vanishes
from gpbnb.report.ledger.checks.integration.cases import Case, cases, constants, states
from gpbnb.report.ledger.checks.integration.registry import CHECKS, MAIN, eq
from gpbnb.report.ledger.finding import Finding, Verdict, compare, given
from gpbnb.report.ledger.formula import Words
from gpbnb.report.ledger.statements import Statement

# -- title, abstract, figure ----------------------------------------------------------------------


_POWERS = {
    "directly proportional": 1.0,
    "inversely proportional": -1.0,
    "directly proportional to the square-root": 0.5,
    "inversely proportional to the square-root": -0.5,
}


def _limited(printed: Statement) -> bool:
    """Whether a claim restricts itself to inputs that vary slowly between updates."""
    ranges = {part.label: part.printed for part in printed.parts if isinstance(part, Words)}
    return {"for small $\\mu$": True, "for every $\\mu$": False}[ranges.get("range", "for every $\\mu$")]


@CHECKS.add(MAIN + "sabstract.abstract-claim")
def abstract(printed: Statement) -> Finding:
    mu = np.array([1e-3, 0.1, 1.0, 10.0, 100.0])
    width, rate = theory.exponents(mu)
    in_rms = float(np.log(theory.random_walk(6.0, 5.0, 7.0) / theory.random_walk(2.0, 5.0, 7.0)) / np.log(3))
    amplitude, bandwidth, frequency = (_POWERS[printed.says(name)] for name in ("amplitude", "bandwidth", "frequency"))
    away = np.maximum(abs(width - bandwidth), abs(rate - frequency)) + abs(in_rms - amplitude)
    small = mu <= 0.1 if _limited(printed) else mu < np.inf
    return compare(
        bool(np.all(away[small] < 0.01)),
        f"the error varies with the bandwidth and the frequency to the powers {width[0]:.2f} and "
        f"{rate[0]:.2f} at $\\mu=10^{{-3}}$, {width[2]:.2f} and {rate[2]:.2f} at $\\mu=1$, and "
        f"{width[-1]:.2f} and {rate[-1]:.2f} at $\\mu=100$; it varies with the rms to the power "
        f"{in_rms:.2f} throughout",
        Verdict.INCONSISTENT,
        otherwise_note="the claim is true only of approximation (39) for small $\\mu$, not of (35); (39) is 1 % too "
        f"large at $\\mu={theory.validity(0.01):.2f}$ and 10 % at {theory.validity(0.1):.2f}",
    )


@cache
def _growth() -> tuple[float, float, float]:
    """Return the unevenness of variance growth for two inputs, and variances for a sharp-edged spectrum."""
    f_c, uneven = 2.0, 0.0
    for process in (theory.first_order(1.0, 1.0), theory.resonant(1.0, 3.0, 0.2)):
        variance = theory.rule_variance(process, f_c, theory.RULES["trapezoidal"], 400)
        grown = (variance[400] - variance[200]) * f_c / 200
        uneven = max(uneven, abs(float(grown) / theory.walk_rate(process, f_c) - 1))
    return uneven, _with_edge(_EDGE, 100), _with_edge(_EDGE, 1000)


_EDGE = 0.4


def _with_edge(edge: float, n: int) -> float:
    """Return the error variance after n cycles, over σ_x² T², for a flat spectrum that ends at `edge` times f_c."""
    f = np.pi * edge * (np.arange(20_000) + 0.5) / 20_000
    one = np.cos(f) - np.sin(f) / f  # trapezoid minus integral over a cycle
    return float(np.mean((one * np.sin(n * f) / np.sin(f)) ** 2))


@CHECKS.add(MAIN + "sabstract.random-walk")
def walk_type(printed: Statement) -> Finding:
    uneven, early, late = _growth()
    grows = "a random walk type error" if uneven < 1e-9 else "another error"
    return compare(
        printed.says("growth") == grows,
        "after many cycles the variance grows by the same amount in each cycle, for the input of (1) and for a "
        "resonant one; the spectrum at the multiples of $f_c$ gives the same rate",
        note="the claim holds for noise limited by a filter; an input whose flat spectrum ends at "
        f"${_EDGE:g}f_c$ causes no random walk: its error variance is ${early:.2g}\\sigma_x^2T^2$ "
        f"after 100 cycles and ${late:.2g}\\sigma_x^2T^2$ after 1000",
    )


_LETTERS = {
    "the integration algorithm processing rate and the band-limited random noise magnitude/bandwidth": {P, OMEGA, T},
    "the integration algorithm processing rate alone": {T},
    "the time since the start": {TIME},
}


@CHECKS.add(MAIN + "sanalysis.aim")
def aim(printed: Statement) -> Finding:
    d32, d33, d22 = derivation.steady_changes()
    letters = sp.simplify((d33 + d22 - 2 * d32) / T).free_symbols
    return compare(
        letters == _LETTERS[printed.says("of")],
        "$\\dot P_{ee}$ depends only on $P_{11\\infty}=\\sigma_x^2$, $\\omega_{bw}$ and $T$",
        note="the claim holds for the growth of the error at large $n$; the error itself also depends on the time",
    )


# -- the model, (1)-(4) ---------------------------------------------------------------------------


@CHECKS.add(MAIN + "sanalysis.band-limited")
def band_limited() -> Finding:
    omega = 3.0
    angle = np.pi / 2 * (np.arange(1000) + 0.5) / 1000
    process = theory.first_order(1.0, omega)
    # Shares of the variance below ω tan θ; the density over θ is uniform.
    density = process.psd(omega * np.tan(angle)) * omega / np.cos(angle) ** 2 / 2000
    inside = float(np.sum(density[:500]) / np.sum(density))
    return given(f"names $x_1$; {inside:.0%} of its variance lies below $\\omega_{{bw}}$, and the rest above")


@CHECKS.add(MAIN + "sanalysis.bandwidth")
def bandwidth() -> Finding:
    process = theory.first_order(2.0, 3.0)
    low, edge = (float(process.psd(s)) for s in (0.0, 3.0))
    return given(f"names $\\omega_{{bw}}$, in rad/s; the spectral density there is {edge / low:.2f} of that at zero")


@CHECKS.add(*eq("2"))
def trapezoidal(printed: Statement) -> Finding:
    samples = [sp.Rational(v) for v in ("1", "3", "-2", "11/2")]
    period = sp.Rational(1, 4)
    rule = theory.RULES["trapezoidal"].weights[0]
    agrees = True
    for k in range(1, 4):
        start = sp.Rational(k, 3)
        area = period * (sp.Rational(rule[0]) * samples[k - 1] + sp.Rational(rule[1]) * samples[k])
        names = {"T": period, "n": sp.Integer(k), "x_1": lambda i: samples[int(i)]}
        names["x_3"] = {k - 1: start, k: start + area}
        agrees = agrees and hold(printed.links(names))
    return compare(agrees, "each cycle adds the area of the trapezoid between two samples")


@CHECKS.add(*eq("3"))
def state_form(printed: Statement) -> Finding:
    x1, x2, n1, w = sp.symbols("x_1 x_2 n_p1 omega_bw")
    names = {
        "x_underline_dot": sp.Matrix([-w * x1 + n1, x1]),  # (1)
        "A_underline": sp.Matrix([[-w, 0], [1, 0]]),
        "x_underline": sp.Matrix([x1, x2]),
        "n_underline_p": sp.Matrix([n1, 0]),
    }
    return compare(hold(printed.links(names)), "this is (1), with the vectors and the matrix of (4)")


@CHECKS.add(*eq("4"))
def matrices(printed: Statement) -> Finding:
    x1, x2, n1, w = sp.symbols("x_1 x_2 n_p1 omega_bw")
    x, a, noise = (printed.relation(k).value({"matrix": sp.Matrix}) for k in (1, 2, 3))
    rates = sp.Matrix([-w * x1 + n1, x1])  # (1)
    agrees = (
        printed.equates
        and x == sp.Matrix([x1, x2])
        and vanishes(a - rates.jacobian(x))
        and vanishes(rates - a * x - noise)
    )
    return compare(
        bool(agrees),
        (
            "the derivatives of (1) with respect to $\\underline x$ form $\\underline A$, and the "
            "remaining term is $\\underline n_p$"
        ),
    )


# -- the transition, (5)-(9) ----------------------------------------------------------------------


_FORCE = sp.Rational(2, 3) - sp.Rational(5, 4) * TAU
"""A noise n_p1(τ) for which (1) has a solution in closed form."""


@cache
def _driven(case: Case) -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """Return the states before and after a cycle with a given input, by integrating (1), and the input's part."""
    s = sp.Symbol("s", positive=True)
    w, start = case.omega, sp.Matrix(case.before[:2])
    force = _FORCE.subs(TAU, s)
    x1 = sp.exp(-w * TAU) * (start[0] + sp.integrate(sp.expand(force * sp.exp(w * s)), (s, 0, TAU)))
    after = sp.Matrix([x1.subs(TAU, case.period), start[1] + sp.integrate(sp.expand(x1), (TAU, 0, case.period))])
    return start, after, after - case.phi * start


@CHECKS.add(*eq("5"))
def discrete(printed: Statement) -> Finding:
    agrees = True
    for case in cases():
        start, after, driven = _driven(case)
        index = constants(case)["n"]
        states_at = {index: after, index - 1: start}
        names = {"n": index, "Phi": {index: case.phi}, "x_underline": states_at, "q_underline": {index: driven}}
        agrees = agrees and hold(printed.links(names))
    return compare(
        agrees,
        "the equation is (3), integrated over a cycle with a given input; the part independent of "
        "the state is $\\underline q_n$",
    )


def _integral(term: Any, bounds: list[Any]) -> Any:
    variable, first, last = bounds
    return sp.Matrix(term).applyfunc(lambda entry: sp.integrate(sp.expand(entry), (variable, first, last)))


@CHECKS.add(*eq("6-phi"))
def transition_integral(printed: Statement) -> Finding:
    case = cases()[0]
    time, index = sp.Symbol("tau", positive=True), constants(case)["n"]
    exact = transition_in_time(case)

    def phi(argument: Any) -> sp.Matrix:
        return exact(case.period if argument == index else argument)

    names = {
        **constants(case),
        "Phi": phi,
        "tau": time,
        "A": sp.Matrix([[-case.omega, 0], [1, 0]]),
        "I": sp.eye(2),
        "Int": _integral,
    }
    links = printed.links(names)
    residual = derivation.transition_residual(identity=False)
    return compare(
        hold(links),
        f"(7) exceeds the printed integral by ${sp.latex(residual)}$: $\\Phi(\\tau)=I+\\int_0^\\tau A\\Phi\\,d\\tau_1$",
        Verdict.MISPRINT,
        otherwise_note="the $I$ is missing, although $\\Phi(0)=I$ is printed beside the equation, and the limits "
        "are those of $t$, not of $\\tau$; by the printed equation $\\Phi(0)$ would be an integral over nothing, zero. "
        "(7) is right, so nothing depends on the misprint. Both integrals have the wrong limits",
    )


def transition_in_time(case: Case) -> Any:
    """Return the matrix exponential of (4) as a function of time, for the bandwidth of a case."""
    return lambda time: derivation.transition_matrix().applyfunc(lambda e: e.subs({OMEGA: case.omega, T: time}))


@CHECKS.add(*eq("6-q-n"))
def noise_integral(printed: Statement) -> Finding:
    agrees = True
    for case in cases():
        _, _, driven = _driven(case)
        noise = sp.Matrix([_FORCE.subs(TAU, TAU - constants(case)["t"](sp.Symbol("n") - 1)), 0])
        names = {
            **constants(case),
            "Phi": transition_in_time(case),
            "tau": TAU,
            "n_underline_P": noise,
            "n_underline_p": lambda time, noise=noise: noise.subs(TAU, time),
            "Int": _integral,
            "q_underline": {sp.Symbol("n"): driven},
        }
        agrees = agrees and hold(printed.links(names))
    right, wrong = derivation.noise("right"), derivation.noise("printed")
    found = float(wrong[0, 0].subs({P: 1, OMEGA: 1, T: 1, TIME: 5}))
    expected = float(right[0, 0].subs({P: 1, OMEGA: 1, T: 1}))
    return compare(
        agrees,
        "$\\underline q_n=\\int\\Phi(t_n-\\tau)\\,\\underline n_p(\\tau)\\,d\\tau$; as printed, $E(q_1^2)$ would fall "
        f"to {found:.2g} of $\\sigma_x^2$ after five correlation times, where it is {expected:.2g}",
        Verdict.MISPRINT,
        otherwise_note="the document uses only that the $\\underline q_n$ of different cycles are independent, so "
        "nothing depends on the misprint. $\\Phi(\\tau-t_{n-1})$ would also give the right "
        "covariance; the capital $P$ stands for $p$",
    )


@CHECKS.add(*eq("7", "9"))
def transition(printed: Statement) -> Finding:
    agrees = True
    for case in cases():
        names = constants(case)
        names["Phi"] = {names["n"]: case.phi}
        agrees = agrees and hold(printed.links(names))
    return compare(agrees, f"$\\exp(AT)={sp.latex(derivation.transition_matrix())}$")


@CHECKS.add(MAIN + "sanalysis.easily-shown")
def easily_shown(printed: Statement) -> Finding:
    ours = derivation.transition_matrix()
    a = sp.Matrix([[-OMEGA, 0], [1, 0]])
    solves = vanishes((ours.diff(T) - a * ours).applyfunc(sp.simplify)) and ours.subs(T, 0) == sp.eye(2)
    follows = solves and vanishes((ours - derivation.printed_transition()).applyfunc(sp.simplify))
    return compare(
        printed.says("from") == ("easily shown" if follows else "easily refuted"),
        "(7) is the only solution of the derivative of (6), $\\dot\\Phi=A\\Phi$, with $\\Phi(0)=I$",
        note="the printed integral of (6) lacks the identity",
    )


# -- states from cycle to cycle, (10), (11) -------------------------------------------------------


@CHECKS.add(*eq("10"))
def components(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(states(case))) for case in cases())
    return compare(agrees, "the equations are the rows of (5), and (2)")


@CHECKS.add(MAIN + "sanalysis.uncorrelated-q")
def uncorrelated(printed: Statement) -> Finding:
    # Covariance of x_1 at a time t before t_{n-1} with x_n and the integral, minus the part that (5) explains.
    phi, together = derivation.transition_matrix(), P * sp.exp(-OMEGA * (TIME + TAU))
    past = together.subs(TAU, T) - phi[0, 0] * together.subs(TAU, 0)
    integral = sp.integrate(together, (TAU, 0, T)) - phi[1, 0] * together.subs(TAU, 0)
    found = "uncorrelated" if sp.simplify(past) == 0 == sp.simplify(integral) else "correlated"
    return compare(
        printed.says("noise") == found,
        "$E(x_1x_1')=\\sigma_x^2e^{-\\omega_{bw}|\\tau|}$ gives $E(q_1x_1)=E(q_2x_1)=0$ for $x_1$ at "
        "$t_{n-1}$ and at all earlier times, and $x_2$ and $x_3$ are computed from these values",
    )
