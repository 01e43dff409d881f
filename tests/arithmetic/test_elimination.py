"""Compiled elimination gives the digits of the loops in gpbnb.arithmetic.linalg, in every format that it serves."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import elimination
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.kernels.tags import Hardware64

each_pivoting = pytest.mark.parametrize("pivot", [False, True], ids=["in order", "pivoting"])


def outcome(function, *arguments):
    """What a call returns, or how it fails."""
    try:
        result = function(*arguments)
    except np.linalg.LinAlgError as error:
        return str(error)
    components = result if isinstance(result, tuple) else (result,)
    return [part.to_fractions().tolist() if isinstance(part, FloatArray) else part.tolist() for part in components]


@each_pivoting
@pytest.mark.parametrize("size", ["1e-285", "1e300"])
def test_beyond_the_range_of_float64_the_exact_loop_goes_on(size: str, pivot: bool) -> None:
    fmt = FloatFormat(2, 24)
    a = fmt.array([[size, "1"], ["1", size]])
    assert isinstance(a.backend, Compiled)
    for function in (linalg.lu, linalg.inv):
        assert outcome(function, a, pivot) == outcome(function, a.on_exact_backend(), pivot)
    b = fmt.array(["1e-200", size])
    assert outcome(linalg.solve, a, b, pivot) == outcome(
        linalg.solve, a.on_exact_backend(), b.on_exact_backend(), pivot
    )


def inverse(tag, a: np.ndarray, identity: np.ndarray) -> np.ndarray:
    factors, order, x = a.copy(), np.arange(len(a)), identity.copy()
    assert elimination.lu(tag, factors, order, True, 0, len(a)) == -1
    x = x[order]
    elimination.reduce(tag, factors, x)
    elimination.substitute(tag, factors, x)
    return x


def test_plain_float64_in_the_same_order() -> None:
    a = np.random.default_rng(2).normal(size=(7, 7))
    rows = [[*row, *unit] for row, unit in zip(a.tolist(), np.eye(7).tolist(), strict=True)]
    for k in range(7):
        largest = max(range(k, 7), key=lambda i: (abs(rows[i][k]), -i))
        rows[k], rows[largest] = rows[largest], rows[k]
        for i in range(k + 1, 7):
            m = -(rows[i][k] / rows[k][k])
            rows[i][k + 1 :] = [p + m * q for p, q in zip(rows[i][k + 1 :], rows[k][k + 1 :], strict=True)]
    for k in reversed(range(7)):
        for i in range(k + 1, 7):
            rows[k][7:] = [p - rows[k][i] * q for p, q in zip(rows[k][7:], rows[i][7:], strict=True)]
        rows[k][7:] = [p / rows[k][k] for p in rows[k][7:]]
    assert inverse(Hardware64(), a, np.eye(7)).tolist() == [row[7:] for row in rows]
