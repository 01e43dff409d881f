"""Every three-digit decimal number with a telling second one, with ``==`` against exact rational arithmetic."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import oracles
import pytest
from oracles import as_pair

from gpbnb.arithmetic.kernels.exact import ExactKernel, kernel
from gpbnb.arithmetic.rounding import Rounding, Rules

ROUNDING = {True: Rounding.NEAREST, False: Rounding.CHOP}
E = -5  # exponent of the second operand: not zero, lest an exponent be forgotten

pytestmark = pytest.mark.parametrize("nearest", [True, False], ids=["nearest", "chop"])


class TestThreeDecimalDigits:
    """Base 10, three digits: each of 900 significands with 30 that reach carries, ties and the ends of the range.

    They give nearly every sum and every case of a quotient. Both operands negative, zeros, and each pair in both orders
    are in test_exact_kernel.py: the code has no branch that depends on the base or the precision together with these.
    Here the order alternates with the gap.
    """

    M = np.arange(100, 1000)
    TELLING = np.array([*range(100, 106), 199, 333, *range(494, 507), 555, 667, *range(890, 893), *range(996, 1000)])

    @pytest.mark.parametrize("gap", range(9))
    def test_sums_and_differences(self, gap: int, nearest: bool) -> None:
        count = 0
        for sign in (1, -1):
            n = self.M[:, np.newaxis] * 10**gap + sign * self.TELLING
            m, e = self.added(kernel(Rules(10, 3, ROUNDING[nearest])), gap, sign * self.TELLING)
            self.check_integers(n, m, e, nearest)
            count += n.size
        assert count == 2 * 900 * 30

    def added(self, k: ExactKernel, gap: int, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        m1, m2 = self.M.astype(object)[:, np.newaxis], second.astype(object)
        add = np.frompyfunc(k.add, 4, 2)
        m, e = add(m2, E, m1, E + gap) if gap % 2 else add(m1, E + gap, m2, E)
        return m.astype(np.int64), np.where(m == 0, E, e).astype(np.int64)

    def test_products(self, nearest: bool) -> None:
        n = self.M[:, np.newaxis] * self.TELLING
        m1, m2 = self.M.astype(object), self.TELLING.astype(object)
        m, e = np.frompyfunc(kernel(Rules(10, 3, ROUNDING[nearest])).multiply, 4, 2)(m1[:, np.newaxis], 2 * E, m2, -E)
        self.check_integers(n, m.astype(np.int64), e.astype(np.int64), nearest)
        assert n.size == 900 * 30

    def check_integers(self, n: np.ndarray, m: np.ndarray, e: np.ndarray, nearest: bool) -> None:
        """Compare pairs with the integers n in units of 10**E, rounded by looking for their neighbours."""
        size = np.abs(n)
        numbers = np.array(oracles.numbers_below(int(size.max()), 10, 3))
        place = np.searchsorted(numbers, size, side="right")
        below, above = numbers[place - 1], numbers[place]
        expected = np.sign(n) * np.where(nearest & (above - size <= size - below), above, below)
        assert np.array_equal(m * 10 ** (e - E + 2), 100 * expected)
        assert np.all((m == 0) | ((np.abs(m) >= 100) & (np.abs(m) < 1000)))
        # The neighbours themselves against the definition: each value where they are few, else every 97th.
        distinct, first = np.unique(n, return_index=True)
        step = 1 if len(distinct) < 5_000 else 97
        for value, found in zip(distinct[::step].tolist(), expected.flat[first[::step]].tolist(), strict=True):
            assert oracles.rounded(Fraction(value), 10, 3, nearest) == found

    @pytest.mark.parametrize("gap", [50, 10**6, 10**30])
    def test_sums_of_numbers_far_apart(self, gap: int, nearest: bool) -> None:
        # The smaller operand is less than any digit of the larger: it decides only when the larger is chopped.
        add = kernel(Rules(10, 3, ROUNDING[nearest])).add
        for m1 in self.M.tolist():
            below = (m1 - 1, E + gap) if m1 > 100 else (999, E + gap - 1)
            for m2 in self.TELLING.tolist():
                towards = (m1, E + gap) if nearest else below
                assert add(m1, E + gap, m2, E) == (m1, E + gap)
                assert add(m2, E, m1, E + gap) == (m1, E + gap)
                assert add(m1, E + gap, -m2, E) == towards
                assert add(-m1, E + gap, m2, E) == (-towards[0], towards[1])

    def test_quotients(self, nearest: bool) -> None:
        one, other = (each.ravel() for each in np.meshgrid(self.M, self.TELLING, indexing="ij"))
        p, q = np.concatenate([one, other]), np.concatenate([other, one])
        k = kernel(Rules(10, 3, ROUNDING[nearest]))
        m, e = np.frompyfunc(k.divide, 4, 2)(p.astype(object), 2 * E, q.astype(object), E)
        assert m.size == 2 * 900 * 30
        # Equal fractions have equal quotients: the oracle rounds each fraction in lowest terms once.
        divisor = np.gcd(p, q)
        distinct, which = np.unique(p // divisor * 1000 + q // divisor, return_inverse=True)
        expected = np.array(list(self.rounded_ratios(distinct.tolist(), nearest)))[which.reshape(p.shape)]
        assert np.array_equal(m.astype(np.int64), expected[..., 0])
        assert np.array_equal(e.astype(np.int64), expected[..., 1] + E)

    def rounded_ratios(self, keys: list[int], nearest: bool) -> Iterator[tuple[int, int]]:
        # oracles.rounded without the loop for the exponent: a quotient is within 0.1 and 10.
        for key in keys:
            p, q = divmod(key, 1000)
            e = -2 if p >= q else -3
            digits, rest = divmod(p * 10**-e, q)
            if nearest and Fraction(rest, q) >= Fraction(1, 2):
                digits += 1
            yield (100, e + 1) if digits == 1000 else (digits, e)

    def test_ratios_of_this_test(self, nearest: bool) -> None:
        # A sample of the fractions of test_quotients, by the definition.
        pairs = [(p, q) for p in self.M[::31].tolist() for q in self.M[::29].tolist()]
        found = self.rounded_ratios([p * 1000 + q for p, q in pairs], nearest)
        for (p, q), pair in zip(pairs, found, strict=True):
            assert as_pair(oracles.rounded(Fraction(p, q), 10, 3, nearest), 10, 3) == pair

    def test_roots(self, nearest: bool) -> None:
        for m in self.M.tolist():
            for e in (-4, 7):
                value = oracles.square_root(m * Fraction(10) ** e, 10, 3, nearest)
                assert kernel(Rules(10, 3, ROUNDING[nearest])).sqrt(m, e) == as_pair(value, 10, 3)
