r"""Derive the algebra of hung1984, ch. II, section 12, again, and the algebra of the bound that replaces it.

Matrices of the report are plain symbols if each formula is linear in them. The report's error algebra is linear,
because it uses one ε for a whole matrix. If the order of factors matters, symbols do not commute.
"""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Step, first_order

N, M, K = sp.symbols("n m k", integer=True, positive=True)
NTH, J = sp.symbols("i j", integer=True, positive=True)
BETA, EPS = sp.Symbol("beta", positive=True), sp.Symbol("epsilon")
C, D = sp.symbols("c d", positive=True)  # roundings of a closed loop and of an input


def _error(rounded: sp.Expr) -> sp.Expr:
    """Return the coefficient of ε in a rounded quantity."""
    return sp.expand(first_order(rounded, (EPS,)) / EPS)


# -- (102)-(117) ------------------------------------------------------------------------------------------------------

PP, P, Q, KHP, CQ = sp.symbols(r"P_{kp} P_k Q {KHP_{kp}} {(I-KH)Q}")
KZ, KREST, PHI, FK, X, U = sp.symbols(r"K_k {P_{kp}H^TR^{-1}} \Phi F_k x u_k")


def prediction_error() -> sp.Expr:
    """Derive the error of the rounded (100) over ε, from two products of length n and the sum."""
    product = PP - Q
    return _error((product * (1 + 2 * N * EPS) + Q) * (1 + EPS))


def covariance_error() -> sp.Expr:
    """Derive the error of the rounded (101) over ε, with exact K and :math:`KHP_{kp} = P_{kp} - P_k`."""
    update = _error((PP - KHP * (1 + M * EPS)) * (1 + EPS) * (1 + N * EPS)).subs(KHP, PP - P)
    carried = prediction_error().subs({PP: P, Q: CQ}, simultaneous=True)  # multiplied by (I - KH)
    return sp.expand(update + carried)


def gain_error() -> sp.Expr:
    r"""Derive the error of the rounded :math:`P_kH^TR^{-1}` over ε, for diagonal R and without the part of Q."""
    covariance = covariance_error().subs({P: KZ, PP: KREST, CQ: 0}, simultaneous=True)
    return sp.expand(covariance + KZ * _error((1 + EPS) * (1 + (N + M) * EPS)))


def transition_error() -> sp.Expr:
    r"""Derive the error of the rounded (109) over ε, with :math:`KH\Phi = \Phi - F_k` and the printed (108)."""
    gain = gain_error().coeff(KZ)
    loop = PHI - (PHI - FK) * (1 + gain * EPS) * (1 + M * EPS)
    return _error(loop * (1 + EPS) * (1 + N * EPS))


def input_error() -> sp.Expr:
    """Derive the error of the rounded (110) over ε, with the printed (108)."""
    return _error(U * (1 + gain_error().coeff(KZ) * EPS) * (1 + M * EPS))


def state_error() -> sp.Expr:
    """Derive the error of the rounded (111) over ε without the part of Φ; the coefficients belong to F and to u."""
    loop = FK * X * (1 + transition_error().coeff(FK) * EPS)
    return _error((loop * (1 + N * EPS) + U * (1 + input_error().coeff(U) * EPS)) * (1 + EPS))


# -- (118)-(125) ------------------------------------------------------------------------------------------------------


def count_start(c: sp.Expr = C, g: sp.Expr = sp.S.Zero) -> sp.Expr:
    """Return a_0, the number of roundings of x_0 in k steps with c + (j - 1)g roundings in step j."""
    return sp.expand(sp.Sum(c + (J - 1) * g, (J, 1, K)).doit())


def count_input(c: sp.Expr = C, d: sp.Expr = D, g: sp.Expr = sp.S.Zero) -> sp.Expr:
    """Return a_i, the number of roundings of u_i up to step k."""
    return sp.expand(sp.Sum(c + (J - 1) * g, (J, NTH + 1, K)).doit() + d + (NTH - 1) * g)


def second_coefficient(c: sp.Expr = C, d: sp.Expr = D, g: sp.Expr = sp.S.Zero, sign: int = -1) -> sp.Expr:
    """Return the factor of βB: the sum of a_0 - a_i or, with sign 1, of a_0 + a_i."""
    return sp.expand(sp.summation(sp.expand(count_start(c, g) + sign * count_input(c, d, g)), (NTH, 1, K)))


ONCE = (6 * N + 3 * M + 5, 4 * N + 3 * M + 4)
TWICE = (ONCE[0] + N + 1, ONCE[1] + 1)


# -- the contraction bound --------------------------------------------------------------------------------------------


def contraction() -> tuple[Step, ...]:
    r"""Derive the exact identities behind the contraction bound, for every n and m; symbols do not commute.

    For two covariances A and B before the measurement, K and L are the gains, :math:`KS = AH^T` and
    :math:`S = HAH^T + R`, :math:`LT = BH^T` and :math:`T = HBH^T + R`; :math:`H' = H^T`, :math:`L' = L^T`, B and R are
    symmetric, but A need not be.
    """
    a, b, h, ht, r, k, o, lt = sp.symbols("A B H H' R K L L'", commutative=False)
    phi, e, nu = sp.symbols(r"\Phi e \hat{\nu}", commutative=False)
    alpha, t, size = sp.symbols("alpha t q", positive=True)
    s = h * a * ht + r
    after_a, after_b = a - k * h * a, b - b * ht * lt
    zero_k, zero_l = after_a * ht - k * r, h * after_b - r * lt
    gains = (k - o) * s + (a * ht - k * s) + (o * r - (b - o * h * b) * ht)
    return (
        Step("the two forms of (99) are one: $AH'-KS$ is zero where $(A-KHA)H'-KR$ is zero", a * ht - k * s, zero_k),
        Step("likewise, $HB-TL'$ is zero where $H(B-BH'L')-RL'$ is zero", h * b - (h * b * ht + r) * lt, zero_l),
        Step(
            "two updates, subtracted; the last two terms are zero",
            after_a - after_b,
            (1 - k * h) * (a - b) * (1 - ht * lt) + zero_k * lt - k * zero_l,
        ),
        Step("two gains, subtracted; the last two terms are zero", (1 - o * h) * (a - b) * ht, gains),
        Step(
            "two closed loops, subtracted: $F_k - A_k = (K-L)H\\Phi = F_kE_{k-1}G_k$",
            (1 - o * h) * phi - (1 - k * h) * phi,
            (k - o) * h * phi,
        ),
        Step(
            "two states, $\\Phi\\hat x + K\\hat\\nu$ and $\\Phi(\\hat x-e) + L(\\hat\\nu + H\\Phi e)$, subtracted",
            k * nu + phi * e - o * (nu + h * phi * e),
            (1 - o * h) * phi * e + (k - o) * nu,
        ),
        Step(
            "$f \\le \\alpha + f\\,g\\zeta$, from $F_k = A_k + F_kE_{k-1}G_k$: the largest such $f$",
            alpha + t * alpha / (1 - t),
            alpha / (1 - t),
        ),
        Step(
            "residuals of one size and $\\alpha < 1$: the errors stay at",
            alpha * size / (1 - alpha) + size,
            size / (1 - alpha),
        ),
    )
