"""The decorators of compiled functions, and the cache that keeps what was compiled.

Use :func:`compiled` for functions that Python calls, and :func:`inner` for those that only compiled functions call.

numba's own cache checks only the file that defines a function, and misses changes in other files whose functions are
compiled into it. Here the key of the cache covers all files that the defining file imports. Several processes can fill
the cache at the same time: they wait for each other and compile nothing twice.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import platform
import sys
from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path
from typing import IO, Any

import llvmlite
import numba
import numpy as np
from numba import njit
from numba.core import caching

from gpbnb.arithmetic.kernels.machine_code import generate_on_demand
from gpbnb.caching import cache_folder, changed_since_import, digest, imported, lock, remove_unused, unlock, writable

_VERSIONS = (numba.__version__, llvmlite.__version__, np.__version__, platform.python_version())
_LONGEST_WAIT = 240.0  # seconds, for another process that compiles the same function
_NOTICE = (
    "gpbnb: compiling for this processor. The first use of a function takes up to a minute; "
    "later runs load the result from {}.\n"
)


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function on its first call with given types, or load it from the cache.

    The compiled function releases Python's global interpreter lock.
    """
    dispatcher = njit(nogil=True, no_cfunc_wrapper=True)(function)
    sources = imported(Path(function.__code__.co_filename).resolve())
    if _folder() is not None and not changed_since_import(sources):
        dispatcher._cache = _Cache(function)
    return dispatcher


def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function into the compiled functions that call it.

    It gets no entry points for Python and C, which take longer to compile than a short function itself.

    Parameters
    ----------
    options : passed to numba's ``njit``.
    """
    decorate = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)
    return decorate if function is None else decorate(function)


@lru_cache(maxsize=1)
def _folder() -> Path | None:
    chosen = Path(numba.config.CACHE_DIR).absolute()
    return chosen if numba.config.CACHE_DIR and writable(chosen) else cache_folder("compiled")


@cache
def _stamp(path: Path) -> str:
    return digest(imported(path))


@lru_cache(maxsize=1)
def _tell(folder: Path) -> None:
    if not os.environ.get("GPBNB_QUIET"):
        sys.stderr.write(_NOTICE.format(folder))
        sys.stderr.flush()
    remove_unused(folder)


class _Locator(caching._CacheLocator):  # type: ignore[misc]
    def __init__(self, function: Any, file: str) -> None:
        self._py_file = file
        self._lineno = function.__code__.co_firstlineno
        self._folder = _folder()

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return _stamp(Path(self._py_file).resolve())

    def get_disambiguator(self) -> str:
        return str(self._lineno)

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator:
        return cls(function, file)


class _Implementation(caching.CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _Cache(caching.FunctionCache):  # type: ignore[misc]
    """numba's cache of a function, with one file for each set of types."""

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _Files(Path(self._cache_path), f"{function.__module__}.{function.__name__}", _stamp_of(self))

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        finally:
            self._cache_file.release()


def _stamp_of(cache: _Cache) -> tuple[str, ...]:
    return (cache._impl.locator.get_source_stamp(), *_VERSIONS)


class _Files:
    """Cache files with the methods that numba expects: load, save and flush."""

    def __init__(self, folder: Path, name: str, stamp: tuple[str, ...]) -> None:
        self._folder, self._name, self._stamp = folder, name, stamp
        self._locks: dict[Path, IO[bytes] | None] = {}

    def load(self, key: Any) -> Any:
        path = self._path(key)
        found = self._read(path, key)
        if found is None:
            if path not in self._locks:  # else it is still locked since a failed compilation
                self._locks[path] = lock(path, _LONGEST_WAIT)
            found = self._read(path, key)
            if found is None:
                generate_on_demand()
                _tell(self._folder)
            else:
                self.release()
        return found

    def save(self, key: Any, data: Any) -> None:
        path = self._path(key)
        draft = path.with_name(f"{path.name}.{os.getpid()}.tmp")
        try:
            draft.write_bytes(caching.dumps((self._stamp, key, data)))
            draft.replace(path)
        except OSError:  # a full disk only costs time
            draft.unlink(missing_ok=True)

    def flush(self) -> None:
        for path in self._folder.glob(f"{self._name}.*.compiled"):
            path.unlink(missing_ok=True)

    def release(self) -> None:
        """Unlock the files, so that waiting processes can read them."""
        while self._locks:
            unlock(*self._locks.popitem())

    def _path(self, key: Any) -> Path:
        # Two keys may share a name, because the file also contains the key.
        short = hashlib.sha256(repr((self._stamp, str(key))).encode()).hexdigest()[:24]
        return self._folder / f"{self._name}.{short}.compiled"

    def _read(self, path: Path, key: Any) -> Any:
        try:
            stamp, stored, data = pickle.loads(path.read_bytes())
        except OSError:
            return None
        except Exception:  # truncated, or written by another version: compile again
            return None
        if stamp != self._stamp or stored != key:
            return None
        with contextlib.suppress(OSError):
            os.utime(path)
        return data
