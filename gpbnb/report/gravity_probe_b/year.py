"""A year of Gravity Probe B, 3,153,600 steps, in many formats and forms.

The command ``python -m gpbnb.report.gravity_probe_b.year`` resumes where it was interrupted. Its results are stored
next to this file, in ``year.csv`` and ``bounds.csv``, with their provenance in ``year.json``; :func:`load` and
:func:`bounds` read them.
"""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb import sweeps
from gpbnb.arithmetic.formats import Rounding
from gpbnb.bounds.bounded_run import BoundedRun
from gpbnb.filters.emulation import History, relative
from gpbnb.filters.forms import Form
from gpbnb.report.gravity_probe_b.model import SEED, YEAR
from gpbnb.report.gravity_probe_b.year_cases import CASES, MODELS, Case
from gpbnb.report.gravity_probe_b.year_runs import ResumableRun, history, reference_checkpoints, run_cases
from gpbnb.sweeps import Column

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


if __name__ == "__main__":
    sys.exit(main())
