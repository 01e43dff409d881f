"""Savage's memorandum of 2016: true values of its symbols.

The values come from the matrix exponential of (4), from direct integration and from the rule (2), never from the
printed equation that they check.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.report.display.derivation import hold
from gpbnb.report.integration import derivation, experiment, theory
from gpbnb.report.integration.derivation import MU, OMEGA, P22, TAU, TIME, X2, X3, P, T
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.judge import read, vanishes
from gpbnb.report.ledger.statements import Statement, statement

Names = dict[str, Any]
MAIN = "savage2016.main."
N = sp.Symbol("n")


# -- cases: one cycle with given numbers ----------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One cycle with given numbers.

    Parameters
    ----------
    omega, period, steady : bandwidth, cycle time and steady variance of the input.
    cycle : index n of the cycle.
    before : states x_1, x_2, x_3 before the cycle.
    drawn : noises q_1, q_2 of the cycle.
    """

    omega: sp.Rational
    period: sp.Rational
    steady: sp.Rational
    cycle: int
    before: tuple[sp.Rational, ...]
    drawn: tuple[sp.Rational, ...]

    def number(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression of the derivation with the values of this case."""
        return expression.subs({OMEGA: self.omega, T: self.period, P: self.steady})

    @cached_property
    def phi(self) -> sp.Matrix:
        """The transition matrix of (4) over a cycle."""
        return derivation.transition_matrix().applyfunc(self.number)


@cache
def cases() -> tuple[Case, ...]:
    """Return two cases with different numbers, none of them 0 or 1."""
    given = (
        (("3/2", "5/4", "7/3"), 2, ("2", "1/3", "3/5"), ("5/7", "-3/4")),
        (("2/5", "7/2", "5/3"), 3, ("-3/2", "7/5", "4/3"), ("-2/9", "6/5")),
    )
    found = []
    for numbers, cycle, *states in given:
        omega, period, steady = map(sp.Rational, numbers)
        before, drawn = (tuple(map(sp.Rational, each)) for each in states)
        found.append(Case(omega, period, steady, cycle, before, drawn))
    return tuple(found)


def at(now: Any, before: Any) -> Callable[[Any], Any]:
    """Return a function for an indexed name with values only at n and n-1."""

    def value(index: Any) -> Any:
        if index == N:
            return now
        if index == N - 1 and before is not None:
            return before
        raise LookupError(f"got cycle {index}; needed a cycle at which this case has a value")

    return value


@cache
def constants(case: Case) -> Names:
    """Return the letters that every equation may use."""
    phi = case.phi
    return {
        "numbers": sp.Rational, "omega_bw": case.omega, "T": case.period, "P_11_inf": case.steady, "n": N,
        "f_c": 1 / case.period, "mu": case.omega * case.period, "sigma_x": sp.sqrt(case.steady),
        "t": at(case.cycle * case.period, (case.cycle - 1) * case.period),
        **{f"phi_{i + 1}{j + 1}": at(phi[i, j], None) for i, j in product(range(2), repeat=2)},
    }  # fmt: skip


@cache
def states(case: Case) -> Names:
    """Return the states of (10) before and after a cycle, with the true integral and the trapezoidal rule."""
    (x1, x2, x3), (q1, q2), phi = case.before, case.drawn, case.phi
    new1 = phi[0, 0] * x1 + q1
    new2 = phi[1, 0] * x1 + x2 + q2
    after = (new1, new2, x3 + (x1 + new1) / 2 * case.period)
    of_states = {f"x_{i + 1}": at(after[i], case.before[i]) for i in range(3)}
    return constants(case) | of_states | {"q_1": at(q1, None), "q_2": at(q2, None)}


def extended(case: Case) -> tuple[sp.Matrix, sp.Matrix]:
    """Return transition matrix and noise covariance of (x_1, x_2, x_3), from (4) and the rule (2)."""
    half = case.period / 2
    phi = case.phi
    rule = sp.Matrix([[1, 0], [0, 1], [half, 0]])
    step = sp.Matrix([[phi[0, 0], 0, 0], [phi[1, 0], 1, 0], [half * (1 + phi[0, 0]), 0, 1]])
    return step, rule * derivation.noise().applyfunc(case.number) * rule.T


def covariances(case: Case, before: sp.Matrix) -> Names:
    """Return covariances before and after a cycle, from those before it."""
    step, added = extended(case)
    after = step * before * step.T + added
    names = dict(constants(case))
    for i, j in product(range(3), repeat=2):
        names[f"P_{i + 1}{j + 1}"] = at(after[i, j], before[i, j])
        names[f"DeltaP_{i + 1}{j + 1}"] = at(after[i, j] - before[i, j], None)
    now, past = (p[2, 2] + p[1, 1] - 2 * p[2, 1] for p in (after, before))
    of_error = {
        "P_ee": at(now, past),
        "DeltaP_ee": at(now - past, None),
        "P_dot_ee": at((now - past) / case.period, None),
    }
    return names | of_error


@cache
def arbitrary(case: Case) -> Names:
    """Return covariances of a cycle that starts with an arbitrary covariance, not the steady one."""
    x, y = sp.Rational(2, 3), sp.Rational(4, 7)
    return covariances(case, sp.Matrix([[x, 3 * y, 5 * x], [3 * y, 7 * y, x + y], [5 * x, x + y, 11 * x * y]]))


@cache
def from_zero(case: Case) -> Names:
    """Return covariances of cycle n if the input starts in its steady state and the integrals start at zero."""
    step, added = extended(case)
    before = sp.diag(case.steady, 0, 0)
    for _ in range(case.cycle - 1):
        before = step * before * step.T + added
    return covariances(case, before)


@cache
def steady(case: Case) -> Names:
    """Return covariances of a cycle in the steady state, in which P_11, P_12 and P_31 do not change."""
    step, added = extended(case)
    c12, c13 = sp.symbols("c12 c13")
    before = sp.Matrix([[case.steady, c12, c13], [c12, 2, 3], [c13, 3, 5]])
    gap = (step * before * step.T + added - before)[0, 1:]
    fixed = sp.solve(list(gap), [c12, c13], dict=True)[0]
    names = covariances(case, before.subs(fixed))
    return {**names, "P_12_inf": fixed[c12], "P_31_inf": fixed[c13], "t_inf": sp.oo}


@cache
def closed_form(case: Case, cycles: int) -> sp.Expr:
    """Return the error variance after some cycles from the covariances of single cycles' errors, without (10)-(34).

    The errors of single cycles have the variance r_0. Two errors k cycles apart have the covariance r_1 φ^(k-1).
    """
    r0, r1 = errors_of_cycles(case)
    phi = case.phi[0, 0]
    together = sum((cycles - k) * r1 * phi ** (k - 1) for k in range(1, cycles))
    return cycles * r0 + 2 * together


@cache
def errors_of_cycles(case: Case) -> tuple[sp.Expr, sp.Expr]:
    """Return r_0 and r_1, the variance of a cycle's error and its covariance with the error of the next cycle."""
    s, u = sp.symbols("s u", positive=True)
    w, period, half = case.omega, case.period, case.period / 2
    kernel = case.steady * sp.exp(-w * s)
    squared = 2 * sp.integrate((period - s) * kernel, (s, 0, period))
    ends = 2 * half**2 * (kernel.subs(s, 0) + kernel.subs(s, period))
    mixed = 2 * half * sp.integrate(kernel, (s, 0, period))
    r0 = ends + squared - 2 * mixed
    # Trapezoid and integral of one cycle times those of the next cycle, which starts where the first ends.
    before = half * (1 + sp.exp(w * period)) - sp.integrate(sp.exp(w * u), (u, 0, period))
    after = half * (1 + sp.exp(-w * period)) - sp.integrate(sp.exp(-w * u), (u, 0, period))
    return r0, case.steady * sp.exp(-w * period) * before * after


@cache
def walk_rate(case: Case) -> sp.Expr:
    """Return the growth of the error variance per second after many cycles, (r_0 + 2 r_1/(1-φ))/T."""
    r0, r1 = errors_of_cycles(case)
    return (r0 + 2 * r1 / (1 - case.phi[0, 0])) / case.period


def each(values: Callable[[Case], Names], **more: Callable[[Case], Any]) -> list[Names]:
    """Return the symbols of both cases, with more of them."""
    return [{**values(case), **{name: value(case) for name, value in more.items()}} for case in cases()]


# -- abstract and model, (1)-(4) ------------------------------------------------------------------

_POWERS = {
    "directly proportional": 1.0,
    "inversely proportional": -1.0,
    "directly proportional to the square-root": 0.5,
    "inversely proportional to the square-root": -0.5,
}
SOME_MU = (1e-3, 0.1, 1.0, 10.0, 100.0)


@cache
def powers() -> tuple[Any, Any, float]:
    """Return the powers of bandwidth and frequency with which the error varies, for some μ, and that of the rms."""
    in_rms = np.log(theory.random_walk(6.0, 5.0, 7.0) / theory.random_walk(2.0, 5.0, 7.0)) / np.log(3)
    return (*theory.exponents(np.array(SOME_MU)), float(in_rms))


def proportions(limited: bool) -> Names:
    """Return what the error is proportional to, for every μ or for small μ."""
    width, rate, in_rms = powers()
    small = np.array(SOME_MU) <= (0.1 if limited else np.inf)

    def phrases(power: Any) -> set[str]:
        return {name for name, value in _POWERS.items() if np.all(abs(np.atleast_1d(power) - value) < 0.01)}

    return {"amplitude": phrases(in_rms), "bandwidth": phrases(width[small]), "frequency": phrases(rate[small]),
            "range": "for small $\\mu$"}  # fmt: skip


_EDGE = 0.4


def _with_edge(edge: float, n: int) -> float:
    """Return the error variance after n cycles, over σ_x² T², for a flat spectrum that ends at `edge` times f_c."""
    f = np.pi * edge * (np.arange(20_000) + 0.5) / 20_000
    one = np.cos(f) - np.sin(f) / f  # trapezoid minus integral over a cycle
    return float(np.mean((one * np.sin(n * f) / np.sin(f)) ** 2))


@cache
def growth() -> Names:
    """How the variance grows for two inputs, and variances for an input whose spectrum has a sharp edge."""
    f_c, uneven = 2.0, 0.0
    for process in (theory.first_order(1.0, 1.0), theory.resonant(1.0, 3.0, 0.2)):
        variance = theory.trapezoid_variance(process, f_c, 400)
        grown = (variance[400] - variance[200]) * f_c / 200
        uneven = max(uneven, abs(float(grown) / theory.walk_rate(process, f_c) - 1))
    return {"growth": "a random walk type error" if uneven < 1e-9 else "another error", "edge": _EDGE,
            "early": _with_edge(_EDGE, 100), "late": _with_edge(_EDGE, 1000)}  # fmt: skip


_LETTERS = {
    "the integration algorithm processing rate and the band-limited random noise magnitude/bandwidth": {P, OMEGA, T},
    "the integration algorithm processing rate alone": {T},
    "the time since the start": {TIME},
}


def aim() -> Names:
    """On which letters the rate depends."""
    d32, d33, d22 = derivation.steady_changes()
    letters = sp.simplify((d33 + d22 - 2 * d32) / T).free_symbols
    return {"of": {phrase for phrase, meant in _LETTERS.items() if meant == letters}}


def variance_inside() -> float:
    """Return the share of the variance of x_1 below its bandwidth, from the density over the angle θ, ω tan θ."""
    omega = 3.0
    angle = np.pi / 2 * (np.arange(1000) + 0.5) / 1000
    density = theory.first_order(1.0, omega).psd(omega * np.tan(angle)) * omega / np.cos(angle) ** 2 / 2000
    return float(np.sum(density[:500]) / np.sum(density))


def density_at_edge() -> float:
    process = theory.first_order(2.0, 3.0)
    low, edge = (float(process.psd(s)) for s in (0.0, 3.0))
    return edge / low


def trapezoids() -> list[Names]:
    samples, period = [sp.Rational(v) for v in ("1", "3", "-2", "11/2")], sp.Rational(1, 4)
    before, now = map(sp.Rational, theory.TRAPEZOID)
    found = []
    for k in range(1, 4):
        start = sp.Rational(k, 3)
        area = period * (before * samples[k - 1] + now * samples[k])
        found.append({"T": period, "n": sp.Integer(k), "x_1": lambda i: samples[int(i)], "numbers": sp.Rational,
                      "x_3": {k - 1: start, k: start + area}})  # fmt: skip
    return found


def state_form() -> Names:
    """Return vectors and matrix of (1): the states, the derivatives by them, and what is left of the rates."""
    x1, x2, n1, w = sp.symbols("x_1 x_2 n_p1 omega_bw")
    states, rates = sp.Matrix([x1, x2]), sp.Matrix([-w * x1 + n1, x1])
    slopes = rates.jacobian(states)
    return {"x_underline": states, "A_underline": slopes, "n_underline_p": sp.expand(rates - slopes * states),
            "x_underline_dot": rates, "matrix": sp.Matrix, "numbers": sp.Rational}  # fmt: skip


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


def driven(case: Case) -> Names:
    """Return the states before and after a cycle with a given input."""
    start, after, driven = _driven(case)
    states_at = {N: after, N - 1: start}
    return {"n": N, "Phi": {N: case.phi}, "x_underline": states_at, "q_underline": {N: driven}, "numbers": sp.Rational}


def _integral(term: Any, bounds: list[Any]) -> Any:
    return sp.Matrix(term).applyfunc(lambda entry: _integrated(entry, *bounds))


@cache
def _integrated(entry: sp.Expr, variable: sp.Symbol, first: sp.Expr, last: sp.Expr) -> sp.Expr:
    return sp.integrate(sp.expand(entry), (variable, first, last))


def transition_in_time(case: Case) -> Any:
    """Return the matrix exponential of (4) as a function of time, for the bandwidth of a case."""
    return lambda time: derivation.transition_matrix().applyfunc(lambda e: e.subs({OMEGA: case.omega, T: time}))


def transition_integral() -> Names:
    """Return the letters of the first line of (6), with the exact transition matrix."""
    case = cases()[0]
    exact = transition_in_time(case)
    return {
        **constants(case), "Phi": lambda argument: exact(case.period if argument == N else argument),
        "tau": sp.Symbol("tau", positive=True), "A": sp.Matrix([[-case.omega, 0], [1, 0]]), "I": sp.eye(2),
        "Int": _integral,
    }  # fmt: skip


def noise_integral(case: Case) -> Names:
    """Return the letters of the second line of (6), for the given input."""
    noise = sp.Matrix([_FORCE.subs(TAU, TAU - constants(case)["t"](N - 1)), 0])
    return {
        **constants(case), "Phi": transition_in_time(case), "tau": TAU, "n_underline_P": noise,
        "n_underline_p": lambda time: noise.subs(TAU, time), "Int": _integral, "q_underline": {N: _driven(case)[2]},
    }  # fmt: skip


def variance_of_q() -> tuple[float, float]:
    """Return E(q_1²) after five correlation times, as printed and right, over σ_x²."""
    found = derivation.noise("printed")[0, 0].subs({P: 1, OMEGA: 1, T: 1, TIME: 5})
    return float(found), float(derivation.noise("right")[0, 0].subs({P: 1, OMEGA: 1, T: 1}))


def uncorrelated() -> Names:
    """Whether the noise of a cycle is correlated with x_1 at a time t before it, by the covariance of x_1."""
    phi, together = derivation.transition_matrix(), P * sp.exp(-OMEGA * (TIME + TAU))
    past = together.subs(TAU, T) - phi[0, 0] * together.subs(TAU, 0)
    integral = sp.integrate(together, (TAU, 0, T)) - phi[1, 0] * together.subs(TAU, 0)
    return {"noise": "uncorrelated" if sp.simplify(past) == 0 == sp.simplify(integral) else "correlated"}


# -- variances and covariances, (12)-(29) ---------------------------------------------------------


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
def errors_of_the_set() -> tuple[float, float]:
    """Return the largest relative error of P_ee by (18) and (25), corrected and as printed, over some μ and n."""
    errors = {True: 0.0, False: 0.0}
    for mu in (0.5, 2.0, 10.0):
        exact = theory.error_variance(np.arange(1, 41), mu)
        for right in errors:
            found = theory.savage_recursion(40, mu) if right else theory.savage_recursion(40, mu, 1.0, True)
            errors[right] = max(errors[right], float(np.max(abs(found[1:] / exact - 1))))
    return errors[True], errors[False]


def means() -> Names:
    """Return the letters of (12), with their expected values."""
    return {
        "n": N, "E": derivation.expected, "e": at(X3 - X2, None), "x_2": at(X2, None), "x_3": at(X3, None),
        "P_ee": at(derivation.P33 + P22 - 2 * derivation.P32, None), "numbers": sp.Rational,
    }  # fmt: skip


def every_pair() -> list[Names]:
    """Return the cases with each pair of indices i and j."""
    return [
        {**arbitrary(case), "DeltaP_ij": arbitrary(case)[f"DeltaP_{pair}"]}
        for case in cases()
        for pair in ("11", "22", "32", "33", "31", "21")
    ]


def change_by_18() -> Names:
    """Whether the change of P_32 by (18) as printed agrees with (32), and in how many cases."""
    before, step = Relation("P_32[n-1]"), statement(MAIN + "eq18-p32").relation()
    change = statement(MAIN + "eq32").relation()
    right = [vanishes(step.value(s) - before.value(s) - change.value(s)) for s in map(steady, cases())]
    return {"result": "(32)" if all(right) else "a result other than (32)", "right": sum(right), "count": len(right)}


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
        **constants(case), "t": sp.Rational(6, 5), "P": now, "P_dot": slope, "N_P11": density,
        "A": sp.Matrix([[-case.omega, 0], [1, 0]]), "N_p": sp.Matrix([[density, 0], [0, 0]]),
    }  # fmt: skip
    del names["T"]  # a symmetric matrix would hide the transpose
    for i, j in product(range(2), repeat=2):
        names[f"P_{i + 1}{j + 1}"], names[f"P_dot_{i + 1}{j + 1}"] = now[i, j], slope[i, j]
    return names


_ANY = (sp.Rational(7, 2), sp.Rational(-2, 3), sp.Rational(5, 4))


def from_any(case: Case) -> Names:
    return _in_time(case, _ANY)


def from_steady(case: Case) -> Names:
    return _in_time(case, (case.steady, sp.S.Zero, sp.S.Zero))


def gives_entries(phrase: str) -> bool:
    """Whether the cited equations give the entries of P, A and N_p, which (19) contains."""
    cited = [statement(MAIN + f"eq{number}") for number in re.findall(r"\((\d+)\)", phrase)]
    parts = [part for each in cited for part in each.parts if isinstance(part, Relation) and part.equates]
    given = {part.sides[0].text: part.sides[-1].text for part in parts}
    return all(given.get(name, "").startswith("[[") for name in ("P", "A_underline", "N_p"))


def _follows_from(start: int, carried: int) -> bool:
    """Whether (23) follows from these multiples of the steady variance of x_1 and of the other steady values."""
    for case in cases():
        others = (carried * case.steady / case.omega * x for x in (1, case.period))
        names = _in_time(case, (start * case.steady, *others))
        values = {OMEGA: case.omega, P: case.steady, TIME: names["t"]}
        pairs = (("P_12", derivation.p12(TIME)), ("P_22", derivation.p22(TIME)))
        if not all(vanishes(names[key] - expected.subs(values)) for key, expected in pairs):
            return False
    return True


def steady_start() -> Names:
    """For which variance of x_1 and which other conditions at the start (23) follows."""
    starts = {"at its steady state value": 1, "zero": 0, "twice its steady state value": 2}
    conditions = {"zero": 0, "steady": 1}
    return {"start": {name for name, start in starts.items() if _follows_from(start, 0)},
            "conditions": {name for name, carried in conditions.items() if _follows_from(1, carried)}}  # fmt: skip


def first_change(printed: bool) -> float:
    """Return the first change of P_22 for ω = 10 and T = 0.01, by (25) as printed or corrected."""
    return float(derivation.p22_change(printed=printed).subs({P: 1, OMEGA: 10, T: sp.Rational(1, 100), TIME: 0}))


CLOSE = 1e-10
"""Relative error allowed for the recursion (18), which subtracts numbers that are 12/μ² times the result."""


def complete_set() -> Names:
    right, wrong = errors_of_the_set()
    kind = "comprise a complete set for evaluating" if right < CLOSE else "lack an equation for evaluating"
    return {"set": kind, "wrong": wrong}


# -- the steady state and the random walk, (30)-(39) ----------------------------------------------


def gives_33(phrase: str) -> bool:
    """Whether (14) becomes (33) with the changes that an equation gives."""
    relations = [part for part in statement(f"{MAIN}eq{phrase.strip('()')}").parts if isinstance(part, Relation)]
    changes = {each.sides[0].value(): each.value() for each in relations}
    rate, stated = (statement(f"{MAIN}eq{number}").relation().value() for number in ("14", "33"))
    return bool(sp.simplify(rate.subs(changes) - stated) == 0)


SUMMED = 1e-12


@cache
def _folded() -> float:
    """Return the largest relative difference of (35) squared from the sum of the spectrum over the multiples of f_c."""
    return max(abs(_summed(mu) / float(theory.walk_factor(mu)) - 1) for mu in (1e-4, 0.1, 1.0, 30.0))


def _summed(mu: float) -> float:
    """Return (35) squared over σ_x² T from the spectrum at the multiples of f_c; an integral replaces distant ones."""
    k = np.arange(1, 20_001)
    near = float(np.sum(theory.first_order(1.0, mu).psd(2 * np.pi * k)))
    return 2 * (near + float(np.arctan(mu / (2 * np.pi * (len(k) + 0.5)))) / np.pi)


def exactness() -> Names:
    return {"kind": "an exact" if _folded() < SUMMED and hold(derivation.independent()) else "an approximate"}


def is_large_enough(phrase: str) -> bool:
    """Whether the error variance after so many cycles is that of the random walk."""
    n = {"for very large n": 10_000, "for any n": 2, "for n = 1": 1}[phrase]
    some = (0.01, 1.0, 100.0)
    return max(abs(float(theory.error_variance(n, m)) / (n * float(theory.walk_factor(m))) - 1) for m in some) < 1e-3


def settling() -> str:
    begins = {mu: theory.settling_cycles(mu, 0.01) for mu in (0.1, 1.0, 100.0)}
    return ", ".join(f"{np.ceil(k):.0f} on at $\\mu={mu:g}$" for mu, k in begins.items())


def in_minutes() -> float:
    """Return by what the number of (35) is multiplied, with minutes in place of seconds throughout."""
    return theory.random_walk(2.0 * 60, 3.0 * 60, 7.0 * 60) / theory.random_walk(2.0, 3.0, 7.0)


def unit() -> str:
    power = float(np.log(in_minutes()) / np.log(60))
    units = {"per square-root-of-secs": 0.5, "per second": 1.0}
    return next((name for name, expected in units.items() if abs(power - expected) < 1e-12), "")


def exponential() -> Names:
    """Return exp(-μ) to third order, with a symbol for the terms that the dots stand for."""
    dots = sp.Symbol("dots")
    return {"mu": MU, "dots": dots, "exp": lambda x: sp.series(sp.exp(x), MU, 0, 4).removeO() + dots,
            "numbers": sp.Rational}  # fmt: skip


def gaps_of_37(printed: Statement) -> list[float]:
    """Return the lowest power of μ in the difference of neighbouring sides of (37), without the terms of the dots."""
    return [_order(link.left - link.right) for link in printed.links({"mu": MU, "dots": sp.S.Zero})]


def steps_of_37(printed: Statement) -> bool:
    """Whether the second step, which only divides by 2 and μ, and the last are exact, and others omit terms from μ²."""
    first, second, third, fourth, last = gaps_of_37(printed)
    return printed.equates and min(first, third, fourth) >= 2 and min(second, last) == float("inf")


@cache
def _order(difference: sp.Expr) -> float:
    """Return the lowest exponent of μ in an expression in μ and exp(-μ), whose series is cut."""
    cut = sum(((-MU) ** k / sp.factorial(k) for k in range(7)), start=sp.S.Zero)
    gap = sp.cancel(sp.together(difference.subs(sp.exp(-MU), cut)))
    if gap == 0:
        return float("inf")
    numerator, denominator = (sp.Poly(part, MU) for part in sp.fraction(gap))
    return float(min(m for (m,) in numerator.monoms()) - min(m for (m,) in denominator.monoms()))


def small_mu() -> Names:
    """Return the letters of (38) and (39) for a very small μ."""
    omega, sigma, mu = sp.Rational(7, 3), sp.Rational(5, 2), sp.Rational(1, 10**12)
    f_c = omega / mu
    walk = (1 + sp.exp(-mu)) / (1 - sp.exp(-mu)) - 2 / mu
    return {"sigma_e_rw": sp.N(sigma * sp.sqrt(walk / f_c), 60), "sigma_x": sigma, "mu": mu, "f_c": f_c,
            "omega_bw": omega, "numbers": sp.Rational}  # fmt: skip


def next_term() -> bool:
    """Whether the approximation is too large by a fraction μ²/120."""
    mu = np.array([0.01, 0.03, 0.1])
    return bool(np.all(abs((theory.approximation_ratio(mu) - 1) / (mu**2 / 120) - 1) < 0.01))


def approximates(phrase: str) -> bool:
    return abs(float(theory.approximation_ratio({"small": 1e-3, "large": 1e3}[phrase])) - 1) < 1e-6


# -- what the memorandum leaves undone ------------------------------------------------------------


@cache
def simulated() -> float:
    """Return the largest deviation of a small simulation from the exact variance, in standard errors."""
    some, cycles = (0.01, 0.1, 1.0, 10.0), 300
    errors = experiment.sweep(some, cycles, 4000, np.random.default_rng(35))
    exact = [float(theory.error_variance(cycles, mu)) for mu in some]
    return float(np.max(np.abs(experiment.deviations(errors, exact))))


@cache
def transient() -> Names:
    """Compare the variance of the first cycles with its recursion and with simulations."""
    mu, n = 3.0, [1, 2, 5, 20]
    closed = theory.error_variance(np.arange(41), mu)
    again = float(np.max(abs(theory.error_variance_recursion(40, mu) - closed)))
    _, errors = experiment.simulate(theory.first_order(1.0, mu), 1.0, n[-1], np.random.default_rng(14), 4000)
    run = np.cumsum(errors, axis=0)[np.array(n) - 1]
    away = float(np.max(np.abs(experiment.deviations(run, closed[n]))))
    return {"right": hold(derivation.transient()) and again < 1e-12 and away < 4, "away": away}


@cache
def numerical_example() -> Names:
    """Compute (35) for a sensor, in two ways, and its inverse."""
    omega, f_c = 2 * np.pi * 100, 1000.0
    ours, away = theory.random_walk(1.0, omega, f_c), simulated()
    again = np.sqrt(theory.walk_rate(theory.first_order(1.0, omega), f_c))
    rate = theory.required_rate(1.0, omega, ours)
    right = abs(ours / again - 1) < 1e-12 and abs(rate / f_c - 1) < 1e-9 and away < 4
    return {"right": bool(right), "ours": ours, "away": away}


CHECKS = read(__name__, globals())
