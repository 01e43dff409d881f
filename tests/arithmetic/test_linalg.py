"""Linear algebra: orders of sums, pivots, shapes and the ends of ranges. The corpus compares digits."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.named import BINARY64
from tests import oracles

pytestmark = pytest.mark.usefixtures("loops_at_once")

each_pivoting = pytest.mark.parametrize("pivot", [False, True], ids=["in order", "pivoting"])


def exact(x: FloatArray) -> list:
    return x.to_fractions().tolist()


class TestSingular:
    FMT = FloatFormat(10, 4)

    @pytest.mark.parametrize("pivot", [False, True])
    @pytest.mark.parametrize("matrix", [[[0]], [[1, 2], [2, 4]], [[0, 0], [0, 1]], [[1, 2, 3], [4, 5, 6], [5, 7, 9]]])
    def test_is_refused(self, matrix: list[list[int]], pivot: bool) -> None:
        a = self.FMT.array(matrix)
        for call in (linalg.lu, linalg.inv):
            with pytest.raises(np.linalg.LinAlgError, match=r"got a zero pivot in column \d of \d"):
                call(a, pivot)
        with pytest.raises(np.linalg.LinAlgError, match="zero pivot"):
            linalg.solve(a, self.FMT.array([1] * len(matrix)), pivot)
        assert linalg.det(a) == 0

    def test_what_needs_pivoting_is_told_so(self) -> None:
        a = self.FMT.array([[0, 2], [3, 1]])
        with pytest.raises(np.linalg.LinAlgError, match="try pivot=True"):
            linalg.inv(a)
        assert str(linalg.inv(a, pivot=True)) == "[[-0.1667  0.3333]\n [    0.5       0]]"


@pytest.mark.parametrize("fmt", [FloatFormat(10, 2), FloatFormat(2, 4, "even")], ids=str)
def test_sums_in_halves_and_in_blocks_are_those_of_their_definition(fmt: FloatFormat) -> None:
    r = oracles.rounds(fmt)
    for n in range(1, 70):
        x, y = (fmt.array(np.random.default_rng([n, k]).normal(size=n)) for k in range(2))
        given = x.to_fractions().tolist(), y.to_fractions().tolist()
        assert linalg.dot(x, y, "pairwise").to_fractions() == oracles.summed(r, *given, "pairwise")
        for block in (1, 3, 32):
            expected = oracles.summed(r, *given, "blocked", block=block)
            assert linalg.dot(x, y, "blocked", block=block).to_fractions() == expected
        assert np.cumsum(x).to_fractions().tolist()[-1] == oracles.Numbers.of(fmt).total(given[0])


def test_long_sums_in_loops_are_those_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = (FloatFormat(10, 3).array(np.random.default_rng(k).normal(size=(37, 37))) for k in range(2))
    asked: tuple[dict, ...] = ({"order": "pairwise"}, {"order": "blocked", "block": 5}, {"fused": True})
    at_once = [exact(linalg.matmul(a, b, **options)) for options in asked]
    monkeypatch.setattr(linalg, "_MOST_PRODUCTS", 0)
    assert [exact(linalg.matmul(a, b, **options)) for options in asked] == at_once


@pytest.mark.parametrize("overflow", ["raise", "saturate", "wrap"])
def test_a_format_without_the_number_one_has_no_identity(overflow: str) -> None:
    """Q15 clipped the ones to 32767/32768; what needs no ones is computed."""
    fmt = FixedFormat(0, 15, overflow=overflow)
    a = fmt.array([["0.5", "0.25"], ["0.125", "0.5"]])
    for function in (linalg.lu, linalg.inv):
        with pytest.raises(OverflowError, match="does not hold the number 1; needed it for"):
            function(a)
    assert linalg.det(a) == Fraction(7, 32)
    x = linalg.solve(a, fmt.array(["0.125", "0.0625"]))
    assert x.to_float() == pytest.approx([3 / 14, 1 / 14], abs=2**-13)  # four roundings of half a unit, amplified twice
    wide = replace(fmt, integer_bits=1)
    assert linalg.inv(wide.array([["2/3"]])).to_float()[0] == pytest.approx([1.5], abs=2**-14)


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
    assert linalg.inv(BINARY64.array(a), pivot=True).to_float().tolist() == [row[7:] for row in rows]
