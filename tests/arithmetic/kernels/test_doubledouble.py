"""The reference arithmetic against MPFR at 400 bits, in which sums and products of the operands are exact."""

from __future__ import annotations

from typing import Any

import gmpy2
import numpy as np
import pytest

from gpbnb.arithmetic.machine import CODES, code_of, evaluate, tables

COUNT = 20_000
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
    """Compute one operation on many numbers; None if one of them has no result."""
    values = np.zeros((3, len(a[0]), 2))
    values[0], values[1] = np.transpose(a), np.transpose(b)
    kind, formats = tables([None])
    row = code_of(np.array([[CODES[name], 0, 1, 0, 2]]), np.zeros(1, np.int64))
    done = evaluate(kind, formats, row, values, np.zeros((2, len(a[0])), np.uint8))
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
    zero, tiny, huge = (
        (np.zeros(1), np.zeros(1)),
        (np.array([2.0**-500]), np.zeros(1)),
        (np.array([2.0**600]), np.zeros(1)),
    )
    for name, operands_of in (("multiply", (zero, huge)), ("subtract", (huge, huge))):
        out = computed(name, *operands_of)
        assert out is not None
        assert out[0][0] == 0
    assert computed("multiply", tiny, tiny) is None
    assert computed("multiply", huge, huge) is None
    assert computed("divide", tiny, huge) is None
