"""The decorators of compiled functions, which numba's cache keeps in ``__pycache__``.

Use :func:`compiled` for functions that Python calls, and :func:`inner` or :func:`borrowing` for those that only
compiled functions call.

numba compiles a function again if its file has changed. Loops in the folders ``kernels`` are compiled into others, so
here a change of any file in these folders counts as well.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import njit
from numba.core import typed_passes, untyped_passes
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.runtime import rtsys

from gpbnb.arithmetic.kernels.machine_code import generate_on_demand

if numba.config.DISABLE_JIT:
    raise ImportError(
        "got NUMBA_DISABLE_JIT=1 in the environment; needed compiled loops: gpbnb has no others; unset it"
    )

_SOURCES = sorted(Path(__file__).parents[2].glob("*/kernels/*.py"))
_KERNELS = hashlib.sha256(b"".join(path.read_bytes() for path in _SOURCES)).digest()


_UNUSED = (
    untyped_passes.InlineClosureLikes,
    untyped_passes.InlineInlinables,
    untyped_passes.LiteralUnroll,
    untyped_passes.WithLifting,
    typed_passes.AnnotateTypes,
    typed_passes.DumpParforDiagnostics,
    typed_passes.InlineOverloads,
    typed_passes.NopythonRewrites,
)


class Compiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler without what serves closures, array expressions and reports, which no compiled function has.

    It takes three quarters of the time.
    """

    def compile_extra(self, func: Any) -> Any:
        """Compile without looking for cyclic garbage, which takes a tenth of the time and finds little."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        found = DefaultPassBuilder.define_nopython_pipeline(self.state)
        found.passes[:] = [each for each in found.passes if each[0] not in _UNUSED]
        return [found]


INLINE = {"forceinline": True, "no_cfunc_wrapper": True, "_nrt": False, "pipeline_class": Compiler}
"""Options of numba's ``overload`` for what is compiled into its callers."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function on its first call with given types, or load it from the cache.

    The compiled function releases Python's global interpreter lock.
    """
    dispatcher = njit(nogil=True, no_cfunc_wrapper=True, pipeline_class=Compiler)(function)
    with contextlib.suppress(RuntimeError):  # numba found no folder that it can write to
        dispatcher._cache = _Cache(function)
    return dispatcher


def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function into the compiled functions that call it.

    It gets no entry points for Python and C, which take longer to compile than a short function itself.

    Parameters
    ----------
    options : passed to numba's ``njit``.
    """
    given = {"forceinline": False} | options  # by default, numba takes this option from the function that calls
    decorate = njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=Compiler, **given)
    return decorate if function is None else decorate(function)


def borrowing(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function like :func:`inner` that counts no references to the arrays of its callers.

    Counting took almost half of the time of a filter's step. The function must neither make nor return arrays, nor
    call one that returns arrays, except for those that borrow, too: numba would release what was never counted.
    """
    return inner(function, _nrt=False, **options)


def addressed(function: Callable[..., Any]) -> Any:
    """Compile a function like :func:`borrowing` whose :func:`address_of` compiled functions call, for one of many."""
    dispatcher = borrowing(function, nogil=True)
    with contextlib.suppress(RuntimeError):
        dispatcher._cache = _Cache(function)
    return dispatcher


def address_of(dispatcher: Any, *kinds: Any) -> int:
    """Compile an :func:`addressed` function for arguments of these types, or load it, and return its address."""
    dispatcher.compile(kinds)
    found = dispatcher.overloads[kinds]
    return int(found.library.get_pointer_to_function(found.fndesc.llvm_func_name))


class _Files(IndexDataCacheFile):  # type: ignore[misc]
    """One file for each set of types, named by them.

    numba numbers its files. Two processes that compile at once choose one number for two functions, and a third one
    runs the wrong one.
    """

    def _name(self, key: Any) -> str:
        named = hashlib.sha256(repr((numba.__version__, np.__version__, str(key))).encode()).hexdigest()
        return f"{Path(self._index_path).stem}.{named[:24]}.nbc"

    def save(self, key: Any, data: Any) -> None:
        with contextlib.suppress(OSError):  # a full disk
            self._save_data(self._name(key), ((self._source_stamp, key), data))

    def load(self, key: Any) -> Any:
        try:
            known, data = self._load_data(self._name(key))
        except Exception:  # there is none, it is damaged, or it names what has moved since
            return None
        return data if known == (self._source_stamp, key) else None


class _Cache(FunctionCache):  # type: ignore[misc]
    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = _KERNELS, self._impl.locator.get_source_stamp()
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)  # the rest of numba, which takes 0.3 s, is imported only for compiling
        found = self._load_overload(sig, target_context)
        if found is None:
            generate_on_demand()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        data.library.get_pointer_to_function(data.fndesc.llvm_func_name)  # machine code is made on demand
        super().save_overload(sig, data)
