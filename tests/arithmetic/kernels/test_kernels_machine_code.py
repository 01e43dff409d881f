"""Machine code is made for functions that Python calls, and for no others."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numba import njit
from numba.core.bytecode import FunctionIdentity
from numba.core.registry import cpu_target

from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.machine_code import generate_on_demand


def has_machine_code(function):
    (compiled,) = function.overloads.values()
    return cpu_target.target_context.codegen()._engine.is_symbol_defined(compiled.fndesc.llvm_func_name)


def test_a_function_that_is_only_compiled_into_others_has_none():
    generate_on_demand()

    @inner
    def root(x):
        if x[0] < 0.0:  # the array is packed for Python in the environment of this function
            raise ValueError("got a negative number", x)
        return np.sqrt(x[0])

    @njit
    def half_root(x):
        return 0.5 * root(x)

    @njit
    def twice_half_root(x):
        return 2.0 * half_root(x)

    assert twice_half_root(np.array([9.0])) == 3.0
    with pytest.raises(ValueError, match="negative") as caught:
        twice_half_root(np.array([-9.0]))
    assert caught.value.args[1].tolist() == [-9.0]
    assert has_machine_code(twice_half_root)
    assert has_machine_code(half_root)
    assert not has_machine_code(root)
    assert half_root(np.array([4.0])) == 1.0


def test_functions_of_the_same_name_stay_apart(monkeypatch):
    """numba numbers functions in each process: one from the cache may have the name of one compiled now."""
    generate_on_demand()
    monkeypatch.setattr(FunctionIdentity, "_unique_ids", itertools.repeat(10**9))

    def plus(a):
        @njit
        def added(x):
            return x + a

        return added

    first, second = plus(1.0), plus(2.0)
    assert (first(0.5), second(0.5), first(0.25)) == (1.5, 2.5, 1.25)
    names = {each.fndesc.llvm_func_name for f in (first, second) for each in f.overloads.values()}
    assert len(names) == 1
