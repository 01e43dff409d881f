"""The tests that concern a module, found from imports."""

from __future__ import annotations

import ast
from collections import deque
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from gpbnb.names import HOMES

#: Tests of the form of the project, and tests against what notebooks and sweeps stored. They judge no mutant.
NOT_JUDGES = (
    "tests/pages/",
    "tests/mutants/",
    "tests/test_api_pages.py",
    "tests/test_architecture.py",
    "tests/test_commands.py",
    "tests/test_distribution.py",
    "tests/test_environment.py",
    "tests/test_execute_notebooks.py",
    "tests/test_mutants_record.py",
    "tests/test_notebooks.py",
    "tests/test_prose.py",
    "tests/test_single_page.py",
    "tests/test_vocabulary.py",
    "tests/sweeps/test_sweeps_stored.py",
)


def module_of(path: Path, root: Path) -> str:
    """Name of a module from its file."""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def _imported(path: Path, package: str) -> tuple[str, ...]:
    return tuple(_names(path, package))


def _names(path: Path, package: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = package.split(".")
                base = ".".join([*parts[: len(parts) - node.level + 1], base]).rstrip(".")
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


class Concern:
    """Imports of the package and of its tests."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.modules = {module_of(path, root): path for path in sorted((root / "gpbnb").rglob("*.py"))}
        self._public = {f"gpbnb.{name}": home for name, home in HOMES.items()}
        self._below = {name: self._direct(path) for name, path in self.modules.items()}
        self.tests = [
            path
            for path in sorted((root / "tests").rglob("test_*.py"))
            if not str(path.relative_to(root)).startswith(NOT_JUDGES)
        ]
        self._needed = {path: self._helpers(path, set()) for path in self.tests}

    def _direct(self, path: Path) -> set[str]:
        inside = "gpbnb" in path.relative_to(self.root).parts
        package = module_of(path, self.root)
        if path.name != "__init__.py":
            package = package.rpartition(".")[0]
        names = set(_imported(path, package if inside else ""))
        names |= {self._public[name] for name in names if name in self._public}
        found = {name for name in names if name in self.modules and name != "gpbnb"}
        # The package that holds a module is imported with it.
        return found | {each.rpartition(".")[0] for each in found} & set(self.modules) - {"gpbnb"}

    def _helpers(self, path: Path, seen: set[Path]) -> set[str]:
        seen.add(path)
        found = self._direct(path)
        for name in _imported(path, ""):
            for folder in (path.parent, self.root / "tests"):
                helper = folder / f"{name.split('.')[0]}.py"
                if helper.is_file() and helper not in seen:
                    found |= self._helpers(helper, seen)
        return found

    def judges(self, module: str) -> list[Path]:
        """List test files that reach a module: those with its name first, then the nearest; its own topic counts."""
        if module == "gpbnb":  # whose names every test imports
            return [test for test in self.tests if test.parent == self.root / "tests"]
        topic, name = module.split(".")[1], module.split(".")[-1]
        ranked = []
        for test in self.tests:
            steps = self._distance(self._needed[test], module)
            if steps is not None:
                there = test.relative_to(self.root / "tests").parts[0] == topic
                named = there and name in test.stem.removeprefix(f"test_{topic}")
                ranked.append((0 if named else 1 + steps + (0 if there else 2), str(test), test))
        return [test for _, _, test in sorted(ranked)]

    def reaches(self, module: str, other: str) -> bool:
        """Whether a module imports another, itself included, directly or not."""
        return self._distance([module], other) is not None

    def _distance(self, start: Iterable[str], module: str) -> int | None:
        queue = deque((name, 0) for name in start)
        seen = set()
        while queue:
            name, steps = queue.popleft()
            if name == module:
                return steps
            if name not in seen:
                seen.add(name)
                queue.extend((below, steps + 1) for below in self._below.get(name, ()))
        return None
