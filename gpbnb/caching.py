"""Folders for results that are kept between runs, and digests of the sources that those results depend on."""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
"""The folder of the package."""

_IMPORT = re.compile(
    rb"""^[ \t]*(?: from [ \t]+ (?P<module>[\w.]+) [ \t]+ import [ \t]* (?P<names>\([^)]*\)|[^\n]*)
                 | import [ \t]+ (?P<plain>[^\n]*) )""",
    re.MULTILINE | re.VERBOSE,
)


def cache_folder(name: str) -> Path | None:
    """Find a folder that can be written to, and create it.

    The first that works of ``$GPBNB_CACHE_DIR``, ``.cache/gpbnb`` in a checkout, the user's folder for caches, and the
    system's folder for temporary files.

    Parameters
    ----------
    name : of the folder below, as in ``kernels``.

    Returns
    -------
    folder : None if none of them can be written to.
    """
    return next((base / name for base in _bases() if writable(base / name)), None)


def writable(folder: Path) -> bool:
    """Tell whether files can be written into a folder, which is created if need be."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _bases() -> Iterator[Path]:
    if named := os.environ.get("GPBNB_CACHE_DIR"):
        yield Path(named).absolute()
    checkout = PACKAGE.parent
    if (checkout / "pyproject.toml").is_file():
        yield checkout / ".cache" / "gpbnb"
    if user := os.environ.get("XDG_CACHE_HOME"):
        yield Path(user) / "gpbnb"
    try:
        home = Path.home()
    except RuntimeError:  # no home at all
        pass
    else:
        if sys.platform == "win32":
            yield Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "gpbnb" / "Cache"
        else:
            yield home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "gpbnb"
    temporary = Path(tempfile.gettempdir()) / f"gpbnb-{_user()}"
    try:
        temporary.mkdir(mode=0o700, exist_ok=True)
        # Anyone may have put a folder there, and what is cached is executed.
        if not hasattr(os, "getuid") or temporary.stat(follow_symlinks=False).st_uid == os.getuid():
            yield temporary
    except OSError:
        pass


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def digest(paths: Iterable[Path]) -> str:
    """Digest the names and contents of files, in any order; names count from the package's folder where they can."""
    found = hashlib.sha256()
    for path in sorted(set(paths)):
        name = path.relative_to(PACKAGE) if path.is_relative_to(PACKAGE) else path
        content = _content(path)
        found.update(f"{name.as_posix()} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()


def imported(path: Path) -> frozenset[Path]:
    """List a source file of the package, and all files of the package that it imports, directly or through others."""
    found: set[Path] = set()
    waiting = [path.resolve()]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting += _named(file) - found
    return frozenset(found)


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _named(path: Path) -> frozenset[Path]:
    """Files of the package that a source file names in its import statements."""
    names: set[str] = set()
    for match in _IMPORT.finditer(_content(path)):
        if match["module"]:
            module = match["module"].decode()
            names.add(module)
            names |= {f"{module}.{name}" for name in re.findall(r"\w+", match["names"].decode())}
        else:
            names |= set(re.findall(r"[\w.]+", match["plain"].decode()))
    files: set[Path] = set()
    for name in names:
        parts = name.split(".")
        if parts[0] == PACKAGE.name:
            below = PACKAGE.joinpath(*parts[1:])
            files |= {file for file in (below.with_name(f"{below.name}.py"), below / "__init__.py") if file.is_file()}
    return frozenset(files)
