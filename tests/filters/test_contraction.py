"""gpbnb.filters.contraction: a bound that no trajectory exceeds, and that some come near."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.rational import exact
from gpbnb.filters import contraction
from gpbnb.filters.steps import StepModel
from gpbnb.report.kalman import exact_step

UNIT = 2.0**-102


def floats(entries):
    return np.asarray(entries, dtype=object).astype(np.float64)


def model(rng, n, m):
    """A random model in few digits, its closed loop neither slow nor fast, of various scales."""
    scale = exact(np.diag([Fraction(10) ** int(e) for e in rng.integers(-3, 4, n)]))
    inverse = exact(np.diag([1 / scale[i, i] for i in range(n)]))
    Phi = scale @ (exact(rng.integers(-9, 10, (n, n))) / (5 * n) + Fraction(1, 2) * np.eye(n, dtype=int)) @ inverse
    H = exact(rng.integers(-9, 10, (m, n))) @ inverse
    Q = scale @ exact(np.diag(rng.integers(0, 3, n))) @ scale / 100
    R = exact(np.diag(10 ** rng.integers(0, 3, m))) / 10
    root = exact(rng.integers(-3, 4, (n, n)))
    P = scale @ (root @ root.T + 1 * np.eye(n, dtype=int)) @ scale
    return Phi, H, Q, R, scale[np.arange(n), np.arange(n)] * rng.integers(-9, 10, n), P


def shortened(entries, digits=240):
    """Fractions near these that do not grow: far below all that is bounded here."""
    flat = [Fraction(round(x * 2**digits), 2**digits) for x in np.asarray(entries, dtype=object).flat]
    return np.array(flat, dtype=object).reshape(np.shape(entries))


def one_step(before, model, repeated, off):
    """The bound after one step."""
    of_one = (type(each)(*(part[np.newaxis] for part in each)) for each in (model, repeated, off))
    return contraction.at_step(contraction.contraction_steps(before, *of_one), 0)


def trajectory(rng, n, m, size, steps=8, disturb="random"):
    """Errors and bounds of a filter disturbed at each step by about `size`, at random or so that it adds up."""
    *given, x, P = model(rng, n, m)
    plain = StepModel(*map(floats, given))
    x0 = x + exact(floats(x) * size * rng.uniform(-1, 1, n))
    dE = exact(np.diag(floats(P).diagonal() * size))
    bound = contraction.contraction_start(floats(P), np.abs(floats(x0 - x)), np.abs(floats(dE)))
    run, truth = (x0, P + dE), (x, P)
    for _ in range(steps):
        z = exact(rng.integers(-99, 100, m))
        here, true = exact_step.exact_step(*given, *run, z), exact_step.exact_step(*given, *truth, z)
        spread = np.sqrt(floats(here.P).diagonal())
        if disturb == "random":
            q, T = rng.uniform(-1, 1, n) * spread, rng.uniform(-1, 1, (n, n)) * np.outer(spread, spread)
        else:
            q, T = np.sign(floats(here.x - true.x) + 1e-300) * spread, np.outer(spread, spread)
        x = shortened(here.x + exact(q * size))
        P = shortened(here.P + exact((T + T.T) * size / 2))
        K, S = floats(here.gain), floats(here.innovation_covariance)
        off = contraction.evaluation_errors(plain, floats(run[0]), floats(run[1]), floats(z), K, S, UNIT)
        repeated = contraction.Repeated(K, S, floats(here.innovation), floats(x - here.x), floats(P - here.P))
        bound = one_step(bound, plain, repeated, off)
        used = shortened(here.gain * (1 + exact(size)))
        yield (
            (floats(x - true.x), contraction.state_error_bound(bound)),
            (floats(P - true.P), contraction.covariance_error_bound(bound)),
            (floats(used - true.gain), contraction.gain_error_bound(bound, K, floats(used), off.gain)),
        )
        run, truth = (x, P), (shortened(true.x), shortened((true.P + true.P.T) / 2))


@pytest.mark.parametrize(("size", "disturb"), [(1e-2, "random"), (1e-4, "adding up"), (1e-14, "adding up")])
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (3, 2)])
def test_no_trajectory_exceeds_the_bound_and_some_come_near(n, m, size, disturb):
    rng = np.random.default_rng([n, m, int(-np.log10(size))])
    ratios = []
    for _ in range(3):
        for pairs in trajectory(rng, n, m, size, disturb=disturb):
            for error, bound in pairs:
                assert np.all(np.abs(error) <= bound)
            error, bound = pairs[0]
            ratios.append((np.abs(error) / bound).max())
    # Within a factor of 50, but where the covariance is so disturbed that the gain is hardly known.
    assert max(ratios) > (1 / 50 if size < 1e-2 else 1 / 1000)


def test_without_disturbance_the_bound_is_what_the_evaluation_may_err():
    rng = np.random.default_rng(5)
    for pairs in trajectory(rng, 2, 1, 0.0):
        for error, bound in pairs[:2]:
            assert np.all(error == 0) or np.all(np.abs(error) <= bound)
            assert bound.max() < 1e-20 * 1e8  # the scales of the model reach 1e3, squared 1e6


@pytest.mark.parametrize("alike", [False, True])
def test_evaluation_errors_cover_what_float64_does(alike):
    """Also with two precise sensors that are alike, whose gain has the errors of an inverse."""
    rng = np.random.default_rng(6)
    for _ in range(40):
        Phi, H, Q, R, x, P = model(rng, 3, 2)
        given = (Phi, H[[0, 0]], Q, R / 10**6) if alike else (Phi, H, Q, R)
        z = exact(rng.integers(-99, 100, 2))
        Phi, H, Q, R, x1, P1, z1 = map(floats, (*given, x, P, z))
        stored, plain = [exact(each) for each in (Phi, H, Q, R, x1, P1, z1)], StepModel(Phi, H, Q, R)
        true = exact_step.exact_step(*stored)
        Pp = Phi @ P1 @ Phi.T + Q
        S = H @ Pp @ H.T + R
        L = np.linalg.cholesky((S + S.T) / 2)
        K = np.linalg.solve(L.T, np.linalg.solve(L, H @ Pp)).T
        v = z1 - H @ (Phi @ x1)
        x2, P2 = Phi @ x1 + K @ v, Pp - K @ (H @ Pp)
        dq, dT, dK, dv = contraction.evaluation_errors(plain, x1, P1, z1, floats(true.gain), S, 2.0**-53)
        for computed, right, allowed in (
            (x2, true.x, dq),
            ((P2 + P2.T) / 2, true.P, dT),
            (K, true.gain, dK),
            (v, true.innovation, dv),
        ):
            assert np.all(abs(exact(computed) - right) <= exact(allowed))


@pytest.mark.parametrize("n", [1, 2, 5, 10])
def test_the_spectral_norm_is_bounded_from_above_and_sharply(n):
    rng = np.random.default_rng(n)
    for _ in range(10):
        Z = rng.standard_normal((n, n))
        for scale in (0.5, 0.999999, 1.0, 3.0):
            X = Z / np.linalg.svd(Z)[1][0] * scale
            top = np.linalg.svd(X)[1][0]
            found = contraction._norm2(X)
            # Its square is sharp to a thousandth of its distance from 1, relatively; numpy's own error is below 1e-13.
            assert top * (1 - 1e-13) <= found <= top * (1 + 0.6e-3 * abs(1 - top**2)) + 1e-11
