"""Derive the error of a ramp behind a low-pass filter; the matrices of hung1984, ch. III, (5) and (7), in symbols."""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Step

TIME = sp.Symbol("t", real=True)


def deroll(angle: sp.Expr) -> sp.Matrix:
    """Return the matrix of (7); that of (5) is its inverse."""
    return sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])


def filters() -> tuple[Step, ...]:
    """Derive the error of a ramp after a low-pass filter of noise bandwidth B, and the smallest error."""
    b, k, n0, tau, length = sp.symbols("B k N_0 tau L", positive=True)
    s = sp.Symbol("s", positive=True)
    pole = sp.exp(-s / tau) / tau
    error = k**2 / (16 * b**2) + n0 * b
    least = sp.Symbol("B_0", positive=True)
    return (
        Step("single pole: it lags by τ", sp.Integral(s * pole, (s, 0, sp.oo)), tau),
        Step("single pole: noise bandwidth", sp.Integral(pole**2, (s, 0, sp.oo)) / 2, 1 / (4 * tau)),
        Step("moving average: it lags by half its length", sp.Integral(s / length, (s, 0, length)), length / 2),
        Step("moving average: noise bandwidth", sp.Integral(1 / length**2, (s, 0, length)) / 2, 1 / (2 * length)),
        Step(
            "single pole: lag and noise against its bandwidth",
            (k * tau) ** 2 + n0 / (4 * tau),
            error.subs(b, 1 / (4 * tau)),
        ),
        Step(
            "moving average: the same function",
            (k * length / 2) ** 2 + n0 / (2 * length),
            error.subs(b, 1 / (2 * length)),
        ),
        Step(
            "never smaller than at $B=B_0$, where $k^2 = 8N_0B_0^3$",
            error.subs(k, sp.sqrt(8 * n0 * least**3)),
            sp.Rational(3, 2) * n0 * least,
            n0 * (b - least) ** 2 * (2 * b + least) / (2 * b**2),
        ),
        Step(
            "the least mean square error",
            sp.Rational(3, 2) * n0 * sp.cbrt(k**2 / (8 * n0)),
            sp.Rational(3, 4) * sp.cbrt(k * n0) ** 2,
        ),
    )
