"""The classes of errors, the error that each of equal sources may have, and how much averaging reduces an error."""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import Enum

GOAL = 1.0
"""The total that Figure II-2 assumes and the design goal in ch. I; milliarcseconds per year."""


class Kind(Enum):
    """How an error behaves statistically: the first classification in ch. II."""

    DETERMINISTIC = "deterministic"
    CONSTANT = "random constant"
    PROCESS = "random process"


class ErrorForm(Enum):
    """How an error enters a reading: the second classification in ch. II."""

    BIAS = "bias"
    DRIFT = "drift"
    SCALE_FACTOR = "scale factor"
    NOISE = "noise"


def root_sum_square(errors: Iterable[float]) -> float:
    """Return the root of the sum of squares, without overflow; hung1982, ch. II."""
    return math.hypot(*errors)


def equal_error(total: float, sources: float) -> float:
    r"""Return the size of each of N equal, independent errors, :math:`e = \text{total}/\sqrt N`: Figure II-2.

    Parameters
    ----------
    total : root-sum-square of all errors, in any unit; 0 or above.
    sources : N, above 0.
    """
    if not (total >= 0 and sources > 0):
        raise ValueError(f"got a total of {total} over {sources} sources; needed total >= 0 and sources > 0")
    return total / math.sqrt(sources)


def equal_sources(total: float, each: float) -> float:
    """Return the number, not rounded, of equal independent errors of size `each` whose root-sum-square is `total`."""
    if not (total >= 0 and each > 0):
        raise ValueError(f"got a total of {total} from errors of {each}; needed total >= 0 and each > 0")
    return (total / each) ** 2


# -- what averaging leaves ------------------------------------------------------------------------


def cycles_factor(cycles: float) -> float:
    r"""Return the largest fraction of a cyclic error that remains in a mean over `cycles`: :math:`|\sin\pi c|/(\pi c)`.

    The error is a constant that rolls with the spacecraft, or it repeats with the orbit. A mean over whole cycles
    removes it.
    """
    if not cycles >= 0:
        raise ValueError(f"got {cycles} cycles; needed 0 or more")
    if cycles == 0:
        return 1.0
    # the remainder is exact in float64; sin(pi c) of a large c is not accurate
    return abs(math.sin(math.pi * math.remainder(cycles, 1.0))) / (math.pi * cycles)


def white_factor(readings: float) -> float:
    r"""Return the fraction of noise that remains in a mean of N independent readings: :math:`1/\sqrt N`."""
    if not readings >= 1:
        raise ValueError(f"got {readings} readings; needed 1 or more")
    return 1 / math.sqrt(readings)


def correlated_factor(time: float, correlation_time: float) -> float:
    r"""Return the fraction of noise with the correlation :math:`\mathrm e^{-u/\tau}` that remains in a mean over T.

    .. math:: \sqrt{2(h - 1 + \mathrm e^{-h})}\,/\,h, \qquad h = T/\tau

    The fraction refers to the standard deviation. For small h the function sums a series, because the closed
    form cancels.

    Parameters
    ----------
    time, correlation_time : T and τ, in the same unit; T at least 0, τ above 0.
    """
    if not (time >= 0 and correlation_time > 0):
        raise ValueError(f"got T = {time} and tau = {correlation_time}; needed T >= 0 and tau > 0")
    h = time / correlation_time
    if h < 0.5:
        # 2 sum_k (-h)^k / (k + 2)!; thirteen terms leave less than 1e-16 at h = 1/2
        return math.sqrt(2 * math.fsum((-h) ** k / math.factorial(k + 2) for k in range(13)))
    return math.sqrt(2 * (h + math.expm1(-h))) / h
