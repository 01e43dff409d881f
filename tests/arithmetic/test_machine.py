"""The machine: random programs, rows without a result, functions for many lanes, errors of double-double numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import gmpy2
import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.lanes import recorded, repeatable
from gpbnb.arithmetic.machine import (
    CODES,
    NEGATIVE_ROOT,
    OPERANDS,
    OVERFLOW,
    ZERO_DIVISOR,
    ZERO_PIVOT,
    Memory,
    accumulate,
    code_of,
    evaluate,
    fault_of,
    independent,
    tables,
)
from tests.oracles import floating

INPUTS, ROWS = 12, 150
OPERATIONS = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "negative": lambda x, y: -x,
    "absolute": lambda x, y: abs(x),
}
NAMES = (*OPERATIONS, "choose", "compare", "combine")
FORMATS = [
    *(FloatFormat(2, t, rounding) for t in (1, 11, 24, 26, 40, 52, 53) for rounding in ("nearest", "chop")),
    *(FloatFormat(2, t, rounding) for t in (2, 24, 33, 53) for rounding in ("even", "up", "down")),
    FloatFormat(2, 20, "odd"),
    *(FloatFormat(*each, "half up") for each in ((2, 11), (2, 30), (2, 52), (2, 53), (10, 9), (16, 6), (16, 13))),
    *(FloatFormat(16, t, rounding) for t in (1, 6, 13) for rounding in ("nearest", "chop", "even")),
    *(FloatFormat(10, t, rounding) for t in (1, 8, 9, 18) for rounding in ("nearest", "chop")),
    FloatFormat(10, 12, "even"),
    FloatFormat(2, 11, "even", -14, 15),
    FloatFormat(2, 24, "even", -126, 127),
    FloatFormat(2, 64, "even"),
    FloatFormat(10, 25),
]


def rounded(x, fmt):
    return floating(fmt.base, fmt.precision, fmt.rounding.value, fmt.emin)(Fraction(x))


def drawn(rng, exact, fmt):
    """Draw a program whose results stay within small powers of the base, and compute it with fractions."""
    rows, truths = [], [False, True]
    while len(rows) < ROWS:
        name = str(rng.choice(NAMES))
        a, b, c = rng.integers(0, len(exact), 3).tolist()
        p, q = rng.integers(0, len(truths), 2).tolist()
        x, y, z = exact[a], exact[b], exact[c]
        if name == "compare":
            orders = int(rng.integers(8))
            rows.append((CODES[name], a, b, orders, len(truths)))
            truths.append(bool(orders >> ((x > y) - (x < y) + 1) & 1))
            continue
        if name == "combine":
            table = int(rng.integers(16))
            rows.append((CODES[name], p, q, table, len(truths)))
            truths.append(bool(table >> (2 * truths[p] + truths[q]) & 1))
            continue
        if name == "divide" and y == 0:
            continue
        if name == "choose":
            row, result = (p, b, c), y if truths[p] else z
        else:
            row = a, b, 0
            result = rounded(OPERATIONS[name](x, y), fmt)
        if result and not Fraction(1, 200) < abs(result) < 200:
            continue
        rows.append((CODES[name], *row, len(exact)))
        exact.append(result)
    return np.array(rows, np.int64), truths


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_a_program_has_the_digits_of_fractions(fmt):
    rng = np.random.default_rng([fmt.base, fmt.precision])
    given = [rounded(Fraction(int(each), 24), fmt) for each in rng.integers(-400, 400, INPUTS)]
    exact = [Fraction(0), *given]
    rows, expected = drawn(rng, exact, fmt)
    kind, formats = tables([fmt])
    packed = fmt.backend.pack(fmt.array(exact[: 1 + INPUTS]).components)
    alone = packed.ndim == 1
    for lanes in (1, 5):
        shape = () if alone and lanes == 1 else (lanes, *packed.shape[1:])
        values, truths = np.zeros((len(exact), *shape), packed.dtype), np.zeros((len(expected), *shape[:1]), np.uint8)
        values[: len(packed)] = packed if not shape else packed[:, np.newaxis]
        truths[1] = 1
        assert evaluate(Memory(values, truths), kind, formats, code_of(rows, np.zeros(ROWS, np.int64))) == ROWS
        for lane in range(lanes):
            numbers = values if not shape else values[:, lane]
            found = fmt.backend.to_exact(fmt.backend.unpack(numbers))
            assert [fmt.kernel.to_fraction(*each) for each in zip(*found, strict=True)] == exact
            assert (truths if not shape else truths[:, lane]).astype(bool).tolist() == expected


@pytest.mark.parametrize(
    ("name", "row", "reason"),
    [
        *(("multiply", (1, 1), OVERFLOW), ("divide", (1, 0), ZERO_DIVISOR), ("nonzero", (0, 0), ZERO_PIVOT)),
        ("sqrt", (5, 0), NEGATIVE_ROOT),
    ],
)
@pytest.mark.parametrize("fmt", [FloatFormat(2, 11, "even", -14, 15), FloatFormat(2, 24)], ids=str)
def test_the_first_row_without_a_result_is_named(fmt, name, row, reason):
    """Alone, and in one lane of three whose numbers are 1 in the others."""
    large = Fraction(60000) if fmt.emax is not None else Fraction(2) ** 800
    values, truths = np.array([0.0, float(large), 1.0, 0.0, 0.0, -1.0]), np.array([0, 1], np.uint8)
    rows = np.array([(CODES["add"], 2, 2, 0, 3), (CODES[name], *row, 0, 4)], np.int64)
    kind, formats = tables([fmt])
    code = code_of(rows, np.zeros(2, np.int64))
    for lane in (0, 2):
        lanes = np.ones((6, 3))
        lanes[:, lane] = values
        assert evaluate(Memory(lanes, np.repeat(truths[:, None], 3, axis=1)), kind, formats, code) == 1
    done = evaluate(Memory(values, truths), kind, formats, code)
    fault = fault_of(rows, values, done)
    assert (fault.row, fault.reason) == (1, reason)
    assert values[3] == 2


@pytest.mark.parametrize(("name", "powers"), [("multiply", (-600, -600)), ("divide", (-600, 600))])
@pytest.mark.parametrize("lanes", [(), (3,)], ids=["one lane", "lanes"])
def test_a_result_below_float64_is_no_zero_where_the_format_has_no_end(name, powers, lanes):
    """The processor's product, or quotient, is zero; those of later lanes are 1."""
    values, truths = np.ones((3, *lanes)), np.zeros((2, *lanes), np.uint8)
    values.reshape(3, -1)[:2, 0] = [2.0**each for each in powers]
    rows = np.array([(CODES[name], 0, 1, 0, 2)], np.int64)
    kind, formats = tables([FloatFormat(2, 24)])
    assert evaluate(Memory(values, truths), kind, formats, code_of(rows, np.zeros(1, np.int64))) == 0


def test_rows_are_left_out_where_a_truth_value_does_not_hold():
    skip, divide, add = (CODES[name] for name in ("skip", "divide", "add"))
    kind, formats = tables([FloatFormat(2, 24)])
    for truth, done, found in ((0, 4, [0, 0, 6]), (1, 1, None)):
        values, truths = np.array([0.0, 3.0, 0.0, 0.0, 0.0]), np.array([0, 1], np.uint8)
        rows = np.array([(skip, truth, 2, 0, 9), (divide, 1, 0, 0, 2), (add, 1, 1, 0, 3), (add, 1, 1, 0, 4)], np.int64)
        assert evaluate(Memory(values, truths), kind, formats, code_of(rows, np.zeros(4, np.int64))) == done
        assert found is None or values[2:].tolist() == found


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


COUNT = 4_000
# Of the theorems cited in the kernel, the largest: quotients, 15 u**2 and terms of higher order, u = 2**-53.
BOUND = 2.0**-102


def operands(rng: np.random.Generator, cancelling: bool) -> tuple[Any, Any]:
    high = rng.standard_normal((2, COUNT)) * 2.0 ** rng.integers(-60, 60, (2, COUNT))
    share = rng.choice([0.0, 0.5, -0.5, 1e-9, 1.0], (2, COUNT)) * rng.uniform(0, 1, (2, COUNT))
    low = share * np.spacing(np.abs(high)) / 2
    if cancelling:  # the sum loses up to all but the last bits
        high[1] = -high[0] * (1 + rng.integers(-2, 3, COUNT) * 2.0 ** -rng.integers(20, 53, COUNT))
    high, rest = high + low, low - ((high + low) - high)
    return (high[0], rest[0]), (high[1], rest[1])


def computed(name: str, a: Any, b: Any) -> tuple[Any, Any] | None:
    """Compute one operation on many numbers, in lanes and in rows; None if one of them has no result."""
    count = len(a[0])
    values = np.zeros((3, count, 2))
    values[0], values[1] = np.transpose(a), np.transpose(b)
    kind, formats = tables([None])
    row = code_of(np.array([[CODES[name], 0, 1, 0, 2]]), np.zeros(1, np.int64))
    done = evaluate(Memory(values, np.zeros((2, count), np.uint8)), kind, formats, row)
    alone, at = np.concatenate([values[0], values[1, ::-1], 0 * values[2]])[:, np.newaxis], np.arange(count)
    rows = np.stack([np.full(count, CODES[name]), at, 2 * count - 1 - at, 0 * at, 2 * count + at], axis=1)
    memory = Memory(alone, np.zeros((2, 1), np.uint8))
    assert (evaluate(memory, kind, formats, code_of(rows, 0 * at)) == count) == bool(done)
    assert not done or np.array_equal(alone[2 * count :, 0], values[2])
    return (values[2, :, 0], values[2, :, 1]) if done else None


def exact(x: Any) -> list[gmpy2.mpfr]:
    return [gmpy2.mpfr(high) + gmpy2.mpfr(low) for high, low in zip(*map(np.ndarray.tolist, x), strict=True)]


@pytest.mark.parametrize("name", ["add", "subtract", "multiply", "divide", "sqrt"])
@pytest.mark.parametrize("cancelling", [False, True])
def test_relative_errors_stay_below_the_bound(name: str, cancelling: bool) -> None:
    a, b = operands(np.random.default_rng(102), cancelling)
    if name == "sqrt":
        sign = np.where(a[0] < 0, -1.0, 1.0)
        a = a[0] * sign, a[1] * sign
    out = computed(name, a, b)
    assert out is not None
    function = {
        "add": lambda x, y: x + y,
        "subtract": lambda x, y: x - y,
        "multiply": lambda x, y: x * y,
        "divide": lambda x, y: x / y,
        "sqrt": lambda x, y: gmpy2.sqrt(x),
    }[name]
    worst = gmpy2.mpfr(0)
    with gmpy2.context(precision=400) as context:
        operands_and_results = list(zip(exact(a), exact(b), exact(out), strict=True))
        pairs = [(function(x, y), found) for x, y, found in operands_and_results]
        assert not context.inexact or name in ("divide", "sqrt")
        for expected, found in pairs:
            if expected == 0:
                assert found == 0
            else:
                worst = max(worst, abs((found - expected) / expected))
    assert worst <= BOUND
    if name != "subtract" or not cancelling:
        assert worst > BOUND / 2**8  # else the operands were easy
    assert np.array_equal(out[0] + out[1], out[0])


def test_range_and_zero() -> None:
    zero, tiny, huge = ((np.append(each, np.ones(4)), np.zeros(5)) for each in (0.0, 2.0**-500, 2.0**600))
    for name, operands_of in (("multiply", (zero, huge)), ("subtract", (huge, huge))):
        out = computed(name, *operands_of)
        assert out is not None
        assert out[0][0] == 0
    assert computed("multiply", tiny, tiny) is None
    assert computed("multiply", huge, huge) is None
    assert computed("divide", tiny, huge) is None


def test_rows_run_together_that_do_not_take_results_of_each_other():
    rng = np.random.default_rng(1)
    codes = np.repeat(rng.integers(0, len(CODES), 60), rng.integers(1, 30, 60))
    rows = np.zeros((len(codes), 5), np.int64)
    rows[:, 0], rows[:, 4] = codes, np.arange(50, 50 + len(codes))
    rows[:, 1:4] = rows[:, 4:] - rng.integers(1, 50, (len(codes), 3))
    found = list(independent(rows))
    assert [begin for begin, _ in found] == [0, *(end for _, end in found[:-1])]
    assert found[-1][1] == len(rows)
    for begin, end in found:
        for code, *places, result in rows[begin:end].tolist():
            numbers, truths = (np.array(places)[each[code]].tolist() for each in OPERANDS)
            own = truths if code == CODES["combine"] else [] if code == CODES["compare"] else numbers
            assert code == rows[begin, 0]
            assert not [each for each in own if rows[begin, 4] <= each < result]
    assert max(end - begin for begin, end in found) > 5


@pytest.mark.parametrize("fmt", [FloatFormat(2, 24), FloatFormat(2, 53, "chop"), FloatFormat(16, 6)], ids=str)
@pytest.mark.parametrize("factor", [2.0**100, 2.0**-100])
def test_powers_beyond_the_range_of_float64_have_no_result(fmt, factor):
    held = 10 if factor > 1 else 9
    kind, formats = tables([fmt])
    rows = np.array([(CODES["multiply"], k, 0, 0, k + 1) for k in range(12)])
    powers, truths = np.full((13, 1), factor), np.array([[0], [1]], np.uint8)
    assert evaluate(Memory(powers, truths), kind, formats, code_of(rows, np.zeros(12, np.int64))) == held - 1
    assert powers[:held, 0].tolist() == [factor**k for k in range(1, held + 1)]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_decimal_exponent_beyond_the_machine_has_no_result(sign):
    kind, formats = tables([FloatFormat(10, 2)])
    for count in (3, 20):
        powers = np.full((count, 1, 2), [10, sign * 2**58])
        assert accumulate(kind, formats, "multiply", powers) == (count == 3)


def _times_all(x, factors):
    for each in factors:
        x = x * each
    return x


@pytest.mark.parametrize("steps", [1, 2, 3, 100])
def test_steps_whose_numbers_are_far_from_one_on_the_way_are_rounded_as_well(steps):
    """Quick computation leaves the first step of four, in which a product is 1e-200, and goes on behind it."""
    fmt, far = FloatFormat(2, 24), "1e-100"
    factors = fmt.array([[far, far, "1e100", "1e100"], *([[each] * 4 for each in ("1.01", "0.99", "1.003")])])
    loop = repeatable(_times_all, ((1,), (4,))).loop(fmt)
    loop.states = np.array([1.5])
    loop.feed([(2, factors.to_float())])
    loop.keep(loop.after)
    kept, _, row = loop.take(0, steps)
    x, expected = fmt.round("1.5"), []
    for k in range(steps):
        x = _times_all(fmt.array([x]), factors[k % 4]).to_fractions()[0]
        expected.append(x)
    assert row == -1
    assert list(map(Fraction, kept.ravel().tolist())) == expected
