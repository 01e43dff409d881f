"""Notebooks are executed again when something changes that their outputs depend on, and only then."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

import nbformat
import pytest

from gpbnb import caching

ROOT = Path(__file__).resolve().parents[1]
CODE = {
    "clock": "from gpbnb import clock\n\nprint(clock.__name__)",
    "data": "from gpbnb.report.budget import theory\n\n"
    'print(theory.__name__)\nprint(open("../tests/count.txt").read())',
}


@pytest.fixture
def script():
    """The script as a module."""
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        import execute_notebooks
    finally:
        sys.path.pop(0)
    return execute_notebooks


@pytest.fixture
def copy(tmp_path, monkeypatch, script, capsys):
    """A checkout with two small notebooks; `copy(*options)` runs the script and returns what it wrote.

    `copy.keys()` gives the keys of the notebooks, which change with all that their outputs depend on.
    """
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("gpbnb", "scripts"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    for name in ("book", "tests"):
        (tmp_path / name).mkdir()
    (tmp_path / "tests" / "count.txt").write_text("41", encoding="utf-8")
    for name, code in CODE.items():
        cells = [nbformat.v4.new_markdown_cell("Prose.", id="a"), nbformat.v4.new_code_cell(code, id="b")]
        nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "book" / f"{name}.ipynb")
    for name, value in {
        "PYTHONPATH": tmp_path,
        "GPBNB_CACHE_DIR": tmp_path / "cache",
        "XDG_CACHE_HOME": tmp_path / "other",
    }.items():
        monkeypatch.setenv(name, str(value))
    # What the script computes in this process is about the copy, as in the processes that it starts.
    monkeypatch.setattr(script, "ROOT", tmp_path)
    monkeypatch.setattr(script, "BOOK", tmp_path / "book")
    monkeypatch.setattr(script, "__file__", str(tmp_path / "scripts" / "execute_notebooks.py"))
    monkeypatch.setattr(caching, "PACKAGE", tmp_path / "gpbnb")
    paths = {name: tmp_path / "book" / f"{name}.ipynb" for name in CODE}

    def fresh() -> None:
        caching.forget()
        caching._named.cache_clear()

    def run(*options: str, status: int = 0, names: Iterable[str] = CODE) -> str:
        fresh()
        capsys.readouterr()
        assert script.main([*options, *(str(paths[name]) for name in names)]) == status
        return "".join(capsys.readouterr())

    def keys() -> dict[str, str]:
        fresh()
        return {name: script.key_of(nbformat.read(path, as_version=4)) for name, path in paths.items()}

    run.root, run.keys = tmp_path, keys
    yield run
    fresh()


def executed(text: str) -> set[str]:
    """Names of the notebooks that were executed, from the lines of progress."""
    return set(re.findall(r"^  \[\d+/\d+, \d+ s\] (\w+):", text, re.MULTILINE))


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_exactly_the_notebooks_that_depend_on_a_change_have_another_key(copy):
    book, package = copy.root / "book", copy.root / "gpbnb"

    def changed_by(change):
        before = copy.keys()
        change()
        after = copy.keys()
        return {name for name in CODE if before[name] != after[name]}

    def append(path, text):
        with path.open("a", encoding="utf-8") as file:
            file.write(text)

    assert changed_by(lambda: change(book / "data.ipynb", "Prose.", "Other prose.")) == set()
    # A file outside the package counts if the code of a notebook names it.
    assert changed_by(lambda: change(copy.root / "tests" / "count.txt", "41", "43")) == {"data"}
    assert changed_by(lambda: append(package / "clock.py", "# \n")) == {"clock"}
    assert changed_by(lambda: append(next((package / "report" / "budget").glob("*.csv")), "\n")) == {"data"}
    assert changed_by(lambda: append(package / "report" / "budget" / "theory.py", "# \n")) == {"data"}
    assert changed_by(lambda: change(book / "clock.ipynb", "print(", "print(1, ")) == {"clock"}
    assert changed_by(lambda: append(package / "report" / "rolling" / "theory.py", "# \n")) == set()


def test_notebooks_are_executed_if_their_key_is_new_or_their_outputs_cannot_be_trusted(copy):
    book = copy.root / "book"
    # A notebook that fails stays as it is, and the message says where it failed; the other's outputs are kept.
    change(book / "data.ipynb", "print(theory.__name__)", "print(1 / 0)")
    before = [path.read_bytes() for path in sorted(book.iterdir())]
    failed = copy(status=1)
    assert executed(failed) == {"clock", "data"}
    assert "2 of 2 notebooks to execute" in failed
    assert "data: FAILED" in failed
    assert "ZeroDivisionError" in failed
    assert "1 / 0" in failed
    assert [path.read_bytes() for path in sorted(book.iterdir())] == before
    change(book / "data.ipynb", "print(1 / 0)", "print(theory.__name__)")
    first = copy()
    assert executed(first) == {"data"}
    assert "1 of 2 notebooks to execute" in first
    assert first.endswith("2 notebooks changed: clock, data\n")
    assert copy("--check") == "2 notebooks compared with their stored outputs: 0 cells differ\n"
    change(book / "data.ipynb", "Prose.", "Other prose.")
    assert copy() == "0 notebooks changed\n"
    assert "Other prose." in (book / "data.ipynb").read_text()
    # A file outside the package and a source change the outputs; stored ones are compared with them, and replaced.
    change(copy.root / "tests" / "count.txt", "41", "43")
    with (copy.root / "gpbnb" / "clock.py").open("a") as source:
        source.write("__name__ = 'another module'\n")
    wrong = copy("--check", status=1)
    assert executed(wrong) == {"clock", "data"}
    assert "\n+43\n" in wrong
    assert "clock.ipynb, cell 1:" in wrong
    assert "+stdout: another module" in wrong
    assert copy().endswith("2 notebooks changed: clock, data\n")
    assert '"another module\\n"' in (book / "clock.ipynb").read_text()
    # Damaged outputs are not believed.
    for path in (copy.root / "cache" / "notebooks").glob("clock.*.json"):
        path.write_bytes(path.read_bytes().replace(b"another", b"a wrong"))
    assert executed(copy("--check", names=["clock"])) == {"clock"}
    # Neither are those that another user could have written.
    assert executed(copy("--check", names=["clock"])) == set()
    (copy.root / "cache").chmod(0o777)
    told = copy("--check", names=["clock"])
    assert executed(told) == {"clock"}
    assert f"but others can write to {copy.root / 'cache'}; needed a folder that only you can write" in told


def test_another_picture_is_a_difference(script, tmp_path):
    def drawn(picture):
        output = nbformat.v4.new_output("display_data", {"image/svg+xml": picture, "text/plain": "<Figure>"})
        return nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("draw()", outputs=[output], id="a")])

    nbformat.write(drawn("<svg>1</svg>"), tmp_path / "page.ipynb")
    assert script.differences(tmp_path / "page.ipynb", drawn("<svg>1</svg>")) == []
    (told,) = script.differences(tmp_path / "page.ipynb", drawn("<svg>2</svg>"))
    assert re.search(r"\n-image/svg\+xml: picture \w{12}\n\+image/svg\+xml: picture \w{12}\n", told)


def test_the_longest_are_named_and_start_first(script):
    paths = sorted((ROOT / "book").glob("*.ipynb"))
    assert {path.stem for path in paths} >= set(script.LONGEST)
    assert [path.stem for path in script._longest_first(paths)][: len(script.LONGEST)] == list(script.LONGEST)
    assert caching.PACKAGE.parent == ROOT
