"""Run many measurement records in many formats."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import whole_number
from gpbnb.filters.system import LinearSystem
from gpbnb.wordlength.answer import Basis
from gpbnb.wordlength.asked import MOST_STEPS, Asked, admitted, checked_format, is_filter
from gpbnb.wordlength.judges import judge_for
from gpbnb.wordlength.models import ModelSource

MOST_RECORDS = 1_000_000
"""Largest number of records to simulate."""


class RecordSurvey(NamedTuple):
    """Results for each record in each format.

    Parameters
    ----------
    formats : the formats of the survey.
    ratios : (records, formats), largest error or bound / tolerance; infinite if a run stopped, a variance was no
        longer positive, or no bound exists.
    """

    formats: tuple[FloatFormat | FixedFormat, ...]
    ratios: NDArray[np.float64]
    #: For each record and format, why the ratio is infinite; otherwise an empty text.
    reasons: tuple[tuple[str, ...], ...]

    def __repr__(self) -> str:
        """Return a table with a row for each format."""
        rows = [
            (format_text(fmt), f"{share:.0%}", f"{worst:.3g}")
            for fmt, share, worst in zip(self.formats, self.shares, self.ratios.max(axis=0).tolist(), strict=True)
        ]
        header = ("format", "within the tolerance", "largest error / tolerance")
        width = max(len(name) for name, _, _ in (header, *rows))
        lines = [
            f"{name:<{width}}  {share:>{len(header[1])}}  {worst:>{len(header[2])}}" for name, share, worst in rows
        ]
        count = f"{len(self.ratios)} record{'s' * (len(self.ratios) != 1)}"
        return "\n".join([f"{count} in each format", f"{header[0]:<{width}}  {header[1]}  {header[2]}", *lines])

    @property
    def shares(self) -> tuple[float, ...]:
        """For each format, the share of records that stay within the tolerance."""
        return tuple(float(share) for share in (self.ratios <= 1).mean(axis=0))


def survey_records(
    model: ModelSource,
    records: Any,
    tolerance: Any,
    formats: Sequence[FloatFormat | FixedFormat | str],
    *,
    form: Form | str | None = None,
    basis: Basis = "emulation",
    steps: int | None = None,
    progress: bool = False,
) -> RecordSurvey:
    """Run a model on many records of measurements or inputs in many formats.

    Parameters
    ----------
    model, tolerance, form, basis : as for :func:`gpbnb.required_precision`; basis "emulation" or "bound".
    records : (records, steps, m), or a list of records (steps, m) of any lengths, with NaN where a measurement is
        missing. A whole number requests that many simulated records of a Kalman filter with `steps` steps each and the
        seeds 0, 1, …; at most :data:`MOST_RECORDS`, and 100 million steps in all.
    formats : formats of any base, rounding and range, or their names; for a linear filter, with compiled loops.
    progress : show a progress bar that counts records.

    Raises
    ------
    ValueError : no records or formats; a format without compiled loops; or for a reason given in
        :func:`gpbnb.required_precision`.

    Examples
    --------
    >>> from gpbnb import FloatFormat, LinearModel
    >>> walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
    >>> found = survey_records(walk, 3, 0.01, [FloatFormat(2, 4), "float32"], steps=20)
    >>> found.shares
    (0.0, 1.0)
    >>> found
    3 records in each format
    format    within the tolerance  largest error / tolerance
    4 bits                      0%                       15.7
    BINARY32                  100%                   7.39e-06
    """
    if basis in ("guarantee", "probable"):
        raise ValueError(f'got basis "{basis}"; needed "emulation" or "bound": the others do not depend on a record')
    if isinstance(formats, str) or not isinstance(formats, Iterable):
        raise TypeError(f"got formats {formats!r}; needed a list of formats or names")
    chosen = tuple(map(checked_format, formats))
    if not chosen or len(set(chosen)) != len(chosen):
        count, different = len(chosen), len(set(chosen))
        raise ValueError(f"got {count} formats, {different} different; needed different ones, at least one")
    given, most, found = admitted(model), max(fmt.precision for fmt in chosen), []
    asked = [
        Asked.of(given, z, form=form, seed=seed, tolerance=tolerance, basis=basis)
        for z, seed in _records(given, records, steps)
    ]
    for fmt in chosen:
        asked[0].check_sizes(fmt)
        if isinstance(given, LinearModel | LinearSystem):
            fmt.check_compiled()
    for each in tqdm(asked, "records", unit="record", disable=not progress):
        judge = judge_for(each, chosen[0].base, most)
        found.append([judge.proof(fmt) for fmt in chosen])
    ratios = np.array([[each.ratio for each in row] for row in found])
    return RecordSurvey(chosen, ratios, tuple(tuple(each.why for each in row) for row in found))


def _records(model: Any, records: Any, steps: int | None) -> list[tuple[Any, int]]:
    """Return each record, or its number of steps, and its seed."""
    if isinstance(records, (int, np.integer)):
        count = whole_number("records", records, most=MOST_RECORDS)
        if not is_filter(model):
            raise ValueError(f"got {count} records to simulate; needed a list: only a Kalman filter simulates them")
        if steps is None:
            raise ValueError(f"got {count} records to simulate without steps; needed steps=, how many each has")
        return [(whole_number("steps", steps, most=MOST_STEPS // count), seed) for seed in range(count)]
    if steps is not None:
        raise ValueError("got steps with records; needed steps only for records to simulate")
    if not isinstance(records, Iterable) or isinstance(records, str):
        raise TypeError(f"got records {records!r}; needed a list of records (steps, m), or a whole number and steps=")
    if not (data := [(z, 0) for z in records]):
        raise ValueError("got no records; needed at least one")
    return data
