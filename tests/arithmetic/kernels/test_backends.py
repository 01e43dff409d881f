"""Which backend holds a format; beyond a backend and between two, the digits are those of the exact kernel."""

from __future__ import annotations

import operator
import pickle
import re
from collections import Counter
from fractions import Fraction
from random import Random
from typing import Any

import numpy as np
import pytest

from gpbnb import BFLOAT16, BINARY32
from gpbnb.arithmetic import linalg, named
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.kernels.backends import Compiled, Exact, Floats, Pairs, TwoWords, backend
from gpbnb.arithmetic.kernels.tags import Double, Proved, Quick, Single
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
    edges = [2**60, 2**63] if fmt.base == 10 else [520, 960, 1023, 1074]
    e = random.randint(-30, 30) + random.choice([0, 0, *edges, *(-edge for edge in edges)])
    return random.choice([m, -m]), e


def made(fmt: FloatFormat, pairs: list[tuple[int, int]]) -> FloatArray:
    m, e = np.array(pairs, dtype=object).T
    return FloatArray.from_pairs(m, e, fmt)


# Few numbers at once, or one: a number beyond the range sends them all to the exact backend.
@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize(("base", "precision"), [(2, 1), (2, 26), (10, 10), (16, 1)])
def test_operations_at_the_edge_of_the_range_are_exact(base: int, precision: int, rounding: Rounding) -> None:
    fmt, random = FloatFormat(base, precision, rounding), Random(960)
    for count in 30 * [1] + 10 * [3]:
        check_operations(*(made(fmt, [pair(random, fmt) for _ in range(count)]) for _ in range(2)))


@pytest.mark.parametrize("rounding", [Rounding.NEAREST, Rounding.CHOP])
@pytest.mark.parametrize(("base", "precision"), COMPILED)
def test_a_power_of_the_base_less_a_far_number_has_a_digit_more(base: int, precision: int, rounding: Rounding) -> None:
    """From each number of digits below, up to where only its sign matters."""
    fmt, least = FloatFormat(base, precision, rounding), base ** (precision - 1)
    far = {least, least + base // 2, base * least // 2, base * least // 2 + 1, base * least - 1}
    pairs = [(m, -d) for d in range(precision + 4) for m in far if least <= m < base * least]
    x, y = made(fmt, len(pairs) * [(least, 0)]), made(fmt, pairs)
    for one, other in ((x, y), (x, -y), (-x, y)):
        assert same(one + other, one.on_exact_backend() + other.on_exact_backend())


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


FORMATS = {
    "binary128": named.BINARY128,
    "54 bits": FloatFormat(2, 54),
    "64 bits, up": FloatFormat(2, 64, "up"),
    "53 bits, saturating": FloatFormat(2, 53, emin=-200, emax=200, overflow="saturate"),
    "24 bits, far": FloatFormat(2, 24, "even", emin=-16382, emax=16383),
    "IBM, 14 digits": named.IBM_HEX64,
    "decimal128": named.DECIMAL128,
    "19 digits, odd": FloatFormat(10, 19, "odd"),
    "Q16.40": FixedFormat(16, 40),
    "Q0.63": FixedFormat(0, 63, "even", overflow="saturate"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_format_is_stored_in_two_words(name: str) -> None:
    assert isinstance(FORMATS[name].backend, TwoWords)


def values(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    far = rng.standard_normal(40) * 10.0 ** rng.integers(-40, 40, 40)
    few = rng.integers(-99, 99, 40) / 2.0 ** rng.integers(0, 40, 40)
    return np.concatenate([far, few, rng.uniform(-1, 1, 100), [0.0, 5e-324, 0.1, -(2.0**-60), 2.0**53 + 2, 1e22, 1e23]])


@pytest.mark.parametrize("name", FORMATS)
def test_float64_is_rounded_like_its_fraction(name: str) -> None:
    fmt: Any = FORMATS[name]
    x = values(3)
    if isinstance(fmt, FixedFormat):
        x = x[np.abs(x) < 0.99]
    if fmt.limits is not None:
        x = x[(x == 0) | (np.abs(x) > 1e-70) & (np.abs(x) < 1e70)]
    expected = fmt.array([Fraction(value) for value in x.tolist()])
    assert np.all(fmt.array(x) == expected)
    whole = np.array([0, 1, -1, 2**62 + 1, -(2**63) + 1]) if not isinstance(fmt, FixedFormat) else np.array([0])
    assert np.all(fmt.array(whole) == fmt.array(whole.tolist()))


NARROW = {
    "binary32": named.BINARY32,
    "binary64": named.BINARY64,
    "24 bits": FloatFormat(2, 24),
    "6 hexadecimal": FloatFormat(16, 6, "chop"),
    "Q7.8": FixedFormat(7, 8, "down"),
    "8 digits": FloatFormat(10, 8),
    "17 digits": FloatFormat(10, 17, "chop"),
    "decimal64": named.DECIMAL64,
}
ALL = FORMATS | NARROW


@pytest.mark.parametrize("source", ALL)
def test_conversion_between_formats_rounds_once(source: str) -> None:
    tiny = [Fraction(1, 10**9), Fraction(3, 10**25)] if not isinstance(ALL[source], FixedFormat) else []
    halves = [Fraction(2 * n + 1, 2**k) for k in (9, 25, 54) for n in (0, 6)]
    x = ALL[source].array([*(Fraction(n, 97) for n in range(-96, 97, 5)), *tiny, *halves])
    for target in ALL.keys() - {source}:
        found, expected = ALL[target].array(x), ALL[target].array(x.to_fractions())
        assert np.all(found == expected), target
        assert found.backend is expected.backend, target
        if type(x.backend) is not type(found.backend) or ALL[source].base != ALL[target].base:
            assert ALL[target].backend.from_backend(x.backend, x.components) is not None, target


@pytest.mark.parametrize("name", ["binary128", "decimal128", "Q16.40", "binary32", "17 digits", "6 hexadecimal"])
def test_sorting_orders_like_fractions_and_keeps_the_order_of_equal_entries(name: str) -> None:
    fmt = ALL[name]
    rng = np.random.default_rng(8)
    step = fmt.unit_roundoff / 2 if isinstance(fmt, FloatFormat) else Fraction(1, 2**40)
    near = [Fraction(1, 2) + k * step for k in range(5)]
    numbers = [*near, Fraction(0), *(Fraction(int(n), 8) for n in rng.integers(-40, 40, 31)), *(-x for x in near)]
    x = fmt.array([numbers[i] for i in rng.permutation(len(numbers))]).reshape(6, 7)
    fractions = x.to_fractions()
    for axis in (0, 1, -1, None):
        assert np.array_equal(np.argsort(x, axis=axis), np.argsort(fractions, axis=axis, kind="stable"))


PRODUCTS = {
    "bfloat16": BFLOAT16,
    "24 bits, even": FloatFormat(2, 24, "even"),
    "24 bits, even, flushed": FloatFormat(2, 24, "even", emin=-100, emax=100, subnormal=False),
    "24 bits, even, small": FloatFormat(2, 24, "even", emin=-40, emax=40),
    "53 bits, even": FloatFormat(2, 53, "even"),
    "53 bits, even, small": FloatFormat(2, 53, "even", emin=-100, emax=100),
}


def chosen(name: str, scale: float) -> Any:
    """The kind of numbers in which a product of two matrices is computed."""
    a = PRODUCTS[name].array(scale * np.random.default_rng(1).uniform(0.5, 1, (30, 30)))
    assert isinstance(a.backend, Compiled)
    return next(iter(a.backend._attempts([a.components, a.components], 27_000)))[0]


def test_products_without_range_checks_are_those_that_cannot_leave_the_range() -> None:
    assert chosen("bfloat16", 1.0) == Proved()
    assert chosen("bfloat16", 2.0**61.5) == Quick()
    assert chosen("24 bits, even", 1.0) == Single()
    assert chosen("24 bits, even", 2.0**-60) == Proved()
    assert chosen("24 bits, even", 2.0**-475) == Quick()
    assert chosen("24 bits, even, flushed", 2.0**-48) == Quick()
    assert chosen("24 bits, even, small", 2.0**-10) == Proved()
    assert chosen("53 bits, even", 1.0) == Double()
    assert chosen("53 bits, even, small", 2.0**-30) == Quick()


def test_a_product_without_range_checks_has_the_digits_of_the_exact_backend() -> None:
    a = PRODUCTS["24 bits, even"].array(np.random.default_rng(1).uniform(0.5, 1, (30, 30)))
    exact = a.on_exact_backend()
    assert all(map(np.array_equal, (a @ a).to_pairs(), (exact @ exact).to_pairs()))


def test_the_first_operations_of_a_kind_are_exact_and_the_next_ones_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    fmt, load, used = FloatFormat(16, 6), backends._loops, []
    monkeypatch.setattr(backends, "LOOPS_AFTER", 1000)
    monkeypatch.setattr(backends, "_DONE", Counter())
    monkeypatch.setattr(backends, "_loops", lambda name: used.append(name) or load(name))
    x, y = fmt.array([1, 2, 3]) / 7, fmt.array([9, -5, 4]) / 11

    def results() -> list[FloatArray]:
        product, fused, sums = np.outer(x, y) @ y, x.multiply_add(y, x), [x.sum(), x.prod(), np.cumsum(y)]
        return [x - y, x / y, np.sqrt(x), product, fused, *sums, linalg.inv(np.outer(x, y) + fmt.eye(3))]

    early = results()
    assert not {"elementwise", "matrices"} & {*used}
    assert all(each.backend is fmt.backend for each in early)
    for _ in range(30):
        late = results()
    assert {"elementwise", "matrices"} & {*used}
    assert all(each.backend is fmt.backend for each in late)
    assert all(same(a, b) for a, b in zip(early, late, strict=True))


@pytest.mark.parametrize("after", [0, 10**9], ids=["in loops", "before loops"])
@pytest.mark.parametrize("fmt", [BINARY32, FloatFormat(10, 7, emin=-30, emax=30), FixedFormat(4, 11)], ids=str)
def test_an_overflow_is_named_with_the_place_of_the_first(
    fmt: Any, after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backends, "LOOPS_AFTER", after)
    x = fmt.array([0, fmt.largest, fmt.largest])
    for operation, name in ((operator.add, "addition"), (operator.mul, "multiplication")):
        for a, b, place in ((x, x, " at [1]"), (x[2], x, " at [1]"), (x, x[:, None], " at [1, 1]"), (x[1], x[2], "")):
            with pytest.raises(OverflowError, match=f"^{re.escape(name + place)}: (got|overflow)"):
                operation(a, b)


@pytest.mark.parametrize(
    "y", [0x108A7BAF98BFC4591761C439A03AB, 0x11844F8AA41D370E71B70961B6AAC, 0x1107C655C58194001D2C262E4D0AF]
)
def test_the_first_guess_of_a_reciprocal_may_be_two_too_large(y: int) -> None:
    """It is, if the second word of a divisor is its first plus a remainder of all bits by it, plus one."""
    fmt, random = FloatFormat(2, 113, "chop"), Random(1)
    tops = [y - 1 - random.randrange(2 ** random.randrange(1, 112)) for _ in range(200)]
    found = fmt.array(tops) / fmt.array(y)
    assert found.to_fractions().tolist() == [fmt.round(Fraction(x, y)) for x in tops]


@pytest.mark.usefixtures("loops_at_once")
def test_each_entry_of_an_operand_counts() -> None:
    with pytest.raises(ValueError, match="holds exactly"):
        _ = FloatFormat(2, 60).array([0, 0]) + np.array([1, 2**62 + 1])
    x = BINARY32.array([1, 2, 3])
    assert x.multiply_add(x, BINARY32.zeros((2, 3))).to_float().tolist() == [[1, 4, 9], [1, 4, 9]]
