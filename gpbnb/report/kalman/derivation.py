r"""Derive the algebra of hung1984, ch. II, section 12, again, and the algebra of the bound that replaces it.

Matrices of the report are plain symbols if each formula is linear in them. The report's error algebra is linear,
because it uses one ε for a whole matrix. If the order of factors matters, symbols do not commute.
"""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step, first_order, over, together, unevaluated

N, M, K = sp.symbols("n m k", integer=True, positive=True)
NTH, J = sp.symbols("i j", integer=True, positive=True)
BETA, EPS = sp.Symbol("beta", positive=True), sp.Symbol("epsilon")
C, D, G = sp.symbols("c d g", positive=True)  # roundings of a closed loop and of an input; growth of both per step


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


def report() -> Derivation:
    """Derive (102)-(114) by the report's own algebra, and show the terms that it omits."""
    return Derivation(
        (
            Step("(102), (103): $\\tilde P_{kp}/\\epsilon$", prediction_error(), (2 * N + 1) * PP - 2 * N * Q),
            Step(
                "(104), (105): $\\tilde P_k/\\epsilon$; the last two terms are left out, (104) keeps the first of them",
                covariance_error(),
                together((3 * N + M + 2) * P, -M * PP, -2 * N * CQ),
            ),
            Step(
                "(107), (108): $\\tilde K_k/\\epsilon$; the last term is left out",
                gain_error(),
                together((4 * N + 2 * M + 3) * KZ, -M * KREST),
            ),
            Step(
                "(112): $\\tilde F_k/\\epsilon$; the last term is left out",
                transition_error(),
                together((5 * N + 3 * M + 4) * FK, -(4 * N + 3 * M + 3) * PHI),
            ),
            Step("(113): $\\tilde u_k/\\epsilon$", input_error(), (4 * N + 3 * M + 3) * U),
            Step(
                "(114)-(117): $\\tilde x_k/\\epsilon$",
                state_error(),
                together((6 * N + 3 * M + 5) * FK * X, (4 * N + 3 * M + 4) * U),
            ),
        )
    )


# -- (118)-(125) ------------------------------------------------------------------------------------------------------


def propagated() -> Derivation:
    r"""Derive (118), (123) by induction over k: :math:`x_k = \Psi_k x_0 + \sum_i \Psi_{k,i}u_i`, factors in order."""
    F, psi, x0, s, u = sp.symbols("F_{k+1} Psi_k x_0 s_k u_{k+1}", commutative=False)
    return Derivation(
        (
            Step(
                "(111) of step $k+1$ on $x_k = \\Psi_k x_0 + s_k$: $\\Psi_{k+1} = F_{k+1}\\Psi_k$, "
                "$s_{k+1} = F_{k+1}s_k + u_{k+1}$",
                F * unevaluated(psi * x0 + s) + u,
                together(F * psi * x0, F * s + u),
            ),
        )
    )


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
GROWTH = 3 * N + M + 2


def printed_coefficients() -> tuple[sp.Expr, sp.Expr]:
    """Return the factors of β‖x_k‖ and βB in (125)."""
    loop = 7 * N + 3 * M + 6
    return K * loop, K * (3 * N + 1) + K * (K - 1) / 2 * loop


def general() -> Derivation:
    """Derive (119)-(125) for every k, by summation instead of a pattern."""
    c, d = TWICE
    start, inputs = count_start(c), count_input(c, d)
    first, second = printed_coefficients()
    x_0, *each = (start.subs(K, 3), *(inputs.subs({K: 3, NTH: i}) for i in (1, 2, 3)))
    differences = (3 * N + 1, 10 * N + 3 * M + 7, 17 * N + 6 * M + 13)
    return Derivation(
        (
            Step("what follows (118): $n+1$ more roundings of each loop", c, together(ONCE[0], N + 1)),
            Step("(119), $x_0$", 3 * unevaluated(c), 3 * (7 * N + 3 * M + 6)),
            Step("(119), $u_1$", together(2 * unevaluated(c), d), 18 * N + 9 * M + 17),
            Step("(119), $u_2$", together(c, d), 11 * N + 6 * M + 11),
            Step("(119), $u_3$", together(ONCE[1], 1), 4 * N + 3 * M + 5),
            *(
                Step(f"(119)-(121), $u_{i}$ by difference", together(x_0, sp.Mul(-1, u_i, evaluate=False)), difference)
                for i, (u_i, difference) in enumerate(zip(each, differences, strict=True), 1)
            ),
            Step("(122), first line", together(*differences), 30 * N + 9 * M + 21),
            Step(
                "(124): the second coefficient",
                second_coefficient(c, d).subs(K, 4),
                together(4 * unevaluated(3 * N + 1), 6 * unevaluated(7 * N + 3 * M + 6)),
            ),
            Step("(125), first coefficient, every $k$", start, first),
            Step("(125), second coefficient, every $k$", second_coefficient(c, d), second),
        )
    )


def corrected() -> Derivation:
    r"""Derive the coefficients of (125) with its faults corrected one after another.

    Each term :math:`T_i` of (118) has its own error of at most :math:`a_i\beta`. With
    :math:`T_0 = x_k - \sum T_i`, the sum is :math:`a_0\|x_k\| + \sum(a_0 + a_i)\|T_i\|`, with a plus sign.
    """
    c, d = ONCE
    one, own, x, t = sp.symbols("e_0 e_i x_k T_i")
    return Derivation(
        (
            Step(
                "errors of their own: with $T_0 = x_k - T_i$, the worst is $a_0|x_k| + (a_0+a_i)|T_i|$",
                one * unevaluated(x - t) + own * t,
                together(one * x, (own - one) * t),
            ),
            Step("counted once: first coefficient", count_start(c), K * ONCE[0]),
            Step(
                "counted once: second coefficient",
                second_coefficient(c, d),
                K * (2 * N + 1) + K * (K - 1) / 2 * ONCE[0],
            ),
            Step(
                "signs of their own: second coefficient",
                second_coefficient(c, d, sign=1),
                K * ONCE[1] + K * (3 * K - 1) / 2 * ONCE[0],
            ),
            Step(
                "errors of $P_{k-1}$ carried on: first coefficient",
                count_start(c, GROWTH),
                K * ONCE[0] + K * (K - 1) / 2 * GROWTH,
            ),
            Step(
                "and second: of third order in $k$",
                sp.limit(second_coefficient(c, d, GROWTH) / K**3, K, sp.oo),
                unevaluated(GROWTH) / 6,
            ),
        )
    )


# -- when the printed steps are bounds --------------------------------------------------------------------------------


def forgotten() -> Derivation:
    r"""Derive the effect of a closed loop of norm f < 1, :math:`\|T_i\| \le f^{k-i}\|u\|`, and a_0 ≥ a_i."""
    f, j = sp.Symbol("f", positive=True), sp.Symbol("j", integer=True, nonnegative=True)
    start = count_start(ONCE[0], GROWTH)
    later = count_input(*ONCE, GROWTH).subs(NTH, j + 1)
    return Derivation(
        (
            Step("sum of $f^{k-i}$: one more step", f * over(1 - f**K, 1 - f) + 1, over(1 - f ** (K + 1), 1 - f)),
            Step("$a_0$ is at least $a_i$, with $i = j+1$", start, later, sp.expand(start - later)),
        )
    )


def scalar_conditions() -> Derivation:
    r"""Compare (105) with the possible error for one state and one measurement if only (101) is rounded.

    With :math:`\kappa = KH`, :math:`P_{kp} = P_k/(1-\kappa)`; each rounding has its own sign. The error can be
    :math:`\beta P_k(2 + 3\kappa)/(1-\kappa)`, but the step from (104) to (105) allows only :math:`3\beta P_k`. The
    relative error of a gain in the first form stays below (108), because no difference is formed.
    """
    kappa = sp.Symbol("kappa", nonnegative=True)
    n = m = 1
    allowed = n + m + 1

    def may(kappa: sp.Expr) -> sp.Expr:
        return over(together(n + 1, (n + m + 1) * unevaluated(kappa)), together(1, -kappa))

    return Derivation(
        (
            Step(
                "where $\\kappa=\\frac16$, possible and allowed are equal",
                may(sp.Rational(1, 6)),
                sp.Integer(allowed),
            ),
            Step(
                "beyond it they differ: possible minus allowed, times $1-\\kappa$",
                unevaluated(together(may(kappa), -allowed)) * unevaluated(1 - kappa),
                6 * kappa - 1,
            ),
            Step(
                "(108), first form: 4 roundings of $P_pH$ in the numerator and, times $\\kappa$, in the denominator; "
                "1 of $H(P_pH)$; 1 each of sum, quotient and product",
                sp.Integer(9),
                together(4 * (1 - kappa), kappa, 3),
                2 + 3 * kappa,
            ),
        )
    )


def smallest() -> Derivation:
    r"""Derive the errors of the scalar filter with z = Q = 0 and an R so small that 1 + R rounds to 1; the rest is 1.

    The rounded values are :math:`S = 1`, :math:`K = 1`, :math:`P = 0`. The exact values are below.
    """
    r = sp.Symbol("R", positive=True)
    p, gain = 1 - 1 / (1 + r), 1 / (1 + r)
    return Derivation(
        (
            Step("exact covariance", unevaluated(1) - over(1, 1 + r), r / (1 + r)),
            Step("both forms of (99) agree", over(p, r), gain),
            Step("(105): error of $\\hat P = 0$ over its bound", over(p, 6 * BETA * p), 1 / (6 * BETA)),
            Step("(108): error of $\\hat K = 0$ over its bound", over(gain, 9 * BETA * gain), 1 / (9 * BETA)),
            Step("(125), $u_1 = 0$: error of $\\hat x = 0$ over its bound", over(p, 16 * BETA * p), 1 / (16 * BETA)),
            Step(
                "(125), second form: $\\hat x = 1$",
                over(1 - p, 16 * BETA * p),
                1 / (16 * BETA * r),
            ),
        )
    )


# -- the contraction bound --------------------------------------------------------------------------------------------


def contraction() -> Derivation:
    r"""Derive the exact identities behind the contraction bound, for every n and m; symbols do not commute.

    For two covariances A and B before the measurement, K and L are the gains, :math:`KS = AH^T` and
    :math:`S = HAH^T + R`, :math:`LT = BH^T` and :math:`T = HBH^T + R`; :math:`H' = H^T`, :math:`L' = L^T`, B and R are
    symmetric, but A need not be.
    """
    a, b, h, ht, r, k, o, lt = sp.symbols("A B H H' R K L L'", commutative=False)
    phi, e, nu = sp.symbols(r"\Phi e \hat{\nu}", commutative=False)
    one = sp.S.One
    s = h * a * ht + r
    after_a, after_b = a - k * h * a, b - b * ht * lt
    zero_k = unevaluated(after_a * ht - k * r)
    zero_l = unevaluated(h * after_b - r * lt)
    return Derivation(
        (
            Step(
                "the two forms of (99) are one: $AH'-KS$ is zero where $(A-KHA)H'-KR$ is zero", a * ht - k * s, zero_k
            ),
            Step(
                "likewise, $HB-TL'$ is zero where $H(B-BH'L')-RL'$ is zero",
                h * b - unevaluated(h * b * ht + r) * lt,
                zero_l,
            ),
            Step(
                "two updates, subtracted; the last two terms are zero",
                after_a - after_b,  # SymPy typesets an unevaluated difference without its parentheses
                together(
                    unevaluated(one - k * h) * unevaluated(a - b) * unevaluated(one - ht * lt), zero_k * lt, -k * zero_l
                ),
            ),
            Step(
                "two gains, subtracted; the last two terms are zero",
                unevaluated(one - o * h) * unevaluated(a - b) * ht,
                together(
                    unevaluated(k - o) * unevaluated(s),
                    unevaluated(a * ht - k * s),
                    unevaluated(o * r - (b - o * h * b) * ht),
                ),
            ),
            Step(
                "two closed loops, subtracted: $F_k - A_k = (K-L)H\\Phi = F_kE_{k-1}G_k$",
                unevaluated(one - o * h) * phi - unevaluated(one - k * h) * phi,
                unevaluated(k - o) * h * phi,
            ),
            Step(
                "two states, $\\Phi\\hat x + K\\hat\\nu$ and $\\Phi(\\hat x-e) + L(\\hat\\nu + H\\Phi e)$, subtracted",
                together(k * nu, phi * e, -o * unevaluated(nu + h * phi * e)),
                together(unevaluated(one - o * h) * phi * e, unevaluated(k - o) * nu),
            ),
        )
    )


def recursion() -> Derivation:
    r"""Derive the scalar recursion of the contraction bound: the norm of the exact closed loop, and a steady state."""
    alpha, t, size = sp.symbols("alpha t q", positive=True)
    return Derivation(
        (
            Step(
                "$f \\le \\alpha + f\\,g\\zeta$, from $F_k = A_k + F_kE_{k-1}G_k$: the largest such $f$",
                together(alpha, t * over(alpha, 1 - t)),
                over(alpha, 1 - t),
            ),
            Step(
                "residuals of one size and $\\alpha < 1$: the errors stay at",
                together(alpha * over(size, 1 - alpha), size),
                over(size, 1 - alpha),
            ),
        )
    )
