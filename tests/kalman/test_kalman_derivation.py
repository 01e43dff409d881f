"""gpbnb.report.kalman.derivation: its counts and identities are those of exact filters."""

from __future__ import annotations

import numpy as np
import sympy as sp

from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.report.kalman import derivation, exact_step


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
