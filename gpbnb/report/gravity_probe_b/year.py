"""A year of Gravity Probe B, 3,153,600 steps, in many formats and forms.

In one base, all formats use the same numbers. The model is stored once, in 14 bits or 4 decimal digits, and
measurements are whole milliarcseconds. So one reference serves all formats, and errors come only from the arithmetic.

The results are stored next to this file, in ``year.csv`` and ``bounds.csv``, with their provenance in ``year.json``;
:func:`load` and :func:`bounds` read them.
"""

from __future__ import annotations

import hashlib
import math
import os
import platform
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb import sweeps
from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.contraction import Contraction
from gpbnb.filters.emulation import History, compare_runs, emulate, relative
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, log_spaced, reference
from gpbnb.filters.simulation import BLOCK, Simulation
from gpbnb.report.gravity_probe_b.model import SEED, TRUTH, YEAR, gravity_probe_b, gravity_probe_b_year
from gpbnb.sweeps import Column, Sweep

#: Format in which the model is stored, by base; every format of this base in :data:`CASES` contains it.
STORED = {2: FloatFormat(2, 14), 10: FloatFormat(10, 4)}

#: The models, with roll periods of 600 s as in the reports, 77.5 s as flown, and 600 s without process noise.
MODELS = ("roll 600 s", "roll 77.5 s", "no process noise")


class YearCase(NamedTuple):
    """One run of the year; a precision of 0 stands for the reference in double-double."""

    model: str
    base: int
    precision: int
    rounding: Rounding
    form: Form

    @property
    def fmt(self) -> FloatFormat | MaybeNone:
        """The format of the run; None for double-double."""
        return FloatFormat(self.base, self.precision, self.rounding) if self.precision else None

    @property
    def reference(self) -> YearCase:
        """The case that serves as the reference for this one."""
        return YearCase(self.model, self.base, 0, Rounding.NEAREST, Form.INNOVATION)

    @property
    def name(self) -> str:
        """Name of the files for this case."""
        words = f"{self.model} {self.base} {self.precision} {self.rounding.value} {self.form.name.lower()}"
        return words.replace(" ", "-").replace(".", "_")


def _cases() -> tuple[YearCase, ...]:
    usual, flown, noiseless = MODELS
    nearest, chop = Rounding.documented()
    others = (Form.INNOVATION, Form.JOSEPH, Form.UD)
    cases = [YearCase(usual, 2, t, nearest, Form.HUNG) for t in (24, 18, 32, 14, 20, 53)]
    cases += [YearCase(usual, 2, t, chop, Form.HUNG) for t in (24, 18, 32)]
    cases += [YearCase(usual, 2, 24, nearest, form) for form in others]
    cases += [YearCase(usual, 10, 8, nearest, Form.HUNG), YearCase(usual, 10, 6, nearest, Form.HUNG)]
    cases += [YearCase(flown, 2, 24, nearest, Form.HUNG), YearCase(noiseless, 2, 24, nearest, Form.HUNG)]
    cases += [YearCase(usual, 2, t, nearest, Form.HUNG) for t in (22, 28)]
    cases += [YearCase(usual, 2, 18, nearest, form) for form in others]
    cases += [YearCase(usual, 2, 24, nearest, Form.HUNG_SECOND_GAIN), YearCase(usual, 10, 8, chop, Form.HUNG)]
    cases += [YearCase(usual, 10, 8, nearest, Form.UD), YearCase(usual, 10, 10, nearest, Form.HUNG)]
    cases += [YearCase(usual, 2, 24, chop, form) for form in others]
    cases += [YearCase(usual, 10, 8, nearest, form) for form in others[:2]]
    cases += [YearCase(usual, 10, 4, nearest, Form.HUNG), YearCase(usual, 10, 16, nearest, Form.HUNG)]
    cases += [YearCase(usual, 2, t, nearest, Form.HUNG) for t in (16, 26, 40)]
    cases += [YearCase(usual, 2, t, chop, Form.HUNG) for t in (14, 20, 28, 53)]
    cases += [YearCase(usual, 2, 53, nearest, form) for form in others]
    # Neighbours of the smallest precisions that meet a milliarcsecond a year, or the report's criterion.
    cases += [
        YearCase(usual, 10, 9, nearest, Form.HUNG),
        *(YearCase(usual, 2, t, nearest, Form.HUNG) for t in (31, 33, 19)),
    ]
    return tuple(cases)


#: All runs, the most informative first.
CASES = _cases()

#: Runs with their own contraction bound, the references of the first model, from which the other bounds follow.
BOUNDED_CASES = frozenset(YearCase(MODELS[0], base, 0, Rounding.NEAREST, Form.INNOVATION) for base in STORED)


@cache
def model(name: str, base: int) -> LinearModel:
    """Return one of :data:`MODELS` as stored in a base."""
    roll = "77.5" if name == MODELS[1] else "600"
    return gravity_probe_b(roll, process_noise=name != MODELS[2]).rounded(STORED[base])


@cache
def simulation(name: str) -> Simulation:
    """Return the simulated measurements, the same for both bases; the truth follows the model of base 2."""
    return gravity_probe_b_year(model(name, 2))


def checkpoint_steps(steps: int = YEAR) -> tuple[int, ...]:
    """Return the steps whose results are saved, three per decade."""
    return log_spaced(steps, 3)


# -- resumable runs ----------------------------------------------------------------------------------

_BLOCKS_PER_SAVE = 64  # blocks
_FINGERPRINT_STEPS = 200  # steps that show whether the code's results are unchanged


class ResumableRun:
    """A run of one case, saved in a file, with its contraction bound if ``BOUNDED_CASES`` contains the case."""

    def __init__(self, case: YearCase, directory: Path, steps: int) -> None:
        self.case, self.steps, self.seconds = case, steps, 0.0
        self.run = _run(case, steps)
        self.truth: NDArray[np.float64] = np.array(TRUTH)
        self.file = directory / f"{case.name}.npz"
        self.fingerprint = fingerprint(case, steps)
        if self.file.exists():
            with np.load(self.file) as saved:
                if str(saved["fingerprint"]) == self.fingerprint:
                    for name, array in self._arrays().items():
                        array[...] = saved[name]
                    if self.run.bounded:
                        self.run.bound = Contraction(*(saved[f"bound_{name}"][()] for name in Contraction._fields))
                    self.truth, self.seconds = saved["truth"], float(saved["seconds"])

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {name: getattr(self.run, name) for name in ("x", "P", "X", "G", "C", "notes")}
        if self.run.bounded:
            arrays |= dict(zip(("states", "gains", "covariances"), self.run.bounds, strict=True))
        return arrays

    @property
    def finished(self) -> bool:
        """Whether all steps are done, or the run has stopped."""
        return self.run.steps >= self.steps or self.run.stopped is not None

    def advance(self, blocks: int, bar: Any = None) -> None:
        """Take at most `blocks` blocks of measurements, and save the run."""
        source = simulation(self.case.model)
        for _ in range(blocks):
            if self.finished:
                break
            before, start = self.run.steps, time.process_time()
            z, self.truth = source.block(before // BLOCK, self.truth, self.steps - before)
            self.run.take(z)
            self.seconds += time.process_time() - start
            if bar is not None:
                bar.update(self.run.steps - before)
        self.save()

    def save(self) -> None:
        """Save the run, either completely or not at all."""
        draft = self.file.with_suffix(f".{os.getpid()}.npz")
        arrays = self._arrays()
        if self.run.bounded:
            arrays |= {f"bound_{name}": np.asarray(each) for name, each in self.run.bound._asdict().items()}
        arrays |= {"truth": self.truth, "seconds": np.array(self.seconds), "fingerprint": np.array(self.fingerprint)}
        np.savez(draft, allow_pickle=False, **arrays)
        os.replace(draft, self.file)


def _run(case: YearCase, steps: int) -> Run:
    bounded = case in BOUNDED_CASES
    return Run(model(case.model, case.base), case.fmt, case.form, checkpoint_steps(steps), bounded=bounded)


@cache
def fingerprint(case: YearCase, steps: int) -> str:
    """Digest the inputs of a run and its results for the first measurements, to the last digit.

    Saved runs are discarded when the code's results change, but not when only its text changes.
    """
    given, run = model(case.model, case.base), _run(case, steps)
    digest = hashlib.sha256(
        repr((case.name, steps, checkpoint_steps(steps), TRUTH, BLOCK, case in BOUNDED_CASES)).encode()
    )
    for letter in ("Phi", "H", "Q", "R", "x0", "P0"):
        digest.update(" ".join(map(str, getattr(given, letter).flat)).encode())
    run.take(simulation(case.model).measurements(_FINGERPRINT_STEPS))
    bound = run.bound if run.bounded else ()
    for each in (run.x, run.P, run.notes, *bound):
        digest.update(np.ascontiguousarray(each).tobytes())
    return digest.hexdigest()


def run_cases(
    cases: Sequence[YearCase],
    directory: Path,
    steps: int = YEAR,
    progress: bool = True,
    each: int = _BLOCKS_PER_SAVE,
) -> None:
    """Run the cases and their references one after another, each from its saved state.

    Parameters
    ----------
    directory : folder in which runs are saved after every 64 blocks of 4096 steps.
    """
    directory.mkdir(parents=True, exist_ok=True)
    todo = list(dict.fromkeys(part for case in cases for part in (case.reference, case)))
    with tqdm(total=len(todo) * steps, desc="year", unit="step", unit_scale=True, disable=not progress) as bar:
        for case in todo:
            bar.set_postfix_str(case.name)
            if _is_finished(case, directory, steps):
                bar.update(steps)
                continue
            run = ResumableRun(case, directory, steps)
            bar.update(run.run.steps)
            while not run.finished:
                run.advance(each, bar)


def _is_finished(case: YearCase, directory: Path, steps: int) -> bool:
    file = directory / f"{case.name}.npz"
    if not file.exists():
        return False
    with np.load(file) as saved:
        done, _, _, stopped = saved["notes"]
        return str(saved["fingerprint"]) == fingerprint(case, steps) and (done >= steps or stopped > 0)


def history(case: YearCase, directory: Path, steps: int = YEAR) -> History:
    """Return the errors of a finished run."""
    return compare_runs(
        ResumableRun(case, directory, steps).run, reference_checkpoints(case.reference, directory, steps)
    )


@cache
def reference_checkpoints(case: YearCase, directory: Path, steps: int) -> Checkpoints:
    """Checkpoints of a finished run that serves others as their reference."""
    return ResumableRun(case, directory, steps).run.checkpoints()


_HERE = Path(__file__).parent
_COLUMNS = ("drift_2", "drift_3", "rate_2", "rate_3", "state", "gain", "covariance", "least_eigenvalue")

# -- what was found -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Year:
    """Errors of a year in one format and form, as stored; arrays (c,), after each of the steps.

    Parameters
    ----------
    drift, rate : (c, 2), errors of the drift angles in mas and of their rates in mas/yr.
    state : largest error of any state, in its unit.
    gain, covariance : norms (22) of their errors, relative to the true values.
    least_eigenvalue : least eigenvalue of the covariance, scaled to ones on the true diagonal.
    """

    case: YearCase
    steps: NDArray[np.int64]
    drift: NDArray[np.float64]
    rate: NDArray[np.float64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]
    least_eigenvalue: NDArray[np.float64]
    indefinite: int | None
    stopped: int | None
    seconds: float


def rows(case: YearCase, found: History) -> list[tuple[str, ...]]:
    """Return rows of ``year.csv`` with six significant digits."""
    numbers = np.column_stack(
        [found.state[:, :4], found.state_norm, found.gain_norm, found.covariance_norm, found.least_eigenvalue]
    )
    return [
        (*_name(case), str(step), *(f"{number:.6g}" for number in line))
        for step, line in zip(found.steps.tolist(), numbers.tolist(), strict=True)
    ]


@dataclass(frozen=True, eq=False)
class YearBounds:
    """The contraction bound of a run, in the same units and norms as the errors of :class:`Year`.

    The errors of a run without its own bound are at most its distance from the reference plus the reference's bound:
    :func:`gpbnb.filters.contraction.companion_bound`.
    """

    case: YearCase
    steps: NDArray[np.int64]
    drift: NDArray[np.float64]
    rate: NDArray[np.float64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]


def bound_rows(case: YearCase, directory: Path, steps: int) -> list[tuple[str, ...]]:
    """Return rows of ``bounds.csv``, if the case has bounds, with six significant digits, rounded upwards."""
    run, true = ResumableRun(case, directory, steps).run, reference_checkpoints(case, directory, steps)
    if not run.bounded:
        return []
    states, gains, covariances = (each[: len(true.steps)] for each in run.bounds)
    norms = [relative(gains, true.to_float("K")), relative(covariances, true.to_float("P"))]
    numbers = np.column_stack([states[:, :4], states.max(axis=1), *norms])
    return [
        (*_name(case), str(step), *(f"{number * (1 + 1e-5):.6g}" for number in line))
        for step, line in zip(true.steps, numbers.tolist(), strict=True)
    ]


def _name(case: YearCase) -> tuple[str, ...]:
    return case.model, str(case.base), str(case.precision), case.rounding.value, case.form.name.lower()


_KEY_COLUMNS = (
    Column("model", "text", choices=MODELS),
    Column("base", "integer", 2, 16),
    Column("precision", "integer", 0, 53),
    Column("rounding", "text", choices=tuple(rounding.value for rounding in Rounding.documented())),
    Column("form", "text", choices=tuple(form.name.lower() for form in Form)),
    Column("step", "integer", 1, YEAR),
)

#: Columns of ``year.csv``. Errors have a sign; an indefinite covariance has eigenvalues below zero.
COLUMNS = (
    *_KEY_COLUMNS,
    *(Column(name) for name in _COLUMNS[:4]),
    *(Column(name, low=0) for name in _COLUMNS[4:7]),
    Column(_COLUMNS[7]),
)

#: Columns of ``bounds.csv``, whose values are not negative.
BOUND_COLUMNS = (*_KEY_COLUMNS, *(Column(name, low=0) for name in _COLUMNS[:7]))

_COMMAND = "python -m gpbnb.report.stored recompute gravity_probe_b/year"


def write(cases: Iterable[YearCase], directory: Path, steps: int = YEAR, to: Path = _HERE) -> None:
    """Collect the finished runs in ``year.csv``, ``bounds.csv`` and ``year.json``."""
    lines: list[tuple[str, ...]] = []
    bounded: list[tuple[str, ...]] = []
    about: dict[str, Any] = {}
    references: dict[str, Any] = {}
    for case in cases:
        resumable = ResumableRun(case, directory, steps)
        if not resumable.finished:
            continue
        found = history(case, directory, steps)
        lines += rows(case, found)
        about[case.name] = {
            "indefinite": found.indefinite,
            "stopped": found.stopped,
            "seconds": round(resumable.seconds, 1),
            "fingerprint": resumable.fingerprint,
        }
        if case.reference.name not in references:
            references[case.reference.name] = _of_reference(case.reference, directory, steps)
            bounded += bound_rows(case.reference, directory, steps)
    origin = {"command": _COMMAND, "seed": str(SEED), **sweeps.machine()}
    sweeps.write(to / "year.csv", COLUMNS, lines, {**origin, "cells": f"{len(about)} of {len(CASES)}"})
    sweeps.write(to / "bounds.csv", BOUND_COLUMNS, bounded, {**origin, "cells": f"{len(references)} references"})
    made = {
        "command": _COMMAND,
        "steps": steps,
        **machine(),
        "references": references,
        "cases": about,
    }
    sweeps.write_record(to / "year.json", made)


def machine() -> dict[str, Any]:
    """Return the machine and the versions with which results are made."""
    return {
        "machine": f"{platform.system()} {platform.machine()}, python {platform.python_version()}",
        "versions": {name: version(name) for name in ("numpy", "numba", "llvmlite")},
    }


def _of_reference(case: YearCase, directory: Path, steps: int) -> dict[str, Any]:
    """Return the error of the unrounded filter at the end, and the standard deviation that it computed."""
    resumable = ResumableRun(case, directory, steps)
    true = reference_checkpoints(case, directory, steps)
    x, deviation = true.x[-1].astype(np.float64), np.sqrt(true.P[-1].diagonal().astype(np.float64))
    return {
        "seconds": round(resumable.seconds, 1),
        "fingerprint": resumable.fingerprint,
        "estimate": [float(f"{each:.9g}") for each in x],
        "estimate minus truth": [float(f"{each:.6g}") for each in x - resumable.truth],
        "standard deviation": [float(f"{each:.6g}") for each in deviation],
    }


@cache
def load(directory: Path = _HERE) -> tuple[Year, ...]:
    """Load the years that ship with the package, in the order of ``CASES``."""
    about = provenance(directory)["cases"]
    result = []
    for case, numbers in _read(directory / "year.csv", COLUMNS).items():
        result.append(
            Year(
                case,
                numbers[:, 0].astype(np.int64),
                numbers[:, 1:3],
                numbers[:, 3:5],
                numbers[:, 5],
                numbers[:, 6],
                numbers[:, 7],
                numbers[:, 8],
                about[case.name]["indefinite"],
                about[case.name]["stopped"],
                about[case.name]["seconds"],
            )
        )
    return tuple(result)


@cache
def bounds(directory: Path = _HERE) -> dict[YearCase, YearBounds]:
    """Load the contraction bounds of ``BOUNDED_CASES`` that ship with the package."""
    return {
        case: YearBounds(
            case, numbers[:, 0].astype(np.int64), numbers[:, 1:3], numbers[:, 3:5], *(numbers[:, i] for i in (5, 6, 7))
        )
        for case, numbers in _read(directory / "bounds.csv", BOUND_COLUMNS).items()
    }


def _read(file: Path, columns: tuple[Column, ...]) -> dict[YearCase, NDArray[np.float64]]:
    groups: dict[YearCase, list[tuple[str, ...]]] = {}
    for row in sweeps.read(file, columns, _COMMAND).rows:
        case = YearCase(row[0], int(row[1]), int(row[2]), Rounding(row[3]), Form[row[4].upper()])
        groups.setdefault(case, []).append(row[5:])
    return {case: np.array(group, dtype=np.float64) for case, group in groups.items()}


def provenance(directory: Path = _HERE) -> dict[str, Any]:
    """Return the provenance of the years."""
    return sweeps.read_record(directory / "year.json", _COMMAND)


# -- the years as a sweep ----------------------------------------------------------------------------

#: Steps of a year that a sample recomputes, about eleven days.
SAMPLE_STEPS = 100_000


def first_steps(case: YearCase, directory: Path | None = None, steps: int = SAMPLE_STEPS) -> list[tuple[str, ...]]:
    """Return the rows of a year up to some step."""
    chosen = tuple(step for step in checkpoint_steps() if step <= steps)
    z = simulation(case.model).measurements(chosen[-1])
    fmt = case.fmt
    if fmt is None:
        raise ValueError(f"got {case}, a reference; needed a case with a format")
    given = model(case.model, case.base)
    return rows(case, emulate(given, z, fmt, case.form, chosen, _true(case.model, case.base, chosen)))


@cache
def _true(name: str, base: int, chosen: tuple[int, ...]) -> Checkpoints:
    return reference(model(name, base), simulation(name).measurements(chosen[-1]), chosen)


def sample_of_year(case: YearCase, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows of the first eleven days."""
    return first_steps(case)


def same_errors(stored: tuple[str, ...], computed: tuple[str, ...]) -> bool:
    """Whether two rows of a year agree, apart from the last digits of an eigenvalue, which depend on LAPACK."""
    return stored[:-1] == computed[:-1] and math.isclose(
        float(stored[-1]), float(computed[-1]), rel_tol=1e-4, abs_tol=1e-12
    )


@dataclass(frozen=True)
class YearSweep(Sweep[YearCase]):
    """The years, whose runs share references; their bounds and their provenance are files of their own."""

    def recompute(
        self,
        folder: Path,
        executor: Executor | None = None,
        *,
        count: int | None = None,
        only: Sequence[str] = (),
        store: bool = False,
        steps: int = YEAR,
    ) -> Path:
        """Run the first cases one after another, each from its saved state, and write all files.

        Parameters
        ----------
        steps : number of steps; fewer for a trial.
        """
        if executor is not None or only:
            raise ValueError(
                f"{self.name}: got processes or words; needed one process and all cases, or the first ones"
            )
        progress, file = folder / self.name, folder / f"{self.name}.csv"
        if not store:
            run_cases(CASES[:count], progress, steps)
        file.parent.mkdir(parents=True, exist_ok=True)
        write(CASES[:count], progress, steps, file.parent)
        return file


SWEEP = YearSweep(
    name="gravity_probe_b/year",
    file=_HERE / "year.csv",
    columns=COLUMNS,
    key=6,
    cells=lambda: CASES,
    compute=first_steps,
    command=_COMMAND,
    seed=SEED,
    sample=sample_of_year,
    same=same_errors,
)
