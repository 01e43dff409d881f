r"""Derive the algebra of the guarantee with SymPy; matrices are symbols that do not commute."""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step, over, together, unevaluated


def recursion() -> Derivation:
    r"""Derive the recursion of the error, for every n and m and every program that is linear apart from roundings.

    The program uses :math:`\hat F, \hat K`, and the exact filter F and K. The roundings of the step add w, and p is the
    exact estimate before the step.
    """
    phi, h, k, known, loop = sp.symbols(r"\Phi H K \hat{K} \hat{F}", commutative=False)
    e, p, z, w = sp.symbols("e p z w", commutative=False)
    one = sp.S.One
    exact_loop, stored = unevaluated(one - k * h) * phi, loop - unevaluated(one - known * h) * phi
    innovation = z - h * phi * p
    computed = loop * (p + e) + known * z + w
    return Derivation(
        (
            Step(
                "computed minus exact estimate after a step",
                sp.expand(computed) - (exact_loop * p + k * z),
                together(loop * e, stored * p, unevaluated(known - k) * unevaluated(innovation), w),
            ),
            Step(
                "the exact estimate, written with the computed loop: $\\hat F p + \\hat K z$ minus the difference",
                exact_loop * p + k * z,
                together(loop * p, known * z, -(stored * p), -(unevaluated(known - k) * unevaluated(innovation))),
            ),
        )
    )


def telescope() -> Derivation:
    r"""Derive two lags of the certificate; with :math:`r_l = c_lF - c_{l+1}`, rows need not be exact."""
    f, g = sp.symbols("F G", commutative=False)
    c0, c1, c2 = sp.symbols("c_0 c_1 c_2", commutative=False)
    e, v, w = sp.symbols("e v w", commutative=False)  # error two steps earlier; disturbances of the two steps
    before = g * e + v
    return Derivation(
        (
            Step(
                "$c_0$ times the error after two steps",
                sp.expand(c0 * (f * before + w)),
                together(c0 * w, c1 * v, unevaluated(c0 * f - c1) * before, unevaluated(c1 * g - c2) * e, c2 * e),
            ),
        )
    )


def induction() -> Derivation:
    r"""Derive, for one state, a bound that bounds itself, from sums truncated after L steps and a remainder ρ."""
    f, w = sp.symbols("F w", positive=True)
    lags = sp.Symbol("L", integer=True, positive=True)
    cut = w * over(1 - f**lags, 1 - f)
    return Derivation(
        (
            Step(
                "the bound b with $b = \\sum_{l<L}F^lw + F^Lb$ is the infinite sum, wherever it is cut",
                together(cut, f**lags * over(w, 1 - f)),
                over(w, 1 - f),
            ),
        )
    )


def ellipsoid() -> Derivation:
    r"""Derive an ellipsoid that contains the sum with a segment; the Cauchy-Schwarz inequality becomes a square.

    In some direction, u is the half-width of the ellipsoid and v that of the segment. t and τ are any positive
    numbers.
    """
    u, v = sp.symbols("u v", nonnegative=True)
    t, tau = sp.symbols(r"t \tau", positive=True)
    grown = (t + tau) * (u**2 / t + v**2 / tau)
    return Derivation(
        (
            Step(
                "squared half-width of the new ellipsoid, less that of the sum of both sets",
                together(grown, -((u + v) ** 2)),
                over((tau * u - t * v) ** 2, t * tau),
            ),
        )
    )
