"""Make machine code only for functions that Python calls.

By default, numba also makes machine code for functions that are only compiled into others, and never uses it. Without
this work, a long loop compiles in about five sixths of the time.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.registry import cpu_target


class _Library(JITCodeLibrary):  # type: ignore[misc]
    """The compiled form of a function, with machine code once its address is asked for."""

    _has_machine_code = False

    def _finalize_final_module(self) -> None:
        if self._object_caching_enabled and self._compiled_object:  # loaded from the cache
            self._generate()
        self._finalized = True

    def _generate(self) -> None:
        super()._finalize_final_module()
        self._has_machine_code = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        # The engine may already know this name from another function: one that a different process numbered and cached.
        if not self._has_machine_code and name in {
            function.name for function in self._final_module.functions if not function.is_declaration
        }:
            self._generate()
        return int(super().get_pointer_to_function(name))


@lru_cache(maxsize=1)
def generate_on_demand() -> None:
    """Let numba make machine code for functions that are compiled from now on when their addresses are asked for."""
    codegen = cpu_target.target_context.codegen()
    codegen._library_class = _Library
    set_now = codegen.set_env
    waiting: dict[str, Any] = {}

    def set_env(name: str, environment: Any) -> None:
        """Set a function's environment in all machine code that contains the function, now or later."""
        waiting[name] = environment
        for each in [each for each in waiting if codegen._engine.is_symbol_defined(each)]:
            set_now(each, waiting.pop(each))

    codegen.set_env = set_env
