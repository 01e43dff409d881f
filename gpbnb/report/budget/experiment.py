"""Averages of simulated errors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
