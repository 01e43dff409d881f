"""Arrays of t-digit numbers: conversion, text, shapes, products, and NumPy's manners."""

from __future__ import annotations

import copy
import io
import math
import pickle
from decimal import Decimal
from fractions import Fraction
from random import Random

import numpy as np
import pytest
import scipy.fft
import scipy.linalg

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding

pytestmark = pytest.mark.usefixtures("loops_at_once")

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
D4 = FloatFormat(10, 4)
B8 = FloatFormat(2, 8)


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

    def test_kinds_of_result(self) -> None:
        x = D4.array([["1.5", "-2"], ["0", "1e-3"]])
        assert x.to_float().dtype == np.float64
        assert x.to_float().tolist() == [[1.5, -2.0], [0.0, 0.001]]
        assert x.to_fractions().dtype == object
        assert x.to_fractions().tolist() == [[Fraction(3, 2), -2], [0, Fraction(1, 1000)]]
        assert isinstance(x[0, 0].to_fractions(), Fraction)
        assert isinstance(x[0, 0].to_float(), float)
        assert np.asarray(x[0]).tolist() == x[0].to_float().tolist()
        assert np.asarray(x, dtype=object).tolist() == x.to_fractions().tolist()
        assert x.astype(float).tolist() == x.to_float().tolist()
        assert x[0, 0].astype(object).shape == ()
        assert x[0, 0].astype(object).item() == Fraction(3, 2)
        assert f"{x[0, 0]:.3f}" == "1.500"
        assert f"{x[0, 0]}" == "1.5"

    def test_containers(self) -> None:
        for values in [
            [1, 2],
            (1, 2),
            range(1, 3),
            np.array([1, 2]),
            np.array([1.0, 2.0]),
            np.array(["1", "2"]),
            ["1", Decimal(2)],
            np.array([1, Fraction(2)], dtype=object),
            [np.array(1), np.float32(2)],
            np.array([1, 2], dtype=np.longdouble),
            np.array(["1", "2"], dtype=np.dtypes.StringDType()),
        ]:
            assert np.array_equal(D4.array(values), D4.array(["1", "2"]))

    def test_shapes(self) -> None:
        assert D4.array(1).shape == ()
        assert D4.array([]).shape == (0,)
        assert D4.array([[], []]).shape == (2, 0)
        assert D4.array(np.zeros((2, 0, 3))).shape == (2, 0, 3)
        assert D4.array([[[1], [2]]]).shape == (1, 2, 1)


class TestText:
    def test_columns_are_aligned(self) -> None:
        x = D4.array([["3.235", "-1.234"], ["1000", "1e-7"]])
        assert repr(x).splitlines() == [
            "FloatFormat(base=10, precision=4, rounding=Rounding.NEAREST).array([[ '3.235', '-1.234'],",
            "                                                                    [  '1000',   '1e-7']])",
        ]
        assert str(x).splitlines() == ["[[ 3.235 -1.234]", " [  1000   1e-7]]"]

    def test_notation(self) -> None:
        values = ["0", "1", "1e15", "1e16", "1.2e16", "1e-4", "1.2e-5", "-0.05", "120"]
        found = [str(D4.array(v)) for v in values]
        assert found == ["0", "1", "1000000000000000", "1e+16", "1.2e+16", "0.0001", "1.2e-5", "-0.05", "120"]

    def test_digits_are_the_nearest_or_chop_to_the_number(self) -> None:
        # 171 / 512 = 0.333984375 in five digits
        assert str(B8.array("1/3")) == "0.33398"
        assert str(B8.array("2/3")) == "0.66797"  # 171 / 256 = 0.66796875
        assert str(FloatFormat(2, 8, CHOP).array(Fraction(171, 512))) == "0.33399"


class TestArithmetic:
    X = D4.array([["1.5", "-2", "0.25"], ["3", "4", "-0.5"]])

    def test_copies(self) -> None:
        x = self.X[:, ::2].T
        for y in (copy.copy(x), copy.deepcopy(x), pickle.loads(pickle.dumps(x))):
            assert isinstance(y, FloatArray)
            assert y.format == x.format
            assert np.array_equal(x, y)
            assert not y.to_pairs()[0].flags.writeable
            assert not y.to_pairs()[1].flags.writeable

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

    def test_what_is_exact_passes(self) -> None:
        assert np.asarray(self.HALF).tolist() == [0.5, -2.0, 0.0]
        assert math.sqrt(self.HALF[0]) == math.sqrt(0.5)
        assert scipy.linalg.solve(np.eye(3), self.HALF).tolist() == [0.5, -2.0, 0.0]
        assert np.asarray(FloatFormat(2, 53).array([0.1])).tolist() == [0.1]
        stream = io.BytesIO()
        np.save(stream, self.HALF)
        stream.seek(0)
        assert np.load(stream).tolist() == [0.5, -2.0, 0.0]
        assert pickle.loads(pickle.dumps(self.LONG)).tolist() == self.LONG.tolist()
