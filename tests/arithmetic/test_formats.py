"""Reading and rounding of single numbers, any base and precision."""

from __future__ import annotations

from decimal import ROUND_DOWN, ROUND_HALF_UP, Context, Decimal
from fractions import Fraction
from random import Random

import flint
import gmpy2
import mpmath
import numpy as np
import pytest
import sympy

from gpbnb.arithmetic.conversion import exact_ratio
from gpbnb.arithmetic.formats import FloatFormat, prints_as
from gpbnb.arithmetic.rounding import Rounding
from tests import oracles

pytestmark = pytest.mark.usefixtures("loops_at_once")

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP


def digits(random: Random, fewest: int, most: int) -> str:
    drawn = "".join(random.choices("0123456789", k=random.randint(fewest, random.choice([fewest, 3, most]))))
    return random.choice(["5", "25", "995", drawn, drawn, drawn])


def text(random: Random) -> str:
    """A number as written by hand, with zeros on either side, ties, and a power of ten or none."""
    whole = digits(random, 1, 50) + random.choice(["", "."]) + digits(random, 0, 50)
    sign, number = random.choice(["", "+", "-"]), random.choice([whole, whole, f".{digits(random, 1, 50)}"])
    power = f"{random.choice('eE')}{random.choice(['', '+', '-'])}{digits(random, 1, 9)}"
    return sign + number + random.choice(["", power])


def oracle(x: Fraction, fmt: FloatFormat) -> Fraction:
    return oracles.rounds(fmt)(x)


def hard_to_round(random: Random) -> tuple[Fraction, FloatFormat]:
    """A number of the format, a tie, a power of the base or a carry; then one a little beside it."""
    base = random.choice([random.randint(2, 40), 2, 10, 16, 60, 1000])
    fmt = FloatFormat(base, random.choice([random.randint(1, 30), 1, 2]), random.choice([NEAREST, CHOP]))
    low, high = base ** (fmt.precision - 1), base**fmt.precision
    m = random.choice([random.randrange(low, high), low, high - 1])
    part = random.choice([Fraction(0), Fraction(1, 2), Fraction(1), Fraction(1, base)])
    beside = random.choice([-1, 0, 1]) * Fraction(base) ** -random.randint(1, 60)
    return random.choice([-1, 1]) * (m + part + beside) * Fraction(base) ** random.randint(-40, 40), fmt


class TestRounding:
    def test_any_base_against_the_definition(self) -> None:
        random = Random(1)
        for x, fmt in [(Fraction(999, 1000), FloatFormat(10, 2)), *(hard_to_round(random) for _ in range(300))]:
            assert fmt.round(x) == oracle(x, fmt)
            assert fmt.round(f"{x.numerator}/{x.denominator}") == fmt.round(x)
            assert fmt.round(fmt.round(x)) == fmt.round(x)
            assert fmt.round(-x) == -fmt.round(x)
            if x:  # the relative error is within the unit roundoff
                error = abs(fmt.round(x) - x) / abs(x)
                assert error <= fmt.unit_roundoff if fmt.rounding is NEAREST else error < fmt.unit_roundoff

    def test_decimal_strings_against_decimal(self) -> None:
        random = Random(2)
        for given, precision in ((text(random), random.randint(1, random.choice([5, 40]))) for _ in range(300)):
            for rounding, name in ((NEAREST, ROUND_HALF_UP), (CHOP, ROUND_DOWN)):
                context = Context(prec=precision, rounding=name, Emax=10**15, Emin=-(10**15))
                for value in (given, Decimal(given)):
                    x = FloatFormat(10, precision, rounding).array(value)
                    assert Decimal(str(x)) == context.create_decimal(given)


class TestInput:
    THIRD = FloatFormat(3, 40)  # holds no decimal fraction by accident

    @pytest.mark.parametrize(
        ("value", "exact"),
        [
            (0.1, Fraction(0.1)),
            (-5e-324, Fraction(-1, 2**1074)),
            (np.float32(0.1), Fraction(13421773, 2**27)),
            (np.float16(0.1), Fraction(1638, 2**14)),
            (np.longdouble(1) / 3, Fraction(*(np.longdouble(1) / 3).as_integer_ratio())),
            (np.uint64(2**64 - 1), Fraction(2**64 - 1)),
            (Decimal("-1.250E-3"), Fraction(-1, 800)),
            (Decimal("-0"), Fraction(0)),
            ("1/3", Fraction(1, 3)),
            ("-6 / 8", Fraction(-3, 4)),
            (np.str_("2.5"), Fraction(5, 2)),
            ("0e99999999999", Fraction(0)),
            (gmpy2.mpq(1, 3), Fraction(1, 3)),
        ],
    )
    def test_is_read_exactly(self, value: object, exact: Fraction) -> None:
        p, q, k = exact_ratio(value)
        assert (p == 0 and exact == 0) or Fraction(p, q) * Fraction(10) ** k == exact
        assert self.THIRD.round(value) == oracle(exact, self.THIRD)
        assert self.THIRD.array([value, 1])[0].to_fractions() == oracle(exact, self.THIRD)

    def test_numbers_of_every_type_are_read_with_sign_and_size(self) -> None:
        floats = (float, np.float32, np.float64, np.longdouble, Decimal, mpmath.mpf, flint.arb, gmpy2.mpfr)
        ratios = (Fraction, gmpy2.mpq, flint.fmpq, sympy.Rational)
        wholes = (int, np.int64, np.longlong, gmpy2.mpz, flint.fmpz, sympy.Integer, mpmath.mpf, flint.arb)
        for sign in (1, -1):
            for exact in (Fraction(3, 2**20), Fraction(5 * 2**90), Fraction(0), Fraction(22)):
                for value in (
                    *(make(sign * float(exact)) for make in floats),
                    *(m(sign * exact.numerator, exact.denominator) for m in ratios),
                ):
                    p, q, k = exact_ratio(value)
                    assert Fraction(p, q) * Fraction(10) ** k == sign * exact, type(value)
            assert all(exact_ratio(make(sign * 7)) == (sign * 7, 1, 0) for make in wholes)


class TestSplit:
    def test_example_of_the_report(self) -> None:
        # (2): 765.4567 = .7654 * 10**3 + .567 * 10**-1
        assert FloatFormat(10, 4).split("765.4567") == (Fraction("0.7654"), Fraction("0.567"), 3)
        assert FloatFormat(10, 4).split(0) == (0, 0, 0)

    def test_identity(self) -> None:
        random = Random(3)
        for x, fmt in (hard_to_round(random) for _ in range(300)):
            u, v, e = fmt.split(x)
            base = Fraction(fmt.base)
            if x == 0:
                assert (u, v, e) == (0, 0, 0)
                continue
            assert u * base**e + v * base ** (e - fmt.precision) == x
            assert 1 / base <= abs(u) < 1
            assert abs(v) < 1
            assert u * x > 0
            assert v * x >= 0
            assert (u * base**fmt.precision).denominator == 1


@pytest.mark.parametrize(
    ("value", "printed", "so"),
    [
        (0.99999998766, ".999999987", True),  # chopped
        (0.99999998766, ".999999988", True),  # rounded
        (0.99999998766, ".999999989", False),
        (1.2566e8, "1.2566e8", True),
        (1.2567e8, "1.2566e8", False),
        (0.0076, ".0004", False),
        (0.00039996, ".0004", True),
        (1.2337e-6, "1.234e-6", True),
        (1.2337e-7, "1.234e-6", False),
    ],
)
def test_a_number_rounded_or_chopped_prints_as_it_is_printed(value, printed, so):
    assert prints_as(value, printed, *Rounding.documented()) is so


def test_random_numbers_come_from_one_sequence_however_many_formats_are_in_use():
    first = FloatFormat(2, 12, "stochastic")
    kept = first.backend
    for seed in range(1, 400):
        other = FloatFormat(2, 12, "stochastic", seed=seed)
        assert other.backend is not kept
        assert other.kernel is not kept.kernel
    second = FloatFormat(2, 12, "stochastic")
    assert second.backend is kept
    assert second.kernel is kept.kernel
    assert second.exact_backend.kernel is kept.kernel
