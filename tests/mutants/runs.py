"""Runs of tests in forked processes, so that the libraries are imported once and no fault outlives its run."""

from __future__ import annotations

import contextlib
import gc
import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from inspect import CO_OPTIMIZED
from itertools import zip_longest
from multiprocessing import Pipe, get_context
from pathlib import Path
from types import CodeType, FunctionType
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
    "pytest_mpl.plugin",
)

NO_PICTURES = ("-o", "addopts=")
"""Options of pytest without which figures are compared with their stored pictures."""
QUICK = 1.0
"""Seconds. Tests that take longer run after all others."""


def load_libraries() -> None:
    """Import what every run needs."""
    os.environ["MPLBACKEND"] = "Agg"
    for name in LIBRARIES:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    os.environ.pop("MPLBACKEND")


class How(NamedTuple):
    """How the tests of a run are chosen and executed."""

    #: seconds of processor time after which no further test begins. A process that takes three times as long, and ten
    #: seconds, is ended.
    budget: float
    #: digest by source file: compiled functions of these files are taken from the cache although a source has changed.
    stamps: Mapping[str, str] | None = None
    #: compare figures with their stored pictures, and run no other tests; otherwise compare none.
    pictures: bool = False
    #: stop at the first failure.
    stop: bool = True
    #: tests not to run.
    left_out: frozenset[str] = frozenset()
    #: known durations, by test.
    seconds: Mapping[str, float] | None = None


class _Recorder:
    """Notes the outcome and the time of every test, and ends the run when its time is used up."""

    def __init__(self, now: Path, how: How) -> None:
        self.seconds: dict[str, float] = {}
        self.failed: list[str] = []
        self.now, self.how, self.slow = now, how, False
        self.deferred: set[str] = set()

    def wants(self, item: Any) -> bool:
        if item.nodeid in self.how.left_out or item.nodeid in self.seconds:
            return False
        if self.how.pictures and item.get_closest_marker("mpl_image_compare") is None:
            return False
        if self.slow or (self.how.seconds or {}).get(item.nodeid, 0.0) <= QUICK:
            return True
        self.deferred.add(item.nodeid.partition("::")[0])
        return False

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = [item for item in items if self.wants(item)]

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.now.write_text(nodeid, encoding="utf-8")
        self.seconds[nodeid] = -time.process_time()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self.seconds[nodeid] += time.process_time()

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed and report.nodeid not in self.failed:
            self.failed.append(report.nodeid)

    def pytest_runtest_protocol(self, item: Any) -> None:
        if time.process_time() > self.how.budget:
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


def run(root: Path, tests: Sequence[str], how: How) -> Outcome:
    """Run tests in a forked process, which imports them and the package: first those that are not known to be slow."""
    return _forked(lambda recorder: _import_and_run(root, tests, recorder), how)


def _forked(task: Callable[[_Recorder], None], how: How) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        report, now = Path(folder, "report"), Path(folder, "now")
        child = os.fork()
        if not child:
            _child(task, report, _Recorder(now, how))
        _, status = os.waitpid(child, 0)
        if report.is_file():
            return Outcome(**json.loads(report.read_text(encoding="utf-8")))
        running = now.read_text(encoding="utf-8") if now.is_file() else "collection"
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGKILL, signal.SIGXCPU):
            return Outcome([], {}, running)
        return Outcome([f"{running}: the process ended"], {}, "")


def _child(task: Callable[[_Recorder], None], report: Path, recorder: _Recorder) -> None:
    try:
        os.setsid()
        sink = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(sink, stream)
        # The processor time of the parent does not count: a forked process begins at zero.
        hard = int(3 * recorder.how.budget + 10)
        resource.setrlimit(resource.RLIMIT_CPU, (hard, hard + 5))
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = str(report.parent)
        os.environ["PYTEST_DEBUG_TEMPROOT"] = str(report.parent)
        os.environ["MPLCONFIGDIR"] = str(report.parent)
        task(recorder)
        draft = report.with_suffix(".draft")
        draft.write_text(json.dumps(Outcome(recorder.failed, recorder.seconds, "")._asdict()), encoding="utf-8")
        draft.replace(report)
    except BaseException as error:
        recorder.now.write_text(f"{type(error).__name__}: {error}", encoding="utf-8")
    finally:
        os._exit(3)


def _import_and_run(root: Path, tests: Sequence[str], recorder: _Recorder) -> None:
    how = recorder.how
    os.chdir(root)
    os.environ["PYTHONPATH"] = str(root)
    sys.dont_write_bytecode = True
    sys.path[:] = [str(root), *(each for each in sys.path if Path(each or ".").resolve() not in (root, _CHECKOUT))]
    for name in [name for name in sys.modules if name.split(".")[0] in ("gpbnb", "tests")]:
        del sys.modules[name]
    if how.stamps is not None:
        compiling = importlib.import_module("gpbnb.arithmetic.kernels.compiling")
        stamps, known = compiling._stamp, how.stamps
        compiling._stamp = lambda path: known.get(str(path)) or stamps(path)
    options = ["-q", "-W", "ignore::pytest.PytestAssertRewriteWarning", "-o", f"cache_dir={recorder.now.parent}"]
    options += ["-x"] if how.stop else []
    options += [] if how.pictures else NO_PICTURES
    for recorder.slow in (False, True):
        for test in tests:  # one after the other: those that are not needed are not imported
            if recorder.slow and test.partition("::")[0] not in recorder.deferred:
                continue
            if time.process_time() > how.budget or (how.stop and recorder.failed):
                break
            code = int(pytest.main([*options, test], plugins=[recorder]))
            if code not in (0, 1, 2, 5) and not recorder.failed:
                recorder.failed.append(f"{test}: pytest ended with {code}")


class Fresh:
    """A process without the package, which forks the runs of :func:`run`.

    A run that is forked from a process with the package would import it a second time, which numba does not support.
    """

    def __init__(self) -> None:
        self._pipe, other = Pipe()
        get_context("fork").Process(target=_serve, args=(other,), daemon=True).start()

    def run(self, root: Path, tests: Sequence[str], how: How) -> Outcome:
        self._pipe.send((root, tests, how))
        return Outcome(*self._pipe.recv())


def _serve(pipe: Any) -> None:
    while True:
        try:
            asked = pipe.recv()
        except EOFError:
            return
        pipe.send(tuple(run(*asked)))


class Collected:
    """All tests, imported once. A fault in the body of a function is seeded by giving the function other code."""

    def __init__(self, session: pytest.Session, root: Path) -> None:
        self.items: dict[str, list[pytest.Item]] = {}
        for item in session.items:
            self.items.setdefault(item.nodeid.partition("::")[0], []).append(item)
        self.functions: dict[tuple[str, str, int], list[FunctionType]] = {}
        for each in gc.get_objects():
            if isinstance(each, FunctionType) and each.__code__.co_filename.startswith(str(root / "gpbnb")):
                self.functions.setdefault(_place(each.__code__), []).append(each)
        gc.collect()
        gc.freeze()

    def changed(self, path: Path, source: str, other: str) -> dict[FunctionType, CodeType] | None:
        """The functions of a file that a fault changes, with their new code; None if it changes more than these."""
        old, new = (list(_codes(compile(each, str(path), "exec"))) for each in (source, other))
        if len(old) != len(new):
            return None
        found: dict[FunctionType, CodeType] = {}
        for before, after in zip(old, new, strict=True):
            if not before.co_flags & CO_OPTIMIZED:  # of the module, or of a class
                if _shell(before) != _shell(after):
                    return None
            elif before != after:
                for function in self.functions.get(_place(before), ()):
                    if before.co_freevars != after.co_freevars:
                        return None
                    found[function] = after
        return found or None

    def run(self, tests: Sequence[str], codes: Mapping[FunctionType, CodeType], how: How) -> Outcome:
        """Run the tests of some files, or single tests, on a fault in a forked process."""

        def task(recorder: _Recorder) -> None:
            for function, code in codes.items():
                function.__code__ = code
            # Files that had a fault for a while are again as they were imported.
            importlib.import_module("gpbnb.caching")._IMPORTED = time.time()
            # Findings of the checks are kept by the sources in files, which do not have the fault.
            importlib.import_module("gpbnb.report.ledger.cache")._folder = lambda: None
            importlib.import_module("gpbnb.report.ledger.cache")._file.cache_clear()
            chosen: dict[str, pytest.Item] = {}
            for test in tests:
                items = self.items.get(test.partition("::")[0], ())
                chosen |= {item.nodeid: item for item in items if "::" not in test or item.nodeid == test}
            for recorder.slow in (False, True):
                items = [item for item in chosen.values() if recorder.wants(item)]
                for item, following in zip_longest(items, items[1:]):
                    if time.process_time() > how.budget or (how.stop and recorder.failed):
                        return
                    if not item.config.pluginmanager.is_registered(recorder):
                        item.config.pluginmanager.register(recorder)
                    item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)

        return _forked(task, how)


def _place(code: CodeType) -> tuple[str, str, int]:
    return code.co_filename, code.co_qualname, code.co_firstlineno


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _codes(each)


def _shell(code: CodeType) -> tuple[Any, ...]:
    consts = tuple((type(each), each) for each in code.co_consts if not isinstance(each, CodeType))
    return code.co_code, repr(consts), code.co_names


class _Server:
    def __init__(self, root: Path, serve: Callable[[Collected], None]) -> None:
        self.root, self.serve = root, serve

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.serve(Collected(session, self.root))
        return True


def with_collected(root: Path, tests: Sequence[str], serve: Callable[[Collected], None]) -> None:
    """Collect tests, in this process, and hand them to a function."""
    os.chdir(root)
    os.environ["PYTHONPATH"] = str(root)
    sys.dont_write_bytecode = True
    sys.path[:] = [str(root), *(each for each in sys.path if Path(each or ".").resolve() not in (root, _CHECKOUT))]
    options = ["-qq", "-s", "--continue-on-collection-errors", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    pytest.main([*options, *NO_PICTURES, *tests], plugins=[_Server(root, serve)])
