r"""Derive the algebra of savage2016 again from (1) and (2), and the consequence that each misprint would have.

Everything up to (35) is exact. P stands for the steady-state variance :math:`P_{11\infty} = \sigma_x^2`.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from gpbnb.report.display.derivation import Step

OMEGA, T, P, TAU, TIME = sp.symbols("omega T P tau t", positive=True)
MU = sp.Symbol("mu", positive=True)
L, PHI = sp.symbols("L varphi", positive=True)
N = sp.Symbol("n", integer=True, nonnegative=True)

#: States and noises of (10) before a step, and the covariances of the states.
X1, X2, X3, Q1, Q2 = sp.symbols("x_1 x_2 x_3 q_1 q_2")
P11, P12, P22, P31, P32, P33 = sp.symbols("P_11 P_12 P_22 P_31 P_32 P_33")
PHI11, PHI21, P11N, P12N, P22N = sp.symbols("phi_11 phi_21 P_11n P_12n P_22n")

DECAY = sp.exp(-OMEGA * T)


# -- the transition, (5)-(9) ----------------------------------------------------------------------


@cache
def transition_matrix() -> sp.ImmutableMatrix:
    """Return the matrix exponential of A T, from (4) alone."""
    return sp.ImmutableMatrix((sp.Matrix([[-OMEGA, 0], [1, 0]]) * T).exp().applyfunc(sp.simplify))


def printed_transition() -> sp.Matrix:
    """Return the matrix as printed in (7)."""
    return sp.Matrix([[DECAY, 0], [(1 - DECAY) / OMEGA, 1]])


def transition_residual(identity: bool) -> sp.Matrix:
    r"""Return (7) minus :math:`\int_0^T A\Phi\,d\tau`, the right side of (6), and minus the identity that (6) omits."""
    a = sp.Matrix([[-OMEGA, 0], [1, 0]])
    integrand = (a * printed_transition()).subs(T, TAU)
    integral = integrand.applyfunc(lambda entry: sp.integrate(entry, (TAU, 0, T)))
    return (printed_transition() - integral - (sp.eye(2) if identity else sp.zeros(2))).applyfunc(sp.simplify)


@cache
def noise(kernel: str = "right") -> sp.ImmutableMatrix:
    r"""Return the covariance of q_n in (6), from white noise of density :math:`N = 2\omega P`.

    The kernel is "right", :math:`\int\Phi(t_n-\tau)n_p(\tau)d\tau`; "reversed", with :math:`\Phi(\tau-t_{n-1})`; or
    "printed", with :math:`\Phi(\tau)`, τ counted from the start of all cycles.
    """
    arguments = {"right": T - TAU, "reversed": TAU, "printed": TIME + TAU}
    column = printed_transition()[:, 0].subs(T, arguments[kernel])
    density = 2 * OMEGA * P * column * column.T
    return sp.ImmutableMatrix(density.applyfunc(_over_cycle))


def _over_cycle(entry: sp.Expr) -> sp.Expr:
    """Integrate a sum of exponentials of τ over a cycle."""
    total = sp.S.Zero
    for term in sp.Add.make_args(sp.expand(entry)):
        rate = sp.expand(sp.diff(term, TAU) / term)
        total += term * T if rate == 0 else (term.subs(TAU, T) - term.subs(TAU, 0)) / rate
    return sp.expand(total)


# -- covariances from cycle to cycle, (10)-(18) ---------------------------------------------------


def expected(expression: sp.Expr) -> sp.Expr:
    """Return the expected value of a product of states before a step and noises of this step, which are independent."""
    moments = {
        (2, 0, 0, 0, 0): P11,
        (1, 1, 0, 0, 0): P12,
        (0, 2, 0, 0, 0): P22,
        (1, 0, 1, 0, 0): P31,
        (0, 1, 1, 0, 0): P32,
        (0, 0, 2, 0, 0): P33,
        (0, 0, 0, 2, 0): P11N - PHI11**2 * P11,
        (0, 0, 0, 1, 1): P12N - PHI11 * (P12 + PHI21 * P11),
        (0, 0, 0, 0, 2): P22N - P22 - 2 * PHI21 * P12 - PHI21**2 * P11,
    }
    polynomial = sp.Poly(sp.expand(expression), X1, X2, X3, Q1, Q2)
    return sp.expand(sum(c * moments.get(powers, 0) for powers, c in polynomial.terms()))


def printed_18(half: bool) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return P31, P32 and P33 after a step by (18), as printed or with the missing 1/2 in the last term of P32."""
    weight = sp.Rational(1, 2) if half else sp.Integer(1)
    quarter = sp.Rational(1, 4)
    return (
        PHI11 * P31 + P11N * T / 2 + PHI11 * P11 * T / 2,
        P32 + PHI21 * P31 + P12N * T / 2 + P12 * T / 2 + weight * PHI21 * P11 * T,
        P33 + (1 + PHI11) * P31 * T + quarter * P11N * T**2 + (quarter + PHI11 / 2) * P11 * T**2,
    )


# -- the continuous covariances, (19)-(28) --------------------------------------------------------


def p12(t: sp.Expr) -> sp.Expr:
    """Return P12 of (23) at the time t."""
    return P * (1 - sp.exp(-OMEGA * t)) / OMEGA


def p22(t: sp.Expr) -> sp.Expr:
    """Return P22 of (23) at the time t."""
    return 2 * P / OMEGA * (t - (1 - sp.exp(-OMEGA * t)) / OMEGA)


def p22_change(printed: bool) -> sp.Expr:
    r"""Return (25) minus :math:`P_{22_{n-1}}`, t = t_{n-1}; as printed it lacks a factor :math:`1/\omega`."""
    factor = 1 if printed else 1 / OMEGA
    return 2 * P / OMEGA * (T - factor * (1 - DECAY) * sp.exp(-OMEGA * TIME))


# -- the steady state, (30)-(35) ------------------------------------------------------------------


def steady_changes(half: bool = True) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return ΔP32, ΔP33 and ΔP22 of (32), from (18) and (25) for large n."""
    p31 = P * T / 2 * (1 + DECAY) / (1 - DECAY)
    steady = {P11: P, P11N: P, P12: P / OMEGA, P12N: P / OMEGA, P31: p31, PHI11: DECAY, PHI21: (1 - DECAY) / OMEGA}
    _, second, third = printed_18(half)
    return (second - P32).subs(steady), (third - P33).subs(steady), 2 * P / OMEGA * T


def walk() -> sp.Expr:
    """Return the square of (35), divided by P T, as a function of μ."""
    return (1 + sp.exp(-MU)) / (1 - sp.exp(-MU)) - 2 / MU


def independent() -> tuple[Step, ...]:
    r"""Derive (35) from the errors of single cycles, without (10)-(34).

    With :math:`R(\tau) = Pe^{-\omega|\tau|}`, the error of one cycle has the variance r_0. Its covariance with the
    error k cycles later is :math:`r_k = r_1e^{-\omega(k-1)T}`. The variance of the sum therefore grows by
    :math:`r_0 + 2r_1 + 2r_2 + \dots` per cycle.
    """
    s = sp.Symbol("s", positive=True)
    along = sp.Integral(P * sp.exp(-OMEGA * TAU), (TAU, 0, T))
    inner = sp.Integral(2 * P * (T - s) * sp.exp(-OMEGA * s), (s, 0, T))
    r0 = P * (1 + DECAY) * T**2 / 2 + inner.doit() - T * 2 * along.doit()
    drawn = T * (1 + DECAY) / 2 - (1 - DECAY) / OMEGA
    r1 = P * drawn**2
    grow = walk().subs(MU, OMEGA * T)
    return (
        Step(
            "$r_0$: variance of the trapezoid, of the integral, and their covariance",
            P * T**2 * (1 + DECAY) / 2 + inner - 2 * T * along,
            r0,
        ),
        Step(
            "$gT$: expected error of the next cycle for a sample of size 1",
            drawn / T,
            (1 - DECAY) / 2 * grow,
        ),
        Step(
            "the sum $r_0 + 2r_1/(1-e^{-\\omega T})$ equals (35)",
            r0 + 2 * r1 / (1 - DECAY),
            P * T**2 * grow,
        ),
    )


def transient() -> tuple[Step, ...]:
    r"""Derive the variance at every n for an input in its steady state, with Langevin's L and :math:`φ = e^{-\mu}`."""
    pee = N * L - L**2 / 2 * (1 - PHI**N)
    c = L / 2 * (1 - PHI**N)
    g = (1 - PHI) * L / 2
    r = L - (1 - PHI) * L**2 / 2
    r0, r1 = sp.symbols("r_0 r_1")
    grown = {r0: r, r1: g**2}
    k = sp.Symbol("k", integer=True, positive=True)
    total = N * r0 + 2 * r1 * (N / (1 - PHI) - (1 - PHI**N) / (1 - PHI) ** 2)
    return (
        Step("$c_n = E(e_nx_{1n})$ in units of $\\sigma_x^2T$: its recursion", PHI * c + g, c.subs(N, N + 1)),
        Step("$P_{n+1}$ from $P_n$, in units of $\\sigma_x^2T^2$", pee + 2 * g * c + r, pee.subs(N, N + 1)),
        Step("the variance starts at zero", pee.subs(N, 0), sp.Integer(0)),
        Step(
            "the same from $n\\,r_0 + 2\\sum_{k<n}(n-k)\\,r_1\\varphi^{k-1}$, summed",
            total.subs(grown),
            pee,
        ),
        Step(
            "that sum, by induction over $n$: one more cycle adds $r_0 + 2r_1(1-\\varphi^n)/(1-\\varphi)$",
            total.subs(N, k + 1) - total.subs(N, k),
            r0 + 2 * r1 * (1 - PHI**k) / (1 - PHI),
        ),
    )


@cache
def printed_37(cubic: sp.Expr) -> sp.Expr:
    r"""Return the walk to order μ² from (37) with the numerator :math:`1-\frac12\mu+\frac14\mu^2-c\mu^3`."""
    numerator = 1 - MU / 2 + MU**2 / 4 - cubic * MU**3
    denominator = 1 - MU / 2 + MU**2 / 6 - MU**3 / 24
    return sp.series(2 / MU * (numerator / denominator - 1), MU, 0, 3).removeO()


# -- what the misprints would have led to -------------------------------------------------------------


@cache
def misprints() -> dict[str, sp.Expr]:
    """Return, as a function of μ, the steady-state rate over P T that each misprint would give.

    "(12)" omits P22, for which the print has the square of a mean. "(18)" has the full last term of P32. "(25)" is
    taken for large n. "(34)" omits T, which is set to 1 s. "(37)" is expanded to μ².
    """
    d32, d33, d22 = steady_changes()
    wrong32 = steady_changes(half=False)[0]

    def rate(expression: sp.Expr) -> sp.Expr:
        return sp.simplify((expression / (P * T**2)).subs(OMEGA, MU / T))

    return {
        "(12)": rate(d33 - 2 * d32),
        "(18)": rate(d33 + d22 - 2 * wrong32),
        "(25)": rate(d33 + sp.limit(p22_change(printed=True), TIME, sp.oo) - 2 * d32),
        "(34)": sp.simplify(((1 + DECAY - 2 / OMEGA * (1 - DECAY)) / (1 - DECAY) / T).subs(OMEGA, MU / T)),
        "(37)": printed_37(sp.Rational(1, 6)),
    }
