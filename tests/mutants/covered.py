"""Which tests execute a line of the package, measured by coverage.py in one run of all tests."""

from __future__ import annotations

import ast
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import coverage
import pytest


class _Contexts:
    """Names the test that runs to coverage.py. What fixtures do concerns all tests of their file."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self.measured = measured
        self.seconds: dict[str, float] = {}

    def pytest_runtest_setup(self, item: Any) -> None:
        self.measured.switch_context(item.nodeid.partition("::")[0])

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: Any) -> Any:
        self.measured.switch_context(item.nodeid)
        began = time.process_time()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = round(time.process_time() - began, 2)
            self.measured.switch_context(item.nodeid.partition("::")[0])


def measure(root: Path, tests: Sequence[str], file: Path) -> None:
    """Run tests in this process, and write the lines of the package that each executes, and its time."""
    os.chdir(root)
    sys.path.insert(0, str(root))
    measured = coverage.Coverage(data_file=None, config_file=False, include=[str(root / "gpbnb" / "*")])
    contexts = _Contexts(measured)
    measured.start()
    pytest.main(["-q", "-o", "console_output_style=count", *tests], plugins=[contexts])
    measured.stop()
    data = measured.get_data()
    lines = {
        str(Path(name).relative_to(root)): {
            str(line): sorted(filter(None, found)) for line, found in data.contexts_by_lineno(name).items()
        }
        for name in data.measured_files()
    }
    draft = file.with_suffix(".draft")
    draft.write_text(json.dumps({"lines": lines, "seconds": contexts.seconds}), encoding="utf-8")
    draft.replace(file)


class Covered:
    """The tests that execute a statement, from a file of :func:`measure`."""

    def __init__(self, file: Path) -> None:
        found = json.loads(file.read_text(encoding="utf-8"))
        self._lines: dict[str, dict[str, list[str]]] = found["lines"]
        self.seconds: dict[str, float] = found["seconds"]

    def tests(self, name: str, source: str, line: int) -> set[str]:
        """Tests, and files whose fixtures do, that execute the statement of a line, or use what it defines."""
        executed = self._lines.get(name, {})
        return {test for each in statement(source, line) or uses(source, line) for test in executed.get(str(each), ())}


def statement(source: str, line: int) -> range:
    """The lines of the innermost statement at a line of a function; of a compound one, only its head."""
    found = range(0)
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef | ast.Lambda):
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.stmt) and node is not function and node.lineno <= line <= (node.end_lineno or line):
                inner = getattr(node, "body", None) or getattr(node, "cases", None)
                first = inner[0] if inner else None
                end = (node.end_lineno or line) + 1
                if first is not None:
                    end = max(getattr(first, "lineno", None) or first.pattern.lineno, node.lineno + 1)
                found = range(node.lineno, end)
    return found


def uses(source: str, line: int) -> set[int]:
    """The lines of functions that use what the statement of a line outside functions defines."""
    module = ast.parse(source)
    names = set()
    for node in module.body:
        if node.lineno <= line <= (node.end_lineno or line):
            stored = (each for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store))
            names = {node.name} if isinstance(node, ast.ClassDef) else {each.id for each in stored}
    functions = (each for each in ast.walk(module) if isinstance(each, ast.FunctionDef))
    inside = (each for function in functions for part in function.body for each in ast.walk(part))
    return {each.lineno for each in inside if isinstance(each, ast.Name) and each.id in names}


if __name__ == "__main__":
    measure(Path(sys.argv[1]), sys.argv[3:], Path(sys.argv[2]))
