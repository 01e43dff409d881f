"""gpbnb.arithmetic.derivatives against SymPy, and its values against the functions themselves."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from gpbnb import FloatFormat
from gpbnb.arithmetic.derivatives import SLOPES, jacobian

FMT = FloatFormat(2, 53)
X = ["0.3", "-0.7", "0.45"]
SYMBOLS = sympy.symbols("x:3")

ELEMENTARY = {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}


def by_sympy(expressions):
    at = dict(zip(SYMBOLS, map(sympy.Rational, X), strict=True))
    return np.array(sympy.Matrix(expressions).jacobian(SYMBOLS).evalf(30, subs=at).tolist(), dtype=float)


def close(function, expressions):
    x = FMT.array(X)
    value, slopes = jacobian(function, x)
    assert np.array_equal(value, function(x))
    expected = by_sympy(expressions)
    assert np.abs(slopes.to_float() - expected).max() < 2**-48 * max(1, np.abs(expected).max())  # some 30 roundings


@pytest.mark.parametrize("name", sorted(SLOPES))
def test_the_slope_of_each_function(name):
    inner = SYMBOLS[0] * SYMBOLS[1] + (2 if name.startswith("log") else 0)
    formula = {"expm1": sympy.exp(inner) - 1, "log1p": sympy.log(1 + inner)}.get(name)
    formula = getattr(sympy, ELEMENTARY.get(name, name))(inner) if formula is None else formula
    close(lambda x: getattr(np, name)(x[0] * x[1] + (2 if name.startswith("log") else 0)).reshape(1), [formula])


def test_operations_and_functions_of_two_numbers():
    a, b, c = SYMBOLS

    def function(x):
        return np.stack(
            [
                x[0] / x[1] - 2 * x[2],
                np.hypot(x[0], x[1]),
                np.arctan2(x[1], x[2]),
                np.sqrt(x[0] + 1) * x[1] ** 3,
                (1 / x[2] - x[0]) / (3 - x[1]),
                abs(x[1]) + np.abs(x[0]),
                x @ x + np.linalg.norm(x),
                np.cross(x, [1, 2, 4])[1] + x.sum() - x.mean() * 3,
                np.where(x[0] > x[1], x[0] * x[2], x[1]),
                np.maximum(x[0], x[1]) * np.minimum(x[0], x[2]),
                np.prod(x) + np.square(x[0]),
                (x[1] + 5) % 2 * x[2] + np.remainder(x[1], 2),
                -x[0],
            ]
        )

    square = a**2 + b**2 + c**2
    close(
        function,
        [
            a / b - 2 * c,
            sympy.sqrt(a**2 + b**2),
            sympy.atan2(b, c),
            sympy.sqrt(a + 1) * b**3,
            (1 / c - a) / (3 - b),
            -b + a,
            square + sympy.sqrt(square),
            c * 1 - a * 4 + a + b + c - (a + b + c),
            a * c,
            a * a,
            a * b * c + a**2,
            (b + 1) * c + b,  # 4.3 - 2 * 2 = 0.3 = b + 1
            -a,
        ],
    )


def test_products_of_matrices():
    A, B = sympy.Matrix(2, 2, [SYMBOLS[0], 2, SYMBOLS[1], SYMBOLS[2]]), sympy.Matrix(2, 2, [1, SYMBOLS[1], 3, 4])

    def function(x):
        left = np.stack([np.stack([x[0], x[0] * 0 + 2]), np.stack([x[1], x[2]])])
        right = np.stack([np.stack([x[0] * 0 + 1, x[1]]), FMT.array([3, 4])])
        product = left @ right
        return np.concatenate([product.ravel(), FMT.array([[1, 2], [3, 5]]) @ product[:, 0], left[0] @ [[1], [2]]])

    product = A * B
    close(
        function,
        [*product, product[0] + 2 * product[2], 3 * product[0] + 5 * product[2], SYMBOLS[0] + 4],
    )


def test_what_does_not_depend_on_the_variables_has_no_slope():
    value, slopes = jacobian(lambda x: FMT.array([1, "0.3"]) if x[0] else x, FMT.array(X))
    assert value.tolist() == FMT.array([1, "0.3"]).tolist()
    assert slopes.tolist() == [[0] * 3] * 2
