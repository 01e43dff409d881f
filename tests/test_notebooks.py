"""The form of the notebooks. Their results are compared by nbval, which passes over a cell that was never run."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

BOOK = Path(__file__).resolve().parents[1] / "book"
PATHS = sorted(BOOK.glob("*.ipynb"))
MOST_LINES = 12
ABSOLUTE = re.compile(r"(?<![\w.:/<])/(home|root|Users|work|tmp|usr|opt|var|private|mnt|srv)/|\b[A-Z]:\\\\")
PICTURES = ("image/png", "image/svg+xml", "image/jpeg")


def code_cells(path: Path) -> list[dict]:
    return [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def texts(path: Path) -> list[str]:
    """Everything a reader sees of a notebook, pictures aside."""
    found = ["".join(cell["source"]) for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]]
    for cell in code_cells(path):
        for output in cell["outputs"]:
            found.append("".join(output.get("text", [])))
            data = output.get("data", {})
            found += ["".join(value) for kind, value in data.items() if kind.startswith("text/")]
    return found


each_notebook = pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)


def test_there_are_notebooks():
    assert PATHS


@each_notebook
def test_every_cell_was_executed_in_order(path):
    cells = code_cells(path)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))


@each_notebook
def test_no_cell_failed_or_warned(path):
    outputs = [output for cell in code_cells(path) for output in cell["outputs"]]
    assert [o for o in outputs if o["output_type"] == "error" or o.get("name") == "stderr"] == []


@each_notebook
def test_cells_are_short_and_define_nothing(path):
    for cell in code_cells(path):
        source = "".join(cell["source"])
        assert len([line for line in source.splitlines() if line.strip()]) <= MOST_LINES, source
        definitions = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
        assert not [node for node in ast.walk(ast.parse(source)) if isinstance(node, definitions)], source


@each_notebook
def test_no_path_of_one_machine(path):
    assert [text for text in texts(path) if ABSOLUTE.search(text)] == []


@each_notebook
def test_every_figure_has_alt_text_and_a_caption(path):
    for cell in code_cells(path):
        kinds = [kind for output in cell["outputs"] for kind in output.get("data", {})]
        # nbval compares the pixels of a glued picture, which differ between machines.
        assert not [kind for kind in kinds if kind.startswith("application/papermill.record/image")]
        if not set(kinds).isdisjoint(PICTURES):
            settings = cell["metadata"].get("mystnb", {})
            assert settings.get("image", {}).get("alt", "").strip(), "".join(cell["source"])
            assert settings.get("figure", {}).get("caption", "").strip(), "".join(cell["source"])
