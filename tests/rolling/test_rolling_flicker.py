"""The 1/f noise of rolling.experiment: response, density over four decades, causality, reproducibility."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.report.rolling import experiment, theory
from gpbnb.report.rolling.experiment import record

LEVEL = 7.0


def rng(seed=0):
    return np.random.default_rng(seed)


# -- the response ---------------------------------------------------------------------------------


def test_the_response_is_that_of_the_binomial_coefficients():
    h = theory.impulse_response(200)
    exact = [Fraction(math.comb(2 * k, k), 4**k) for k in range(200)]
    # One rounding for the quotient and one for the product of each lag.
    assert all(
        abs(Fraction(x) / y - 1) <= 2 * k * Fraction(2) ** -52 for k, (x, y) in enumerate(zip(h, exact, strict=True))
    )
    assert len(theory.impulse_response(1)) == 1


def test_the_noise_is_white_noise_through_the_full_response():
    """The slow way: a convolution with every lag."""
    n, seed = 5000, 11
    white = math.sqrt(math.pi * LEVEL) * rng(seed).spawn(2)[1].standard_normal(n)
    slow = np.convolve(white, theory.impulse_response(n))[:n]
    fast = record(LEVEL, n, 2, rng(seed))[:, 1]
    assert np.allclose(fast, slow, rtol=0, atol=1e-13 * np.max(abs(slow)))  # some roundings of the largest numbers


@pytest.mark.parametrize("period", [None, 77.5])
def test_filtered_noise_has_the_variance_of_all_that_each_white_sample_adds(period):
    weights, n = [0.5, 0.3, 0.2], 8
    h = theory.impulse_response(n)
    turn = np.ones(n) if period is None else np.exp(1j * theory.roll_phase(np.arange(n), period))
    added = [sum(w * turn[n - 1 - j] * h[n - 1 - j - k] for j, w in enumerate(weights) if j + k < n) for k in range(n)]
    expected = math.pi * LEVEL * np.sum(np.abs(added) ** 2)
    assert theory.filtered_variance(weights, LEVEL, n, period) == pytest.approx(expected, rel=1e-12)


# -- what a record depends on -----------------------------------------------------------------------


# -- the density --------------------------------------------------------------------------------------


def test_windows_that_overlap_are_worth_fewer_independent_values():
    """The correlations of periodograms, and of their frequencies, are those of the window with itself (Welch 1967)."""
    w = 1 - np.cos(2 * np.pi * np.arange(1000) / 1000)
    neighbours = (w[500:] @ w[:500] / (w @ w)) ** 2
    frequencies = sum(abs(np.fft.fft(w**2)[1:3] / (w @ w)) ** 2)
    three_segments = 3 / (1 + 2 * (2 / 3) * neighbours)
    averages = experiment.welch(np.zeros((2000, 2)), 1.0, 1000)[2]
    assert averages == pytest.approx(2 * three_segments / (1 + 2 * frequencies), rel=1e-5)
