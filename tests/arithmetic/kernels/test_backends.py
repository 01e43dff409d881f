"""FloatArrays beyond their compiled backend, and between the two: the digits are those of the exact kernel."""

from __future__ import annotations

import operator
import pickle
from fractions import Fraction
from random import Random
from typing import Any

import numpy as np
import pytest

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled, Exact, Floats, Pairs, TwoWords, backend
from gpbnb.arithmetic.rounding import Rounding, Rules

OPERATIONS = [operator.add, operator.sub, operator.mul, operator.truediv]
COMPILED = [(2, 1), (2, 24), (2, 26), (2, 53), (10, 1), (10, 9), (10, 10), (10, 18), (16, 1), (16, 13)]


def pair(random: Random, fmt: FloatFormat) -> tuple[int, int]:
    """A number inside the range of the backend, at its edge, or far beyond."""
    least = fmt.base ** (fmt.precision - 1)
    last = fmt.base * least - 1
    m = random.choice([random.randint(least, last), random.randint(least, last), least, last])
    if random.randrange(10) == 0:
        return 0, 0
    edges = [2**60, 2**63] if fmt.base == 10 else [960, 1023, 1074]
    e = random.randint(-30, 30) + random.choice([0, 0, *edges, *(-edge for edge in edges)])
    return random.choice([m, -m]), e


def made(fmt: FloatFormat, pairs: list[tuple[int, int]]) -> FloatArray:
    m, e = np.array(pairs, dtype=object).T
    return FloatArray.from_pairs(m, e, fmt)


# Few numbers at once: one beyond the range sends them all to the exact backend.
@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize(("base", "precision"), COMPILED[::2])
def test_operations_at_the_edge_of_the_range_are_exact(base: int, precision: int, rounding: Rounding) -> None:
    fmt, random = FloatFormat(base, precision, rounding), Random(960)
    for _ in range(20):
        check_operations(*(made(fmt, [pair(random, fmt) for _ in range(3)]) for _ in range(2)))


def check_operations(x: FloatArray, y: FloatArray) -> None:
    p, q = x.on_exact_backend(), y.on_exact_backend()
    assert isinstance(p.backend, Exact)
    for operation in OPERATIONS[:3]:
        assert same(operation(x, y), operation(p, q))
    if np.all(y != 0):
        assert same(x / y, p / q)
    assert same(np.sqrt(abs(x)), np.sqrt(abs(p)))
    assert same(-x, -p)
    assert same(x.sum(), p.sum())
    assert same(x.prod(), p.prod())
    assert np.array_equal(x < y, p < q)
    assert np.array_equal(x == y, p == q)
    assert same(np.outer(x, y) @ y, np.outer(p, q) @ q)
    assert same(np.concatenate([x, q]), np.concatenate([p, y]))
    assert same(np.where([True, False, True], x, q), np.where([True, False, True], p, y))


def same(x: Any, y: Any) -> bool:
    return x.shape == y.shape and all(bool(np.all(p == q)) for p, q in zip(x.to_pairs(), y.to_pairs(), strict=True))


@pytest.mark.parametrize(
    ("base", "kind", "longest", "wider"),
    [(2, Floats, 53, 113), (16, Floats, 13, 28), (10, Pairs, 18, 34), (3, Exact, 1, 1), (8, Exact, 1, 1)],
)
def test_the_carrier_of_a_format(base: int, kind: type, longest: int, wider: int) -> None:
    for precision in {6, longest}:
        assert type(backend(Rules(base, precision, Rounding.NEAREST))) is kind
    for precision in range(longest + 1, wider + 1):
        assert type(backend(Rules(base, precision, Rounding.NEAREST))) is TwoWords
    assert type(backend(Rules(base, wider + 1, Rounding.NEAREST))) is Exact
    assert pickle.loads(pickle.dumps(backend(Rules(base, 6, Rounding.CHOP)))).nearest is False


@pytest.mark.parametrize(("base", "precision"), [(2, 24), (16, 6)])
def test_floats_hold_powers_of_two_from_minus_960_to_1023(base: int, precision: int) -> None:
    """At the edges: the smallest size is 2**-960, and all sizes are below 2**1024 with one digit to spare."""
    carrier, bits = backend(Rules(base, precision, Rounding.NEAREST)), base.bit_length() - 1
    least = -960 // bits - (precision - 1)
    most = 1023 // bits - precision
    for m, e, held in (
        (base ** (precision - 1), least, True),
        (base**precision - 1, least - 1, False),
        (base**precision - 1, most, True),
        (base ** (precision - 1), most + 1, False),
    ):
        found = carrier.from_exact(np.array([m], dtype=object), np.array([e], dtype=object))
        assert (found is not None) == held
        if found is not None:
            assert Fraction(float(found[0][0])) == m * Fraction(base) ** e


@pytest.mark.parametrize(("base", "precision"), COMPILED)
def test_numbers_of_usual_size_stay_on_the_compiled_backend(base: int, precision: int) -> None:
    fmt = FloatFormat(base, precision)
    assert isinstance(fmt.backend, Compiled)
    x, y = (made(fmt, [(base ** (precision - 1), -precision + k) for k in range(3)]) for _ in range(2))
    for name in ("add", "subtract", "multiply", "divide", "sqrt", "round_"):
        operands = (x, y)[: 1 if name in ("sqrt", "round_") else 2]
        found = fmt.backend.apply(name, *(each.components for each in operands))
        assert found is not None
        assert found[0].shape == (3,)
    for name in ("add", "multiply"):
        assert fmt.backend.fold(name, x.components) is not None
