"""Folders for results kept between runs, and digests of the sources on which those results depend."""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.metadata import distributions
from pathlib import Path
from typing import IO

import llvmlite.binding as llvm

try:
    import fcntl
except ImportError:  # on Windows, processes do not wait for each other
    fcntl = None  # type: ignore[assignment]

PACKAGE = Path(__file__).resolve().parent
"""The folder of the package."""

_SETTINGS = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE")
_NO_DATA = (".py", ".pyc", ".tmp", ".lock")
_IMPORTED = time.time()
_KEPT = 30 * 24 * 3600.0  # seconds after the last use

_IMPORT = re.compile(
    rb"""^[ \t]*(?: from [ \t]+ (?P<module>[\w.]+) [ \t]+ import [ \t]* (?P<names>\([^)]*\)|[^\n]*)
                 | import [ \t]+ (?P<plain>[^\n]*) )""",
    re.MULTILINE | re.VERBOSE,
)


def cache_folder(name: str) -> Path | None:
    """Find a writable folder, and create it if necessary.

    The first writable one is used: ``$GPBNB_CACHE_DIR``, ``.cache/gpbnb`` in a checkout, the user's folder for caches,
    or the system's folder for temporary files.

    Parameters
    ----------
    name : name of the subfolder, as in ``kernels``.

    Returns
    -------
    folder : None if none of them can be written to.
    """
    return next((base / name for base in _bases() if writable(base / name)), None)


def writable(folder: Path) -> bool:
    """Tell whether a folder is writable; create it if necessary."""
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
    except RuntimeError:  # there is no home folder
        pass
    else:
        if sys.platform == "win32":
            yield Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "gpbnb" / "Cache"
        else:
            yield home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "gpbnb"
    temporary = Path(tempfile.gettempdir()) / f"gpbnb-{_user()}"
    try:
        temporary.mkdir(mode=0o700, exist_ok=True)
        # Anyone may have created a folder there, and cached files are executed.
        if not hasattr(os, "getuid") or temporary.stat(follow_symlinks=False).st_uid == os.getuid():
            yield temporary
    except OSError:
        pass


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def remove_unused(folder: Path) -> None:
    """Remove the files of a folder that have not been used for a month; every use updates a file's time."""
    with contextlib.suppress(OSError):
        for file in folder.iterdir():
            if file.is_file() and time.time() - file.stat().st_mtime > _KEPT:
                file.unlink(missing_ok=True)


def lock(path: Path, longest_wait: float) -> IO[bytes] | None:
    """Wait until no other process holds the lock of a file, then take it; :func:`unlock` releases it.

    Parameters
    ----------
    path : the file; the lock is a separate file next to it.
    longest_wait : seconds after which to continue without the lock.

    Returns
    -------
    handle : None if the system has no locks or if the wait was too long.
    """
    if fcntl is None:
        return None
    try:
        handle = _beside(path).open("wb")
    except OSError:
        return None
    began = time.monotonic()
    while True:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            if time.monotonic() - began > longest_wait:
                handle.close()
                return None
            time.sleep(0.05)
        else:
            return handle


def unlock(path: Path, handle: IO[bytes] | None) -> None:
    """Release the lock of a file."""
    if handle is not None:
        _beside(path).unlink(missing_ok=True)
        handle.close()


@contextlib.contextmanager
def locked(path: Path, longest_wait: float) -> Iterator[None]:
    """Hold the lock of a file within a ``with`` block; see :func:`lock`."""
    handle = lock(path, longest_wait)
    try:
        yield
    finally:
        unlock(path, handle)


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}.lock")


def digest(paths: Iterable[Path]) -> str:
    """Digest the names and contents of files, in any order; names are relative to the package's folder if possible."""
    found = hashlib.sha256()
    for path in sorted(set(paths)):
        name = path.relative_to(PACKAGE) if path.is_relative_to(PACKAGE) else path
        content = _content(path)
        found.update(f"{name.as_posix()} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()


@cache
def environment() -> tuple[str, ...]:
    """Describe what a result may depend on besides sources and data: Python, the installed packages, the processor."""
    packages = sorted({f"{each.name}=={each.version}" for each in distributions()})
    features = sorted(name for name, there in llvm.get_host_cpu_features().items() if there)
    settings = [f"{name}={os.environ.get(name, '')}" for name in _SETTINGS]
    machine = (platform.system(), platform.machine(), llvm.get_host_cpu_name(), *features)
    return platform.python_version(), *machine, *settings, *packages


def changed_since_import(paths: Iterable[Path]) -> bool:
    """Tell whether a file changed after this process imported the package, so that the process may run old code."""
    return any(path.stat().st_mtime > _IMPORTED for path in paths)


def imported(path: Path) -> frozenset[Path]:
    """List a source file of the package and all files of the package that it imports, directly or indirectly."""
    return _following([path.resolve()])


def imported_by(code: str) -> frozenset[Path]:
    """List all files of the package that some code imports, directly or indirectly."""
    return _following(_named(code.encode()))


def _following(first: Iterable[Path]) -> frozenset[Path]:
    found: set[Path] = set()
    waiting = list(first)
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting += _named(_content(file)) - found
    return frozenset(found)


def with_data(sources: Iterable[Path]) -> frozenset[Path]:
    """Add the data files next to source files."""
    found = set(sources)
    for folder in {path.parent for path in found}:
        found |= {path for path in folder.iterdir() if path.is_file() and path.suffix not in _NO_DATA}
    return frozenset(found)


def forget() -> None:
    """Forget all digests, so that files are read again for the next digest."""
    _content.cache_clear()


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _named(code: bytes) -> frozenset[Path]:
    """List the files of the package that some code names in its import statements."""
    names: set[str] = set()
    for match in _IMPORT.finditer(code):
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
