"""Estimate how likely a year stays within a tolerance: shares of records, confidence, and the precision needed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.report.confidence import interval, quantile_limit
from gpbnb.sweeps import Table


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
