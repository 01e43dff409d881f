"""Run many measurement records in many formats, on any executor, with progress and resumption."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.search import Outcome, least_from_which_on
from gpbnb.filters.array_forms import AnyForm
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel, real_numbers
from gpbnb.filters.named import form_named, whole_number
from gpbnb.filters.nonlinear import NO_GUARANTEE, AnyModel, NonlinearModel
from gpbnb.filters.nonlinear_run import simulated
from gpbnb.sweeps import Column, Sweep
from gpbnb.wordlength.precision import survey_formats
from gpbnb.wordlength.requirement import Basis, checked_tolerance

MOST_RECORDS = 1_000_000
"""Largest number of records to simulate."""


class RecordCell(NamedTuple):
    """One record of a survey; a digest of everything that the result depends on identifies the survey."""

    question: str
    record: int


class RecordSurvey(NamedTuple):
    """Results for each record in each format.

    Parameters
    ----------
    formats : the formats of the survey.
    ratios : (records, formats), largest error or bound / tolerance; infinite if a run stopped, a variance was no
        longer positive, or no bound exists.
    """

    formats: tuple[FloatFormat, ...]
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

    def enough(self) -> tuple[FloatFormat, ...]:
        """For each base, rounding and range, the format with the fewest digits in which all records meet the tolerance.

        A format counts only if the formats with more digits in the survey also meet the tolerance.
        """
        met = {fmt: bool((self.ratios[:, i] <= 1).all()) for i, fmt in enumerate(self.formats)}
        found = []
        kinds = {fmt: replace(fmt, precision=1, given_largest=None) for fmt in self.formats}
        for kind in dict.fromkeys(kinds.values()):
            alike = {fmt.precision: fmt for fmt in self.formats if kinds[fmt] == kind}
            least = least_from_which_on({precision: met[fmt] for precision, fmt in alike.items()})
            found += [] if least is None else [alike[least]]
        return tuple(found)


def survey_records(
    model: AnyModel,
    records: Any,
    tolerance: float | Sequence[float],
    formats: Sequence[FloatFormat],
    form: AnyForm | str = Form.INNOVATION,
    basis: Basis = "emulation",
    *,
    steps: int | None = None,
    executor: Executor | None = None,
    directory: Path | str | None = None,
    chunk: int = 1,
    progress: bool = False,
) -> RecordSurvey:
    """Run a filter on many measurement records in many formats, as :func:`gpbnb.wordlength.precision.survey` does.

    Parameters
    ----------
    records : (records, steps, m), or a list of records (steps, m) of any lengths, with NaN where a measurement is
        missing. A whole number requests that many simulated records of `steps` steps each, with the seeds 0, 1, …;
        at most :data:`MOST_RECORDS`.
    tolerance, form, basis : as for :func:`gpbnb.wordlength.precision.required_precision`; basis "emulation" or "bound".
    formats : formats of any base, rounding and range; for a linear model, with compiled loops.
    executor : any executor of concurrent.futures, or Dask's ``Client.get_executor()``; by default this process.
    directory : folder for finished records. After an interruption, the same call resumes; other arguments start a new
        survey. By default nothing is saved.
    chunk : number of records sent to a worker at once.
    progress : show a progress bar that counts records.

    Raises
    ------
    ValueError : no records or formats; a format without compiled loops; or for a reason given in ``survey``.

    Examples
    --------
    >>> from gpbnb import FloatFormat, LinearModel
    >>> walk = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
    >>> found = survey_records(walk, 3, 0.01, [FloatFormat(2, 4), FloatFormat(2, 24)], steps=20)
    >>> found.shares
    (0.0, 1.0)
    >>> found
    3 records in each format
    format   within the tolerance  largest error / tolerance
    4 bits                     0%                       15.7
    24 bits                  100%                   1.13e-05
    """
    if not isinstance(model, LinearModel | NonlinearModel):
        raise TypeError(f"got a model {type(model).__name__}; needed a LinearModel or a NonlinearModel")
    if isinstance(model, NonlinearModel):
        if basis != "emulation":
            raise ValueError(f'got basis "{basis}" for {model.name}; needed "emulation": {NO_GUARANTEE}')
        if directory is not None:
            raise ValueError(
                "got directory= for a nonlinear filter; needed none: a later call cannot tell whether its functions "
                "are still the same"
            )
    form, chunk = form_named(form), whole_number("chunk", chunk)
    if not isinstance(formats, Iterable):
        raise TypeError(f"got formats {formats!r}; needed a list of FloatFormats")
    given = tuple(formats)
    if not given or len(set(given)) != len(given):
        raise ValueError(f"got {len(given)} formats, {len(set(given))} different; needed different ones, at least one")
    for fmt in given:
        if not isinstance(fmt, FloatFormat):
            raise ValueError(f"got {fmt!r}; needed a FloatFormat")
        if isinstance(model, LinearModel):
            fmt.check_compiled()
    tolerances = checked_tolerance(tolerance, model.n, "states", basis)
    if basis not in ("emulation", "bound"):
        raise ValueError(f'got basis "{basis}"; needed "emulation" or "bound"')
    data = _data(model, records, steps)
    digests = tuple(_digest(model, z, tolerances, given, form, basis) for z in data)
    cells = tuple(RecordCell(digest, number) for number, digest in enumerate(digests))
    sweep = Sweep(
        name="records",
        file=Path("records.csv"),
        columns=(Column("record"), Column("ratios")),
        key=1,
        cells=lambda: cells,
        compute=partial(_ratios, model, data, tolerances, given, form, basis),
        rows=lambda cell, found: [(str(cell.record), " ".join(f"{ratio:.6g}" for ratio, _ in found))],
        command="gpbnb.wordlength.records.survey_records(...)",
        seed=0,
        version="2",
    )
    if directory is None:
        with tempfile.TemporaryDirectory() as folder:
            found = sweep.run(Path(folder), executor, chunk=chunk, progress=progress)
    else:
        found = sweep.run(Path(directory), executor, chunk=chunk, progress=progress)
    ratios = np.array([[ratio for ratio, _ in each] for _, each in found], dtype=np.float64)
    return RecordSurvey(given, ratios, tuple(tuple(reason for _, reason in each) for _, each in found))


def _data(model: AnyModel, records: Any, steps: int | None) -> tuple[Any, ...]:
    """Return the measurements of each record."""
    if isinstance(records, (int, np.integer)):
        count = whole_number("records", records, most=MOST_RECORDS)
        if steps is None:
            raise ValueError(f"got {count} records to simulate without steps; needed steps=, how many each has")
        length = whole_number("steps", steps)
        return tuple(simulated(model, length, seed) for seed in range(count))
    if steps is not None:
        raise ValueError("got steps with records; needed steps only for records to simulate")
    if not isinstance(records, Iterable):
        raise TypeError(f"got records {records!r}; needed a list of records (steps, m), or a whole number and steps=")
    data = tuple(z if isinstance(z, np.ma.MaskedArray) else real_numbers(z) for z in records)
    if not data:
        raise ValueError("got no records; needed at least one")
    for number, z in enumerate(data):
        if z.ndim != 2 or z.shape[1] != model.m or not len(z):
            raise ValueError(f"got record {number} of shape {z.shape}; needed (steps, {model.m})")
    return data


def _ratios(
    model: AnyModel,
    data: tuple[Any, ...],
    tolerances: NDArray[np.float64],
    formats: tuple[FloatFormat, ...],
    form: AnyForm,
    basis: Basis,
    cell: RecordCell,
    directory: Path | None,
) -> list[Outcome]:
    """Return the error / tolerance of one record in each format, and why it is infinite."""
    return survey_formats(model, data[cell.record], tolerances.tolist(), formats, form, basis)


def _digest(
    model: AnyModel,
    z: Any,
    tolerances: NDArray[np.float64],
    formats: tuple[FloatFormat, ...],
    form: AnyForm,
    basis: Basis,
) -> str:
    """Return a name for everything that a result depends on."""
    if isinstance(model, NonlinearModel):
        model = model.noise  # its functions stay the same within one call, and only there
    letters = ("Phi", "H", "Q", "R", "x0", "P0", "B", "u", "b", "d")
    matrices = [None if each is None else each.tolist() for each in (getattr(model, letter) for letter in letters)]
    measured = z.filled(np.nan) if isinstance(z, np.ma.MaskedArray) else z
    parts = (matrices, np.asarray(measured).tolist(), tolerances.tolist(), formats, repr(form), basis)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:20]
