"""A year of Gravity Probe B, 3,153,600 steps, in many formats and forms.

In one base, all formats use the same numbers. The model is stored once, in 14 bits or 4 decimal digits, and
measurements are whole milliarcseconds. So one reference serves all formats, and errors come only from the arithmetic.

The command ``python -m gpbnb.report.gravity_probe_b.year`` saves its progress and resumes where it was interrupted. Its
results are stored next to this file, in ``year.csv`` and ``bounds.csv``, with their provenance in ``year.json``;
:func:`load` and :func:`bounds` read them.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import os
import platform
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb import sweeps
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.bounded_run import BoundedRun
from gpbnb.filters.contraction import Contraction
from gpbnb.filters.emulation import History, compare_runs, emulate, relative
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Checkpoints, Run, log_spaced, reference
from gpbnb.filters.simulation import BLOCK, Simulation
from gpbnb.report.gravity_probe_b.model import SEED, TRUTH, YEAR, gravity_probe_b, gravity_probe_b_year
from gpbnb.sweeps import Column, Sweep, as_computed

#: Format in which the model is stored, by base; every format of this base in :data:`CASES` contains it.
STORED = {2: FloatFormat(2, 14), 10: FloatFormat(10, 4)}

#: The models, with roll periods of 600 s as in the reports, 77.5 s as flown, and 600 s without process noise.
MODELS = ("roll 600 s", "roll 77.5 s", "no process noise")


class Case(NamedTuple):
    """One run of the year; a precision of 0 stands for the reference in double-double."""

    model: str
    base: int
    precision: int
    rounding: Rounding
    form: Form

    @property
    def fmt(self) -> FloatFormat | None:
        """The format of the run; None for double-double."""
        return FloatFormat(self.base, self.precision, self.rounding) if self.precision else None

    @property
    def reference(self) -> Case:
        """The case that serves as the reference for this one."""
        return Case(self.model, self.base, 0, Rounding.NEAREST, Form.INNOVATION)

    @property
    def name(self) -> str:
        """Name of the files for this case."""
        words = f"{self.model} {self.base} {self.precision} {self.rounding.value} {self.form.name.lower()}"
        return words.replace(" ", "-").replace(".", "_")


def _cases() -> tuple[Case, ...]:
    usual, flown, noiseless = MODELS
    nearest, chop = Rounding.documented()
    others = (Form.INNOVATION, Form.JOSEPH, Form.UD)
    cases = [Case(usual, 2, t, nearest, Form.HUNG) for t in (24, 18, 32, 14, 20, 53)]
    cases += [Case(usual, 2, t, chop, Form.HUNG) for t in (24, 18, 32)]
    cases += [Case(usual, 2, 24, nearest, form) for form in others]
    cases += [Case(usual, 10, 8, nearest, Form.HUNG), Case(usual, 10, 6, nearest, Form.HUNG)]
    cases += [Case(flown, 2, 24, nearest, Form.HUNG), Case(noiseless, 2, 24, nearest, Form.HUNG)]
    cases += [Case(usual, 2, t, nearest, Form.HUNG) for t in (22, 28)]
    cases += [Case(usual, 2, 18, nearest, form) for form in others]
    cases += [Case(usual, 2, 24, nearest, Form.HUNG_SECOND_GAIN), Case(usual, 10, 8, chop, Form.HUNG)]
    cases += [Case(usual, 10, 8, nearest, Form.UD), Case(usual, 10, 10, nearest, Form.HUNG)]
    cases += [Case(usual, 2, 24, chop, form) for form in others]
    cases += [Case(usual, 10, 8, nearest, form) for form in others[:2]]
    cases += [Case(usual, 10, 4, nearest, Form.HUNG), Case(usual, 10, 16, nearest, Form.HUNG)]
    cases += [Case(usual, 2, t, nearest, Form.HUNG) for t in (16, 26, 40)]
    cases += [Case(usual, 2, t, chop, Form.HUNG) for t in (14, 20, 28, 53)]
    cases += [Case(usual, 2, 53, nearest, form) for form in others]
    # Neighbours of the smallest precisions that meet a milliarcsecond a year, so that these are exact.
    cases += [Case(usual, 10, 9, nearest, Form.HUNG), *(Case(usual, 2, t, nearest, Form.HUNG) for t in (31, 33))]
    return tuple(cases)


#: All runs, the most informative first.
CASES = _cases()

#: Runs with their own contraction bound, the references of the first model, from which the other bounds follow.
BOUNDED_CASES = frozenset(Case(MODELS[0], base, 0, Rounding.NEAREST, Form.INNOVATION) for base in STORED)


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

    def __init__(self, case: Case, directory: Path, steps: int) -> None:
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
                    if isinstance(self.run, BoundedRun):
                        self.run.bound = Contraction(*(saved[f"bound_{name}"][()] for name in Contraction._fields))
                    self.truth, self.seconds = saved["truth"], float(saved["seconds"])

    def _arrays(self) -> dict[str, NDArray[Any]]:
        arrays = {name: getattr(self.run, name) for name in ("x", "P", "X", "G", "C", "notes")}
        if isinstance(self.run, BoundedRun):
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
        if isinstance(self.run, BoundedRun):
            arrays |= {f"bound_{name}": np.asarray(each) for name, each in self.run.bound._asdict().items()}
        arrays |= {"truth": self.truth, "seconds": np.array(self.seconds), "fingerprint": np.array(self.fingerprint)}
        np.savez(draft, allow_pickle=False, **arrays)
        os.replace(draft, self.file)


def _run(case: Case, steps: int) -> Run:
    kind = BoundedRun if case in BOUNDED_CASES else Run
    return kind(model(case.model, case.base), case.fmt, case.form, checkpoint_steps(steps))


@cache
def fingerprint(case: Case, steps: int) -> str:
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
    bound = run.bound if isinstance(run, BoundedRun) else ()
    for each in (run.x, run.P, run.notes, *bound):
        digest.update(np.ascontiguousarray(each).tobytes())
    return digest.hexdigest()


def run_cases(
    cases: Sequence[Case],
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


def _is_finished(case: Case, directory: Path, steps: int) -> bool:
    file = directory / f"{case.name}.npz"
    if not file.exists():
        return False
    with np.load(file) as saved:
        done, _, _, stopped = saved["notes"]
        return str(saved["fingerprint"]) == fingerprint(case, steps) and (done >= steps or stopped > 0)


def history(case: Case, directory: Path, steps: int = YEAR) -> History:
    """Return the errors of a finished run."""
    return compare_runs(
        ResumableRun(case, directory, steps).run, reference_checkpoints(case.reference, directory, steps)
    )


@cache
def reference_checkpoints(case: Case, directory: Path, steps: int) -> Checkpoints:
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

    case: Case
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


def rows(case: Case, found: History) -> list[tuple[str, ...]]:
    """Return rows of ``year.csv`` with six significant digits."""
    numbers = np.column_stack(
        [found.state[:, :4], found.state_norm, found.gain_norm, found.covariance_norm, found.least_eigenvalue]
    )
    return [
        (*_name(case), str(step), *(f"{number:.6g}" for number in line))
        for step, line in zip(found.steps.tolist(), numbers.tolist(), strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Bounds:
    """The contraction bound of a run, in the same units and norms as the errors of :class:`Year`.

    The errors of a run without its own bound are at most its distance from the reference plus the reference's bound:
    :func:`gpbnb.filters.contraction.companion_bound`.
    """

    case: Case
    steps: NDArray[np.int64]
    drift: NDArray[np.float64]
    rate: NDArray[np.float64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]


def bound_rows(case: Case, directory: Path, steps: int) -> list[tuple[str, ...]]:
    """Return rows of ``bounds.csv``, if the case has bounds, with six significant digits, rounded upwards."""
    run, true = ResumableRun(case, directory, steps).run, reference_checkpoints(case, directory, steps)
    if not isinstance(run, BoundedRun):
        return []
    states, gains, covariances = (each[: len(true.steps)] for each in run.bounds)
    norms = [relative(gains, true.K), relative(covariances, true.P)]
    numbers = np.column_stack([states[:, :4], states.max(axis=1), *norms])
    return [
        (*_name(case), str(step), *(f"{number * (1 + 1e-5):.6g}" for number in line))
        for step, line in zip(true.steps, numbers.tolist(), strict=True)
    ]


def _name(case: Case) -> tuple[str, ...]:
    return case.model, str(case.base), str(case.precision), case.rounding.value, case.form.name.lower()


HEADER = ("model", "base", "precision", "rounding", "form", "step", *_COLUMNS)

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

_COMMAND = "python -m gpbnb.report.gravity_probe_b.year"


def write(cases: Iterable[Case], directory: Path, steps: int = YEAR, to: Path = _HERE) -> None:
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


def _of_reference(case: Case, directory: Path, steps: int) -> dict[str, Any]:
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
def bounds(directory: Path = _HERE) -> dict[Case, Bounds]:
    """Load the contraction bounds of ``BOUNDED_CASES`` that ship with the package."""
    return {
        case: Bounds(
            case, numbers[:, 0].astype(np.int64), numbers[:, 1:3], numbers[:, 3:5], *(numbers[:, i] for i in (5, 6, 7))
        )
        for case, numbers in _read(directory / "bounds.csv", BOUND_COLUMNS).items()
    }


def _read(file: Path, columns: tuple[Column, ...]) -> dict[Case, NDArray[np.float64]]:
    groups: dict[Case, list[tuple[str, ...]]] = {}
    for row in sweeps.read(file, columns, _COMMAND).rows:
        case = Case(row[0], int(row[1]), int(row[2]), Rounding(row[3]), Form[row[4].upper()])
        groups.setdefault(case, []).append(row[5:])
    return {case: np.array(group, dtype=np.float64) for case, group in groups.items()}


def provenance(directory: Path = _HERE) -> dict[str, Any]:
    """Return the provenance of the years."""
    return sweeps.read_record(directory / "year.json", _COMMAND)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(prog=_COMMAND, description="Run the filters for a year in many formats and forms.")
    parser.add_argument("--directory", type=Path, default=Path(".cache/year"), help="folder for saved progress")
    parser.add_argument("--steps", type=int, default=YEAR, help="number of steps; use fewer for a trial")
    parser.add_argument("--cases", type=int, default=len(CASES), help="compute only this many cases")
    parser.add_argument("--output", type=Path, default=Path(".cache/year"), help="folder for year.csv and year.json")
    given = parser.parse_args(arguments)
    try:
        run_cases(CASES[: given.cases], given.directory, given.steps)
    except KeyboardInterrupt:
        print(
            f"interrupted; run the same command again to continue from the progress saved in {given.directory}",
            file=sys.stderr,
        )
        return 130
    given.output.mkdir(parents=True, exist_ok=True)
    write(CASES[: given.cases], given.directory, given.steps, given.output)
    return 0


# -- the years as a sweep ----------------------------------------------------------------------------

#: Steps of a year that a sample recomputes, about eleven days.
SAMPLE_STEPS = 100_000


def first_steps(case: Case, directory: Path | None = None, steps: int = SAMPLE_STEPS) -> list[tuple[str, ...]]:
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


def sample_of_year(case: Case, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows of the first eleven days."""
    return first_steps(case)


def same_errors(stored: tuple[str, ...], computed: tuple[str, ...]) -> bool:
    """Whether two rows of a year agree, apart from the last digits of an eigenvalue, which depend on LAPACK."""
    return stored[:-1] == computed[:-1] and math.isclose(
        float(stored[-1]), float(computed[-1]), rel_tol=1e-4, abs_tol=1e-12
    )


SWEEP: Sweep[Case] = Sweep(
    name="kalman/year",
    file=_HERE / "year.csv",
    columns=COLUMNS,
    key=6,
    cells=lambda: CASES,
    compute=first_steps,
    rows=as_computed,
    command="python -m gpbnb.report.gravity_probe_b.year",
    seed=1984,
    sample=sample_of_year,
    same=same_errors,
)


if __name__ == "__main__":
    sys.exit(main())
