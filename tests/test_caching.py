"""Where caches are kept, and what their keys depend on."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from gpbnb import caching

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted(caching.PACKAGE.rglob("*.py"))


def relative(files) -> set[str]:
    return {file.relative_to(caching.PACKAGE).as_posix() for file in files}


def named_by_parser(path: Path) -> set[Path]:
    """Files of the package that a file imports, found by Python's own parser."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name} imports relatively, which the scan for imports does not follow"
            names |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    below = [caching.PACKAGE.joinpath(*name.split(".")[1:]) for name in names if name.split(".")[0] == "gpbnb"]
    return {file for p in below for file in (p.with_name(f"{p.name}.py"), p / "__init__.py") if file.is_file()}


def test_the_scan_for_imports_finds_what_the_parser_finds():
    for path in SOURCES:
        assert named_by_parser(path) <= caching._named(path.read_bytes()), path
    assert len(SOURCES) > 80


def test_imported_follows_the_imports_of_imports():
    found = relative(caching.imported(caching.PACKAGE / "arithmetic" / "kernels" / "elementwise.py"))
    assert {"arithmetic/kernels/elementwise.py", "arithmetic/kernels/binary.py", "arithmetic/kernels/bits.py"} <= found
    assert not any(name.startswith(("kalman", "ledger", "display")) for name in found)


def test_a_digest_depends_on_names_and_contents_and_not_on_the_order(tmp_path):
    a, b, c = (tmp_path / name for name in "abc")
    a.write_text("1"), b.write_text("2"), c.write_text("1")
    assert caching.digest([a, b]) == caching.digest([b, a, b])
    assert len({caching.digest(files) for files in ([a], [b], [c], [a, b], [a, c], [])}) == 6


def folder_in(environment: dict[str, str], package: Path) -> str:
    """Ask a fresh interpreter, with a package copied elsewhere, where its cache is."""
    code = "from gpbnb.caching import cache_folder; print(cache_folder('x'))"
    known = {key: os.environ[key] for key in ("PATH", "LANG") if key in os.environ}
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, env=known | environment, cwd=package, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def installed(tmp_path):
    """The package as it is installed: no pyproject.toml beside it."""
    (tmp_path / "site" / "gpbnb").mkdir(parents=True)
    for name in ("__init__.py", "caching.py"):
        (tmp_path / "site" / "gpbnb" / name).write_bytes((caching.PACKAGE / name).read_bytes())
    return tmp_path / "site"


def test_each_folder_is_used_where_those_before_it_cannot_be(tmp_path, installed):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file, so that no folder can be made below it, not even by root")
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    every = {
        "GPBNB_CACHE_DIR": str(tmp_path / "own"),
        "XDG_CACHE_HOME": str(tmp_path / "xdg"),
        "HOME": str(tmp_path / "home"),
        "TMPDIR": str(temporary),
    }
    home_cache = "home/Library/Caches/gpbnb/x" if sys.platform == "darwin" else "home/.cache/gpbnb/x"
    expected = ["own/x", "xdg/gpbnb/x", home_cache]
    for key, place in zip(list(every), [tmp_path / each for each in expected], strict=False):
        assert folder_in(every, installed) == str(place)
        every[key] = str(blocked)
    assert folder_in(every, installed).startswith(str(temporary / "gpbnb-"))


def test_a_checkout_keeps_its_cache_to_itself(tmp_path, installed):
    (installed / "pyproject.toml").touch()
    assert folder_in({"HOME": str(tmp_path)}, installed) == str(installed / ".cache" / "gpbnb" / "x")


@pytest.mark.skipif(caching.fcntl is None, reason="no locks on this system")
def test_a_lock_is_waited_for_as_long_as_is_said(tmp_path):
    held, found = caching.lock(tmp_path / "x", 1.0), []
    waiting = threading.Thread(target=lambda: found.append(caching.lock(tmp_path / "x", 0.0)), daemon=True)
    waiting.start()
    waiting.join(5.0)
    caching.unlock(tmp_path / "x", held)
    assert found == [None]
