"""Folders and files for results kept between runs, and digests of the sources on which those results depend.

Cached functions are executed, so folders and files are used only if nobody but the user can write them.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import IO

from gpbnb.clock import IMPORTED
from gpbnb.names import HOMES

try:
    import fcntl
except ImportError:  # on Windows, processes do not wait for each other
    fcntl = None  # type: ignore[assignment]
try:
    import grp
    import pwd
except ImportError:  # on Windows, access lists protect the user's folders
    pwd = None  # type: ignore[assignment]

PACKAGE = Path(__file__).resolve().parent
"""The folder of the package."""

_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_READING = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
_SEAL = hashlib.sha256().digest_size
_IMPORTED = IMPORTED
_KEPT = 30 * 24 * 3600.0  # seconds after the last use
_MOST_LINKS = 40  # in one path, as in Linux
_WARNING = (
    "gpbnb: got a cache in {}, but {}; needed a folder that only you can write, because cached code is executed; "
    "remove it, or set GPBNB_CACHE_DIR to another folder\n"
)

_IMPORT = re.compile(
    rb"""^[ \t]*(?: from [ \t]+ (?P<module>[\w.]+) [ \t]+ import [ \t]* (?P<names>\([^)]*\)|[^\n]*)
                 | import [ \t]+ (?P<plain>[^\n]*) )""",
    re.MULTILINE | re.VERBOSE,
)


def cache_folder(name: str, first: str = "") -> Path | None:
    """Find a writable folder that no other user can write to, and create it if necessary.

    The first such folder is used: `first`, then the subfolder `name` of ``$GPBNB_CACHE_DIR``, of ``.cache/gpbnb`` in a
    checkout, of the user's folder for caches, or of the system's folder for temporary files. If others can write to a
    folder, one line on stderr says so, and the next one is used.

    Parameters
    ----------
    name : name of the subfolder, as in ``kernels``.
    first : path of another folder, or an empty string.

    Returns
    -------
    folder : None if there is no such folder.
    """
    if first and _usable(Path(first).absolute()):
        return Path(first).absolute()
    return next((base / name for base in _bases() if _usable(base) and _usable(base / name)), None)


def _usable(folder: Path) -> bool:
    """Tell whether this user and no other can write to a folder; create it if necessary."""
    flaw = _flaw(folder)
    if flaw is None:
        try:
            for each in (*reversed(folder.parents), folder):
                each.mkdir(mode=0o700, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            return False
        flaw = _flaw(folder)  # others may have created it meanwhile
    if flaw is not None:
        _warn(_WARNING.format(folder, flaw))
    return flaw is None


@cache
def _warn(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()


def _flaw(folder: Path) -> str | None:
    """Say how other users could change a folder, or replace a folder or a link on the path to it."""
    if pwd is None:
        return None
    user, links = os.geteuid(), 0
    place, waiting = Path(folder.anchor), list(reversed(folder.parts[1:]))
    try:
        while waiting:
            if (name := waiting.pop()) == "..":
                place = place.parent
                continue
            status = (place / name).lstat()
            if status.st_uid not in (0, user):
                return _belongs(place / name, status)
            if not stat.S_ISLNK(status.st_mode):
                place /= name
                if waiting and _replaceable(status):
                    return f"others can write to {place}"
                continue
            target, links = Path(os.readlink(place / name)), links + 1
            if links > _MOST_LINKS:
                return f"{place / name} is a link to itself"
            place = Path(target.anchor) if target.is_absolute() else place
            waiting += reversed(target.parts[1:] if target.is_absolute() else target.parts)
        status = place.lstat()
    except OSError:  # it does not exist yet, or cannot be reached
        return None
    if status.st_uid != user:
        return _belongs(place, status)
    return f"others can write to {place}" if status.st_mode & _BY_OTHERS else None


def _belongs(place: Path, status: os.stat_result) -> str:
    return f"{place} belongs to the user with the number {status.st_uid}"


def _replaceable(status: os.stat_result) -> bool:
    """Tell whether other users can replace what is in a folder."""
    if status.st_mode & stat.S_ISVTX:  # they can only replace what belongs to them
        return False
    return bool(status.st_mode & stat.S_IWOTH or (status.st_mode & stat.S_IWGRP and not _private(status.st_gid)))


@cache
def _private(group: int) -> bool:
    """Tell whether a group is the one that many systems create for each user alone."""
    try:
        user, found = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except KeyError:
        return False
    alone = user.pw_gid == group and found.gr_name == user.pw_name and set(found.gr_mem) <= {user.pw_name}
    return alone and user.pw_uid != 0  # the group of root has others in some containers


def read(path: Path) -> bytes | None:
    """Read a file that :func:`write` wrote.

    Returns
    -------
    content : None if the file is missing or damaged, belongs to another user, or if others can write to it.
    """
    try:
        with open(os.open(path, _READING), "rb") as file:
            status = os.fstat(file.fileno())
            if pwd is not None and (status.st_uid != os.geteuid() or status.st_mode & _BY_OTHERS):
                return None
            found = file.read()
    except OSError:
        return None
    seal, content = found[:_SEAL], found[_SEAL:]
    if seal != _seal(path, content):
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    return content


def write(path: Path, content: bytes) -> None:
    """Write a file that only this user can read, as a whole or not at all; a full disk is no error."""
    with contextlib.suppress(OSError):
        number, draft = tempfile.mkstemp(".tmp", f"{path.name}.", path.parent)
        try:
            with open(number, "wb") as file:
                file.write(_seal(path, content) + content)
            os.replace(draft, path)
        except OSError:
            os.unlink(draft)


def replace_file(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all: on a full disk, what it held stays.

    Raises
    ------
    OSError : the file cannot be written.
    """
    path = path.resolve()
    draft = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        draft.write_bytes(content)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def _seal(path: Path, content: bytes) -> bytes:
    """Digest the name and the content of a file, so that a damaged or a renamed one is recognised."""
    return hashlib.sha256(path.name.encode() + b"\0" + content).digest()


def _bases() -> Iterator[Path]:
    if named := os.environ.get("GPBNB_CACHE_DIR"):
        yield Path(named).absolute()
    checkout = PACKAGE.parent
    if (checkout / "pyproject.toml").is_file():
        yield checkout / ".cache" / "gpbnb"
    if user := os.environ.get("XDG_CACHE_HOME"):
        yield Path(user).absolute() / "gpbnb"
    try:
        home = Path.home().absolute()
    except RuntimeError:  # there is no home folder
        pass
    else:
        if sys.platform == "win32":
            yield Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "gpbnb" / "Cache"
        else:
            yield home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "gpbnb"
    yield Path(tempfile.gettempdir()) / f"gpbnb-{_user()}"


def _user() -> str:
    return str(os.geteuid()) if pwd is not None else os.environ.get("USERNAME", "user")


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
    began = time.monotonic()
    while True:
        try:
            handle = _beside(path).open("wb")
        except OSError:
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Its last holder may have removed the file after it was opened here.
            if os.path.samestat(os.fstat(handle.fileno()), _beside(path).stat()):
                return handle
        except (BlockingIOError, FileNotFoundError):
            pass
        except OSError:  # this file system has no locks
            handle.close()
            return None
        handle.close()
        if time.monotonic() - began > longest_wait:
            return None
        time.sleep(0.05)


def unlock(path: Path, handle: IO[bytes] | None) -> None:
    """Release the lock of a file."""
    if handle is not None:
        _beside(path).unlink(missing_ok=True)
        handle.close()


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


def changed_since_import(paths: Iterable[Path]) -> bool:
    """Tell whether a file changed after this process imported the package, so that the process may run old code."""
    return any(_changed(path.stat()) > _IMPORTED for path in paths)


def _changed(status: os.stat_result) -> float:
    """Time of the last change of a file; a file that replaces another may bring an old time of modification along."""
    return status.st_mtime if sys.platform == "win32" else max(status.st_mtime, status.st_ctime)


def imported(path: Path) -> frozenset[Path]:
    """List a source file of the package and all files of the package that it imports, directly or indirectly."""
    found: set[Path] = set()
    waiting = [path.resolve()]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting += _named(_content(file)) - found
    return frozenset(found)


@cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


@cache
def _imports(code: bytes) -> frozenset[str]:
    """List all names in the import statements of some code that may be modules."""
    names: set[str] = set()
    for match in _IMPORT.finditer(code):
        if match["module"]:
            module, given = match["module"].decode(), match["names"].decode()
            names.add(module)
            names |= {f"{module}.{name}" for name in re.findall(r"\w+", given)}
            whole = module == PACKAGE.name and given.strip() == "*"
        else:
            plain = set(re.findall(r"[\w.]+", match["plain"].decode()))
            names |= plain
            whole = PACKAGE.name in plain
        if whole:  # any public name may be used
            names |= set(HOMES.values())
    return frozenset(names)


@cache
def _named(code: bytes) -> frozenset[Path]:
    """List the files of the package that some code names in its import statements."""
    files: set[Path] = set()
    for name in _imports(code):
        name = HOMES.get(name.removeprefix(f"{PACKAGE.name}."), name)
        parts = name.split(".")
        if parts[0] == PACKAGE.name:
            below = PACKAGE.joinpath(*parts[1:])
            files |= {file for file in (below.with_name(f"{below.name}.py"), below / "__init__.py") if file.is_file()}
    return frozenset(files)
