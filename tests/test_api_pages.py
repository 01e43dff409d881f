"""The API reference has a page for each public module, and no other."""

from __future__ import annotations

import ast
import importlib.util
from itertools import pairwise
from pathlib import Path

from gpbnb.names import HOMES, NAMED_FORMATS

ROOT = Path(__file__).resolve().parents[1]


def writer():
    spec = importlib.util.spec_from_file_location("write_api_pages", ROOT / "scripts" / "write_api_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_each_public_module_has_its_page_and_its_docstring():
    found = writer()
    modules = found.public_modules()
    pages = {path.stem: path.read_text(encoding="utf-8") for path in found.PAGES.glob("*.md")}
    assert pages == {module: found.page(module) for module in modules}, "run scripts/write_api_pages.py"
    assert [module for module, summary in modules.items() if not summary] == []


def test_the_page_for_engineers_lists_every_public_name():
    text = (ROOT / "book" / "api.md").read_text(encoding="utf-8")
    names = {*HOMES, "NAMED_FORMATS"} - set(NAMED_FORMATS)
    assert [name for name in sorted(names) if f"`{name} <" not in text] == []


def test_no_docstring_of_a_constant_is_read_as_a_type():
    """Napoleon takes what stands before a colon for the type of the constant."""
    found = []
    for path in (ROOT / "gpbnb").rglob("*.py"):
        if {"checks", "kernels"} & set(path.parts):
            continue
        text = path.read_text(encoding="utf-8")
        docs = [line for line in text.splitlines() if line.startswith("#: ")]
        for before, after in pairwise(ast.parse(text).body):
            if isinstance(before, ast.Assign | ast.AnnAssign) and isinstance(after, ast.Expr):
                docs.append(str(getattr(after.value, "value", "")).split("\n")[0])
        found += [f"{path.relative_to(ROOT)}: {doc}" for doc in docs if ": " in doc.removeprefix("#: ")]
    assert found == []
