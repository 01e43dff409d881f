"""Orders of the sums in compiled products, followed as Python runs them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import matrices

FMT = FloatFormat(10, 3)


@pytest.fixture
def kernel(monkeypatch):
    """The module, with operations on numbers of arrays in place of the compiled ones."""
    operations = {
        "load": lambda fmt, a, at: a[at],
        "add": lambda fmt, x, y: x + y,
        "multiply": lambda fmt, x, y: x * y,
        "multiply_add": lambda fmt, x, y, s: s + x * y,
    }
    for name, operation in operations.items():
        monkeypatch.setattr(matrices, name, operation)
    return matrices


@pytest.mark.parametrize("n", range(1, 9))
def test_sums_have_the_order_of_arrays(kernel, n):
    rng = np.random.default_rng(n)
    a, b = FMT.array(rng.normal(size=(2, n))), FMT.array(rng.normal(size=(n, 2)))
    for block in (1, 2, 3, 9):
        tag = SimpleNamespace(sums=SimpleNamespace(block=block))
        expected = linalg.matmul(a, b, "blocked", block=block)
        for i, j in np.ndindex(2, 2):
            assert kernel._blocked.py_func(tag, a, b, i, j, [None] * 64) == expected[i, j]
    expected = linalg.matmul(a, b, "pairwise")
    for i, j in np.ndindex(2, 2):
        assert kernel._pairwise.py_func(None, a, b, i, j, [None] * 64) == expected[i, j]
