"""Infinity, NaN, signed zero, saturation and the exceptions of IEEE 754, against Fractions, ml_dtypes and libmpdec."""

from __future__ import annotations

import decimal
import itertools
import math
import operator
import pickle
from dataclasses import asdict, replace
from fractions import Fraction
from functools import cache

import ml_dtypes
import numpy as np
import pytest
from test_arithmetic_processors import DETERMINISTIC, expected

import gpbnb
from gpbnb import (
    BINARY16,
    BINARY32,
    BINARY64,
    BINARY128,
    DECIMAL32,
    FP4_E2M1,
    FP6_E2M3,
    FP6_E3M2,
    FP8_E4M3,
    FP8_E5M2,
    IBM_HEX32,
    FixedFormat,
    FloatFormat,
    Rounding,
    flags,
)
from gpbnb.arithmetic.kernels.backends import Compiled, Special

OPERATIONS = {"add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv}
#: A format of six bits with infinity, and one that flushes small results to zero.
SMALL = FloatFormat(2, 3, Rounding.EVEN, emin=-2, emax=3)
FLUSHED = FloatFormat(2, 3, Rounding.EVEN, emin=-2, emax=3, subnormal=False)
NATIVE = {
    "FP8_E4M3": ml_dtypes.float8_e4m3fn,
    "FP8_E5M2": ml_dtypes.float8_e5m2,
    "FP6_E3M2": ml_dtypes.float6_e3m2fn,
    "FP6_E2M3": ml_dtypes.float6_e2m3fn,
    "FP4_E2M1": ml_dtypes.float4_e2m1fn,
}


def negative(x):
    return math.copysign(1, x) < 0


class Definition:
    """What IEEE 754 requires of a format: each result, and the exceptions that it raises.

    Sums and products here have so few digits that float64 holds them; only quotients are Fractions.
    """

    def __init__(self, fmt: FloatFormat) -> None:
        self.fmt, self.finite = fmt, replace(fmt, overflow="raise")
        self.unlimited = FloatFormat(fmt.base, fmt.precision, fmt.rounding)
        self.infinite = math.nan if fmt == special(FP8_E4M3) else math.inf
        #: Pairs have few different results: each is rounded once.
        self.rounded = cache(self._rounded)

    def _rounded(self, exact: float | Fraction):
        """The value for a real number other than zero, and the exceptions; by its definition."""
        x = Fraction(exact)
        fmt, unlimited = self.fmt, expected(x, self.unlimited)
        if abs(unlimited) > fmt.largest:
            down, up = fmt.rounding is Rounding.DOWN, fmt.rounding is Rounding.UP
            finite = fmt.rounding in (Rounding.CHOP, Rounding.ODD) or (up and x < 0) or (down and x > 0)
            limit = fmt.largest if finite else self.infinite
            return float(limit if x > 0 else -limit), {"overflow", "inexact"}
        found = expected(x, self.finite)
        raised = {"inexact"} | ({"underflow"} if abs(unlimited) < fmt.smallest_normal else set())
        return math.copysign(found, x), raised if found != x else set()

    def required(self, name: str, a, b):
        """The result and the exceptions of an operation."""
        if name == "subtract":
            return self.required("add", a, -b)
        if a != a or b != b:
            return math.nan, set()
        if name == "add":
            if math.inf in (abs(a), abs(b)):
                return (math.nan, {"invalid"}) if a == -b else (a if abs(a) == math.inf else b, set())
            if a + b:
                return self.rounded(a + b)
            if not a and not b and negative(a) == negative(b):
                return a, set()
            return (-0.0 if self.fmt.rounding is Rounding.DOWN else 0.0), set()
        sign = -1.0 if negative(a) != negative(b) else 1.0
        if name == "multiply":
            if math.inf in (abs(a), abs(b)):
                return (math.nan, {"invalid"}) if 0 in (a, b) else (sign * math.inf, set())
            return self.rounded(a * b) if a and b else (sign * 0.0, set())
        if abs(a) == math.inf or (not a and not b):
            return (math.nan, {"invalid"}) if abs(b) == math.inf or not a else (sign * math.inf, set())
        if not b:
            return sign * self.infinite, {"divide_by_zero"}
        return self.rounded(Fraction(a) / Fraction(b)) if a and abs(b) != math.inf else (sign * 0.0, set())


def special(fmt: FloatFormat) -> FloatFormat:
    return replace(fmt, overflow="infinity")


def every(fmt: FloatFormat):
    """Every word of a format, as an array of the format."""
    if fmt.subnormal:
        return fmt.from_bits(np.arange(2**fmt.layout.width))
    finite = replace(fmt, overflow="raise")
    sizes = [(4 + m) * Fraction(2) ** (e - 2) for e in range(fmt.emin, fmt.emax + 1) for m in range(4)]
    assert finite.array(sizes).to_fractions().tolist() == sizes
    return fmt.array([0.0, -0.0, math.inf, -math.inf, math.nan, *sizes, *(-size for size in sizes)])


def same(found, wanted) -> bool:
    return (found != found and wanted != wanted) or (found == wanted and negative(found) == negative(wanted))


CASES = [
    (FP8_E4M3, Rounding.EVEN),
    (FP8_E5M2, Rounding.EVEN),
    *((fmt, mode) for fmt in (SMALL, FLUSHED) for mode in DETERMINISTIC),
]


@pytest.mark.parametrize(("fmt", "mode"), CASES, ids=str)
@pytest.mark.parametrize("name", OPERATIONS)
def test_every_pair_of_words_and_every_exception(fmt, mode, name):
    """All words, infinities, NaNs and both zeros among them: values, signs of zeros, and all five counts."""
    fmt = special(replace(fmt, rounding=mode))
    x, definition = every(fmt), Definition(fmt)
    numbers = x.to_float().tolist()
    assert len(x) >= 53
    with flags(fmt) as seen:
        found = OPERATIONS[name](x[:, np.newaxis], x).to_float().ravel().tolist()
    counted = dict.fromkeys(asdict(seen), 0)
    for value, (a, b) in zip(found, itertools.product(numbers, repeat=2), strict=True):
        wanted, raised = definition.required(name, a, b)
        assert same(value, wanted), (name, a, b, value, wanted)
        for each in raised:
            counted[each] += 1
    assert asdict(seen) == counted
    assert counted["inexact"] > 0
    assert (counted["divide_by_zero"] > 0) is (name == "divide")


@pytest.mark.parametrize("name", ["FP8_E4M3", "FP8_E5M2"])
@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_every_pair_as_ml_dtypes_computes_it(name, operation):
    """It rounds binary32 results, which for four bits is correct; the bits, not the payloads of NaN, are compared."""
    fmt, native = special(getattr(gpbnb, name)), NATIVE[name]
    words = np.arange(256, dtype=np.uint8)
    with np.errstate(all="ignore"):
        theirs = operation(words.view(native)[:, np.newaxis], words.view(native))
    x = fmt.from_bits(words)
    ours = operation(x[:, np.newaxis], x)
    nan = np.isnan(theirs.astype(np.float64))
    assert np.array_equal(np.isnan(ours), nan)
    assert np.array_equal(ours.to_bits()[~nan], theirs.view(np.uint8)[~nan])
    assert 256 < nan.sum() < 20_000


@pytest.mark.parametrize("name", NATIVE)
@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
def test_every_pair_saturated(name, operation):
    """All pairs of finite numbers without a zero divisor, in compiled loops, on Python integers, and by definition."""
    fmt = replace(getattr(gpbnb, name), overflow="saturate")
    words = np.arange(2**fmt.layout.width, dtype=np.uint8)
    x = fmt.from_bits(words[np.isfinite(words.view(NATIVE[name]).astype(np.float64))])
    numbers = x.to_fractions().tolist()
    assert isinstance(x.backend, Compiled)
    a, b = (part.ravel() for part in np.meshgrid(np.arange(len(x)), np.arange(len(x)), indexing="ij"))
    if operation is operator.truediv:
        a, b = a[numbers_differ := np.array([numbers[i] != 0 for i in b])], b[numbers_differ]
    found = operation(x[a], x[b])
    assert isinstance(found.backend, Compiled)
    slow = operation(x[a[::7]].on_exact_backend(), x[b[::7]].on_exact_backend())
    assert (slow == found[::7]).all()
    beyond = 0
    finite = replace(fmt, overflow="raise")
    rounded = cache(lambda exact: expected(exact, finite))  # pairs have few different results
    for value, i, j in zip(found.to_fractions().tolist(), a.tolist(), b.tolist(), strict=True):
        exact = operation(numbers[i], numbers[j])
        wanted = rounded(exact)
        beyond += wanted is None
        assert value == (wanted if wanted is not None else fmt.largest if exact > 0 else -fmt.largest)
    assert beyond > 0


@pytest.mark.parametrize("mode", DETERMINISTIC)
@pytest.mark.parametrize("fmt", [FP6_E3M2, FP4_E2M1, FP8_E4M3, DECIMAL32, BINARY32, BINARY64, IBM_HEX32], ids=str)
def test_a_saturated_result_is_the_largest_number_in_every_rounding(fmt, mode):
    fmt = replace(fmt, overflow="saturate", rounding=mode)
    big = fmt.array([fmt.largest, -fmt.largest])
    assert (big + big).to_fractions().tolist() == [fmt.largest, -fmt.largest]
    assert (big * big).to_fractions().tolist() == [fmt.largest] * 2
    assert fmt.array([2 * fmt.largest, fmt.largest / 2]).to_fractions().tolist()[0] == fmt.largest
    assert big.multiply_add(big, -big).to_fractions().tolist() == [fmt.largest] * 2
    assert (np.stack([big, big]) @ big.reshape(2, 1)).to_fractions()[0, 0] == fmt.largest


def test_the_issues_number_saturates():
    assert replace(FP8_E4M3, overflow="saturate").round(470) == 448
    assert math.isnan(special(FP8_E4M3).array(470).to_float())
    with pytest.raises(OverflowError, match="needed at most 448 in size"):
        FP8_E4M3.round(470)


@pytest.mark.parametrize("name", NATIVE)
def test_every_binary16_number_is_converted_as_by_ml_dtypes(name):
    """From 16 bits its way through binary32 is exact, so it rounds once; FP6 and FP4 saturate."""
    given = np.arange(2**16, dtype=np.uint16).view(np.float16)
    given = given[np.isfinite(given)]
    with np.errstate(all="ignore"):
        theirs = given.astype(NATIVE[name]).astype(np.float64)
    fmt = getattr(gpbnb, name)
    infinite = name.startswith("FP8")
    x = (special(fmt) if infinite else replace(fmt, overflow="saturate")).array(given).to_float()
    assert np.array_equal(x, theirs, equal_nan=True)
    if infinite:
        assert np.array_equal(np.signbit(x), np.signbit(theirs) & ~np.isnan(theirs))
        kept = replace(fmt, overflow="saturate").array(given).to_float()
        assert np.array_equal(kept[np.isfinite(x)], x[np.isfinite(x)])
        assert np.array_equal(kept[~np.isfinite(x)], (np.sign(given) * float(fmt.largest))[~np.isfinite(x)])


@pytest.mark.parametrize("native", [np.float16, np.float32, np.float64])
def test_the_processors_own_results(native):
    """Special, extreme and random operands in the processor's arithmetic, which is IEEE 754's."""
    fmt = special({np.float16: BINARY16, np.float32: BINARY32, np.float64: BINARY64}[native])
    info, rng = np.finfo(native), np.random.default_rng(43)
    edges = [0, info.smallest_subnormal, info.tiny, info.max, 1, 3, np.inf, np.nan, info.tiny * 1.5, info.max / 2]
    some = rng.normal(size=30).astype(native) * native(2) ** rng.integers(info.minexp, info.maxexp, 30).astype(native)
    given = np.array([*edges, *some], native)
    given = np.concatenate([given, -given])
    x = fmt.array(given)
    for operation in OPERATIONS.values():
        with np.errstate(all="ignore"):
            theirs = operation(given[:, np.newaxis], given)
        ours = operation(x[:, np.newaxis], x)
        assert np.array_equal(ours.to_float(), theirs.astype(np.float64), equal_nan=True)
        number = ~np.isnan(theirs)
        unsigned = np.dtype(f"u{info.bits // 8}")
        assert np.array_equal(ours.to_bits()[number], np.ascontiguousarray(theirs).view(unsigned)[number])
    with np.errstate(all="ignore"):
        assert np.array_equal(np.sqrt(x).to_float(), np.sqrt(given).astype(np.float64), equal_nan=True)
        for compare in (operator.eq, operator.ne, operator.lt, operator.le, operator.gt, operator.ge):
            assert np.array_equal(compare(x[:, np.newaxis], x), compare(given[:, np.newaxis], given))
        for function in (np.isnan, np.isinf, np.isfinite, np.signbit):
            agree = ~np.isnan(given) if function is np.signbit else given == given
            agree = agree | (function is not np.signbit)
            assert np.array_equal(function(x)[agree], function(given)[agree])
        for function in (np.maximum, np.minimum, np.fmax, np.fmin):
            theirs = function(given[:, np.newaxis], given).astype(np.float64)
            assert np.array_equal(function(x[:, np.newaxis], x).to_float(), theirs, equal_nan=True)
        theirs = np.copysign(given[:, np.newaxis], given)
        agree = ~np.isnan(np.broadcast_to(given, theirs.shape))
        assert np.array_equal(np.copysign(x[:, np.newaxis], x).to_float()[agree], theirs[agree], equal_nan=True)
        assert (x.argmax(), x.argmin()) == (given.argmax(), given.argmin())
        assert np.array_equal(np.sign(x).to_float(), np.sign(given), equal_nan=True)
        assert np.array_equal(np.abs(x).to_float(), np.abs(given), equal_nan=True)
        assert np.array_equal(np.signbit(np.abs(x)), np.zeros(len(x), bool))
        assert (x**0).to_float().tolist() == (given**0).tolist()


def test_every_exception_of_libmpdec():
    """Base 10, where a result is tiny before it is rounded: every pair of some numbers, in five roundings."""
    names = {
        "invalid": decimal.InvalidOperation,
        "divide_by_zero": decimal.DivisionByZero,
        "overflow": decimal.Overflow,
        "underflow": decimal.Underflow,
        "inexact": decimal.Inexact,
    }
    modes = {
        Rounding.EVEN: decimal.ROUND_HALF_EVEN,
        Rounding.NEAREST: decimal.ROUND_HALF_UP,
        Rounding.UP: decimal.ROUND_CEILING,
        Rounding.DOWN: decimal.ROUND_FLOOR,
        Rounding.CHOP: decimal.ROUND_DOWN,
    }
    texts = ["0", "1", "3", "9", "Infinity", "NaN", "1e-3", "1e-2", "9.9e2", "5e2", "1.1e-1", "9.5", "1.5e-2", "7e-3"]
    texts += [f"-{each}" for each in texts if each != "NaN"]
    for mode, theirs in modes.items():
        fmt = special(FloatFormat(10, 2, mode, emin=-2, emax=2))
        context = decimal.Context(prec=2, rounding=theirs, Emin=-2, Emax=2, traps=[])
        numbers = [context.create_decimal(each) for each in texts]
        x = fmt.array(texts)
        for name, operation in OPERATIONS.items():
            for i, j in itertools.product(range(len(texts)), repeat=2):
                context.clear_flags()
                wanted = getattr(context, name)(numbers[i], numbers[j])
                with flags(fmt) as seen:
                    found = operation(x[i], x[j])
                assert {each for each, count in asdict(seen).items() if count} == {
                    each for each, of_decimal in names.items() if context.flags[of_decimal]
                }, (mode, name, texts[i], texts[j])
                assert max(asdict(seen).values()) <= 1
                assert same(float(found.to_float()), float(wanted))


def test_fused_multiply_add_of_special_numbers():
    """All triples of some numbers, against libmpdec's fma, in a range that none of these results leaves."""
    texts = ["0", "-0", "1", "-1", "2.5", "-2.5", "Infinity", "-Infinity", "NaN"]
    context = decimal.Context(prec=7, Emin=-95, Emax=96, traps=[])
    x = special(DECIMAL32).array(texts)
    for i, j, k in itertools.product(range(len(texts)), repeat=3):
        wanted = context.fma(*(decimal.Decimal(texts[at]) for at in (i, j, k)))
        assert same(float(x[i].multiply_add(x[j], x[k]).to_float()), float(wanted)), (texts[i], texts[j], texts[k])
    fmt = special(SMALL)
    tiny = fmt.array(fmt.smallest)
    assert np.signbit((-tiny).multiply_add(tiny, fmt.array(-0.0)))
    assert (-fmt.array(fmt.largest)).multiply_add(2, fmt.array(0.0)).to_float() == -math.inf


def test_counts_are_of_one_format_and_of_one_run():
    fmt, other = special(BINARY32), special(BINARY16)
    with flags(fmt) as outer:
        assert fmt.array(1) / fmt.array(3) > 0
        with flags(fmt) as inner, flags(other) as apart:
            assert np.isinf(fmt.array("3e38") * 2)
            assert other.array("0.1") > 0
        fmt.array("0.1")
    assert (inner.overflow, inner.inexact, apart.inexact) == (1, 2, 1)  # reading 3e38, and doubling it
    assert (outer.inexact, outer.overflow) == (4, 1)
    with flags(fmt) as seen:
        np.exp(fmt.array([0, 1, 2]))  # two roundings, whatever is tried on the way
    assert (seen.inexact, seen.underflow) == (2, 0)
    with pytest.raises(ValueError, match=r"whose exceptions are not counted; needed a format with infinity or NaN"):
        flags(BINARY32).__enter__()


def test_text_bits_pickles_and_conversions_keep_special_numbers():
    fmt = special(BINARY32)
    x = fmt.array([math.inf, "-inf", decimal.Decimal("nan"), "-0.0", -0.0, np.float32("inf"), 0, 1.5])
    assert str(x) == "[ inf -inf  nan   -0   -0  inf    0  1.5]"
    words = [0x7F800000, 0xFF800000, 0x7FC00000, 1 << 31, 1 << 31, 0x7F800000, 0, 0x3FC00000]
    assert x.to_bits().tolist() == words
    made = {"FloatFormat": FloatFormat, "Rounding": Rounding}
    for other in (pickle.loads(pickle.dumps(x)), eval(repr(x), made), fmt.from_bits(words)):
        assert other.to_bits().tolist() == words
        assert other.format == fmt
    assert special(BINARY64).array(x).to_bits()[3] == 1 << 63
    assert [float(each) for each in special(DECIMAL32).array(x).to_float()[:2]] == [math.inf, -math.inf]
    assert np.isnan(special(FP8_E4M3).array(x)[:3]).all()  # which has no infinity
    assert special(FP8_E4M3).array(math.nan).to_bits() == 0x7F
    assert special(BINARY128).array("-inf").to_bits() == 0xFFFF << 112
    with pytest.raises(ValueError, match=r"entry \[0\]: got inf; needed a finite number"):
        BINARY32.array(x)
    with pytest.raises(ValueError, match="got inf, which is no Fraction; needed a finite number"):
        x.to_fractions()
    with pytest.raises(ValueError, match=r"got the operand inf; needed a number of .*, which has NaN and no infinity"):
        special(FP8_E4M3).array(1) + math.inf
    with pytest.raises(ValueError, match="got inf; needed a finite number"):
        BINARY32.array(math.inf)


def test_sums_products_and_elimination_with_special_numbers():
    fmt = special(BINARY16)
    x = fmt.array([[60000, 60000], [-0.0, 1]])
    assert (x @ x.T).to_float().tolist() == [[math.inf, 60000], [60000, 1]]
    assert x[0].sum().to_float() == math.inf
    assert np.signbit(fmt.array([-0.0, -0.0]).sum())
    assert np.isnan(fmt.array([math.inf, 1, -math.inf]).sum())
    assert x.cumsum().to_float().tolist()[1] == math.inf
    assert gpbnb.linalg.solve(fmt.eye(2), x[1]).to_float().tolist() == [0, 1]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: replace(BINARY32, overflow="wrap"), "overflow: got 'wrap'; needed one of 'raise', 'saturate', 'infin"),
        (lambda: special(FP6_E2M3), "in which every word stores a finite number; needed overflow 'raise' or 'saturate"),
        (lambda: special(FP4_E2M1), "in which every word stores a finite number"),
        (lambda: special(IBM_HEX32), "in which every word stores a finite number"),
        (lambda: FloatFormat(2, 8, overflow="saturate"), "or overflow without a range; needed emin and emax as well"),
        (special(BINARY32).check_compiled, "got overflow to infinity; needed 'raise' or 'saturate' for compiled loops"),
        (replace(DECIMAL32, overflow="saturate").check_compiled, "got overflow that saturates in base 10; needed"),
    ],
)
def test_what_a_format_does_not_have_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_the_default_is_what_it_was():
    assert BINARY32.overflow == "raise"
    assert "overflow" not in repr(BINARY32)
    assert eval(repr(special(BINARY32)), {"FloatFormat": FloatFormat, "Rounding": Rounding}) == special(BINARY32)
    assert isinstance(BINARY32.backend, Compiled)
    assert isinstance(special(BINARY32).backend, Special)
    assert FixedFormat(0, 15, overflow="saturate").round(2) == FixedFormat(0, 15).largest
    with pytest.raises(ZeroDivisionError):
        replace(BINARY32, overflow="saturate").array(1) / 0
