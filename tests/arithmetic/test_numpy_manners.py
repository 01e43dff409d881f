"""What NumPy's users write: copies with other entries, np.linalg, pandas, and text in which the format is one line."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY32, BINARY64, BINARY128, FixedFormat, FloatArray, FloatFormat, Rounding, linalg
from tests.oracles import Numbers

pytestmark = pytest.mark.usefixtures("loops_at_once")

FORMATS = [BINARY32, BINARY128, FloatFormat(10, 5), FixedFormat(7, 8)]


def matrices(fmt, n, seed):
    rng = np.random.default_rng(seed)
    a = fmt.array(rng.normal(size=(n, n)))
    return a, a.to_fractions().tolist(), fmt.array(rng.normal(size=n))


def test_linear_algebra_of_numpy_pivots_as_lapack():
    for rounding in ("nearest", "chop"):
        fmt = FloatFormat(10, 4, rounding)
        loops = Numbers.of(fmt)
        for n, seed in itertools.product((1, 2, 3, 5), range(5)):
            a, rows, b = matrices(fmt, n, seed)
            right = [[each] for each in b.to_fractions()]
            assert [[x] for x in np.linalg.solve(a, b).to_fractions()] == loops.solve(rows, right, True)
            assert np.linalg.inv(a).to_fractions().tolist() == loops.inv(rows, True)
            assert np.linalg.det(a).to_fractions() == linalg.det(a).to_fractions()
            assert [[x] for x in np.dot(a, b).to_fractions()] == loops.times(rows, right)
            assert np.linalg.norm(b).to_fractions() == loops.root(loops.dot(b.to_fractions(), b.to_fractions()))


class Frame:
    """What pandas gives: an array that has made whole numbers float64, and exact objects where they are asked for."""

    def __init__(self, columns):
        self.columns = columns

    def __array__(self, dtype=None, copy=None):
        return np.column_stack([np.asarray(each, dtype=np.float64) for each in self.columns])

    def to_numpy(self, dtype=None, copy=False, na_value=None):
        assert dtype is object
        return np.array(self.columns, dtype=object).T


Frame.__module__ = "pandas.core.frame"


def test_a_table_of_pandas_gives_exact_numbers_or_the_reason():
    large = 2**53 + 1
    table = Frame([[large, 3], [0.1, 0.25], ["0.1", Fraction(1, 3)]])
    found = BINARY128.array(table)
    assert found.to_fractions()[:, 0].tolist() == [large, 3]
    assert found[0, 1].to_fractions() == Fraction(0.1)
    assert (found[:, 2] == BINARY128.array(["0.1", "1/3"])).all()
    with pytest.raises(
        ValueError, match=r"entry \[1, 0\]: got nan; needed a finite number; remove or replace the entry"
    ):
        BINARY64.array(Frame([[1, float("nan")]]))
    for value, kind in ((None, "NoneType"), (np.datetime64("2026-01-01"), "datetime64"), (True, "truth value")):
        with pytest.raises(TypeError, match=rf"entry \[0, 0\]: got .*{kind}.*; needed a str, int, float"):
            BINARY64.array(Frame([[value, 1]]))


NAMES = {"FloatFormat": FloatFormat, "FixedFormat": FixedFormat, "Rounding": Rounding}


def test_the_format_stands_in_the_first_line_of_the_text():
    for shape in [(), (3,), (40,), (12, 5), (2, 3, 4), (0,), (0, 3)]:
        for fmt in [*FORMATS, FloatFormat(2, 24)]:
            x = fmt.array(np.arange(np.prod(shape, dtype=int)).reshape(shape) / 8)
            lines = repr(x).splitlines()
            assert lines[0].startswith(f"{fmt}.array(")
            assert max(map(len, lines[1:]), default=0) <= 120
            back = eval(repr(x), NAMES)
            assert isinstance(back, FloatArray)
            assert back.shape == x.shape
            assert (back == x).all()


def test_the_text_of_every_number_is_read_back():
    """All significands, also those with an even last digit, with exponents around zero and far from it."""
    for rounding in Rounding:
        for base, precision in [(2, 3), (3, 2), (6, 2), (10, 1)]:
            fmt = FloatFormat(base, precision, rounding)
            numbers = [
                sign * m * Fraction(base) ** e
                for m in range(base ** (precision - 1), base**precision)
                for e in (-40, -3, -1, 0, 1, 2, 40)
                for sign in (1, -1)
            ]
            x = fmt.array(numbers)
            assert x.to_fractions().tolist() == numbers
            assert fmt.array([str(each) for each in x]).to_fractions().tolist() == numbers
