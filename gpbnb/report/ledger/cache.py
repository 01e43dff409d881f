"""Findings that are kept between runs, in one file for each module of checks.

The name of a file contains a digest of everything on which its findings depend: the sources that the module imports,
directly or indirectly, the data next to them, the versions of the libraries, and the processor. If any of these
changes, a new file is used. Several processes share the files. While one process runs the checks of a module, the
others wait.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from gpbnb.caching import (
    cache_folder,
    changed_since_import,
    digest,
    environment,
    imported,
    locked,
    read,
    remove_unused,
    with_data,
    write,
)
from gpbnb.report.ledger.finding import Finding, Verdict
from gpbnb.report.ledger.statements import Statement

_LONGEST_WAIT = 600.0  # seconds


_FIELDS = tuple(field.name for field in fields(Finding))


class Findings:
    """The known findings of one module of checks."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._known = {} if path is None else _read(path)
        self._changed = False

    def get(self, statement: Statement) -> Finding | None:
        """The finding on a statement, or None if its check has not been run yet."""
        return self._known.get(_name(statement))

    def put(self, statement: Statement, finding: Finding) -> None:
        """Keep a finding."""
        self._known[_name(statement)] = finding
        self._changed = True

    def save(self) -> None:
        """Write the file if there are new findings."""
        if self._path is None or not self._changed:
            return
        content = {name: [getattr(each, field) for field in _FIELDS] for name, each in self._known.items()}
        write(self._path, json.dumps(content, default=lambda verdict: verdict.value).encode())


def known(module: Path) -> Findings:
    """Return the findings of a module of checks, for reading only.

    Parameters
    ----------
    module : the file of the module.
    """
    return Findings(_file(module))


@contextmanager
def shared(module: Path) -> Iterator[Findings]:
    """Yield the findings of a module of checks for additions, and save them; other processes wait."""
    path = _file(module)
    if path is None:
        yield Findings(None)
        return
    with locked(path, _LONGEST_WAIT):
        findings = Findings(path)
        try:
            yield findings
        finally:
            findings.save()


@lru_cache(maxsize=1)
def _folder() -> Path | None:
    folder = cache_folder("ledger")
    if folder is not None:
        remove_unused(folder)
    return folder


@cache
def _file(module: Path) -> Path | None:
    folder = _folder()
    if folder is None:
        return None
    sources = imported(module)
    files = with_data(sources)
    if changed_since_import(files):
        return None
    key = (digest(files), *environment(sources))
    return folder / f"{module.stem}.{hashlib.sha256(repr(key).encode()).hexdigest()[:24]}.json"


def _name(statement: Statement) -> str:
    return f"{statement.id} {hashlib.sha256(repr(statement).encode()).hexdigest()[:16]}"


def _read(path: Path) -> dict[str, Finding]:
    content = read(path)
    found = {} if content is None else json.loads(content)
    return {name: _finding(**dict(zip(_FIELDS, values, strict=True))) for name, values in found.items()}


def _finding(verdict: str, **others: Any) -> Finding:
    return Finding(verdict=Verdict(verdict), **others)
