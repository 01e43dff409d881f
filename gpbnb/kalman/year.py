"""A year of Gravity Probe B, 3,153,600 steps, in many formats and forms: ``python -m gpbnb.kalman.year``.

The command goes on where it was interrupted. What it found is kept beside this file, in ``year.csv`` and
``bounds.csv``, and how, in ``year.json``; :func:`load` and :func:`bounds` read it.

In one base all formats hold the same numbers: the model is stored once, in 14 bits or 4 decimal digits, and what is
measured are whole milliarcseconds. So one reference serves them all, and errors are those of the arithmetic alone.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
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

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.kalman.experiment import (
    BLOCK,
    TRUTH,
    Followed,
    Form,
    History,
    Kept,
    Run,
    Simulation,
    compare_runs,
    gravity_probe_b_year,
    log_spaced,
    relative,
)
from gpbnb.kalman.model import YEAR, LinearModel, gravity_probe_b
from gpbnb.kalman.theory import Contraction

#: In which format the model is stored, by base; a part of every other format of the base in :data:`CASES`.
STORED = {2: FloatFormat(2, 14), 10: FloatFormat(10, 4)}

#: The models, rolling in 600 s as in the reports, in 77.5 s as flown, and in 600 s without process noise.
MODELS = ("roll 600 s", "roll 77.5 s", "no process noise")

_HERE = Path(__file__).parent
_COLUMNS = ("drift_2", "drift_3", "rate_2", "rate_3", "state", "gain", "covariance", "least_eigenvalue")
_SAVED_EACH = 64  # blocks
_TRIED = 200  # steps by which a change of the code is told


class Case(NamedTuple):
    """One run of the year; a precision of 0 stands for the reference in double-double."""

    model: str
    base: int
    precision: int
    rounding: Rounding
    form: Form

    @property
    def fmt(self) -> FloatFormat | None:
        return FloatFormat(self.base, self.precision, self.rounding) if self.precision else None

    @property
    def reference(self) -> Case:
        """The case whose results are true for this one."""
        return Case(self.model, self.base, 0, Rounding.NEAREST, Form.USUAL)

    @property
    def name(self) -> str:
        """What files of it are called."""
        words = f"{self.model} {self.base} {self.precision} {self.rounding.value} {self.form.name.lower()}"
        return words.replace(" ", "-").replace(".", "_")


def _cases() -> tuple[Case, ...]:
    usual, flown, still = MODELS
    nearest, chop = Rounding
    others = (Form.USUAL, Form.JOSEPH, Form.UD)
    cases = [Case(usual, 2, t, nearest, Form.REPORT) for t in (24, 18, 32, 14, 20, 53)]
    cases += [Case(usual, 2, t, chop, Form.REPORT) for t in (24, 18, 32)]
    cases += [Case(usual, 2, 24, nearest, form) for form in others]
    cases += [Case(usual, 10, 8, nearest, Form.REPORT), Case(usual, 10, 6, nearest, Form.REPORT)]
    cases += [Case(flown, 2, 24, nearest, Form.REPORT), Case(still, 2, 24, nearest, Form.REPORT)]
    cases += [Case(usual, 2, t, nearest, Form.REPORT) for t in (22, 28)]
    cases += [Case(usual, 2, 18, nearest, form) for form in others]
    cases += [Case(usual, 2, 24, nearest, Form.SECOND), Case(usual, 10, 8, chop, Form.REPORT)]
    cases += [Case(usual, 10, 8, nearest, Form.UD), Case(usual, 10, 10, nearest, Form.REPORT)]
    cases += [Case(usual, 2, 24, chop, form) for form in others]
    cases += [Case(usual, 10, 8, nearest, form) for form in others[:2]]
    cases += [Case(usual, 10, 4, nearest, Form.REPORT), Case(usual, 10, 16, nearest, Form.REPORT)]
    cases += [Case(usual, 2, t, nearest, Form.REPORT) for t in (16, 26, 40)]
    cases += [Case(usual, 2, t, chop, Form.REPORT) for t in (14, 20, 28, 53)]
    cases += [Case(usual, 2, 53, nearest, form) for form in others]
    # The neighbours of the smallest that meet a milliarcsecond a year, so that these are known to the digit.
    cases += [Case(usual, 10, 9, nearest, Form.REPORT), *(Case(usual, 2, t, nearest, Form.REPORT) for t in (31, 33))]
    return tuple(cases)


#: All runs, the most telling first.
CASES = _cases()

#: Runs with the contraction bound at their side, the references of the first model, on which the others' bounds rest.
FOLLOWED = frozenset(Case(MODELS[0], base, 0, Rounding.NEAREST, Form.USUAL) for base in STORED)


@cache
def model(name: str, base: int) -> LinearModel:
    """One of :data:`MODELS`, as stored in a base."""
    roll = "77.5" if name == MODELS[1] else "600"
    return gravity_probe_b(roll, process_noise=name != MODELS[2]).rounded(STORED[base])


@cache
def simulation(name: str) -> Simulation:
    """The measurements, the same for both bases; the truth moves by the model of base 2."""
    return gravity_probe_b_year(model(name, 2))


def marks(steps: int = YEAR) -> tuple[int, ...]:
    """The steps whose results are kept: three a decade."""
    return log_spaced(steps, 3)


# -- runs that survive interruption -------------------------------------------------------------------


class Journey:
    """A run of a case, kept in a file; with the contraction bound at its side, if it is among :data:`FOLLOWED`."""

    def __init__(self, case: Case, directory: Path, steps: int) -> None:
        self.case, self.steps, self.seconds = case, steps, 0.0
        self.run = _run(case, steps)
        self.truth: NDArray[np.float64] = np.array(TRUTH)
        self.file = directory / f"{case.name}.npz"
        self.told = fingerprint(case, steps)
        if self.file.exists():
            with np.load(self.file) as saved:
                if str(saved["told"]) == self.told:
                    for name, array in self._kept().items():
                        array[...] = saved[name]
                    if isinstance(self.run, Followed):
                        self.run.bound = Contraction(*(saved[f"bound_{name}"][()] for name in Contraction._fields))
                    self.truth, self.seconds = saved["truth"], float(saved["seconds"])

    def _kept(self) -> dict[str, NDArray[Any]]:
        arrays = {name: getattr(self.run, name) for name in ("x", "P", "X", "G", "C", "notes")}
        if isinstance(self.run, Followed):
            arrays |= dict(zip(("states", "gains", "covariances"), self.run.bounds, strict=True))
        return arrays

    @property
    def finished(self) -> bool:
        return self.run.steps >= self.steps or self.run.stopped is not None

    def go_on(self, blocks: int, bar: Any = None) -> None:
        """Take at most so many blocks of measurements, and save."""
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
        """Write all of it, or nothing."""
        draft = self.file.with_suffix(f".{os.getpid()}.npz")
        arrays = self._kept()
        if isinstance(self.run, Followed):
            arrays |= {f"bound_{name}": np.asarray(each) for name, each in self.run.bound._asdict().items()}
        arrays |= {"truth": self.truth, "seconds": np.array(self.seconds), "told": np.array(self.told)}
        np.savez(draft, allow_pickle=False, **arrays)
        os.replace(draft, self.file)


def _run(case: Case, steps: int) -> Run:
    kind = Followed if case in FOLLOWED else Run
    return kind(model(case.model, case.base), case.fmt, case.form, marks(steps))


@cache
def fingerprint(case: Case, steps: int) -> str:
    """A digest of all that a run is told, and of what it makes of the first measurements, to the last digit.

    Code that computes otherwise makes runs begin again; code that is only written otherwise does not.
    """
    told, run = model(case.model, case.base), _run(case, steps)
    digest = hashlib.sha256(repr((case.name, steps, marks(steps), TRUTH, BLOCK, case in FOLLOWED)).encode())
    for letter in ("Phi", "H", "Q", "R", "x0", "P0"):
        digest.update(" ".join(map(str, getattr(told, letter).flat)).encode())
    run.take(simulation(case.model).measurements(_TRIED))
    bound = run.bound if isinstance(run, Followed) else ()
    for each in (run.x, run.P, run.notes, *bound):
        digest.update(np.ascontiguousarray(each).tobytes())
    return digest.hexdigest()


def travel(
    cases: Sequence[Case],
    directory: Path,
    steps: int = YEAR,
    progress: bool = True,
    each: int = _SAVED_EACH,
) -> None:
    """Run the cases and their references, one after another, each from where it was saved.

    Parameters
    ----------
    directory : where runs are saved, each 64 blocks of 4096 steps.
    """
    directory.mkdir(parents=True, exist_ok=True)
    todo = list(dict.fromkeys(part for case in cases for part in (case.reference, case)))
    with tqdm(total=len(todo) * steps, desc="year", unit="step", unit_scale=True, disable=not progress) as bar:
        for case in todo:
            bar.set_postfix_str(case.name)
            if _is_finished(case, directory, steps):
                bar.update(steps)
                continue
            journey = Journey(case, directory, steps)
            bar.update(journey.run.steps)
            while not journey.finished:
                journey.go_on(each, bar)


def _is_finished(case: Case, directory: Path, steps: int) -> bool:
    file = directory / f"{case.name}.npz"
    if not file.exists():
        return False
    with np.load(file) as saved:
        done, _, _, stopped = saved["notes"]
        return str(saved["told"]) == fingerprint(case, steps) and (done >= steps or stopped > 0)


def history(case: Case, directory: Path, steps: int = YEAR) -> History:
    """Errors of a finished run."""
    return compare_runs(Journey(case, directory, steps).run, _true(case.reference, directory, steps))


@cache
def _true(case: Case, directory: Path, steps: int) -> Kept:
    return Journey(case, directory, steps).run.kept()


# -- what was found -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Year:
    """Errors of a year in one format and form, as stored; arrays (c,), after each of the steps.

    Parameters
    ----------
    drift, rate : (c, 2), errors of the drift angles in mas and of their rates in mas/yr.
    state : largest error of any state, in its unit.
    gain, covariance : norms (22) of their errors, relative to those of what they should be.
    least_eigenvalue : of the covariance, scaled to ones on the true diagonal.
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
    """Lines of ``year.csv``: six significant digits."""
    numbers = np.column_stack(
        [found.state[:, :4], found.state_norm, found.gain_norm, found.covariance_norm, found.least_eigenvalue]
    )
    return [
        (*_name(case), str(step), *(f"{number:.6g}" for number in line))
        for step, line in zip(found.steps.tolist(), numbers.tolist(), strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Bounds:
    """The contraction bound beside a run; as the errors of :class:`Year`, in the same units and norms.

    The errors of a run that has none of its own are at most those against its reference, and the reference's bound:
    :func:`gpbnb.kalman.theory.companion_bound`.
    """

    case: Case
    steps: NDArray[np.int64]
    drift: NDArray[np.float64]
    rate: NDArray[np.float64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]


def bound_rows(case: Case, directory: Path, steps: int) -> list[tuple[str, ...]]:
    """Lines of ``bounds.csv``, if the reference is followed: six significant digits, rounded upwards."""
    run, true = Journey(case, directory, steps).run, _true(case, directory, steps)
    if not isinstance(run, Followed):
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


def write(cases: Iterable[Case], directory: Path, steps: int = YEAR, to: Path = _HERE) -> None:
    """Collect the finished runs in ``year.csv``, ``bounds.csv`` and ``year.json``."""
    lines: list[tuple[str, ...]] = []
    bounded: list[tuple[str, ...]] = []
    about: dict[str, Any] = {}
    references: dict[str, Any] = {}
    for case in cases:
        journey = Journey(case, directory, steps)
        if not journey.finished:
            continue
        found = history(case, directory, steps)
        lines += rows(case, found)
        about[case.name] = {
            "indefinite": found.indefinite,
            "stopped": found.stopped,
            "seconds": round(journey.seconds, 1),
            "told": journey.told,
        }
        if case.reference.name not in references:
            references[case.reference.name] = _of_reference(case.reference, directory, steps)
            bounded += bound_rows(case.reference, directory, steps)
    for name, header, body in (("year", HEADER, lines), ("bounds", HEADER[:-1], bounded)):
        with (to / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([header, *body])
    made = {
        "command": "python -m gpbnb.kalman.year",
        "steps": steps,
        **machine(),
        "references": references,
        "cases": about,
    }
    (to / "year.json").write_text(json.dumps(made, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def machine() -> dict[str, Any]:
    """Where results are made, and with which versions."""
    return {
        "machine": f"{platform.system()} {platform.machine()}, python {platform.python_version()}",
        "versions": {name: version(name) for name in ("numpy", "numba", "llvmlite")},
    }


def _of_reference(case: Case, directory: Path, steps: int) -> dict[str, Any]:
    """What the unrounded filter knew at the end: how far it was from the truth, and how far it thought it was."""
    journey = Journey(case, directory, steps)
    true = _true(case, directory, steps)
    x, deviation = true.x[-1].astype(np.float64), np.sqrt(true.P[-1].diagonal().astype(np.float64))
    return {
        "seconds": round(journey.seconds, 1),
        "told": journey.told,
        "estimate": [float(f"{each:.9g}") for each in x],
        "estimate minus truth": [float(f"{each:.6g}") for each in x - journey.truth],
        "standard deviation": [float(f"{each:.6g}") for each in deviation],
    }


@cache
def load(directory: Path = _HERE) -> tuple[Year, ...]:
    """The years that the package brings, in the order of :data:`CASES`."""
    about = provenance(directory)["cases"]
    result = []
    for case, numbers in _read(directory / "year.csv", HEADER).items():
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
    """The contraction bounds of :data:`FOLLOWED` that the package brings."""
    return {
        case: Bounds(
            case, numbers[:, 0].astype(np.int64), numbers[:, 1:3], numbers[:, 3:5], *(numbers[:, i] for i in (5, 6, 7))
        )
        for case, numbers in _read(directory / "bounds.csv", HEADER[:-1]).items()
    }


def _read(file: Path, columns: tuple[str, ...]) -> dict[Case, NDArray[np.float64]]:
    with file.open(encoding="utf-8", newline="") as lines:
        header, *body = list(csv.reader(lines))
    if tuple(header) != columns:
        raise ValueError(
            f"got {file.name} with the columns {header}; needed {list(columns)}; make it anew with this version"
        )
    groups: dict[Case, list[list[str]]] = {}
    for line in body:
        case = Case(line[0], int(line[1]), int(line[2]), Rounding(line[3]), Form[line[4].upper()])
        groups.setdefault(case, []).append(line[5:])
    return {case: np.array(group, dtype=np.float64) for case, group in groups.items()}


def provenance(directory: Path = _HERE) -> dict[str, Any]:
    """How the years were made."""
    found: dict[str, Any] = json.loads((directory / "year.json").read_text(encoding="utf-8"))
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb.kalman.year", description="A year in many formats and forms."
    )
    parser.add_argument("--directory", type=Path, default=Path(".cache/year"), help="where runs are saved on the way")
    parser.add_argument("--steps", type=int, default=YEAR, help="fewer, for a trial")
    parser.add_argument("--cases", type=int, default=len(CASES), help="only so many of the cases")
    parser.add_argument("--output", type=Path, default=_HERE, help="where year.csv and year.json go")
    given = parser.parse_args(arguments)
    try:
        travel(CASES[: given.cases], given.directory, given.steps)
    except KeyboardInterrupt:
        print(f"interrupted; the same command goes on from what is saved in {given.directory}", file=sys.stderr)
        return 130
    given.output.mkdir(parents=True, exist_ok=True)
    write(CASES[: given.cases], given.directory, given.steps, given.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
