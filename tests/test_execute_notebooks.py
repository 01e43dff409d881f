"""Notebooks are executed again when something changes that their outputs depend on, and only then."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from gpbnb import caching

ROOT = Path(__file__).resolve().parents[1]
CODE = {
    "kernels": "from gpbnb.arithmetic.kernels import doubledouble\n\nprint(doubledouble.__name__)",
    "data": "from gpbnb.report.budget import theory\n\nprint(theory.__name__)",
}


@pytest.fixture
def copy(tmp_path):
    """A checkout with two small notebooks; `copy(*options)` runs the script and returns what it wrote."""
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("gpbnb", "scripts"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    (tmp_path / "book").mkdir()
    for name, code in CODE.items():
        cells = [nbformat.v4.new_markdown_cell("Prose.", id="a"), nbformat.v4.new_code_cell(code, id="b")]
        nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "book" / f"{name}.ipynb")
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "GPBNB_CACHE_DIR": str(tmp_path / "cache")}
    environment["XDG_CACHE_HOME"] = str(tmp_path / "other")
    paths = [str(tmp_path / "book" / f"{name}.ipynb") for name in CODE]

    def run(*options: str, status: int = 0) -> str:
        command = [sys.executable, "scripts/execute_notebooks.py", *options, *paths]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout + done.stderr

    run.root = tmp_path
    return run


def executed(text: str) -> set[str]:
    """Names of the notebooks that were executed, from the lines of progress."""
    return set(re.findall(r"^  \[\d+/\d+, \d+ s\] (\w+):", text, re.MULTILINE))


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_exactly_the_notebooks_that_depend_on_a_change_are_executed_again(copy):
    book, package = copy.root / "book", copy.root / "gpbnb"
    # A notebook that fails stays as it is, and the message says where it failed; the other's outputs are kept.
    change(book / "data.ipynb", "print(theory.__name__)", "print(1 / 0)")
    before = [path.read_bytes() for path in sorted(book.iterdir())]
    failed = copy(status=1)
    assert executed(failed) == {"kernels", "data"}
    assert "2 of 2 notebooks to execute" in failed
    assert "data: FAILED" in failed
    assert "ZeroDivisionError" in failed
    assert "1 / 0" in failed
    assert [path.read_bytes() for path in sorted(book.iterdir())] == before
    change(book / "data.ipynb", "print(1 / 0)", "print(theory.__name__)")
    first = copy()
    assert executed(first) == {"data"}
    assert "1 of 2 notebooks to execute" in first
    assert first.endswith("2 notebooks changed: kernels, data\n")
    assert copy("--check") == "2 notebooks compared with their stored outputs: 0 cells differ\n"
    change(book / "data.ipynb", "Prose.", "Other prose.")
    assert copy() == "0 notebooks changed\n"
    assert "Other prose." in (book / "data.ipynb").read_text()
    with (package / "arithmetic" / "kernels" / "doubledouble.py").open("a") as source:
        source.write("__name__ = 'another kernel'\n")
    wrong = copy("--check", status=1)
    assert executed(wrong) == {"kernels"}
    assert "kernels.ipynb, cell 1:" in wrong
    assert "+stdout: another kernel" in wrong
    # One notebook depends on the new data, the other has new code.
    with next((package / "report" / "budget").glob("*.csv")).open("a") as data:
        data.write("\n")
    change(book / "kernels.ipynb", "print(doubledouble.__name__)", "print(6 * 7)")
    assert executed(copy()) == {"kernels", "data"}
    assert '"42\\n"' in (book / "kernels.ipynb").read_text()
    # Neither damaged outputs are believed, nor any that another user could have written.
    for path in (copy.root / "cache" / "notebooks").glob("kernels.*.json"):
        path.write_bytes(path.read_bytes().replace(b"42", b"43"))
    assert executed(copy("--check")) == {"kernels"}
    (copy.root / "cache").chmod(0o777)
    told = copy("--check")
    assert executed(told) == {"kernels", "data"}
    assert f"but others can write to {copy.root / 'cache'}; needed a folder that only you can write" in told


def test_the_longest_are_named_and_start_first():
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        import execute_notebooks as script
    finally:
        sys.path.pop(0)
    paths = sorted((ROOT / "book").glob("*.ipynb"))
    assert {path.stem for path in paths} >= set(script.LONGEST)
    assert [path.stem for path in script._longest_first(paths)][: len(script.LONGEST)] == list(script.LONGEST)
    assert caching.PACKAGE.parent == ROOT
