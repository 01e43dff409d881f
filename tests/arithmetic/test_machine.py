"""The machine: random programs have the digits of fractions, each rounded by its definition."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.machine import CODES, OVERFLOW, ZERO_DIVISOR, ZERO_PIVOT, code_of, evaluate, fault_of, tables
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
        assert evaluate(kind, formats, code_of(rows, np.zeros(ROWS, np.int64)), values, truths) == ROWS
        for lane in range(lanes):
            numbers = values if not shape else values[:, lane]
            found = fmt.backend.to_exact(fmt.backend.unpack(numbers))
            assert [fmt.kernel.to_fraction(*each) for each in zip(*found, strict=True)] == exact
            assert (truths if not shape else truths[:, lane]).astype(bool).tolist() == expected


@pytest.mark.parametrize(
    ("name", "row", "reason"),
    [("multiply", (1, 1), OVERFLOW), ("divide", (1, 0), ZERO_DIVISOR), ("nonzero", (0, 0), ZERO_PIVOT)],
)
@pytest.mark.parametrize("fmt", [FloatFormat(2, 11, "even", -14, 15), FloatFormat(2, 24)], ids=str)
def test_the_first_row_without_a_result_is_named(fmt, name, row, reason):
    large = Fraction(60000) if fmt.emax is not None else Fraction(2) ** 800
    values, truths = np.array([0.0, float(large), 1.0, 0.0, 0.0]), np.array([0, 1], np.uint8)
    rows = np.array([(CODES["add"], 2, 2, 0, 3), (CODES[name], *row, 0, 4)], np.int64)
    kind, formats = tables([fmt])
    done = evaluate(kind, formats, code_of(rows, np.zeros(2, np.int64)), values, truths)
    fault = fault_of(rows, values, done)
    assert (fault.row, fault.reason) == (1, reason)
    assert values[3] == 2


@pytest.mark.parametrize(("name", "powers"), [("multiply", (-600, -600)), ("divide", (-600, 600))])
@pytest.mark.parametrize("lanes", [(), (3,)], ids=["one lane", "lanes"])
def test_a_result_below_float64_is_no_zero_where_the_format_has_no_end(name, powers, lanes):
    """The processor's product, or quotient, is zero."""
    values, truths = np.zeros((3, *lanes)), np.zeros((2, *lanes), np.uint8)
    values[0], values[1] = (2.0**each for each in powers)
    rows = np.array([(CODES[name], 0, 1, 0, 2)], np.int64)
    kind, formats = tables([FloatFormat(2, 24)])
    assert evaluate(kind, formats, code_of(rows, np.zeros(1, np.int64)), values, truths) == 0


def test_rows_are_left_out_where_a_truth_value_does_not_hold():
    skip, divide, add = (CODES[name] for name in ("skip", "divide", "add"))
    kind, formats = tables([FloatFormat(2, 24)])
    for truth, done, found in ((0, 4, [0, 0, 6]), (1, 1, None)):
        values, truths = np.array([0.0, 3.0, 0.0, 0.0, 0.0]), np.array([0, 1], np.uint8)
        rows = np.array([(skip, truth, 2, 0, 9), (divide, 1, 0, 0, 2), (add, 1, 1, 0, 3), (add, 1, 1, 0, 4)], np.int64)
        assert evaluate(kind, formats, code_of(rows, np.zeros(4, np.int64)), values, truths) == done
        assert found is None or values[2:].tolist() == found
