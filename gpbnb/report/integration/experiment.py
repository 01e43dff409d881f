"""Simulate the error of digital integration, exactly in distribution at the sampling times."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from gpbnb.report.integration import theory
from gpbnb.report.integration.theory import Floats, Process


def simulate(process: Process, f_c: float, n: int, rng: np.random.Generator, paths: int = 1) -> tuple[Floats, Floats]:
    """Draw samples (n + 1, paths) of a first-order input and the errors (n, paths) of the trapezoids between them.

    No step is subdivided: the sample and the integral over a cycle are drawn from their joint distribution, given the
    previous sample. The simulation starts in the steady state.
    """
    a, b = theory.exact_step(process, f_c)
    x, d = np.empty((n + 1, paths)), np.empty((n, paths))
    x[0] = process.sigma * rng.standard_normal(paths)
    for k, normal in enumerate(rng.standard_normal((n, paths, 2))):
        x[k + 1], d[k] = a @ x[k : k + 1] + b @ normal.T
    return x, d


def deviations(errors: Floats, variance: ArrayLike) -> Floats:
    r"""Return how far the mean square of errors (k, paths) is from a variance, in standard errors √(2/paths).

    The errors are normal, and their mean is known to be zero.
    """
    observed = np.mean(errors**2, axis=-1)
    return np.asarray((observed / np.asarray(variance) - 1) / math.sqrt(2 / errors.shape[-1]))


def sweep(mu: ArrayLike, cycles: int, paths: int, rng: np.random.Generator) -> Floats:
    """Simulate the trapezoidal rule at many ratios of bandwidth to iteration rate; return the errors, (k, paths)."""
    runs = (simulate(theory.first_order(1.0, one), 1.0, cycles, rng, paths) for one in np.asarray(mu).tolist())
    return np.array([d.sum(axis=0) for _, d in runs])
