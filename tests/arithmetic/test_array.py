"""Arrays of t-digit numbers: conversion, text, shapes, products, and NumPy's manners."""

from __future__ import annotations

import io
import math
from fractions import Fraction
from random import Random

import numpy as np
import pytest
import scipy.fft
import scipy.linalg

from gpbnb.arithmetic.formats import FloatFormat

pytestmark = pytest.mark.usefixtures("loops_at_once")
D4 = FloatFormat(10, 4)


class TestConversion:
    @pytest.mark.parametrize(("base", "most"), {2: 1100, 3: 700, 10: 340, 16: 280}.items())
    def test_to_float_is_nearest(self, base: int, most: int) -> None:
        random = Random(base)
        for _ in range(100):
            precision = random.choice([random.randint(1, 60), 1, 2, 53, 54])
            least = base ** (precision - 1)
            m = random.choice([random.randrange(least, base * least), least, least + base // 2, base * least - 1])
            power = random.choice([random.randint(-most, most), -most, most, most - most // 15, 0])
            self.check_nearest(base, precision, random.choice([-1, 1]) * m * Fraction(base) ** (power - precision))

    def check_nearest(self, base: int, precision: int, value: Fraction) -> None:
        x = FloatFormat(base, precision).array(value)
        try:
            expected = float(value)  # Fraction divides its integers, correctly rounded; subnormal results too
        except OverflowError:
            expected = 0.0
        if expected:
            assert x.to_float() == expected
            assert base != 10 or x.to_float() == float(str(x))
            if Fraction(expected) == value:
                assert float(x) == expected
            else:
                with pytest.raises(ValueError, match=r"needed an explicit conversion: x\.to_float"):
                    float(x)
        else:
            with pytest.raises(OverflowError, match="within the range of float64"):
                x.to_float()


class TestArithmetic:
    X = D4.array([["1.5", "-2", "0.25"], ["3", "4", "-0.5"]])

    def test_input_is_not_shared(self) -> None:
        values = np.array([1, 2], dtype=object)
        x = D4.array(values)
        values[0] = 9
        assert np.array_equal(x, [1, 2])
        f = x.to_fractions()
        f[0] = Fraction(9)
        x.to_float()[0] = 9.0
        assert np.array_equal(x, [1, 2])

    def test_nothing_writes_into_an_array_or_its_views(self) -> None:
        for x in (self.X, self.X[0], self.X.T, self.X.reshape(-1), np.broadcast_to(self.X[0], (2, 3)), self.X + 1):
            assert not x.to_pairs()[0].flags.writeable
            assert not x.to_pairs()[1].flags.writeable
            with pytest.raises(TypeError, match="cannot be changed"):
                x[0] = 1
            with pytest.raises(TypeError, match="cannot be changed"):
                del x[0]
        y = x = self.X
        x += 1
        assert np.array_equal(y, self.X)
        assert x is not y
        for name in ("shape", "format", "T", "anything"):
            with pytest.raises(AttributeError):
                setattr(x, name, None)


class TestLeavingTheFormat:
    """Whatever asks for float64 by itself gets it if it is exact, and an error that names the cure if not."""

    TENTH, HALF = D4.array(["0.1", "0.5"]), D4.array(["0.5", "-2", "0"])
    LONG = FloatFormat(2, 113).array(["0.1", "0.5"])

    def test_no_entry_is_rounded_unseen(self) -> None:
        for x in (self.TENTH, self.LONG):
            for leave in [
                np.asarray,
                lambda x: np.array(x, dtype=float),
                lambda x: float(x[0]),
                lambda x: math.sqrt(x[0]),
                lambda x: np.save(io.BytesIO(), x),
                lambda x: scipy.linalg.solve(np.eye(2), x),
                lambda x: scipy.fft.fft(x),
            ]:
                with pytest.raises(
                    ValueError, match=r"got (an array|float\(\)) of a FloatArray in .*; needed an explicit conv"
                ):
                    leave(x)
