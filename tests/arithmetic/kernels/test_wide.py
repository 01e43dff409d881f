"""Significands of two words against the exact kernel: which formats have them, conversions, and matrices."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from gpbnb.arithmetic import named
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import TwoWords

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
