"""gpbnb.filters.covariance: roundings of textbook covariances are undone and reported."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from gpbnb.arithmetic.definiteness import factor
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.covariance import REPAIR_TOLERANCE
from gpbnb.filters.model import LinearModel


def white_noise(n, dt, size):
    column = np.array([dt**2 / 2, dt, 1.0])[:n]
    return np.outer(column, column) * size**2


def van_loan(n, dt, density):
    """Covariance of a chain of n integrators of white noise over a step; Van Loan 1978."""
    drift, noise = np.diag(np.ones(n - 1), 1), np.zeros((n, n))
    noise[-1, -1] = density
    whole = expm(np.block([[-drift, noise], [np.zeros((n, n)), drift.T]]) * dt)
    return whole[n:, n:].T @ whole[:n, n:]


def inverses(count):
    rng = np.random.default_rng(20)
    for _ in range(count):
        n = int(rng.integers(2, 7))
        sample = rng.standard_normal((n, n + 3))
        yield np.linalg.inv(sample @ sample.T)


STEPS = (0.001, 0.005, 0.01, 0.02, 0.04, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0, 2.0)
TEXTBOOK = [
    *(white_noise(n, dt, size) for n in (2, 3) for dt in STEPS for size in (0.1, 0.3, 0.5, 1.3, 2.0)),
    *(van_loan(n, dt, 0.3) for n in (2, 3) for dt in (0.001, 0.01, 0.1, 1.0, 10.0)),
    *inverses(100),
]


def model(Q, **others):
    n = len(Q)
    given = {"Phi": np.eye(n), "H": np.eye(1, n), "Q": Q, "R": [[1]], "x0": np.zeros(n), "P0": np.eye(n)}
    return LinearModel(**(given | others))


def test_textbook_covariances_are_accepted_with_the_least_change():
    """More than half of them are not exactly symmetric and semidefinite."""
    changed = 0
    for Q in TEXTBOOK:
        found = model(Q)
        factor(found.Q[0])  # exactly semidefinite
        variances = np.sqrt(np.diagonal(Q))
        change = np.abs((found.Q[0] - exact(Q)).astype(float)) / np.multiply.outer(variances, variances)
        assert change.max() <= REPAIR_TOLERANCE
        changed += bool(found.repairs)
        assert bool(found.repairs) == bool(np.any(found.Q[0] != exact(Q)))
    assert changed > len(TEXTBOOK) / 2


def not_quite(n):
    """The first white noise of so many states that float64 makes indefinite."""
    return next(Q for Q in TEXTBOOK if len(Q) == n and model(Q).repairs)


def test_a_repair_is_off_for_exact_input_and_on_demand():
    Q = not_quite(2)
    as_fractions = exact(Q)
    assert model(Q).repairs
    with pytest.raises(ValueError, match="got Q with"):
        model(as_fractions)
    with pytest.raises(ValueError, match="got Q with"):
        model(Q, repair=False)
    assert model(as_fractions, repair=True).repairs == model(Q).repairs
