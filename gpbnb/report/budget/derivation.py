"""Derive the algebra behind hung1982, ch. II: sums of errors, and how averaging reduces each kind of error."""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Step

N, J = sp.symbols("N j", integer=True, positive=True)
E, T, TAU, B = sp.symbols("e T tau b", positive=True)


def equal_sources() -> tuple[Step, ...]:
    """Derive Figure II-2 for N equal, independent errors, and the sum of N errors of the same sign."""
    total = sp.Sum((E / sp.sqrt(N)) ** 2, (J, 1, N))
    return (
        Step("root-sum-square of $N$ errors of $e/\\sqrt N$ each", sp.sqrt(total), E),
        Step("sum of the same $N$ errors with equal signs", sp.Sum(E / sp.sqrt(N), (J, 1, N)), sp.sqrt(N) * E),
    )


def averages() -> tuple[Step, ...]:
    """Derive how a mean over the time T reduces a constant error, a rolling error, and noise."""
    t, u = sp.symbols("t u", positive=True)
    c = sp.Symbol("c", positive=True)  # cycles in T
    h = T / TAU
    correlation = sp.exp(-u / TAU)
    return (
        Step(
            "mean of a constant that rolls with the spacecraft, over $c$ rolls",
            sp.Integral(sp.cos(2 * sp.pi * c * t / T), (t, -T / 2, T / 2)) / T,
            sp.sin(sp.pi * c) / (sp.pi * c),
        ),
        Step("mean of a constant that does not roll: nothing is gained", sp.Integral(E, (t, 0, T)) / T, E),
        Step(
            "variance of the mean of $N$ independent readings of variance $e^2$",
            sp.Sum(E**2, (J, 1, N)) / N**2,
            E**2 / N,
        ),
        Step(
            "variance of the mean of noise with the correlation $\\mathrm{e}^{-u/\\tau}$",
            2 * sp.Integral((T - u) * correlation, (u, 0, T)) / T**2,
            2 * (h - 1 + sp.exp(-h)) / h**2,
        ),
    )
