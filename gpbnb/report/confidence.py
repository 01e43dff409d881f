"""Limits of a probability from counted trials, and of a quantile from a sample."""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import NDArray

CONFIDENCE = 0.95


def interval(within: int, records: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    r"""Return limits of a probability if `within` of `records` trials were successes; Clopper and Pearson 1934.

    Each limit is one-sided. With n successes in n trials, the lower limit is :math:`(1-c)^{1/n}` for a confidence c.

    Examples
    --------
    >>> [round(each, 4) for each in interval(100, 100)]
    [0.9705, 1.0]
    """
    if not 0 <= within <= records or records < 1 or not 0 < confidence < 1:
        raise ValueError(
            f"got {within} of {records} records and a confidence of {confidence}; needed at least one record, and a "
            "confidence between 0 and 1"
        )
    low = float(scipy.stats.beta.ppf(1 - confidence, within, records - within + 1)) if within else 0.0
    high = float(scipy.stats.beta.ppf(confidence, within + 1, records - within)) if within < records else 1.0
    return low, high


def records_needed(probability: float, confidence: float = CONFIDENCE) -> int:
    r"""Return the number of records that must all succeed to show `probability`: :math:`\ln(1-c)/\ln p`, rounded up.

    Examples
    --------
    >>> records_needed(0.99)
    299
    """
    if not 0 < probability < 1 or not 0 < confidence < 1:
        raise ValueError(f"got {probability} and {confidence}; needed both between 0 and 1")
    return math.ceil(math.log(1 - confidence) / math.log(probability))


def quantile_limit(errors: NDArray[np.float64], probability: float = 0.99, confidence: float = CONFIDENCE) -> float:
    """Return an upper limit of a quantile for errors with normally distributed logarithms, by Owen 1968.

    The limit is infinite with fewer than two records, or if an error is infinite.
    """
    if not (errors > 0).all():
        raise ValueError("got an error that is not positive; needed errors above 0, whose logarithms exist")
    n = len(errors)
    if n < 2 or not np.isfinite(errors).all():
        return math.inf
    logs = np.log(errors)
    factor = scipy.stats.nct.ppf(confidence, n - 1, scipy.stats.norm.ppf(probability) * math.sqrt(n)) / math.sqrt(n)
    return float(np.exp(logs.mean() + factor * logs.std(ddof=1)))
