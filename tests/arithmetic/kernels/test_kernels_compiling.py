"""The cache of compiled functions: it compiles again what changed, and nothing else."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType

import pytest
from numba.core.registry import CPUDispatcher

from gpbnb import caching
from gpbnb.arithmetic.kernels import compiling

PROGRAM = """
import json, sys
from gpbnb.alone import alone
from gpbnb.outer import outer

values = {"outer": outer(1.0), "alone": alone(1.0)}
functions = [outer, alone]
if len(sys.argv) > 1:
    import numpy as np
    from gpbnb.arithmetic.kernels.elementwise import product
    from gpbnb.arithmetic.kernels.tags import Binary

    c = np.empty((1, 1))
    product(Binary(24, True), np.array([[3.0]]), np.array([[5.0]]), c)
    values["product"] = c[0, 0]
    functions.append(product)
json.dump({"values": values, "compiled": [f.__name__ for f in functions if f.stats.cache_misses]}, sys.stdout)
"""
VALUES = {"outer": 3.0, "alone": 2.0}
HEADER = "from gpbnb.arithmetic.kernels.compiling import compiled\n"
ADDED = {
    "inner.py": "from numba import njit\n\nFACTOR = 2.0\n\n\n@njit\ndef inner(x):\n    return FACTOR * x\n",
    "outer.py": HEADER + "from gpbnb.inner import inner\n\n\n@compiled\ndef outer(x):\n    return inner(x) + 1.0\n",
    "alone.py": HEADER + "\n\n@compiled\ndef alone(x):\n    return x + 1.0\n",
}


@pytest.fixture
def copy(tmp_path):
    """A copy of the arithmetic, with three small modules beside it; `copy.run()` says what was compiled."""
    package = tmp_path / "gpbnb"
    package.mkdir()
    for name in ("__init__.py", "caching.py"):
        shutil.copy(caching.PACKAGE / name, package)
    shutil.copytree(
        caching.PACKAGE / "arithmetic", package / "arithmetic", ignore=shutil.ignore_patterns("__pycache__")
    )
    for name, text in ADDED.items():
        (package / name).write_text(text)

    class Copy:
        folder = package
        cache = tmp_path / "cache" / "compiled"
        command = (sys.executable, "-c", PROGRAM)
        environment = os.environ | {"PYTHONPATH": str(tmp_path), "GPBNB_CACHE_DIR": str(tmp_path / "cache")}

        def run(self) -> dict:
            return json.loads(self.result().stdout)

        def result(self) -> subprocess.CompletedProcess:
            command = self.command
            return subprocess.run(
                command, cwd=tmp_path, env=self.environment, capture_output=True, text=True, check=True
            )

        def change(self, name: str, old: str, new: str) -> None:
            path = package / name
            text = path.read_text(encoding="utf-8")
            assert old in text
            path.write_text(text.replace(old, new), encoding="utf-8")

    for key in ("NUMBA_CACHE_DIR", "GPBNB_QUIET"):
        Copy.environment.pop(key, None)
    # Python would take old bytecode for a source that changes within a second and keeps its size.
    Copy.environment["PYTHONDONTWRITEBYTECODE"] = "1"
    return Copy()


def test_what_changed_is_compiled_again_and_nothing_else(copy):
    copy.command += ("with a product",)
    values = VALUES | {"product": 15.0}
    first = copy.result()
    assert json.loads(first.stdout) == {"values": values, "compiled": ["outer", "alone", "product"]}
    assert first.stderr.startswith("gpbnb: compiling for this processor.")
    assert str(copy.cache) in first.stderr
    assert len(first.stderr.splitlines()) == 1
    again = copy.result()
    assert json.loads(again.stdout) == {"values": values, "compiled": []}
    assert again.stderr == ""
    # A constant of another file, compiled in two calls away, then the file's own body.
    copy.change("inner.py", "FACTOR = 2.0", "FACTOR = 1000.0")
    assert copy.run() == {"values": values | {"outer": 1001.0}, "compiled": ["outer"]}
    copy.change("alone.py", "x + 1.0", "x + 7.0")
    assert copy.run() == {"values": values | {"outer": 1001.0, "alone": 8.0}, "compiled": ["alone"]}
    copy.change("arithmetic/kernels/binary.py", "p = a * b + 0.0", "p = 2.0 * a * b + 0.0")
    assert copy.run() == {"values": {"outer": 1001.0, "alone": 8.0, "product": 30.0}, "compiled": ["product"]}


def test_what_was_compiled_before_a_change_is_there_when_the_change_is_undone(copy):
    assert copy.run()["compiled"] == ["outer", "alone"]
    copy.change("inner.py", "FACTOR = 2.0", "FACTOR = 3.0")
    assert copy.run() == {"values": VALUES | {"outer": 4.0}, "compiled": ["outer"]}
    copy.change("inner.py", "FACTOR = 3.0", "FACTOR = 2.0")
    assert copy.run() == {"values": VALUES, "compiled": []}


def test_two_processes_compile_nothing_twice(copy):
    settings = {"cwd": copy.folder.parent, "env": copy.environment, "stdout": subprocess.PIPE}
    running = [subprocess.Popen(copy.command, **settings) for _ in range(2)]
    found = [json.loads(process.communicate()[0]) for process in running]
    assert found[0]["values"] == found[1]["values"] == VALUES
    assert sorted(found[0]["compiled"] + found[1]["compiled"]) == ["alone", "outer"]
    assert not list(copy.cache.glob("*.lock"))


def test_a_damaged_file_is_compiled_again(copy):
    copy.run()
    paths = list(copy.cache.glob("*.compiled"))
    assert len(paths) == 2
    for path in paths:
        path.write_bytes(path.read_bytes()[:100])
    assert copy.run() == {"values": VALUES, "compiled": ["outer", "alone"]}
    assert copy.run() == {"values": VALUES, "compiled": []}


def test_a_folder_that_cannot_be_written_to_is_left_out(copy, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.touch()
    copy.environment |= dict.fromkeys(("NUMBA_CACHE_DIR", "GPBNB_CACHE_DIR", "XDG_CACHE_HOME", "HOME"), str(blocked))
    copy.environment["TMPDIR"] = str(tmp_path)
    assert copy.run()["values"] == VALUES
    (own,) = tmp_path.glob("gpbnb-*")
    assert len(list(own.glob("compiled/*.compiled"))) == 2


def modules() -> list[ModuleType]:
    """The modules of the package that compile functions for callers."""
    using = [
        path
        for path in sorted(caching.PACKAGE.rglob("*.py"))
        if re.search(r"\bcompiled\(|@compiled\b", path.read_text("utf-8"))
    ]
    names = [".".join(("gpbnb", *path.relative_to(caching.PACKAGE).with_suffix("").parts)) for path in using]
    return [import_module(name) for name in names if name != compiling.__name__]


def test_a_key_covers_every_function_that_is_compiled_in():
    checked = 0
    for module in modules():
        covered = caching.imported(Path(module.__file__))
        waiting = [f for f in vars(module).values() if isinstance(f, CPUDispatcher)]
        seen = set()
        while waiting:
            function = getattr(waiting.pop(), "py_func", None)
            if function is None or function in seen:
                continue
            seen.add(function)
            assert Path(function.__code__.co_filename).resolve() in covered, (module, function)
            cells = inside(function)
            for value in [function.__globals__.get(name) for name in function.__code__.co_names] + cells:
                if isinstance(value, FunctionType) and value.__module__.startswith("gpbnb"):
                    assert Path(value.__code__.co_filename).resolve() in covered, (module, function, value)
                    checked += 1
                waiting.append(value)
    assert checked > 50


def inside(function: FunctionType) -> list:
    """What a function holds from the one that made it."""
    return [cell.cell_contents for cell in function.__closure__ or ()]


def test_every_cache_has_this_key():
    for path in caching.PACKAGE.rglob("*.py"):
        if path.name != "compiling.py":
            assert "cache=True" not in path.read_text(encoding="utf-8"), f"{path.name}: use `compiled` for a cache"


def test_what_another_process_compiled_meanwhile_is_loaded(tmp_path, monkeypatch):
    """The other process saves its result while this one waits for the lock."""
    files, other = (compiling._Files(tmp_path, "function", ("a version",)) for _ in range(2))
    released = []
    monkeypatch.setattr(compiling, "lock", lambda path, wait: other.save("types", "compiled"))
    monkeypatch.setattr(compiling, "unlock", lambda path, file: released.append(path))
    monkeypatch.setattr(compiling, "_tell", lambda folder: pytest.fail("it would be compiled twice"))
    assert files.load("types") == "compiled"
    assert released == list(tmp_path.glob("*.compiled"))
    assert files.load("types") == "compiled"
    assert len(released) == 1
