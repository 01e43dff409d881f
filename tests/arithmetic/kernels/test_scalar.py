"""One recursion in every arithmetic; what a backend cannot hold raises."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numba import njit

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.scalar import (
    compare,
    load,
    multiply,
    store,
)
from gpbnb.arithmetic.kernels.tags import ShortDecimal


@njit
def powers(fmt: Any, x: Any, y: Any) -> None:
    a = load(fmt, x, 0)
    s = a
    for k in range(y.shape[0]):
        store(fmt, y, k, s)
        s = multiply(fmt, s, a)


@njit
def compared_beyond(fmt: Any, x: Any) -> Any:
    a = load(fmt, x, 0)
    return compare(fmt, multiply(fmt, a, a), a)


@pytest.mark.parametrize("fmt", [FloatFormat(2, 24), FloatFormat(2, 53, "chop"), FloatFormat(16, 6)], ids=str)
@pytest.mark.parametrize("factor", [2.0**100, 2.0**-100])
def test_float64_out_of_range_raises(fmt: FloatFormat, factor: float) -> None:
    y = np.zeros(20)
    with pytest.raises(OverflowError, match="beyond the range of float64"):
        powers(fmt.backend.tag, np.array([factor]), y)
    held = 10 if factor > 1 else 9
    assert y.tolist() == [factor**k for k in range(1, held + 1)] + [0.0] * (20 - held)
    with pytest.raises(OverflowError, match="beyond the range of float64"):
        compared_beyond(fmt.backend.tag, np.array([factor**7]))


def test_a_decimal_exponent_beyond_int64_raises() -> None:
    big = np.array([[10, 2**58]])
    with pytest.raises(OverflowError, match=r"beyond 2\*\*60"):
        powers(ShortDecimal(2, True), big, np.zeros((20, 2), np.int64))
    with pytest.raises(OverflowError, match=r"beyond 2\*\*60"):
        powers(ShortDecimal(2, True), big * [1, -1], np.zeros((20, 2), np.int64))


def test_importing_gpbnb_is_light() -> None:
    code = (
        "import sys, gpbnb\n"
        "from gpbnb.arithmetic import array, bounds, formats, linalg\n"
        "gpbnb.FloatFormat(2, 24).round('0.1')\n"
        "print([name for name in ('numba', 'llvmlite', 'sympy', 'matplotlib', 'mpmath') if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_compiled_functions_are_loaded_without_what_only_compiling_needs() -> None:
    code = (
        "import sys, gpbnb\n"
        "from gpbnb.arithmetic.kernels import backends\n"
        "backends.LOOPS_AFTER = 0\n"
        "x = gpbnb.FloatFormat(2, 24).array(['0.1'])\n"
        "x + x\n"
        "print([name for name in ('numba', 'numba.np.linalg', 'scipy.linalg', 'sympy') if name in sys.modules])"
    )
    for _ in range(2):  # the first run may compile
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "['numba']"
