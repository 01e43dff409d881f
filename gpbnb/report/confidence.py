"""Limits of a probability from counted trials."""

from __future__ import annotations

import math

import scipy

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
