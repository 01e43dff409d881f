"""Run years of many records in many formats in lockstep, with measurements and reference computed only once."""

from __future__ import annotations

import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.records import update_largest
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.filters.simulation import BLOCK

#: The reference, the innovation form in float64.
REFERENCE = FloatFormat(2, 53)

DECIMALS = 4
"""Number of decimals in the entries of measurement matrices in base 10."""

ANGLES = 4
"""Number of first states that are compared, two drift angles and two rates."""


class RecordSource(Protocol):
    """Source of the measurements of many records."""

    @property
    def start(self) -> tuple[float, ...]:
        """Return the truth at step 0."""

    def model(self, base: int) -> LinearModel:
        """Return the filter's model as stored in a base."""

    def matrices(self, block: int, base: int) -> NDArray[np.float64] | None:
        """Return measurement matrices (4096, m, n), in base 10 with four decimals, or None if the model has them."""

    def measurements(
        self, record: int, block: int, truth: NDArray[np.float64], H: NDArray[np.float64] | None, steps: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return measurements of a block, (steps, m), and the truth after them; H is that of base 2."""


class Lockstep:
    """Filters in several formats and one reference, for the same records.

    Parameters
    ----------
    name : identifies the saved state.
    source : source of model and measurements.
    formats : formats, all of one base.
    records : numbers of the records.
    steps : number of steps in the whole run.
    """

    def __init__(
        self,
        name: str,
        source: RecordSource,
        formats: Sequence[FloatFormat],
        form: Form,
        records: Sequence[int],
        steps: int,
    ) -> None:
        bases = {fmt.base for fmt in formats}
        if len(bases) != 1 or steps < 1:
            raise ValueError(f"got the bases {sorted(bases)} and {steps} steps; needed one base and at least one step")
        self.name, self.source, self.records, self.steps, self.block = name, source, tuple(records), steps, 0
        (self.base,) = bases
        model, count = source.model(self.base), len(self.records)
        self.truth = np.tile(np.array(source.start), (count, 1))
        self.reference = Run(model, REFERENCE, Form.INNOVATION, (), records=count)
        self.runs = [Run(model, fmt, form, (), records=count) for fmt in formats]
        self.largest = np.zeros((len(formats), ANGLES, count))
        self.end = np.zeros((len(formats), ANGLES, count))
        self.seconds = np.zeros(len(formats) + 2)  # of the measurements, the reference and each format

    @property
    def finished(self) -> bool:
        """Whether all steps are done."""
        return self.block * BLOCK >= self.steps

    def advance(self) -> None:
        """Take one block of measurements."""
        start = time.process_time()
        length = min(BLOCK, self.steps - self.block * BLOCK)
        H = self.source.matrices(self.block, 2)
        z = np.empty((length, self.reference.model.m, len(self.records)))
        for i, record in enumerate(self.records):
            z[:, :, i], self.truth[i] = self.source.measurements(record, self.block, self.truth[i], H, length)
        if H is not None and self.base != 2:
            H = self.source.matrices(self.block, self.base)
        start = self._timed(0, start)
        true = self._carry(self.reference, H, z)
        start = self._timed(1, start)
        for i, run in enumerate(self.runs):
            computed = self._carry(run, H, z)
            update_largest(computed, true, self.largest[i])
            self.end[i] = computed[-1] - true[-1]
            start = self._timed(i + 2, start)
        self.block += 1

    @staticmethod
    def _carry(run: Run, H: NDArray[np.float64] | None, z: NDArray[np.float64]) -> NDArray[np.float64]:
        if H is not None:
            run.use_measurement_matrices(H, DECIMALS)
        return run.carry(z, ANGLES)

    def _timed(self, place: int, start: float) -> float:
        now = time.process_time()
        self.seconds[place] += now - start
        return now

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {"truth": self.truth, "largest": self.largest, "end": self.end, "seconds": self.seconds}
        for i, run in enumerate((self.reference, *self.runs)):
            arrays |= {f"{name}_{i}": getattr(run, name) for name in ("x", "P", "notes")}
        return arrays

    def save(self, file: Path) -> None:
        """Save the state; a file that exists is replaced as a whole."""
        draft = file.with_suffix(".draft.npz")
        given = {"cell": np.array(self.name), "block": np.array(self.block), "steps": np.array(self.steps)}
        np.savez(draft, allow_pickle=False, **self._arrays(), **given)
        draft.replace(file)

    def restore(self, file: Path) -> None:
        """Continue from a saved state, if there is one of the same name and length."""
        if not file.exists():
            return
        with np.load(file) as saved:
            if str(saved["cell"]) == self.name and int(saved["steps"]) == self.steps:
                for name, array in self._arrays().items():
                    array[...] = saved[name]
                self.block = int(saved["block"])

    def result(self) -> dict[str, Any]:
        """Return the largest errors of the year and errors at its end, by format, state and record."""
        return {
            "largest": self.largest.tolist(),
            "end": self.end.tolist(),
            "indefinite": [run.indefinite or 0 for run in self.runs],
            "seconds": self.seconds.tolist(),
        }


def run_lockstep(lockstep: Lockstep, directory: Path | None, blocks_per_save: int = 16) -> dict[str, Any]:
    """Run to the end, save progress in a directory if one is given, and return the result."""
    total = -(-lockstep.steps // BLOCK)
    file = None if directory is None else directory / f"{zlib.crc32(lockstep.name.encode()):08x}.npz"
    if file is not None:
        lockstep.restore(file)
    left = range(lockstep.block, total)
    for number in tqdm(left, desc=lockstep.name, initial=lockstep.block, total=total, disable=file is None):
        lockstep.advance()
        if file is not None and number % blocks_per_save == blocks_per_save - 1:
            lockstep.save(file)
    if file is not None:
        file.unlink(missing_ok=True)
    return lockstep.result()


def error_rows(heads: Sequence[tuple[str, ...]], first: int, result: dict[str, Any]) -> list[tuple[str, ...]]:
    """List, for each format and record, the largest errors of the year and the errors at its end.

    Parameters
    ----------
    heads : the first columns, for each format.
    first : number of the first record.
    """
    lines = []
    for head, largest, end in zip(heads, np.array(result["largest"]), np.abs(np.array(result["end"])), strict=True):
        numbers = np.stack([largest[:2].max(0), largest[2:].max(0), end[:2].max(0), end[2:].max(0)], axis=1)
        numbers = np.nan_to_num(numbers, nan=np.inf)  # the filter stopped
        lines += [
            (*head, str(first + i), *(f"{value:.6g}" for value in line)) for i, line in enumerate(numbers.tolist())
        ]
    return lines
