"""Products, elimination and sums in compiled loops, near the ends of formats, against the exact backend."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import linalg
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.named import BFLOAT16, BINARY16, BINARY32, BINARY64

pytestmark = pytest.mark.usefixtures("loops_at_once")

FORMATS = [
    BINARY16,
    BFLOAT16,
    BINARY32,
    BINARY64,
    FloatFormat(2, 24),
    FloatFormat(2, 26, "chop"),
    FloatFormat(2, 53),
    FloatFormat(2, 25, "even"),
    FloatFormat(2, 11, "even", -14, 15, subnormal=False),
    FloatFormat(2, 24, "even", -60, 60),
    FloatFormat(2, 27, "even", -60, 60),
    FloatFormat(2, 40, "up", -100, 100, subnormal=False),
    FloatFormat(2, 20, "odd", -30, 30, overflow="saturate"),
    FloatFormat(2, 53, "even", -100, 100),
    FloatFormat(16, 6, "chop", -20, 20, subnormal=False),
    FloatFormat(16, 13),
    FloatFormat(10, 7),
    FixedFormat(4, 12, rounding="down", overflow="saturate"),
    # Loops of two numbers take seconds to compile.
    pytest.param(FloatFormat(10, 12, "even", -30, 30), marks=pytest.mark.long),
    pytest.param(FloatFormat(2, 64, "even", -40, 40), marks=pytest.mark.long),
]


def drawn(fmt, rng, *shape):
    """Numbers whose products and sums are near an end of the range, or not, and some zeros."""
    if isinstance(fmt, FixedFormat):
        return fmt.array(rng.choice([0.01, 1.0, 7.9]) * rng.uniform(-1, 1, shape))
    bits = np.log2(fmt.base)
    ends = [fmt.emin, fmt.emax] if fmt.rules.limits is not None else [-880 // bits, 880 // bits]
    first = int(rng.choice([*ends, ends[0] // 2, ends[1] // 2, 0, 0])) - int(rng.integers(-3, 4))
    powers = np.clip(first + rng.integers(0, rng.choice([1, 6]) + 1, shape), *ends).astype(int)
    digits = rng.uniform(1, 1.9, shape) * rng.choice([-1, 1], shape) * (rng.random(shape) > 0.05)
    sizes = zip(digits.ravel().tolist(), powers.ravel().tolist(), strict=True)
    exact = [Fraction(digit) * Fraction(fmt.base) ** power for digit, power in sizes]
    return fmt.array(np.array(exact, object).reshape(shape))


def outcome(function, arrays):
    try:
        found = function(*arrays)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        return type(error)
    parts = found if isinstance(found, tuple) else (found,)
    return [each.tolist() if isinstance(each, np.ndarray) else [p.tolist() for p in each.to_pairs()] for each in parts]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_loops_have_the_digits_of_the_exact_backend(fmt, monkeypatch):
    monkeypatch.setattr(backends, "_MANY", 1)  # so that proofs about ranges serve small matrices, too
    rng, numbers = np.random.default_rng(20261128), 0
    for _ in range(8):
        (a, b), (s, c) = (drawn(fmt, rng, 3, 9), drawn(fmt, rng, 9, 2)), (drawn(fmt, rng, 4, 4), drawn(fmt, rng, 4, 2))
        for function, *arrays in [
            (lambda x, y: x @ y, a, b),
            (lambda x, y: x @ y, a[:1], b[:, :1]),
            (lambda x: linalg.lu(x, pivot=True), s),
            (lambda x, y: linalg.solve(x, y, pivot=True), s, c),
            (lambda x: np.cumsum(x, axis=0), b),
            (lambda x: x.prod(0), b),
        ]:
            expected = outcome(function, [x.on_exact_backend() for x in arrays])
            assert outcome(function, arrays) == expected
            numbers += isinstance(expected, list)
    assert numbers > 18


@pytest.mark.parametrize("fmt", [FloatFormat(2, 11, "stochastic"), FixedFormat(6, 10, "stochastic")], ids=str)
def test_a_product_draws_random_numbers_in_the_order_of_its_operations(fmt):
    columns, rng = 520, np.random.default_rng(20261129)  # more than run together
    a, b = (fmt.array(rng.uniform(-1, 1, shape)) for shape in ((1, 2), (2, columns)))
    fmt.restart()
    product, *sums = a @ b, b[:1] + b[1:]
    fmt.restart()
    single = [a[0, 0] * b[0, j] for j in range(columns)]
    single = [single[j] + a[0, 1] * b[1, j] for j in range(columns)]
    sums += [b[0, j] + b[1, j] for j in range(columns)]
    assert product.to_fractions()[0].tolist() == [each.to_fractions() for each in single]
    assert sums[0].to_fractions()[0].tolist() == [each.to_fractions() for each in sums[1:]]
