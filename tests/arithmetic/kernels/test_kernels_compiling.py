"""The cache of compiled functions: it compiles again what changed, and nothing else."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType

import numba
import pytest
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.serialize import dumps

from gpbnb import caching
from gpbnb.arithmetic.kernels import compiling

# The program loads the libraries once, and compiles a first function, which takes longest. Each line of input names a
# folder and a number of processes: these load the package from the folder at the same time and say what they compiled.
# They compute first what they are asked for, if anything.
PROGRAM = """
import io, json, os, sys
import numba, numpy as np

numba.njit(lambda x: x + 1.0)(1.0)

def answer(folder, environment, with_product, first):
    os.environ.update(environment)
    sys.path.insert(0, folder)
    sys.stderr = io.StringIO()
    exec(first)
    from gpbnb.alone import alone
    from gpbnb.outer import outer

    values = {"outer": outer(1.0), "alone": alone(1.0)}
    functions = [outer, alone]
    if with_product:
        from gpbnb.arithmetic.kernels.elementwise import product
        from gpbnb.arithmetic.kernels.tags import Binary

        c = np.empty((1, 1))
        product(Binary(24, True), np.array([[3.0]]), np.array([[5.0]]), c)
        values["product"] = c[0, 0]
        functions.append(product)
    names = [f.__name__ for f in functions if f.stats.cache_misses]
    found = {"values": values, "compiled": names, "stderr": sys.stderr.getvalue()}
    os.write(1, (json.dumps(found) + "\\n").encode())

def start(arguments):
    child = os.fork()
    if not child:
        status = 1
        try:
            answer(*arguments)
            status = 0
        finally:
            if status:
                sys.stderr = sys.__stderr__
                sys.excepthook(*sys.exc_info())
            os._exit(status)
    return child

for line in sys.stdin:
    count, *arguments = json.loads(line)
    if any([os.waitpid(child, 0)[1] for child in [start(arguments) for _ in range(count)]]):
        sys.exit(1)
"""
ALONE = "from gpbnb.alone import alone\nfrom gpbnb.outer import outer\n\nprint(outer(1.0), alone(1.0))\n"
VALUES = {"outer": 3.0, "alone": 2.0}
HEADER = "from gpbnb.arithmetic.kernels.compiling import compiled\n"
ADDED = {
    "inner.py": "from numba import njit\n\nFACTOR = 2.0\n\n\n@njit\ndef inner(x):\n    return FACTOR * x\n",
    "outer.py": HEADER + "from gpbnb.inner import inner\n\n\n@compiled\ndef outer(x):\n    return inner(x) + 1.0\n",
    "alone.py": HEADER + "\n\n@compiled\ndef alone(x):\n    return x + 1.0\n",
}


ENVIRONMENT = {key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "GPBNB_QUIET")}
# Python would take old bytecode for a source that changes within a second and keeps its size.
ENVIRONMENT["PYTHONDONTWRITEBYTECODE"] = "1"


@pytest.fixture(scope="module")
def server():
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", PROGRAM], env=ENVIRONMENT, cwd="/", **pipes) as process:
        yield process


@pytest.fixture
def copy(tmp_path, server):
    """A copy of the arithmetic, with three small modules beside it; `copy.run()` says what a process compiled."""
    package = tmp_path / "gpbnb"
    package.mkdir()
    for name in ("__init__.py", "caching.py", "clock.py", "names.py"):
        shutil.copy(caching.PACKAGE / name, package)
    shutil.copytree(
        caching.PACKAGE / "arithmetic", package / "arithmetic", ignore=shutil.ignore_patterns("__pycache__")
    )
    for name, text in ADDED.items():
        (package / name).write_text(text)

    class Copy:
        folder = package
        cache = tmp_path / "cache" / "compiled"
        with_product = False
        told = ""

        def __init__(self) -> None:
            self.environment = {"GPBNB_CACHE_DIR": str(tmp_path / "cache"), "XDG_CACHE_HOME": str(tmp_path / "next")}

        def run(self, first: str = "") -> dict:
            (found,) = self.run_at_once(1, first)
            return found

        def run_at_once(self, count: int, first: str = "") -> list[dict]:
            server.stdin.write(json.dumps([count, str(tmp_path), self.environment, self.with_product, first]) + "\n")
            server.stdin.flush()
            found = [json.loads(server.stdout.readline()) for _ in range(count)]
            self.told = "".join(each.pop("stderr") for each in found)
            return found

        def change(self, name: str, old: str, new: str) -> None:
            path = package / name
            text = path.read_text(encoding="utf-8")
            assert old in text
            path.write_text(text.replace(old, new), encoding="utf-8")

    return Copy()


def test_what_changed_is_compiled_again_and_nothing_else(copy):
    copy.with_product = True
    values = VALUES | {"product": 15.0}
    assert copy.run() == {"values": values, "compiled": ["outer", "alone", "product"]}
    assert copy.told.startswith("gpbnb: compiling for this processor.")
    assert str(copy.cache) in copy.told
    lines = [re.sub(r", \d+ s so far$", "", line) for line in copy.told.splitlines()[1:]]
    names = ("outer.outer", "alone.alone", "arithmetic.kernels.elementwise.product")
    assert [line.removeprefix("gpbnb: compiling function ") for line in lines] == [
        f"{number}, {name}" for number, name in enumerate(names, start=1)
    ]
    assert copy.run() == {"values": values, "compiled": []}
    assert copy.told == ""
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
    found = copy.run_at_once(2)
    assert found[0]["values"] == found[1]["values"] == VALUES
    assert sorted(found[0]["compiled"] + found[1]["compiled"]) == ["alone", "outer"]
    assert not list(copy.cache.glob("*.lock"))


def sealed(path: Path, content: bytes) -> bytes:
    """A file as it would be written with this content, which no damage explains."""
    return caching._seal(path, content) + content


DAMAGES = {
    "empty": lambda path, whole: b"",
    "cut in the seal": lambda path, whole: whole[:31],
    "only a seal": lambda path, whole: whole[:32],
    "cut": lambda path, whole: whole[:-1],
    "zeros": lambda path, whole: bytes(len(whole)),
    "zeros at the end": lambda path, whole: whole[: len(whole) // 2] + bytes(len(whole) - len(whole) // 2),
    "of the former format": lambda path, whole: whole[32:],
    "sealed, no pickle": lambda path, whole: sealed(path, b"no pickle"),
    "sealed, a number": lambda path, whole: sealed(path, pickle.dumps(7)),
    "sealed, three things": lambda path, whole: sealed(path, pickle.dumps((1, 2, 3))),
    "sealed, a missing class": lambda path, whole: sealed(path, b"cgpbnb.nowhere\nNothing\n."),
}


def test_a_damaged_file_is_compiled_again(copy):
    """A number stands for a changed bit in that tenth of the file, where pickled objects and machine code are."""
    copy.run()
    paths = sorted(copy.cache.glob("*.compiled"))
    assert len(paths) == 2
    for damage in (*DAMAGES, *range(10)):
        for path in paths:
            whole = path.read_bytes()
            if damage in DAMAGES:
                path.write_bytes(DAMAGES[damage](path, whole))
            else:
                at = (2 * damage + 1) * len(whole) // 20
                path.write_bytes(whole[:at] + bytes([whole[at] ^ 8]) + whole[at + 1 :])
        assert copy.run() == {"values": VALUES, "compiled": ["outer", "alone"]}, damage
        assert copy.run() == {"values": VALUES, "compiled": []}, damage


def test_files_that_changed_places_are_compiled_again(copy):
    copy.run()
    one, two = copy.cache.glob("*.compiled")
    first = one.read_bytes()
    one.write_bytes(two.read_bytes())
    two.write_bytes(first)
    assert copy.run() == {"values": VALUES, "compiled": ["outer", "alone"]}


def test_a_folder_in_place_of_a_file_costs_only_time(copy):
    copy.run()
    for path in copy.cache.glob("*.compiled"):
        path.unlink()
        path.mkdir()
    assert copy.run() == copy.run() == {"values": VALUES, "compiled": ["outer", "alone"]}


class Planted:
    """An object that writes a file when it is loaded."""

    def __init__(self, marker: Path) -> None:
        self._marker = marker

    def __reduce__(self):
        return open, (str(self._marker), "w")


@pytest.mark.skipif(caching.pwd is None, reason="no modes of files on this system")
@pytest.mark.parametrize("variable", ["GPBNB_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "NUMBA_CACHE_DIR"])
def test_a_file_planted_where_others_write_is_not_loaded(copy, tmp_path, variable):
    """Each owner and mode of a folder is tried in tests/test_caching.py."""
    kept = tmp_path / "kept"
    kept.mkdir(mode=0o700)
    marker = tmp_path / "marker"
    copy.environment |= {"GPBNB_CACHE_DIR": "", "XDG_CACHE_HOME": "", "HOME": str(tmp_path / "home")}
    copy.environment[variable] = str(kept)
    copy.environment["TMPDIR"] = str(tmp_path)  # the last folder that is tried is in it
    first = "import numba; numba.config.reload_config()" if variable == "NUMBA_CACHE_DIR" else ""
    assert copy.run(first)["compiled"] == ["outer", "alone"]
    paths = sorted(kept.rglob("*.compiled"))
    assert len(paths) == 2
    for path in paths:
        path.write_bytes(sealed(path, pickle.dumps(Planted(marker))))
    assert copy.run(first) == {"values": VALUES, "compiled": ["outer", "alone"]}
    assert marker.exists()  # the user's own files are loaded
    marker.unlink()
    for path in paths:
        path.write_bytes(sealed(path, pickle.dumps(Planted(marker))))
        path.chmod(0o666)
    assert copy.run(first) == {"values": VALUES, "compiled": ["outer", "alone"]}
    for path in paths:
        path.write_bytes(sealed(path, pickle.dumps(Planted(marker))))
    kept.chmod(0o777)
    assert copy.run(first) == {"values": VALUES, "compiled": ["outer", "alone"]}
    assert not marker.exists()
    told, notice, *_ = copy.told.splitlines()
    assert f"but others can write to {kept}; needed a folder that only you can write" in told
    assert str(kept) not in notice
    assert all(path.read_bytes().endswith(pickle.dumps(Planted(marker))) for path in paths)


@pytest.mark.parametrize("hidden", [False, True])
def test_a_process_that_runs_old_code_keeps_nothing(copy, hidden):
    """It has imported a constant, whose file changes before it first compiles; if `hidden`, keeping the old time."""
    path = copy.folder / "inner.py"
    old = path.read_text("utf-8")
    first = (
        "import gpbnb.inner, os, pathlib; inner = pathlib.Path(gpbnb.inner.__file__); then = inner.stat()\n"
        f"inner.write_text({old.replace('2.0', '1000.0')!r})\n"
    )
    if hidden:
        first += "os.utime(inner, (then.st_atime, then.st_mtime))"
    assert copy.run(first) == {"values": VALUES, "compiled": ["outer", "alone"]}
    assert copy.run() == {"values": VALUES | {"outer": 1001.0}, "compiled": ["outer"]}


def test_the_notice_can_be_turned_off(copy):
    copy.environment |= {"GPBNB_QUIET": "1"}
    assert copy.run()["compiled"] == ["outer", "alone"]
    assert copy.told == ""


def test_a_folder_that_cannot_be_written_to_is_left_out(copy, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.touch()
    no_folders = dict.fromkeys(("NUMBA_CACHE_DIR", "GPBNB_CACHE_DIR", "XDG_CACHE_HOME", "HOME"), str(blocked))
    environment = ENVIRONMENT | no_folders | {"TMPDIR": str(tmp_path), "PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", ALONE]
    found = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert found.stdout == "3.0 2.0\n"
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


@pytest.fixture
def one(tmp_path):
    """The cache of a function, and what another process would save there."""

    def half(x):
        return 0.5 * x

    dispatcher = numba.njit(half)
    dispatcher(1.0)
    caches = [compiling._Cache(half, tmp_path) for _ in range(2)]
    ((types, result),) = dispatcher.overloads.items()
    return *caches, types, result


def test_what_another_process_compiled_meanwhile_is_loaded(one, tmp_path, monkeypatch):
    """The other process saves its result while this one waits for the lock."""
    here, other, types, result = one
    released = []
    monkeypatch.setattr(compiling, "lock", lambda path, wait: other.save_overload(types, result))
    monkeypatch.setattr(compiling, "unlock", lambda path, file: released.append(path))
    monkeypatch.setattr(compiling, "_tell", lambda folder: pytest.fail("it would be compiled twice"))
    for _ in range(2):
        assert here.load_overload(types, cpu_target.target_context).entry_point(3.0) == 1.5
        assert released == list(tmp_path.glob("*.compiled"))
    here.flush()
    assert not list(tmp_path.iterdir())


def test_a_file_of_other_types_or_with_another_object_is_not_loaded(one):
    """Names of files are shortened digests, which may agree by chance."""
    here, _, types, result = one
    context = cpu_target.target_context
    key = here._index_key(types, context.codegen())
    path, whole = here._path(key), result._reduce()
    name, kind, (code, bits) = whole[0]
    assert kind == "object"
    for content, loaded in (
        ((key, whole), True),
        (("others", whole), False),
        ((key, 7), False),
        ((key, whole[1:]), False),
        ((key, ((name, kind, (code, b"no bitcode")), *whole[1:])), False),
        ((key, ((name, "unknown", bits), *whole[1:])), False),
    ):
        caching.write(path, dumps(content))
        assert (compiling._load(path, key, context) is not None) is loaded, content


@pytest.mark.parametrize(
    "code",
    ["from gpbnb import linalg; import gpbnb.filters.run", "from gpbnb.wordlength.__main__ import main; main(G)"],
)
def test_a_process_without_compilation_is_told_what_to_unset(code, tmp_path):
    """It ended in a TypeError about a call of a scalar operation."""
    (tmp_path / "model.toml").write_text("A = [[0.5]]\nB = [[1]]\n")
    given = f"G = [{str(tmp_path / 'model.toml')!r}, '--tolerance', '1', '--simulate', 'step']; "
    found = subprocess.run(
        [sys.executable, "-c", given + code],
        env=ENVIRONMENT | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        cwd=caching.PACKAGE.parent,
    )
    assert "got NUMBA_DISABLE_JIT=1 in the environment; needed compiled loops" in found.stderr.splitlines()[-1]
    assert ("Traceback" in found.stderr) is ("linalg" in code)
