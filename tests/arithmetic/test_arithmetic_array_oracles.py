"""Arrays of t-digit numbers: each operation against independent arithmetic."""

from __future__ import annotations

import operator
from collections.abc import Iterable
from decimal import MAX_EMAX, MIN_EMIN, ROUND_DOWN, ROUND_HALF_UP, Context, Decimal, DivisionByZero, InvalidOperation
from fractions import Fraction
from random import Random

import gmpy2
import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding

# Many pairs of numbers in each format: drawing one costs more than computing with it.
PAIRS = 10
seeded = settings(derandomize=True, deadline=None, database=None, max_examples=120)
seeds = st.integers(0, 2**32)

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
OPERATIONS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}

Pair = tuple[int, int]


def operands(seed: int, base: int, precision: int, far: list[int]) -> tuple[list[Pair], list[Pair]]:
    """Pairs of numbers (m, e) of the format, chosen so that rounding their sum, product or quotient is hard."""
    random = Random(seed)
    low, high = base ** (precision - 1), base**precision
    edges = [m for m in (low, low + 1, high // 2, high // 2 + 1, high - 1) if m < high]

    def significand() -> int:
        return random.choice([random.randrange(low, high), random.choice(edges), 0])

    def pair() -> tuple[Pair, Pair]:
        reach = random.choice(far)
        m1, e1 = significand(), random.randint(-reach, reach)
        kind = random.choice(["any", "far", "tie", "cancel"])
        if kind == "tie" and base % 2 == 0:  # half a unit of the last digit, and one of its own units beside
            m2, e2 = base // 2 * low + random.choice([-1, 0, 1]), e1 - precision
        elif kind == "cancel":
            m2, e2 = m1 + random.randint(-3, 3), e1 - random.randint(0, 1)
        elif kind == "far":
            m2, e2 = significand(), random.randint(-reach, reach)
        else:
            m2, e2 = significand(), e1 + random.randint(-precision - 5, precision + 5)
        return (random.choice([-1, 1]) * m1, e1), (random.choice([-1, 1]) * min(abs(m2), high - 1), e2)

    first, second = zip(*(pair() for _ in range(PAIRS)), strict=True)
    return list(first), list(second)


class TestAgainstDecimal:
    """Base 10 against the standard library."""

    @seeded
    @given(seeds, st.integers(1, 40), st.sampled_from([NEAREST, CHOP]))
    def test_operations(self, seed: int, precision: int, rounding: Rounding) -> None:
        first, second = operands(seed, 10, precision, far=[50, 10**6])
        context = Context(
            prec=precision,
            rounding=ROUND_HALF_UP if rounding is NEAREST else ROUND_DOWN,
            Emax=MAX_EMAX,
            Emin=MIN_EMIN,
            traps=[InvalidOperation, DivisionByZero],
        )
        a, b = ([Decimal(f"{m}e{e}") for m, e in pairs] for pairs in (first, second))
        fmt = FloatFormat(10, precision, rounding)
        x, y = fmt.array(a), fmt.array(b)

        def same(found: FloatArray, expected: Iterable[Decimal]) -> bool:
            return [Decimal(str(each)) for each in found] == list(expected)

        assert same(x, a)
        assert same(x + y, map(context.add, a, b))
        assert same(x - y, map(context.subtract, a, b))
        assert same(x * y, map(context.multiply, a, b))
        divisors = [i for i in range(PAIRS) if b[i]]
        assert same(x[divisors] / y[divisors], [context.divide(a[i], b[i]) for i in divisors])
        order = np.array([int(each) for each in map(context.compare, a, b)])
        for compare in (operator.lt, operator.le, operator.eq, operator.ne, operator.ge, operator.gt):
            assert np.array_equal(compare(x, y), compare(order, 0))


class TestAgainstMPFR:
    """Base 2 against MPFR, which rounds towards zero but not half away from zero.

    The nearest t-bit number follows from the first t + 1 bits: half away from zero, the last of them decides.
    """

    @staticmethod
    def nearest(result: gmpy2.mpfr, precision: int) -> Fraction:
        m, e = map(int, result.as_mantissa_exp())
        if abs(m).bit_length() <= precision:
            return m * Fraction(2) ** e
        assert abs(m).bit_length() == precision + 1
        return (m + m % 2 * (1 if m > 0 else -1)) * Fraction(2) ** e

    @seeded
    @given(seeds, st.integers(1, 113))
    def test_operations(self, seed: int, precision: int) -> None:
        first, second = operands(seed, 2, precision, far=[150, 20_000])
        exact = gmpy2.context(precision=200, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min())
        a, b = ([exact.mul(gmpy2.mpfr(m, 200), exact.exp2(e)) for m, e in pairs] for pairs in (first, second))
        for rounding, bits in ((CHOP, precision), (NEAREST, precision + 1)):
            mpfr = gmpy2.context(
                precision=bits, round=gmpy2.RoundToZero, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min()
            )
            fmt = FloatFormat(2, precision, rounding)
            x, y = (fmt.array([m * Fraction(2) ** e for m, e in pairs]) for pairs in (first, second))
            results = [(x + y, map(mpfr.add, a, b)), (x - y, map(mpfr.sub, a, b)), (x * y, map(mpfr.mul, a, b))]
            divisors = [i for i in range(PAIRS) if b[i]]
            results.append((x[divisors] / y[divisors], (mpfr.div(a[i], b[i]) for i in divisors)))
            results.append((np.sqrt(abs(x)), (mpfr.sqrt(exact.mul(each, -1 if each < 0 else 1)) for each in a)))
            for ours, theirs in results:
                assert ours.to_fractions().tolist() == [
                    Fraction(*each.as_integer_ratio()) if rounding is CHOP else self.nearest(each, precision)
                    for each in theirs
                ]


class TestAgainstFractions:
    """Any base against the definition."""

    @seeded
    @given(
        seeds,
        st.one_of(st.integers(2, 40), st.sampled_from([2, 10, 16, 60, 1000])),
        st.integers(1, 20),
        st.sampled_from([NEAREST, CHOP]),
    )
    def test_operations(self, seed: int, base: int, precision: int, rounding: Rounding) -> None:
        first, second = operands(seed, base, precision, far=[40])
        fmt = FloatFormat(base, precision, rounding)
        a, b = ([m * Fraction(base) ** e for m, e in pairs] for pairs in (first, second))
        x, y = fmt.array(a), fmt.array(b)
        for sign, operation in OPERATIONS.items():
            those = [i for i in range(PAIRS) if b[i] or sign != "/"]
            exact = [operation(a[i], b[i]) for i in those]
            expected = [oracles.rounded(each, base, precision, rounding is NEAREST) for each in exact]
            assert operation(x[those], y[those]).to_fractions().tolist() == expected
        roots = [oracles.square_root(abs(each), base, precision, rounding is NEAREST) for each in a]
        assert np.sqrt(abs(x)).to_fractions().tolist() == roots
        for compare in (operator.eq, operator.lt, operator.gt):
            assert compare(x, y).tolist() == [compare(p, q) for p, q in zip(a, b, strict=True)]
        assert eval(repr(x[0])) == x[0]
        both = fmt.array([a, b])
        assert eval(repr(both)).shape == (2, PAIRS)
        assert np.all(eval(repr(both)) == both)

    @pytest.mark.parametrize("rounding", Rounding.documented())
    @pytest.mark.parametrize(("base", "precision"), [(2, 1), (2, 3), (3, 1), (3, 2), (10, 1)])
    def test_each_pair_through_the_operators(self, base: int, precision: int, rounding: Rounding) -> None:
        fmt = FloatFormat(base, precision, rounding)
        # As multiples of 1 / unit, from 1 / unit to below base**precision * unit.
        unit = base**3
        significands = np.arange(base ** (precision - 1), base**precision)
        positive = np.concatenate([significands * base**k for k in range(7)])
        numbers = np.concatenate([-positive, [0], positive])
        x = fmt.array([Fraction(int(n), unit) for n in numbers])
        n = 7 * (base - 1) * base ** (precision - 1)
        assert len(numbers) == 2 * n + 1
        for sign, operation in OPERATIONS.items():
            b = positive if sign == "/" else numbers
            # Equal exact results p / q are rounded once.
            p, q = {
                "*": (numbers[:, np.newaxis] * b, unit**2),
                "/": (numbers[:, np.newaxis], b),
            }.get(sign, (operation(numbers[:, np.newaxis], b), unit))
            p, q = (part.ravel() for part in np.broadcast_arrays(p, q))
            ratios = np.stack([p, q], axis=-1) // np.gcd(p, q)[:, np.newaxis]
            exact, which = np.unique(ratios, axis=0, return_inverse=True)
            once = [oracles.rounded(Fraction(*each), base, precision, rounding is NEAREST) for each in exact.tolist()]
            found = operation(x[:, np.newaxis], x[-len(b) :]).to_fractions()
            assert found.shape == (2 * n + 1, n if sign == "/" else 2 * n + 1)
            assert np.array_equal(found.ravel(), np.array(once, object)[which.ravel()])
