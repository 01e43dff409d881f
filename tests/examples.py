"""The examples of README, docstrings and book as Python files."""

from __future__ import annotations

import ast
import doctest
import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "gpbnb"
_BLOCK = re.compile(r"^```\{?(?:python|code-cell)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)


def _of_text(path: Path) -> str:
    return "\n".join(_BLOCK.findall(path.read_text(encoding="utf-8")))


def _of_notebook(path: Path) -> str:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code") + "\n"


def _of_docstrings(path: Path) -> str:
    """Each docstring's examples as a function, after the names that its module defines."""
    parser, functions = doctest.DocTestParser(), []
    for node in ast.walk(tree := ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
            lines = [line for each in parser.get_examples(text) for line in each.source.splitlines()]
            if lines:
                body = "\n".join(f"    {line}" for line in lines)
                functions.append(f"def example_{node.__dict__.get('lineno', 0)}() -> None:\n{body}\n")
    if not functions:
        return ""
    names = [node.name for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    names += [
        each.id for node in tree.body if isinstance(node, ast.Assign) for each in node.targets if hasattr(each, "id")
    ]
    used = sorted(name for name in names if re.search(rf"\b{name}\b", "\n".join(functions)))
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    head = f"from {module} import {', '.join(used)}\n" if used else ""
    return head + "\n".join(functions)


def examples() -> dict[str, str]:
    """Python code by the name of the file for it."""
    found = {"readme": _of_text(ROOT / "README.md")}
    found |= {f"book_{path.stem}": _of_notebook(path) for path in sorted((ROOT / "book").glob("*.ipynb"))}
    found |= {f"book_{path.stem}": _of_text(path) for path in sorted((ROOT / "book").glob("*.md"))}
    for path in sorted(PACKAGE.rglob("*.py")):
        found["docs_" + "_".join(path.relative_to(PACKAGE).with_suffix("").parts)] = _of_docstrings(path)
    return {re.sub(r"\W", "_", name): code for name, code in found.items() if code.strip()}
