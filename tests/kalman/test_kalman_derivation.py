"""gpbnb.kalman.derivation: every step holds, would not if it were wrong, and means what exact filters do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from gpbnb.bounds import exact
from gpbnb.derivation import Derivation
from gpbnb.kalman import derivation, theory

DERIVATIONS = {
    function.__name__: function()
    for function in (
        derivation.report,
        derivation.propagated,
        derivation.general,
        derivation.mended,
        derivation.scalar_conditions,
        derivation.smallest,
        derivation.contraction,
        derivation.recursion,
    )
}
STEPS = [(name, i) for name, steps in DERIVATIONS.items() for i in range(len(steps.steps))]
each_step = pytest.mark.parametrize(("name", "i"), STEPS)


@each_step
def test_the_step_holds_and_is_typeset(name, i):
    step = DERIVATIONS[name].steps[i]
    assert step.holds
    assert step.name.count("$") % 2 == 0
    assert r"\;=\;" in step.latex()


def test_all_hold():
    assert all(steps.holds for steps in DERIVATIONS.values())
    assert len(STEPS) == 42


@each_step
def test_a_wrong_step_would_be_found_out(name, i):
    steps = DERIVATIONS[name].steps
    for wrong in (
        replace(steps[i], right=steps[i].right + derivation.BETA),
        replace(steps[i], right=2 * steps[i].right + 1),
        replace(steps[i], rest=steps[i].rest + 1),
    ):
        assert not wrong.holds
        assert not Derivation((*steps[:i], wrong, *steps[i + 1 :])).holds


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
        true, run = theory.exact_step(Phi, H, Q, R, x, P, z), theory.exact_step(Phi, H, Q, R, x + e, P + E, z)
        S = theory._inverse_of(run.innovation_covariance)
        y = Phi.T @ H.T @ S @ run.innovation
        assert np.all(run.transition @ E @ true.transition.T == run.P - true.P)
        assert np.all(run.x - true.x == true.transition @ (e + E @ y))
        G = Phi.T @ H.T @ S @ H @ Phi
        assert np.all(true.transition == run.transition + true.transition @ E @ G)
        assert np.all(run.gain - true.gain == true.transition @ E @ Phi.T @ H.T @ S)
