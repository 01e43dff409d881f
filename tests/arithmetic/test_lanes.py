"""Functions that are recorded once and run on many arrays together have the digits of arrays of the format."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.lanes import recorded


def loop(K, H, Phi):
    return (K.format.eye(2) - K @ H) @ Phi, np.all(K > 0)


def quotients(a, b):
    return (a * (a / b),)


@pytest.mark.parametrize(
    "fmt", [FloatFormat(2, 11), FloatFormat(2, 24, "even", -126, 127), FloatFormat(10, 4)], ids=str
)
def test_each_lane_has_the_digits_of_arrays(fmt):
    rng = np.random.default_rng(fmt.base)
    given = [fmt.array(rng.normal(size=(7, *shape))) for shape in ((2, 1), (1, 2), (2, 2))]
    packed = [fmt.backend.pack(each.components) for each in given]
    found, positive = recorded(loop, (2, 1), (1, 2), (2, 2)).run(fmt, *packed)
    for k, each in enumerate(zip(*given, strict=True)):
        expected, truth = loop(*each)
        assert np.array_equal(found[k], fmt.backend.pack(expected.components))
        assert positive[k] == truth


def test_lanes_before_one_without_a_result_are_kept():
    fmt, function = FloatFormat(2, 24), recorded(quotients, (3,), (3,))
    a, b = np.ones((5, 3)), np.ones((5, 3))
    b[3, 1] = 0
    (found,), error = function.begin(fmt, a, b)
    assert np.array_equal(found, a[:3])
    assert isinstance(error, ZeroDivisionError)
    with pytest.raises(ZeroDivisionError, match="division by zero"):
        function.run(fmt, a, b)


def test_double_doubles_have_twice_the_digits():
    thirds = np.array([[Fraction(1, 3), Fraction(2, 7)]], object)
    a, b = double_doubles(thirds), double_doubles(thirds[:, ::-1])
    (found,) = recorded(quotients, (2,), (2,)).run(None, a, b)
    for j in range(2):
        x, y = thirds[0, j], thirds[0, 1 - j]
        high, low = map(Fraction, found[0, j])
        assert abs(high + low - x * x / y) < abs(x * x / y) / 2**99
