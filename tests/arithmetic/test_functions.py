"""NumPy's functions of arrays of a format: their values against rounded Fractions, in the order that each states."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import FloatFormat, Rounding
from gpbnb.arithmetic import elementary
from gpbnb.arithmetic.elementary import ELEMENTARY
from gpbnb.arithmetic.named import BFLOAT16, BINARY32

pytestmark = pytest.mark.usefixtures("loops_at_once")

LONG = pytest.param(FloatFormat(2, 113), marks=pytest.mark.long)  # loops of two words take seconds to compile
FORMATS = [FloatFormat(2, 11), FloatFormat(10, 4), LONG, FloatFormat(2, 24, Rounding.CHOP)]


@pytest.fixture(params=FORMATS, ids=str)
def fmt(request):
    return request.param


def drawn(fmt, *shape):
    return fmt.array(np.random.default_rng(sum(shape)).uniform(-4, 4, shape))


def from_left(fmt, terms):
    total = terms[0]
    for term in terms[1:]:
        total = fmt.round(total + term)
    return total


@pytest.mark.parametrize("axis", [None, 0, 1])
def test_variances_are_means_of_squares_of_rounded_differences(fmt, axis):
    x = drawn(fmt, 4, 6)
    rows = {None: [x.to_fractions().ravel()], 0: x.to_fractions().T, 1: x.to_fractions()}[axis]
    for ddof in (0, 1):
        expected = []
        for row in rows:
            center = fmt.round(from_left(fmt, row) / len(row))
            squares = [fmt.round(fmt.round(each - center) ** 2) for each in row]
            expected.append(fmt.round(from_left(fmt, squares) / (len(row) - ddof)))
        assert np.ravel(np.var(x, axis=axis, ddof=ddof)).tolist() == expected
        assert np.array_equal(np.std(x, axis=axis, ddof=ddof), np.sqrt(np.var(x, axis=axis, ddof=ddof)))


def test_interpolation_rounds_each_of_five_operations(fmt):
    nodes, values = [-3, -0.5, 1, 2.5], drawn(fmt, 4)
    f = values.to_fractions()
    for at in [*np.linspace(-3.5, 3, 27).tolist(), *nodes]:
        x = fmt.round(Fraction(at))
        k = max((k for k in range(3) if x >= Fraction(nodes[k])), default=0)
        low, high = Fraction(nodes[k]), Fraction(nodes[k + 1])
        slope = fmt.round(fmt.round(f[k + 1] - f[k]) / fmt.round(high - low))
        expected = fmt.round(fmt.round(slope * fmt.round(x - low)) + f[k])
        expected = f[0] if x <= Fraction(nodes[0]) else f[-1] if x >= Fraction(nodes[-1]) else expected
        assert np.interp(fmt.array(at), nodes, values).item() == expected


def test_convolutions_sum_from_left_to_right(fmt):
    for mode in ["full", "same", "valid"]:
        for lengths in [(7, 3), (3, 7), (6, 4), (4, 4), (5, 1)]:
            a, v = (drawn(fmt, n) for n in lengths)
            first, second = a.to_fractions(), v.to_fractions()
            full = [
                from_left(fmt, [fmt.round(first[i] * second[k - i]) for i in range(len(a)) if 0 <= k - i < len(v)])
                for k in range(len(a) + len(v) - 1)
            ]
            start = {"full": 0, "same": (min(lengths) - 1) // 2, "valid": min(lengths) - 1}[mode]
            assert (
                np.convolve(a, v, mode).tolist()
                == full[start : start + len(np.convolve(a.to_float(), v.to_float(), mode))]
            )
            exactly = [int(each) for each in np.convolve(range(1, len(a) + 1), range(1, len(v) + 1), mode)]
            whole = FloatFormat(2, 53)
            assert np.convolve(whole.array(range(1, len(a) + 1)), list(range(1, len(v) + 1)), mode).tolist() == exactly


def test_reductions_keep_dimensions(fmt):
    """The entries are those without keepdims, and the shape is NumPy's; methods and functions agree."""
    for name in ["sum", "prod", "mean", "max", "min", "argmax", "argmin", "any", "all", "var", "std", "norm"]:
        x = drawn(fmt, 3, 4)
        function = np.linalg.norm if name == "norm" else getattr(np, name)
        for axis in (None, 0, 1, -1):
            flat, kept = function(x, axis=axis), function(x, axis=axis, keepdims=True)
            assert kept.shape == function(x.to_float(), axis=axis, keepdims=True).shape, axis
            assert np.array_equal(kept.reshape(flat.shape), flat), axis
            if hasattr(x, name):
                assert np.array_equal(getattr(x, name)(axis=axis, keepdims=True), kept), axis
                assert np.array_equal(getattr(x, name)(axis), flat), axis


def test_norms_sum_sizes_or_squares_from_left_to_right(fmt):
    x = drawn(fmt, 3, 4)
    rows = x.to_fractions()
    lines = {None: [rows.ravel()], 0: rows.T, 1: rows}
    sums = {axis: [from_left(fmt, abs(line)) for line in each] for axis, each in lines.items()}
    assert np.linalg.norm(x, 1).item() == max(sums[0])
    assert np.linalg.norm(x, np.inf).item() == max(sums[1])
    for axis, each in lines.items():
        squares = [from_left(fmt, [fmt.round(value**2) for value in line]) for line in each]
        assert np.ravel(np.linalg.norm(x, axis=axis)).tolist() == np.sqrt(fmt.array(squares)).tolist()
        if axis is not None:
            assert np.linalg.norm(x, 1, axis).tolist() == sums[axis]
            assert np.linalg.norm(x, np.inf, axis).tolist() == abs(rows).max(axis).tolist()
    assert np.cumsum(x[:0]).shape == (0,)
    assert np.cumsum(x[:0], axis=1).shape == (0, 4)
    assert x[:0].sum(0).tolist() == [0] * 4
    assert x[:0].prod(0).tolist() == [1] * 4


def test_numbers_that_float64_cannot_tell_apart_are_compared_exactly():
    fmt = FloatFormat(2, 113)
    x = fmt.array([1, 1 + Fraction(1, 2**100), 1])
    assert np.argmax(x) == 1
    assert np.argsort(-x).tolist() == [1, 0, 2]
    assert np.sign(x - 1).tolist() == [0, 1, 0]
    assert np.maximum(x, 1).tolist() == x.tolist()
    assert np.any(x - 1)
    assert not np.array_equal(x, [1, 1, 1])


def test_closeness_is_computed_exactly_from_any_numbers():
    fmt = FloatFormat(10, 30)
    edge = 1 + Fraction(1e-8) + Fraction(1e-5)  # the largest number close to 1, which float64 does not hold
    x, above = fmt.array([edge, 1]), edge + Fraction(1, 10**28)
    assert np.isclose(np.array([edge, above], dtype=object), fmt.array(1)).tolist() == [True, False]
    for b in (1000, Fraction(-1, 4)):  # the tolerance is relative to the second number
        edge = b + Fraction(1e-8) + abs(b) * Fraction(1e-5)
        pair = np.array([edge, edge + Fraction(1, 10**28)], dtype=object)
        assert np.isclose(pair, fmt.array(b)).tolist() == [True, False]
    assert np.allclose(x, 1)
    assert not np.allclose(x, 1, rtol=0)
    assert np.allclose(x, [1.1, 1.0], rtol=0, atol="0.1")
    assert np.allclose(x, FloatFormat(2, 8).array(1))


def test_stochastic_rounding_of_elementary_functions_has_the_exact_mean():
    fmt, count = FloatFormat(2, 4, Rounding.STOCHASTIC, seed=3), 2000
    fmt.restart()
    found = np.exp(fmt.array([1] * count)).to_float()
    up = (math.e - 2.5) / 0.25  # between the neighbours 2.5 and 2.75
    assert set(found) == {2.5, 2.75}
    assert abs(np.mean(found == 2.75) - up) < 4 * math.sqrt(up * (1 - up) / count)  # four standard errors


def arguments(name: str, count: int) -> np.ndarray:
    """Numbers at which a function is finite, some of them zero or small."""
    rng = np.random.default_rng(ord(name[-1]))
    values = rng.uniform(-0.99, 0.99, count) * rng.choice([1, 1e-3], count)
    values[::10] = 0
    return abs(values) + (1 if name == "arccosh" else 0.01) if name in ("log", "log2", "log10", "arccosh") else values


def test_results_by_float64_are_those_of_arb() -> None:
    for name in ELEMENTARY:
        decided = 0
        for fmt in (BINARY32, BFLOAT16, FloatFormat(2, 24, "chop"), FloatFormat(16, 6), FloatFormat(2, 44)):
            x = fmt.array(arguments(name, 40))
            found = elementary._by_float64(name, x)
            assert found is not None
            decided += np.count_nonzero(~found[1])
            exact = elementary._by_arb(name, [x], np.ndindex(x.shape))
            assert np.array_equal(getattr(np, name)(x), exact)
        assert decided > 100


def test_numpys_functions_are_closer_than_the_doubt_about_them() -> None:
    for name in ELEMENTARY:
        wide = FloatFormat(2, 120)
        x = arguments(name, 200)
        exact = wide.array(elementary._by_arb(name, [wide.array(x)], np.ndindex(x.shape)))
        for found, expected in zip(getattr(np, name)(x).tolist(), exact.to_fractions().tolist(), strict=True):
            assert abs(Fraction(found) - expected) <= abs(expected) * (Fraction(elementary._DOUBTED[1]) - 1) / 4


def test_a_result_in_doubt_is_left_to_arb(monkeypatch: pytest.MonkeyPatch) -> None:
    x = BINARY32.array(arguments("exp", 40))
    expected = np.exp(x)
    monkeypatch.setattr(elementary, "_DOUBTED", np.array([0.75, 1.25]))
    found = elementary._by_float64("exp", x)
    assert found is not None
    assert found[1].all()
    assert np.array_equal(np.exp(x), expected)
