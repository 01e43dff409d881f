"""Cases in which every symbol of savage2016 has its true value.

The values come from the matrix exponential of (4), from direct integration and from the rule (2), never from the
printed equation that they check.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import sympy as sp

from gpbnb.report.integration import derivation
from gpbnb.report.integration.derivation import OMEGA, P, T

Names = dict[str, Any]
N = sp.Symbol("n")
_VALUES = (("3/2", "5/4", "7/3", "2"), ("2/5", "7/2", "5/3", "3"))
"""Bandwidth, cycle time, steady variance and the index of a cycle, for each case."""
_BEFORE = (
    (("2", "1/3", "3/5"), ("5/7", "-3/4")),
    (("-3/2", "7/5", "4/3"), ("-2/9", "6/5")),
)
"""States before a cycle and noises in it."""


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

    @property
    def phi(self) -> sp.Matrix:
        """The transition matrix of (4) over a cycle."""
        return derivation.transition_matrix().applyfunc(self.number)


@cache
def cases() -> tuple[Case, ...]:
    """Return two cases with different numbers, none of them 0 or 1."""
    found = []
    for values, (states_before, noises) in zip(_VALUES, _BEFORE, strict=True):
        omega, period, variance = (sp.Rational(v) for v in values[:3])
        before = tuple(sp.Rational(v) for v in states_before)
        drawn = tuple(sp.Rational(v) for v in noises)
        found.append(Case(omega, period, variance, int(values[3]), before, drawn))
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


def constants(case: Case) -> Names:
    """Return the letters that every equation may use."""
    phi = case.phi
    return {
        "omega_bw": case.omega,
        "T": case.period,
        "P_11_inf": case.steady,
        "n": N,
        "f_c": 1 / case.period,
        "mu": case.omega * case.period,
        "sigma_x": sp.sqrt(case.steady),
        "t": at(case.cycle * case.period, (case.cycle - 1) * case.period),
        **{f"phi_{i + 1}{j + 1}": at(phi[i, j], None) for i in range(2) for j in range(2)},
    }


@cache
def states(case: Case) -> Names:
    """Return the states of (10) before and after a cycle, with the true integral and the trapezoidal rule."""
    x1, x2, x3 = case.before
    q1, q2 = case.drawn
    phi = case.phi
    new1 = phi[0, 0] * x1 + q1
    new2 = phi[1, 0] * x1 + x2 + q2
    new3 = x3 + (x1 + new1) / 2 * case.period
    after = (new1, new2, new3)
    return {
        **constants(case),
        **{f"x_{i + 1}": at(after[i], case.before[i]) for i in range(3)},
        "q_1": at(q1, None),
        "q_2": at(q2, None),
    }


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
    names = constants(case)
    for i in range(3):
        for j in range(3):
            names[f"P_{i + 1}{j + 1}"] = at(after[i, j], before[i, j])
            names[f"DeltaP_{i + 1}{j + 1}"] = at(after[i, j] - before[i, j], None)
    grown = after - before
    names["P_ee"] = at(*(p[2, 2] + p[1, 1] - 2 * p[2, 1] for p in (after, before)))
    names["DeltaP_ee"] = at(grown[2, 2] + grown[1, 1] - 2 * grown[2, 1], None)
    names["P_dot_ee"] = at(names["DeltaP_ee"](sp.Symbol("n")) / case.period, None)
    return names


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
    w, period = case.omega, case.period

    def kernel(lag: sp.Expr) -> sp.Expr:
        return case.steady * sp.exp(-w * lag)

    half = period / 2
    squared = 2 * sp.integrate((period - s) * kernel(s), (s, 0, period))
    ends = 2 * half**2 * (kernel(sp.Integer(0)) + kernel(period))
    mixed = 2 * half * sp.integrate(kernel(s), (s, 0, period))
    r0 = ends + squared - 2 * mixed
    # Trapezoid and integral of one cycle times those of the next cycle, which starts where the first ends.
    before = half * (1 + sp.exp(w * period)) - sp.integrate(sp.exp(w * u), (u, 0, period))
    after = half * (1 + sp.exp(-w * period)) - sp.integrate(sp.exp(-w * u), (u, 0, period))
    return r0, case.steady * sp.exp(-w * period) * before * after


def walk_rate(case: Case) -> sp.Expr:
    """Return the growth of the error variance per second after many cycles, (r_0 + 2 r_1/(1-φ))/T."""
    r0, r1 = errors_of_cycles(case)
    return (r0 + 2 * r1 / (1 - case.phi[0, 0])) / case.period
