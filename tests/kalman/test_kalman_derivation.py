"""gpbnb.report.kalman.derivation: every step holds, would not if it were wrong, and means what exact filters do."""

from __future__ import annotations

import numpy as np
import pytest
import steps
import sympy as sp

from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.report.kalman import derivation, exact_step

DERIVATIONS = steps.Derivations(
    derivation.report,
    derivation.propagated,
    derivation.general,
    derivation.corrected,
    derivation.forgotten,
    derivation.scalar_conditions,
    derivation.smallest,
    derivation.contraction,
    derivation.recursion,
)

NAMES = {
    "report": {
        r"(102), (103): $\tilde P_{kp}/\epsilon$": "(2*n + 1)*P_kp - 2*n*Q",
        r"(104), (105): $\tilde P_k/\epsilon$; the last two terms are left out, (104) keeps the first of them": (
            "(3*n + m + 2)*P_k - m*P_kp - 2*n*IKHQ"
        ),
        r"(107), (108): $\tilde K_k/\epsilon$; the last term is left out": "(4*n + 2*m + 3)*K_k - m*P_kpHTR1",
        r"(112): $\tilde F_k/\epsilon$; the last term is left out": ("(5*n + 3*m + 4)*F_k - (4*n + 3*m + 3)*Phi"),
        r"(113): $\tilde u_k/\epsilon$": "(4*n + 3*m + 3)*u_k",
        r"(114)-(117): $\tilde x_k/\epsilon$": "(6*n + 3*m + 5)*F_k*x + (4*n + 3*m + 4)*u_k",
    },
    "propagated": {
        r"(111) of step $k+1$ on $x_k = \Psi_k x_0 + s_k$: $\Psi_{k+1} = F_{k+1}\Psi_k$, $s_{k+1} = "
        "F_{k+1}s_k + u_{k+1}$": "F_k1*Psi_k*x_0 + F_k1*s_k + u_k1",
    },
    "general": {
        "what follows (118): $n+1$ more roundings of each loop": "7*n + 3*m + 6",
        "(119), $x_0$": "21*n + 9*m + 18",
        "(119), $u_1$": "18*n + 9*m + 17",
        "(119), $u_2$": "11*n + 6*m + 11",
        "(119), $u_3$": "4*n + 3*m + 5",
        "(119)-(121), $u_1$ by difference": "3*n + 1",
        "(119)-(121), $u_2$ by difference": "10*n + 3*m + 7",
        "(119)-(121), $u_3$ by difference": "17*n + 6*m + 13",
        "(122), first line": "30*n + 9*m + 21",
        "(124): the second coefficient": "4*(3*n + 1) + 6*(7*n + 3*m + 6)",
        "(125), first coefficient, every $k$": "k*(7*n + 3*m + 6)",
        "(125), second coefficient, every $k$": "k*(3*n + 1) + k*(k - 1)/2*(7*n + 3*m + 6)",
    },
    "corrected": {
        "errors of their own: with $T_0 = x_k - T_i$, the worst is $a_0|x_k| + (a_0+a_i)|T_i|$": (
            "e_0*x_k + (e_i - e_0)*T_i"
        ),
        "counted once: first coefficient": "k*(6*n + 3*m + 5)",
        "counted once: second coefficient": "k*(2*n + 1) + k*(k - 1)/2*(6*n + 3*m + 5)",
        "signs of their own: second coefficient": "k*(4*n + 3*m + 4) + k*(3*k - 1)/2*(6*n + 3*m + 5)",
        "errors of $P_{k-1}$ carried on: first coefficient": "k*(6*n + 3*m + 5) + k*(k - 1)/2*(3*n + m + 2)",
        "and second: of third order in $k$": "(3*n + m + 2)/6",
    },
    "forgotten": {
        "sum of $f^{k-i}$: one more step": "(1 - f**(k + 1))/(1 - f)",
        "$a_0$ is at least $a_i$, with $i = j+1$": (
            "(k - j - 1)*(6*n + 3*m + 5) + 4*n + 3*m + 4 + (k*(k - 1)/2 - j*(j - 1)/2)*(3*n + m + 2)"
        ),
    },
    "scalar_conditions": {
        r"where $\kappa=\frac16$, possible and allowed are equal": "3",
        r"beyond it they differ: possible minus allowed, times $1-\kappa$": "6*kappa - 1",
        r"(108), first form: 4 roundings of $P_pH$ in the numerator and, times $\kappa$, in the denominator; 1 of "
        "$H(P_pH)$; 1 each of sum, quotient and product": "7 - 3*kappa",
    },
    "smallest": {
        "exact covariance": "R/(1 + R)",
        "both forms of (99) agree": "1/(1 + R)",
        r"(105): error of $\hat P = 0$ over its bound": "1/(6*beta)",
        r"(108): error of $\hat K = 0$ over its bound": "1/(9*beta)",
        r"(125), $u_1 = 0$: error of $\hat x = 0$ over its bound": "1/(16*beta)",
        r"(125), second form: $\hat x = 1$": "1/(16*beta*R)",
    },
    "contraction": {
        "the two forms of (99) are one: $AH'-KS$ is zero where $(A-KHA)H'-KR$ is zero": "(A - K*H*A)*HT - K*R",
        "likewise, $HB-TL'$ is zero where $H(B-BH'L')-RL'$ is zero": "H*(B - B*HT*LT) - R*LT",
        "two updates, subtracted; the last two terms are zero": (
            "(1 - K*H)*(A - B)*(1 - HT*LT) + ((A - K*H*A)*HT - K*R)*LT - K*(H*(B - B*HT*LT) - R*LT)"
        ),
        "two gains, subtracted; the last two terms are zero": (
            "(K - L)*(H*A*HT + R) + A*HT - K*(H*A*HT + R) + L*R - (B - L*H*B)*HT"
        ),
        r"two closed loops, subtracted: $F_k - A_k = (K-L)H\Phi = F_kE_{k-1}G_k$": "(K - L)*H*Phi",
        r"two states, $\Phi\hat x + K\hat\nu$ and $\Phi(\hat x-e) + L(\hat\nu + H\Phi e)$, subtracted": (
            "(1 - L*H)*Phi*e + (K - L)*hatnu"
        ),
    },
    "recursion": {
        r"$f \le \alpha + f\,g\zeta$, from $F_k = A_k + F_kE_{k-1}G_k$: the largest such $f$": "alpha/(1 - t)",
        r"residuals of one size and $\alpha < 1$: the errors stay at": "q/(1 - alpha)",
    },
}
"""What each step derives, beside its name; see `steps.check_names`."""


@pytest.mark.parametrize("name", DERIVATIONS)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check_each(DERIVATIONS[name], NAMES[name])


def test_the_derivations_are_those_of_the_chapter():
    assert sum(steps.lengths(DERIVATIONS).values()) == 42


def test_the_rows_of_119_are_the_counts_of_every_k():
    (c, d), values = derivation.TWICE, {derivation.K: 3}
    counts = [derivation.count_start(c), *(derivation.count_input(c, d).subs(derivation.NTH, i) for i in (1, 2, 3))]
    rows = DERIVATIONS["general"].steps[1:5]
    assert [sp.expand(count.subs(values) - row.right) for count, row in zip(counts, rows, strict=True)] == [0] * 4


def test_the_general_case_is_the_printed_one_and_no_other():
    first, second = derivation.printed_coefficients()
    values = {derivation.K: 5, derivation.N: 2, derivation.M: 3}
    assert (first.subs(values), second.subs(values)) == (145, 5 * 7 + 10 * 29)
    assert sp.expand(derivation.second_coefficient(*derivation.ONCE) - second) != 0


def test_what_is_left_out():
    n, m = derivation.N, derivation.M
    error = derivation.covariance_error()
    assert error.coeff(derivation.PP) == -m
    assert sp.expand(error.coeff(derivation.CQ) + 2 * n) == 0
    assert derivation.transition_error().coeff(derivation.PHI) == -4 * n - 3 * m - 3


def test_the_identities_hold_for_exact_filters():
    """E_k = A E F' + T and e_k = F (e + E y) + q, for matrices of numbers; A may be asymmetric."""
    rng = np.random.default_rng(42)
    n, m = 3, 2
    for _ in range(5):
        Phi, H = exact(rng.integers(-9, 10, (n, n))) / 10, exact(rng.integers(-9, 10, (m, n)))
        Q, R = exact(np.eye(n, dtype=int)), exact(np.diag([2, 3]))
        root = exact(rng.integers(-3, 4, (n, n)))
        P, x, z = (
            root @ root.T + 1 * np.eye(n, dtype=int),
            exact(rng.integers(-9, 10, n)),
            exact(rng.integers(-9, 10, m)),
        )
        E, e = exact(rng.integers(-9, 10, (n, n))) / 1000, exact(rng.integers(-9, 10, n)) / 100
        true, run = exact_step.exact_step(Phi, H, Q, R, x, P, z), exact_step.exact_step(Phi, H, Q, R, x + e, P + E, z)
        S = inverse_of(run.innovation_covariance)
        y = Phi.T @ H.T @ S @ run.innovation
        assert np.all(run.transition @ E @ true.transition.T == run.P - true.P)
        assert np.all(run.x - true.x == true.transition @ (e + E @ y))
        G = Phi.T @ H.T @ S @ H @ Phi
        assert np.all(true.transition == run.transition + true.transition @ E @ G)
        assert np.all(run.gain - true.gain == true.transition @ E @ Phi.T @ H.T @ S)
