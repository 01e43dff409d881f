r"""Causal 1/f noise: reproducible, with a stated density.

White noise passes through the fractional difference of order one half, whose response is
:math:`h_k = \binom{2k}{k}/4^k` (Kasdin 1995). As an integral over decays,

.. math:: h_k = \frac1\pi\int_{-\infty}^{\infty} \frac{(1+e^y)^{-k}}{2\cosh(y/2)}\,dy,

the response is a sum of some hundred exponentials. The trapezoidal rule gives them and converges here like
:math:`2\sqrt2\,e^{-\pi^2/\text{step}}`. Each exponential is a filter with a memory of one number.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.compiling import compiled

ACCURACY = 1e-6
"""Relative error of the response h_k for k up to `LONGEST`."""

LONGEST = 10**10
"""Number of samples up to which the response is accurate; at one sample every 10 s, three thousand years."""


def exponentials(accuracy: float = ACCURACY, longest: int = LONGEST) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    r"""Return poles p and weights w such that :math:`h_k = \sum_j w_j p_j^k`, for 1 ≤ k < `longest`."""
    # A third of the error each: the step, the largest y, and joining the slowest decays into one that never ends.
    share = accuracy / 3
    step = math.pi**2 / math.log(2 * math.sqrt(2) / share)
    last = -math.log(share) / 1.5
    first = math.log(share / longest)
    y = np.arange(first, last + step, step)
    weights = step / (2 * math.pi * np.cosh(y / 2))
    weights[0] += step / math.pi * math.exp(first / 2) / (math.exp(step / 2) - 1)
    return 1 / (1 + np.exp(y)), weights


@compiled
def _filter(poles, weights, white, out):  # type: ignore[no-untyped-def]
    out[:] = white
    for c in range(white.shape[1]):
        for j in range(0, len(poles), 4):  # four at a time, because each waits for its previous state
            p0, p1, p2, p3 = poles[j], poles[j + 1], poles[j + 2], poles[j + 3]
            w0, w1, w2, w3 = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
            s0 = s1 = s2 = s3 = 0.0
            for i in range(len(white)):
                x = white[i, c]
                out[i, c] = (((out[i, c] + w0 * s0) + w1 * s1) + w2 * s2) + w3 * s3
                s0, s1, s2, s3 = p0 * (s0 + x), p1 * (s1 + x), p2 * (s2 + x), p3 * (s3 + x)


def record(level: float, samples: int, channels: int, rng: np.random.Generator) -> NDArray[np.float64]:
    r"""Generate independent records of 1/f noise (samples, channels); each starts at rest.

    The one-sided density of samples taken Δt apart is :math:`\pi A\,\Delta t/\sin(\pi f\Delta t)`, and A/f at low
    frequencies, whatever Δt. A channel's noise does not depend on the number of channels.
    """
    white = np.stack([source.standard_normal(samples) for source in rng.spawn(channels)], axis=1)
    if level == 0:
        return 0 * white
    poles, weights = (np.pad(each, (0, -len(each) % 4)) for each in exponentials())
    white *= math.sqrt(math.pi * level)
    out = np.empty_like(white)
    _filter(poles, weights, white, out)
    return out
