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


def test_numbers_in_names_are_random():
    """Those of two processes, even of forked ones, must differ."""
    generate_on_demand()
    numbers = sorted(next(FunctionIdentity._unique_ids) for _ in range(4))
    assert all(two - one > 1000 for one, two in itertools.pairwise(numbers))
