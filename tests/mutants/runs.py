"""Runs of tests in forked processes, so that the libraries are imported once and no fault outlives its run."""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

_CHECKOUT = Path(__file__).resolve().parents[2]

#: Imported once by the parent. The package itself is not among them: each process reads it from its files.
LIBRARIES = (
    "numpy",
    "scipy.linalg",
    "scipy.signal",
    "scipy.special",
    "scipy.optimize",
    "scipy.integrate",
    "scipy.stats",
    "numba",
    "sympy",
    "mpmath",
    "flint",
    "matplotlib.pyplot",
    "hypothesis",
    "ml_dtypes",
    "gmpy2",
    "tqdm",
    "mpl_toolkits.mplot3d",
)


def load_libraries() -> None:
    """Import what every run needs."""
    os.environ["MPLBACKEND"] = "Agg"
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    os.environ.pop("MPLBACKEND")


class _Recorder:
    """Notes the outcome and the time of every test, and ends the run when its time is used up."""

    def __init__(self, now: Path, left_out: frozenset[str], budget: float) -> None:
        self.seconds: dict[str, float] = {}
        self.failed: list[str] = []
        self.now, self.left_out, self.budget = now, left_out, budget

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = [item for item in items if item.nodeid not in self.left_out]

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.now.write_text(nodeid, encoding="utf-8")

    def pytest_runtest_logreport(self, report: Any) -> None:
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + report.duration
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_runtest_protocol(self, item: Any) -> None:
        if time.process_time() > self.budget:
            item.session.shouldstop = "the time is used up"

    def pytest_collectreport(self, report: Any) -> None:
        if report.failed:
            self.failed.append(report.nodeid)


class Outcome(NamedTuple):
    """What a run of tests showed."""

    failed: list[str]
    """The tests that failed."""
    seconds: dict[str, float]
    """The time of each test that ended."""
    stuck: str
    """The test that was running when the hard limit ended the process; empty if it ended by itself."""


def run(
    root: Path,
    tests: Sequence[str],
    *,
    budget: float,
    compiled: bool = True,
    left_out: frozenset[str] = frozenset(),
    stop: bool = True,
) -> Outcome:
    """Run tests in a forked process.

    Parameters
    ----------
    budget : seconds of processor time after which no further test begins. A process that takes three times as long,
        and ten seconds, is ended.
    compiled : compile what is to be compiled; otherwise Python runs it.
    left_out : tests not to run.
    stop : at the first failure.
    """
    with tempfile.TemporaryDirectory() as folder:
        report, now = Path(folder, "report"), Path(folder, "now")
        child = os.fork()
        if not child:
            _child(root, tests, report, _Recorder(now, left_out, budget), compiled, stop)
        _, status = os.waitpid(child, 0)
        if report.is_file():
            return Outcome(**json.loads(report.read_text(encoding="utf-8")))
        running = now.read_text(encoding="utf-8") if now.is_file() else "collection"
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGKILL, signal.SIGXCPU):
            return Outcome([], {}, running)
        return Outcome([f"{running}: the process ended"], {}, "")


def _child(root: Path, tests: Sequence[str], report: Path, recorder: _Recorder, compiled: bool, stop: bool) -> None:
    try:
        os.setsid()
        os.chdir(root)
        sink = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(sink, stream)
        # The processor time of the parent does not count: a forked process begins at zero.
        hard = int(3 * recorder.budget + 10)
        resource.setrlimit(resource.RLIMIT_CPU, (hard, hard + 5))
        os.environ["PYTHONPATH"] = str(root)
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(report.parent)
        os.environ["PYTEST_DEBUG_TEMPROOT"] = str(report.parent)
        os.environ["MPLCONFIGDIR"] = str(report.parent)
        sys.dont_write_bytecode = True
        sys.path[:] = [str(root), *(each for each in sys.path if Path(each or ".").resolve() not in (root, _CHECKOUT))]
        for name in [name for name in sys.modules if name.split(".")[0] in ("gpbnb", "tests")]:
            del sys.modules[name]
        if not compiled:
            os.environ["NUMBA_DISABLE_JIT"] = "1"
            importlib.import_module("numba").config.DISABLE_JIT = 1
        options = ["-q", "-W", "ignore::pytest.PytestAssertRewriteWarning", "-o", f"cache_dir={report.parent}"]
        for test in tests:  # one after the other: those that are not needed are not imported
            code = int(pytest.main([*options, *(["-x"] if stop else []), test], plugins=[recorder]))
            if code not in (0, 1, 2, 5) and not recorder.failed:
                recorder.failed.append(f"{test}: pytest ended with {code}")
            if time.process_time() > recorder.budget or (stop and recorder.failed):
                break
        found = Outcome(recorder.failed, recorder.seconds, "")
        draft = report.with_suffix(".draft")
        draft.write_text(json.dumps(found._asdict()), encoding="utf-8")
        draft.replace(report)
    except BaseException as error:
        recorder.now.write_text(f"{type(error).__name__}: {error}", encoding="utf-8")
    finally:
        os._exit(3)
