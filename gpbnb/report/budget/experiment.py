"""Simulations: budgets with random errors, and averages of simulated errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gpbnb.report.budget.theory import Budget

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Draws:
    """Total errors (trials,) of a budget whose groups are drawn at random, in milliarcseconds."""

    budget: Budget
    errors: Floats

    @property
    def deviation(self) -> float:
        """Root mean square of the errors; its relative standard error is one over the square root of 2 · trials."""
        return float(np.sqrt(np.mean(self.errors**2)))

    def beyond(self, limit: float) -> float:
        """Return the fraction of trials whose total is larger in size than `limit`."""
        return float(np.mean(np.abs(self.errors) > limit))


def draw(budget: Budget, trials: int, rng: np.random.Generator) -> Draws:
    """Draw total errors: for each group, a normal random number times the signed sum of its residuals."""
    if not budget.sources or trials < 1:
        raise ValueError(f"got {len(budget.sources)} sources and {trials} trials; needed at least one of each")
    sums = [math.fsum(source.residual for source in group) for group in budget.groups()]
    total: Floats = np.zeros(trials)
    for size in sums:
        total += size * rng.standard_normal(trials)
    return Draws(budget, total)


def turning_mean(cycles: float) -> float:
    """Return the length of the mean of a unit vector that rotates through `cycles`, sampled at midpoints."""
    samples = 20_000
    angle = 2 * np.pi * cycles * (np.arange(samples) + 0.5) / samples
    return float(np.hypot(np.cos(angle).mean(), np.sin(angle).mean()))


SAMPLES = 400
"""Number of samples in one mean of correlated noise."""


def correlated_means(time: float, correlation_time: float, trials: int, rng: np.random.Generator) -> Floats:
    r"""Simulate means (trials,) of unit noise with an exponential correlation, by the trapezoidal rule.

    The samples are exact. The rule overestimates the variance of the mean by a fraction :math:`(T/(400\tau))^2/12`.
    """
    keep = math.exp(-time / SAMPLES / correlation_time)
    value = rng.standard_normal(trials)
    total = value / 2
    for k in range(1, SAMPLES + 1):
        value = keep * value + math.sqrt(1 - keep**2) * rng.standard_normal(trials)
        total = total + (value / 2 if k == SAMPLES else value)
    return np.asarray(total / SAMPLES)
