"""Resumable runs of a year of Gravity Probe B, which save their progress and resume where they were interrupted."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.bounds.bounded_run import BoundedRun
from gpbnb.filters.contraction import Contraction
from gpbnb.filters.emulation import History, compare_runs
from gpbnb.filters.run import Checkpoints, Run
from gpbnb.filters.simulation import BLOCK
from gpbnb.report.gravity_probe_b.model import TRUTH, YEAR
from gpbnb.report.gravity_probe_b.year_cases import BOUNDED_CASES, Case, checkpoint_steps, model, simulation

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
