"""The decorators of compiled functions, and the cache that keeps what was compiled.

Use :func:`compiled` for functions that Python calls, and :func:`inner` or :func:`borrowing` for those that only
compiled functions call.

numba's own cache checks only the file that defines a function, and misses changes in other files whose functions are
compiled into it. It ends a run if a file is damaged, and it can return a function for other types after two processes
have filled it at the same time. Here a file contains one function for one set of types, and its name depends on all
files that the defining file imports. Several processes wait for each other and compile nothing twice.
"""

from __future__ import annotations

import gc
import hashlib
import itertools
import os
import pickle
import platform
import sys
import time
from collections.abc import Callable
from functools import cache, lru_cache
from pathlib import Path
from typing import IO, Any

import llvmlite
import numba
import numpy as np
from numba import njit
from numba.core.caching import FunctionCache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from gpbnb.arithmetic.kernels.machine_code import generate_on_demand
from gpbnb.caching import cache_folder, changed_since_import, digest, imported, lock, read, remove_unused, unlock, write

if numba.config.DISABLE_JIT:
    raise ImportError(
        "got NUMBA_DISABLE_JIT=1 in the environment; needed compiled loops: gpbnb has no others; unset it"
    )

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
    dispatcher._compiler.compile = _without_collection(dispatcher._compiler.compile)
    sources = imported(Path(function.__code__.co_filename).resolve())
    folder = _folder()
    if folder is not None and not changed_since_import(sources):
        dispatcher._cache = _Cache(function, folder)
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


def borrowing(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function like :func:`inner` that counts no references to the arrays of its callers.

    Counting took almost half of the time of a filter's step. The function must neither make nor return arrays, nor
    call one that returns arrays, except for those that borrow, too: numba would release what was never counted.
    """
    return inner(function, _nrt=False, **options)


def _without_collection(compile_: Callable[..., Any]) -> Callable[..., Any]:
    """Compile without Python's garbage collector, which takes a tenth of the time and finds little."""

    def compile_at_once(*arguments: Any) -> Any:
        enabled = gc.isenabled()
        gc.disable()
        try:
            return compile_(*arguments)
        finally:
            if enabled:
                gc.enable()

    return compile_at_once


def is_compiled(function: Any, *arguments: Any) -> bool:
    """Tell whether a :func:`compiled` function need not be compiled for arguments of these types."""
    types = tuple(map(function.typeof_pyval, arguments))
    if types in function.overloads:
        return True
    return isinstance(function._cache, _Cache) and function._cache.holds(types, function.targetctx)


@lru_cache(maxsize=1)
def _folder() -> Path | None:
    return cache_folder("compiled", numba.config.CACHE_DIR)


@cache
def _stamp(path: Path) -> str:
    return digest(imported(path))


@lru_cache(maxsize=1)
def _begin(folder: Path) -> float:
    """Say where compiled functions are kept, remove those that were not used for long, and return the time."""
    if not os.environ.get("GPBNB_QUIET"):
        sys.stderr.write(_NOTICE.format(folder))
    remove_unused(folder)
    return time.monotonic()


_COUNT = itertools.count(1)


def _tell(folder: Path, name: str) -> None:
    """Say which function is compiled now, the how manyth it is, and how long compiling has taken so far."""
    began = _begin(folder)
    if not os.environ.get("GPBNB_QUIET"):
        passed = time.monotonic() - began
        so_far = f", {passed:.0f} s so far" if passed >= 1 else ""
        sys.stderr.write(f"gpbnb: compiling function {next(_COUNT)}, {name.removeprefix('gpbnb.')}{so_far}\n")
        sys.stderr.flush()


class _Cache(FunctionCache):  # type: ignore[misc]
    """The cache of one function, with one file for each set of types."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._py_func, self._folder = function, folder
        self._name = f"{function.__module__}.{function.__name__}"
        self._stamp = (_stamp(Path(function.__code__.co_filename).resolve()), *_VERSIONS)
        self._locks: dict[Path, IO[bytes] | None] = {}
        self.enable()

    @property
    def cache_path(self) -> str:
        return str(self._folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)  # the rest of numba, which takes 0.3 s, is imported only for compiling
        key = self._index_key(sig, target_context.codegen())
        path = self._path(key)
        found = _load(path, key, target_context)
        if found is None:
            if path not in self._locks:  # else it is still locked since a failed compilation
                self._locks[path] = lock(path, _LONGEST_WAIT)
            found = _load(path, key, target_context)
            if found is None:
                generate_on_demand()
                _tell(self._folder, self._name)
            else:
                self._release()
        return found

    def holds(self, sig: Any, target_context: Any) -> bool:
        """Tell whether there is a file for a set of types."""
        return self._path(self._index_key(sig, target_context.codegen())).is_file()

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            if not data.library.has_dynamic_globals:
                key = self._index_key(sig, data.codegen)
                write(self._path(key), dumps((key, data._reduce())))
        finally:
            self._release()

    def flush(self) -> None:
        for path in self._folder.glob(f"{self._name}.*.compiled"):
            path.unlink(missing_ok=True)

    def _release(self) -> None:
        """Unlock the files, so that waiting processes can read them."""
        while self._locks:
            unlock(*self._locks.popitem())

    def _path(self, key: Any) -> Path:
        # Two keys may share a name, because the file also contains the key.
        short = hashlib.sha256(repr((self._stamp, str(key))).encode()).hexdigest()[:24]
        return self._folder / f"{self._name}.{short}.compiled"


def _load(path: Path, key: Any, target_context: Any) -> Any:
    """Load a compiled function, or return None if it must be compiled."""
    content = read(path)
    if content is None:
        return None
    try:
        stored, reduced = pickle.loads(content)
        return CompileResult._rebuild(target_context, *reduced) if stored == key else None
    except Exception:  # it was written by a library of the same version that differs from this one
        return None
