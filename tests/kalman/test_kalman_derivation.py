"""gpbnb.kalman.derivation: every step holds, would not if it were wrong, and means what exact filters do."""

from __future__ import annotations

import numpy as np
import steps
import sympy as sp

from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.kalman import derivation, exact_step

DERIVATIONS = steps.collected(
    derivation.report,
    derivation.propagated,
    derivation.general,
    derivation.corrected,
    derivation.scalar_conditions,
    derivation.smallest,
    derivation.contraction,
    derivation.recursion,
)


@steps.each(DERIVATIONS)
def test_each_step(step):
    steps.check(step)


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
