"""Pairs of numbers of few digits, and every operation, with ``==`` against exact rational arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache

import oracles
import pytest
from oracles import as_pair

from gpbnb.arithmetic.kernels.exact import kernel
from gpbnb.arithmetic.rounding import Rounding, Rules

SMALL = [(2, 1), (2, 2), (2, 3), (3, 1), (3, 2), (3, 3), (10, 1), (10, 2)]
ROUNDING = {True: Rounding.NEAREST, False: Rounding.CHOP}
E = -5  # exponent of the second operand: not zero, lest an exponent be forgotten

pytestmark = pytest.mark.parametrize("nearest", [True, False], ids=["nearest", "chop"])


def significands(base: int, precision: int) -> range:
    return range(base ** (precision - 1), base**precision)


def signed(base: int, precision: int) -> list[int]:
    positive = significands(base, precision)
    return [-m for m in positive] + [0, *positive]


def telling(base: int, precision: int) -> list[int]:
    """All numbers if they are few; else those that reach carries, ties and the ends of the range, and some others."""
    every = significands(base, precision)
    if len(every) <= 30:
        return signed(base, precision)
    first, middle, last = every[0], base**precision // 2, every[-1]
    positive = {*every[:3], *every[::11], *range(middle - 2, middle + 3), first * 2 - 1, *every[-3:], last - first}
    return [-m for m in positive] + [0, *positive]


@pytest.mark.parametrize(("base", "precision"), SMALL)
class TestSmallFormats:
    def test_sums_and_differences(self, base: int, precision: int, nearest: bool) -> None:
        # The shortcut for far-apart operands begins at the gap t + 2.
        k = kernel(Rules(base, precision, ROUNDING[nearest]))
        # All 90 two-digit numbers: in test_exact_kernel_decimal.py each of 900 with such a choice.
        numbers = second = telling(base, precision)
        gaps = [*range(precision + 6), precision + 12]
        count = 0
        for gap in gaps:
            expected: dict[int, tuple[int, int]] = {}
            for m1 in numbers:
                for m2 in second:
                    n = m1 * base**gap + m2
                    if n not in expected:
                        value = oracles.rounded(Fraction(n), base, precision, nearest)
                        m, e = as_pair(value * Fraction(base) ** E, base, precision)
                        expected[n] = m, e
                    pair, (e1, e2) = expected[n], (E + gap if m1 else 0, E if m2 else 0)
                    assert k.add(m1, e1, m2, e2) == pair
                    assert k.add(m2, e2, m1, e1) == pair
                    assert k.subtract(m1, e1, -m2, e2) == pair
                    count += 3
        assert count == 3 * (precision + 7) * len(second) ** 2

    def test_products_and_quotients(self, base: int, precision: int, nearest: bool) -> None:
        k = kernel(Rules(base, precision, ROUNDING[nearest]))

        @cache
        def expected(p: int, q: int, e: int) -> tuple[int, int]:
            value = oracles.rounded(Fraction(p, q) * Fraction(base) ** e, base, precision, nearest)
            return as_pair(value, base, precision)

        numbers, second = signed(base, precision), telling(base, precision)
        count = 0
        for gap in (-7, 0, 1):
            for m1 in numbers:
                for m2 in second:
                    e1, e2 = (E + gap if m1 else 0), (E if m2 else 0)
                    assert k.multiply(m1, e1, m2, e2) == expected(m1 * m2, 1, e1 + e2)
                    count += 1
                    if m2:
                        assert k.divide(m1, e1, m2, e2) == expected(*lowest(m1, m2), e1 - e2)
                        count += 1
        n = 2 * (base - 1) * base ** (precision - 1)
        assert count == 3 * (n + 1) * (2 * len(second) - 1)

    def test_roots(self, base: int, precision: int, nearest: bool) -> None:
        k = kernel(Rules(base, precision, ROUNDING[nearest]))
        assert k.sqrt(0, 0) == (0, 0)
        count = 0
        for m in significands(base, precision):
            for e in range(-6, 7):
                value = oracles.square_root(m * Fraction(base) ** e, base, precision, nearest)
                assert k.sqrt(m, e) == as_pair(value, base, precision)
                count += 1
        assert count == 13 * (base - 1) * base ** (precision - 1)

    def test_order(self, base: int, precision: int, nearest: bool) -> None:
        k = kernel(Rules(base, precision, ROUNDING[nearest]))
        numbers = signed(base, precision)
        for gap in (-3, -1, 0, 1, 3):
            for m1 in numbers:
                for m2 in numbers:
                    e1, e2 = (E + gap if m1 else 0), (E if m2 else 0)
                    x1, x2 = m1 * base ** (gap + 3), m2 * base**3
                    assert k.compare(m1, e1, m2, e2) == (x1 > x2) - (x1 < x2)


def test_a_value_too_long_to_write_out_is_refused(nearest: bool) -> None:
    k = kernel(Rules(10, 4, ROUNDING[nearest]))
    for e in (-3_010_300, 3_010_300, -(10**8), 10**8):  # ten million bits are 3010299 digits
        with pytest.raises(OverflowError, match="to write it as a Fraction"):
            k.to_fraction(1234, e)


def lowest(p: int, q: int) -> tuple[int, int]:
    divisor = math.gcd(p, q) if q > 0 else -math.gcd(p, q)
    return p // divisor, q // divisor


def test_every_power_is_right_beyond_the_table(nearest: bool) -> None:
    # Long significands need powers of the base that are not kept.
    k = kernel(Rules(10, 700, ROUNDING[nearest]))
    m1, m2 = 10**699 + 7, 3 * 10**699 + 1
    x1, x2 = Fraction(m1), m2 * Fraction(10) ** -650
    assert k.add(m1, 0, m2, -650) == as_pair(oracles.rounded(x1 + x2, 10, 700, nearest), 10, 700)
    assert k.divide(m1, 0, m2, -650) == as_pair(oracles.rounded(x1 / x2, 10, 700, nearest), 10, 700)
    assert k.multiply(m1, 0, m2, -650) == as_pair(oracles.rounded(x1 * x2, 10, 700, nearest), 10, 700)
    assert k.sqrt(m1, 0) == as_pair(oracles.square_root(x1, 10, 700, nearest), 10, 700)
