"""The algebra behind hung1982, ch. II: sums of errors, and what averaging leaves of each kind."""

from __future__ import annotations

import sympy as sp

from gpbnb.display.derivation import Derivation, Step, over, unevaluated

N, J = sp.symbols("N j", integer=True, positive=True)
E, T, TAU, B = sp.symbols("e T tau b", positive=True)


def equal_sources() -> Derivation:
    """N independent errors of one size: Figure II-2, and the same with one sign."""
    total = sp.Sum((E / sp.sqrt(N)) ** 2, (J, 1, N))
    return Derivation(
        (
            Step("N errors of $e/\\sqrt N$ each: their root-sum-square", sp.sqrt(total), E),
            Step("the same N errors with one sign", sp.Sum(E / sp.sqrt(N), (J, 1, N)), sp.sqrt(N) * E),
        )
    )


def averages() -> Derivation:
    """What a mean over the time T leaves of a standing error, of one that rolls, and of noise."""
    t, u = sp.symbols("t u", positive=True)
    c = sp.Symbol("c", positive=True)  # cycles in T
    h = T / TAU
    correlation = sp.exp(-u / TAU)
    return Derivation(
        (
            Step(
                "a constant that rolls with the spacecraft, c cycles",
                over(sp.Integral(sp.cos(2 * sp.pi * c * t / T), (t, -T / 2, T / 2)), T),
                over(sp.sin(sp.pi * c), sp.pi * c),
            ),
            Step("a constant that does not: nothing is gained", over(sp.Integral(E, (t, 0, T)), T), E),
            Step(
                "N independent readings of variance $e^2$: variance of their mean",
                over(sp.Sum(E**2, (J, 1, N)), N**2),
                E**2 / N,
            ),
            Step(
                "noise with the correlation $\\mathrm{e}^{-u/\\tau}$: variance of its mean",
                2 * sp.Integral(unevaluated(T - u) * correlation, (u, 0, T)) / T**2,
                2 * (h - 1 + sp.exp(-h)) / h**2,
            ),
        )
    )
