"""Estimate how likely a year stays within a tolerance: shares of records, confidence, and the precision needed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.sweeps import Table

CONFIDENCE = 0.95


class Share(NamedTuple):
    """Largest errors of a year in one format, over many records; in mas and mas/yr.

    `low` and `high` limit the probability that a record stays within the tolerance. `quantile_limit` is an upper limit
    of the 99 % quantile if the logarithms of the errors are normally distributed. Each limit is one-sided and has a
    confidence of 95 %.
    """

    setting: str
    states: str
    form: str
    fmt: FloatFormat
    errors: NDArray[np.float64]
    within: int
    low: float
    high: float
    quantile_limit: float

    @property
    def records(self) -> int:
        """Number of records."""
        return len(self.errors)

    def quantile(self, probability: float) -> float:
        """Return a quantile of the observed errors."""
        return float(np.quantile(self.errors, probability))


def interval(within: int, records: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    r"""Return limits of a probability if `within` of `records` trials were successes; Clopper and Pearson 1934.

    Each limit is one-sided. With n successes in n trials, the lower limit is :math:`(1-c)^{1/n}` for a confidence c.

    Raises
    ------
    ValueError : counts or confidence out of range.

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

    Raises
    ------
    ValueError : an error is zero or negative.
    """
    if not (errors > 0).all():
        raise ValueError("got an error that is not positive; needed errors above 0, whose logarithms exist")
    n = len(errors)
    if n < 2 or not np.isfinite(errors).all():
        return math.inf
    logs = np.log(errors)
    factor = scipy.stats.nct.ppf(confidence, n - 1, scipy.stats.norm.ppf(probability) * math.sqrt(n)) / math.sqrt(n)
    return float(np.exp(logs.mean() + factor * logs.std(ddof=1)))


def shares(table: Table, tolerance: float = 1.0) -> tuple[Share, ...]:
    """Return, for each format, the share of records that stay within the tolerance throughout the year.

    Parameters
    ----------
    table : table with the columns of ``COLUMNS``, and possibly a column `setting` before them.
    tolerance : tolerance for the drift angles in mas and their rates in mas/yr, at every step.
    """
    groups: dict[tuple[str, ...], list[float]] = {}
    for row in table.records():
        key = (row.get("setting", "simple"), row["states"], row["form"], row["base"], row["precision"], row["rounding"])
        groups.setdefault(key, []).append(max(float(row["drift"]), float(row["rate"])))
    found = []
    for (setting, states, form, base, precision, rounding), group in groups.items():
        errors = np.array(group)
        within = int((errors <= tolerance).sum())
        fmt = FloatFormat(int(base), int(precision), Rounding(rounding))
        limits = interval(within, len(errors))
        found.append(Share(setting, states, form, fmt, errors, within, *limits, quantile_limit(errors)))
    return tuple(sorted(found, key=_order))


def _order(share: Share) -> tuple[object, ...]:
    fmt = share.fmt
    return share.setting, share.states, fmt.base, fmt.rounding.value, share.form, fmt.precision


class Needed(NamedTuple):
    """The smallest precisions of one base that meet a tolerance with a probability; None if no format does.

    For `observed`, the share of records within the tolerance is at least this probability. For `lognormal`, the upper
    limit of the quantile is within the tolerance. For `shown`, the lower limit of the probability, without an
    assumption about the distribution, is at least this probability; higher precisions may have fewer records but must
    not refute it.
    """

    observed: int | None
    lognormal: int | None
    shown: int | None


def needed(found: Sequence[Share], probability: float = 0.99, tolerance: float = 1.0) -> Needed:
    """Find the smallest precision from which on every format that was run meets the tolerance.

    Parameters
    ----------
    found : shares for formats of one base, rounding, form and choice of states.

    Raises
    ------
    ValueError : no formats, or formats of several kinds.
    """
    kinds = {(each.setting, each.states, each.form, each.fmt.base, each.fmt.rounding) for each in found}
    if len(kinds) != 1:
        raise ValueError(f"got formats of {len(kinds)} kinds; needed formats of one kind")

    def first(meets: Sequence[bool]) -> int | None:
        enough = None
        for share, met in sorted(zip(found, meets, strict=True), key=lambda pair: -pair[0].fmt.precision):
            if not met:
                break
            enough = share.fmt.precision
        return enough

    by_precision = sorted(found, key=lambda each: each.fmt.precision)
    refuted = [each.fmt.precision for each in by_precision if each.within < probability * each.records]
    shown = (each.fmt.precision for each in by_precision if each.low >= probability)
    return Needed(
        first([each.within >= probability * each.records for each in found]),
        first([each.quantile_limit <= tolerance for each in found]),
        next((each for each in shown if each > max(refuted, default=0)), None),
    )
