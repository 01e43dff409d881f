"""Functions of one and of two numbers against MPFR, which shares no code with Arb or with NumPy's libm."""

from __future__ import annotations

import decimal
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import gmpy2
import numpy as np
import pytest

from gpbnb import FloatFormat, Rounding
from gpbnb.arithmetic.elementary import ELEMENTARY, ELEMENTARY_PAIRS
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.named import BFLOAT16, BINARY16, BINARY32, BINARY64

pytestmark = pytest.mark.usefixtures("loops_at_once")

AMPLE = 1200  # bits; no argument below leads within 2**-1000 of a tie that is not hit exactly
FORMATS = {
    "binary16": BINARY16,
    "bfloat16": BFLOAT16,
    "binary32": BINARY32,
    "binary64": BINARY64,
    "44 bits": FloatFormat(2, 44, emin=-255, emax=255),  # the most whose functions begin in float64
    "8 digits": FloatFormat(10, 8),
    "17 digits": FloatFormat(10, 17),
}
MPFR = {
    "arcsin": gmpy2.asin, "arccos": gmpy2.acos, "arctan": gmpy2.atan, "arcsinh": gmpy2.asinh, "arccosh": gmpy2.acosh,
    "arctanh": gmpy2.atanh, "arctan2": gmpy2.atan2, "rint": gmpy2.rint,
    "deg2rad": lambda x: x * gmpy2.const_pi() / 180, "rad2deg": lambda x: x * 180 / gmpy2.const_pi(),
    "float_power": lambda x, y: x**y,
}  # fmt: skip
WHOLE = ("floor", "ceil", "trunc", "rint")
SPECIAL = (0, 1, -1, 2, -2, 3, 4, 0.5, -0.5, 0.25, 0.75, 8, 27, 64, 100, 1000, 360, 90, 22, 355, 1e4, -1e4, 2**-14)


def oracle(name: str, fmt: Any, values: tuple[Fraction, ...]) -> Fraction | None:
    """The value by MPFR, rounded by MPFR or libmpdec; None if it is not finite, out of range, or a decimal tie."""
    function = MPFR.get(name) or getattr(gmpy2, name)
    with gmpy2.context(gmpy2.get_context(), precision=AMPLE):
        given = [gmpy2.mpfr(gmpy2.mpq(value)) for value in values]
        ample = function(*given)
    if not gmpy2.is_finite(ample):
        return None
    if fmt.base == 2:
        p, low, high = fmt.precision, fmt.emin, fmt.emax
        with gmpy2.context(precision=p, emin=low - p + 2, emax=high + 1, subnormalize=True):
            direct = name not in ("deg2rad", "rad2deg")
            result = function(*given) if direct else gmpy2.mpfr(ample)
        return Fraction(*map(int, result.as_integer_ratio())) if gmpy2.is_finite(result) else None
    exact = Fraction(*map(int, ample.as_integer_ratio()))
    context = decimal.Context(prec=fmt.precision, rounding=decimal.ROUND_HALF_UP, Emin=-(10**6), Emax=10**6)
    ends = [exact * (1 + side * Fraction(1, 1 << 1000)) for side in (-1, 1)]
    low, high = (Fraction(context.divide(decimal.Decimal(e.numerator), decimal.Decimal(e.denominator))) for e in ends)
    return low if low == high else None


def near_ties(call: Callable[..., Any], fmt: Any, arguments: list[np.ndarray], count: int) -> list[np.ndarray]:
    """Those arguments whose value in float64 is nearest to the middle between two numbers of the format."""
    with np.errstate(all="ignore"):
        y = np.abs(call(*arguments))
        unit = float(fmt.base) ** (np.floor(np.log(y) / np.log(fmt.base)) + 1 - fmt.precision)
        off = np.abs(y / unit % 1 - 0.5)
    order = np.argsort(np.where(np.isfinite(off), off, 1))[:count]
    return [each[order] for each in arguments]


def drawn(name: str, fmt: Any, count: int) -> list[Any]:
    """Arguments in the format: random of three sizes, special, and near ties; seeded by the name of the function."""
    rng = np.random.default_rng([ord(c) for c in name])
    arity = 2 if name in ELEMENTARY_PAIRS or name == "fmod" else 1
    whole = count * 40
    raw = [rng.normal(size=whole) * rng.choice([0.01, 1, 100], whole) for _ in range(arity)]
    raw = [fmt.array(each).to_float() for each in raw]
    close = near_ties(getattr(np, name), fmt, raw, count)
    special = (
        [np.array(SPECIAL)] if arity == 1 else list(np.array(np.meshgrid(SPECIAL[::2], SPECIAL[1::2])).reshape(2, -1))
    )
    return [fmt.array(np.concatenate([a[:count], b, c])) for a, b, c in zip(raw, close, special, strict=True)]


def compared(name: str, fmt: Any, arguments: list[Any]) -> int:
    """Compare each entry with MPFR, and return how many there were; entries without a value are dropped."""
    values = list(zip(*(each.to_fractions() for each in arguments), strict=True))
    expected = [oracle(name, fmt, each) for each in values]
    kept = [i for i, value in enumerate(expected) if value is not None]
    found = getattr(np, name)(*(each[kept] for each in arguments)).to_fractions()
    wrong = [(values[i], expected[i], got) for i, got in zip(kept, found, strict=True) if got != expected[i]]
    assert wrong == [], fmt
    return len(kept)


@pytest.mark.parametrize("name", [*ELEMENTARY, *ELEMENTARY_PAIRS, *WHOLE, "fmod"])
def test_functions_agree_with_mpfr(name: str) -> None:
    for fmt in FORMATS.values():
        arguments = drawn(name, fmt, 30)
        if name == "fmod":
            kept = np.flatnonzero(arguments[1] != 0)
            arguments = [each[kept] for each in arguments]
        assert compared(name, fmt, arguments) >= 30, fmt


DIRECTIONS = [Rounding.EVEN, Rounding.CHOP, Rounding.UP, Rounding.DOWN]


@pytest.mark.parametrize("rounding", DIRECTIONS, ids=str)
@pytest.mark.parametrize("base", [2, 10])
def test_rational_values_are_found_in_every_rounding(base: int, rounding: Rounding) -> None:
    """A ball around such a value never rounds to one number if the value is a number or a tie of the format."""
    fmt = FloatFormat(base, 16, rounding)
    assert (base * np.hypot(fmt.array([3, 5]) / base, fmt.array([-4, 12]) / base)).tolist() == [5, 13]
    assert np.cbrt(fmt.array([27, -8, "0.125"])).tolist() == [3, -2, Fraction(1, 2)]
    assert np.exp2(fmt.array([3, -2, 0])).tolist() == [8, Fraction(1, 4), 1]
    assert np.log2(fmt.array([8, "0.25", 1])).tolist() == [3, -2, 0]
    assert np.log10(fmt.array([1000, 1])).tolist() == [3, 0]
    bases, exponents = fmt.array([4, 16, "2.25", -3, 0, 0]), fmt.array(["0.5", "-0.25", "-1.5", 3, 0, 2])
    assert np.float_power(bases, exponents).tolist() == [2, Fraction(1, 2), fmt.round(Fraction(8, 27)), -27, 1, 0]
    assert np.arctan2(fmt.array(0), fmt.array([2, 0])).tolist() == [0, 0]


@pytest.mark.parametrize("rounding", DIRECTIONS, ids=str)
def test_values_closer_to_a_number_than_float64_sees_are_rounded_to_the_right_side(rounding: Rounding) -> None:
    fmt = FloatFormat(2, 24, rounding)
    tiny = fmt.array([Fraction(1, 1 << 40), Fraction(1, 1 << 60)])
    above = 1 + Fraction(1, 1 << 23) if rounding is Rounding.UP else 1
    below = 1 - Fraction(1, 1 << 24) if rounding in (Rounding.DOWN, Rounding.CHOP) else 1
    for found in (np.hypot(1, tiny), np.cosh(tiny), np.exp(tiny), np.exp2(tiny), 2**tiny):
        assert found.tolist() == [above] * 2
    for found in (np.exp(-tiny), np.cos(tiny), np.float_power(1 / fmt.array(2), tiny)):
        assert found.tolist() == [below] * 2
    assert (-tiny % 1).tolist() == [below] * 2


@pytest.mark.parametrize("fmt", FORMATS.values(), ids=FORMATS)
def test_remainders_and_floors_are_exact_fractions_rounded_once(fmt: Any) -> None:
    rng = np.random.default_rng(5)
    spread = 1 if fmt is BINARY16 else 4  # quotients stay in the range
    signs, sizes = rng.choice([-1, 1], (2, 300)), 10.0 ** rng.integers(-spread, spread + 1, (2, 300))
    x, y = fmt.array(signs * (0.5 + np.abs(rng.normal(size=(2, 300)))) * sizes)
    x = np.append(x, fmt.array([-(2.0**-14), 6, -6, 0]))
    y = np.append(y, [2, 3, 4, -5])
    pairs = list(zip(x.to_fractions(), y.to_fractions(), strict=True))
    exact = [a - b * (a // b) for a, b in pairs]
    assert np.remainder(x, y).tolist() == [fmt.round(value) for value in exact]
    assert (x // y).tolist() == [fmt.round(a // b) for a, b in pairs]
    short = [a - b * int(a / b) for a, b in pairs]
    assert np.fmod(x, y).tolist() == short
    assert (x % y).tolist() == np.mod(x, y).tolist()
    assert (1 % y).tolist() == np.remainder(fmt.array(1), y).tolist()
    assert (2 // y).tolist() == [fmt.round(2 // b) for _, b in pairs]


def test_fixed_point_rounds_the_exact_value_once_and_keeps_its_limits() -> None:
    fmt = FixedFormat(3, 6)
    x = fmt.array(np.arange(-511, 512) / 64)
    values = x.to_fractions()
    assert np.floor(x).tolist() == [value.__floor__() for value in values]
    assert np.trunc(x).tolist() == [value.__trunc__() for value in values]
    for name in ("tanh", "arctan", "sin", "arcsinh"):
        for value, found in zip(values[::37], getattr(np, name)(x[::37]).to_fractions(), strict=True):
            with gmpy2.context(precision=AMPLE):
                true = Fraction(*(MPFR.get(name) or getattr(gmpy2, name))(gmpy2.mpfr(value)).as_integer_ratio())
            assert found == fmt.round(true)
    with pytest.raises(OverflowError, match=r"np\.ceil at \[1\]"):
        np.ceil(fmt.array([1, "7.5"]))
    assert np.ceil(FixedFormat(3, 6, overflow="saturate").array("7.5")).item() == fmt.largest
