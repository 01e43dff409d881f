"""Arrays of t-digit numbers: each operation against independent arithmetic."""

from __future__ import annotations

import operator
from decimal import MAX_EMAX, MIN_EMIN, ROUND_DOWN, ROUND_HALF_UP, Context, Decimal, DivisionByZero, InvalidOperation
from fractions import Fraction

import gmpy2
import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpbnb.arithmetic.formats import FloatFormat, Rounding

seeded = settings(derandomize=True, deadline=None, database=None, max_examples=1000)

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
OPERATIONS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}

Pair = tuple[int, int]


@st.composite
def operands(draw: st.DrawFn, base: int, precision: int, far: int) -> tuple[Pair, Pair]:
    """Two numbers (m, e) of the format, chosen so that rounding their sum, product or quotient is hard."""
    low, high = base ** (precision - 1), base**precision

    def significand() -> st.SearchStrategy[int]:
        edges = [m for m in (low, low + 1, high // 2, high // 2 + 1, high - 1) if m < high]
        return st.one_of(st.integers(low, high - 1), st.sampled_from(edges), st.just(0))

    m1, e1 = draw(significand()), draw(st.integers(-far, far))
    kind = draw(st.sampled_from(["any", "far", "tie", "cancel"]))
    if kind == "tie" and base % 2 == 0:  # half a unit of the last digit, and one of its own units beside
        m2, e2 = base // 2 * low + draw(st.sampled_from([-1, 0, 1])), e1 - precision
    elif kind == "cancel":
        m2, e2 = m1 + draw(st.integers(-3, 3)), e1 - draw(st.integers(0, 1))
    elif kind == "far":
        m2, e2 = draw(significand()), draw(st.integers(-far, far))
    else:
        m2, e2 = draw(significand()), e1 + draw(st.integers(-precision - 5, precision + 5))
    signs = st.sampled_from([-1, 1])
    return (draw(signs) * m1, e1), (draw(signs) * min(abs(m2), high - 1), e2)


class TestAgainstDecimal:
    """Base 10 against the standard library."""

    @seeded
    @given(st.data(), st.integers(1, 40), st.sampled_from([NEAREST, CHOP]))
    def test_operations(self, data: st.DataObject, precision: int, rounding: Rounding) -> None:
        (m1, e1), (m2, e2) = data.draw(operands(10, precision, far=data.draw(st.sampled_from([50, 10**6]))))
        context = Context(
            prec=precision,
            rounding=ROUND_HALF_UP if rounding is NEAREST else ROUND_DOWN,
            Emax=MAX_EMAX,
            Emin=MIN_EMIN,
            traps=[InvalidOperation, DivisionByZero],
        )
        a, b = Decimal(f"{m1}e{e1}"), Decimal(f"{m2}e{e2}")
        fmt = FloatFormat(10, precision, rounding)
        x, y = fmt.array(a), fmt.array(b)
        assert Decimal(str(x)) == a
        assert Decimal(str(x + y)) == context.add(a, b)
        assert Decimal(str(x - y)) == context.subtract(a, b)
        assert Decimal(str(x * y)) == context.multiply(a, b)
        if b:
            assert Decimal(str(x / y)) == context.divide(a, b)
        order = int(context.compare(a, b))
        assert (x < y, x <= y, x == y, x != y, x >= y, x > y) == (
            (order < 0), (order <= 0), (order == 0), (order != 0), (order >= 0), (order > 0),
        )  # fmt: skip


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
    @given(st.data(), st.integers(1, 113))
    def test_operations(self, data: st.DataObject, precision: int) -> None:
        (m1, e1), (m2, e2) = data.draw(operands(2, precision, far=data.draw(st.sampled_from([150, 20_000]))))
        exact = gmpy2.context(precision=200, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min())
        a = exact.mul(gmpy2.mpfr(m1, 200), exact.exp2(e1))
        b = exact.mul(gmpy2.mpfr(m2, 200), exact.exp2(e2))
        for rounding, bits in ((CHOP, precision), (NEAREST, precision + 1)):
            mpfr = gmpy2.context(
                precision=bits, round=gmpy2.RoundToZero, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min()
            )
            fmt = FloatFormat(2, precision, rounding)
            x, y = fmt.array(m1 * Fraction(2) ** e1), fmt.array(m2 * Fraction(2) ** e2)
            results = [(x + y, mpfr.add(a, b)), (x - y, mpfr.sub(a, b)), (x * y, mpfr.mul(a, b))]
            if m2:
                results.append((x / y, mpfr.div(a, b)))
            results.append((np.sqrt(abs(x)), mpfr.sqrt(exact.mul(a, -1 if a < 0 else 1))))
            for ours, theirs in results:
                expected = Fraction(*theirs.as_integer_ratio()) if rounding is CHOP else self.nearest(theirs, precision)
                assert ours.to_fractions() == expected


class TestAgainstFractions:
    """Any base against the definition."""

    @seeded
    @given(
        st.data(),
        st.one_of(st.integers(2, 40), st.sampled_from([2, 10, 16, 60, 1000])),
        st.integers(1, 20),
        st.sampled_from([NEAREST, CHOP]),
    )
    def test_operations(self, data: st.DataObject, base: int, precision: int, rounding: Rounding) -> None:
        (m1, e1), (m2, e2) = data.draw(operands(base, precision, far=40))
        fmt = FloatFormat(base, precision, rounding)
        a, b = m1 * Fraction(base) ** e1, m2 * Fraction(base) ** e2
        x, y = fmt.array(a), fmt.array(b)
        for sign, operation in OPERATIONS.items():
            if b or sign != "/":
                expected = oracles.rounded(operation(a, b), base, precision, rounding is NEAREST)
                assert operation(x, y).to_fractions() == expected
        root = oracles.square_root(abs(a), base, precision, rounding is NEAREST)
        assert np.sqrt(abs(x)).to_fractions() == root
        assert (x == y, x < y, x > y) == (a == b, a < b, a > b)
        assert eval(repr(x)) == x
        assert eval(repr(fmt.array([[a, b]]))).shape == (1, 2)
        assert np.all(eval(repr(fmt.array([[a, b]]))) == fmt.array([[a, b]]))

    @pytest.mark.parametrize("rounding", Rounding.documented())
    @pytest.mark.parametrize(("base", "precision"), [(2, 1), (2, 3), (3, 1), (3, 2), (10, 1)])
    def test_each_pair_through_the_operators(self, base: int, precision: int, rounding: Rounding) -> None:
        fmt = FloatFormat(base, precision, rounding)
        positive = [
            m * Fraction(base) ** e for e in range(-3, 4) for m in range(base ** (precision - 1), base**precision)
        ]
        numbers = [-x for x in positive] + [Fraction(0), *positive]
        x = fmt.array(numbers)
        count = 0
        for sign, operation in OPERATIONS.items():
            second = positive if sign == "/" else numbers
            found = operation(x[:, np.newaxis], fmt.array(second)).to_fractions()
            for i, a in enumerate(numbers):
                for j, b in enumerate(second):
                    assert found[i, j] == oracles.rounded(operation(a, b), base, precision, rounding is NEAREST)
                    count += 1
        n = 7 * (base - 1) * base ** (precision - 1)
        assert count == 3 * (2 * n + 1) ** 2 + (2 * n + 1) * n
