"""The cache of compiled functions: it compiles again what changed, and runs no function in place of another."""

from __future__ import annotations

import itertools
import os
import re
import runpy
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import FunctionType, ModuleType

import numpy as np
import pytest
from numba import njit
from numba.core.bytecode import FunctionIdentity
from numba.core.registry import CPUDispatcher, cpu_target

import gpbnb
from gpbnb.arithmetic.kernels import compiling
from gpbnb.arithmetic.kernels.compiling import inner
from gpbnb.arithmetic.kernels.machine_code import generate_on_demand

PACKAGE = Path(gpbnb.__file__).parent
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}


def test_what_changed_or_was_damaged_is_compiled_again(tmp_path, monkeypatch):
    """A change in a folder of kernels concerns all functions, another one those of its file."""
    path = tmp_path / "own.py"
    monkeypatch.setitem(sys.modules, "own", ModuleType("own"))  # numba looks for the module of what it loads

    def compiled(factor: int, kernels: bytes = b"") -> list[float]:
        text = f"def multiple(n):\n    @compiled\n    def f(x):\n        return n * x + {factor}\n    return f\n"
        path.write_text(f"from gpbnb.arithmetic.kernels.compiling import compiled\n{text}")
        monkeypatch.setattr(compiling, "_KERNELS", kernels)
        two, three = map(runpy.run_path(str(path), run_name="own")["multiple"], (2.0, 3.0))
        assert (two(5.0), three(5.0)) == (10.0 + factor, 15.0 + factor)
        return sum(each.stats.cache_misses.total() for each in (two, three))

    assert [compiled(1), compiled(1), compiled(2), compiled(2), compiled(2, b"new")] == [2, 0, 2, 0, 2]
    for damage in (b"", b"no pickle", b"cgpbnb.nowhere\nNothing\n.", None):
        kept, _ = sorted(tmp_path.rglob("*.nbc"))  # new files take the place of old ones
        kept.write_bytes(kept.read_bytes()[:-1] if damage is None else damage)
        assert [compiled(2, b"new"), compiled(2, b"new")] == [1, 0]


def test_a_change_is_noticed_of_every_function_that_is_compiled_in():
    """Each stands in the file of its caller, which numba compares, or in a folder of kernels."""
    checked = 0
    for path in sorted(PACKAGE.rglob("*.py")):
        if not re.search(r"\bcompiled\(|@compiled\b", path.read_text("utf-8")) or path.name == "compiling.py":
            continue
        module = import_module(".".join(("gpbnb", *path.relative_to(PACKAGE).with_suffix("").parts)))
        waiting, seen = [f for f in vars(module).values() if isinstance(f, CPUDispatcher)], set()
        while waiting:
            each = waiting.pop()
            function = each if isinstance(each, FunctionType) else getattr(each, "py_func", None)
            if function is None or function in seen or not str(function.__module__).startswith("gpbnb"):
                continue
            seen.add(function)
            file = Path(function.__code__.co_filename).resolve()
            assert file == path or file in compiling._SOURCES, (path, file, function)
            checked += file != path
            waiting += [function.__globals__.get(name) for name in function.__code__.co_names]
            waiting += [cell.cell_contents for cell in function.__closure__ or ()]
    assert checked > 50


def test_a_command_without_compilation_is_told_what_to_unset(tmp_path):
    """It ended in a TypeError about a call of a scalar operation."""
    (tmp_path / "model.toml").write_text("A = [[0.5]]\nB = [[1]]\n")
    asked = [str(tmp_path / "model.toml"), "--tolerance", "1", "--simulate", "step"]
    found = subprocess.run(
        [sys.executable, "-m", "gpbnb.wordlength", *asked],
        env=ENVIRONMENT | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        cwd=PACKAGE.parent,
    )
    assert "got NUMBA_DISABLE_JIT=1 in the environment; needed compiled loops" in found.stderr.splitlines()[-1]
    assert "Traceback" not in found.stderr


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


LIGHT = """
import sys, gpbnb
from gpbnb.arithmetic import array, bounds, formats, linalg
from gpbnb.arithmetic.kernels import backends
gpbnb.FloatFormat(2, 24).round("0.1")
heavy = ("numba", "numba.np.linalg", "llvmlite", "scipy.linalg", "sympy", "matplotlib", "mpmath")
print([name for name in heavy if name in sys.modules])
backends.LOOPS_AFTER = 0
x = gpbnb.FloatFormat(2, 24).array(["0.1"])
x + x
print([name for name in heavy if name in sys.modules])
"""


def test_gpbnb_loads_no_heavy_package_and_compiled_functions_only_numba(loops_at_once) -> None:
    x = gpbnb.FloatFormat(2, 24).array(["0.1"])
    assert (x + x).to_float() == 2 * x.to_float()  # compiled here, loaded there
    run = subprocess.run([sys.executable, "-c", LIGHT], capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n['numba', 'llvmlite']\n"
