"""Formats of processors: every rounding mode, a limited range, fused operations, fixed point."""

from __future__ import annotations

import itertools
import math
import operator
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest

from gpbnb.arithmetic import linalg, named
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from tests.oracles import floating

pytestmark = pytest.mark.usefixtures("loops_at_once")

TRUEDIV = operator.truediv
BINARY = [operator.add, operator.sub, operator.mul, TRUEDIV]
DETERMINISTIC = [mode for mode in Rounding if mode is not Rounding.STOCHASTIC]


def up(mode: Rounding, negative: Any, odd: Any, inexact: Any, half: Any) -> Any:
    """Whether the size of a number is rounded up, by the definition of each mode.

    `odd` tells about the last digit kept; `half` is above, at or below 0 if the rest is above, at or below one half.
    """
    return (
        inexact
        & {
            Rounding.NEAREST: half >= 0,
            Rounding.EVEN: (half > 0) | ((half == 0) & odd),
            Rounding.HALF_UP: (half > 0) | ((half == 0) & ~negative),
            Rounding.CHOP: False,
            Rounding.UP: ~negative,
            Rounding.DOWN: negative,
            Rounding.ODD: ~odd,
        }[mode]
    )


def expected(x: Fraction, fmt: FloatFormat) -> Fraction | None:
    """The number of the format for an exact result; None if it overflows."""
    y = floating(fmt.base, fmt.precision, fmt.rounding.value, fmt.emin, fmt.subnormal)(x)
    return None if fmt.limits is not None and abs(y) > fmt.limits.largest else y


TINY = [
    FloatFormat(2, 3, emin=-3, emax=3),
    FloatFormat(2, 3, emin=-3, emax=3, subnormal=False),
    FloatFormat(16, 1, emin=-1, emax=0, subnormal=False),
    FloatFormat(10, 1, emin=-1, emax=0),
    FloatFormat(10, 1, emin=-1, emax=0, subnormal=False),
    FloatFormat(3, 2, emin=-1, emax=1),
    FloatFormat(2, 4),
    FloatFormat(2, 1),
    FloatFormat(2, 1, emin=-3, emax=3, subnormal=False),
]


def pairs(operation: Any, counts: Any, scale: Fraction) -> tuple[Any, Any, Any, Any]:
    """Every pair of numbers that are multiples of 1 / scale, as indices; and the exact results p / q, likewise."""
    i, j = (part.ravel() for part in np.indices((len(counts), len(counts))))
    if operation is TRUEDIV:
        i, j = i[counts[j] != 0], j[counts[j] != 0]
        return i, j, np.sign(counts[j]) * counts[i] * scale.numerator, abs(counts[j]) * scale.denominator
    if operation is operator.mul:
        return i, j, counts[i] * counts[j] * scale.denominator, np.full(i.shape, scale.numerator)
    return i, j, operation(counts[i], counts[j]), np.ones(i.shape, int)


def some(beyond: Any, p: Any, q: Any) -> Any:
    """Of the results p / q beyond a range the eight smallest in size, and eight of all."""
    beyond = np.flatnonzero(beyond)
    beyond = beyond[np.argsort(abs(p[beyond]) / q[beyond], kind="stable")]
    return np.unique([*beyond[:8], *beyond[:: -(-len(beyond) // 8) or 1]]).astype(int)


class Small:
    """Every number of a small format; of an unlimited one those near 1. `counts` are multiples of 1 / scale."""

    def __init__(self, fmt: FloatFormat) -> None:
        base, t = fmt.base, fmt.precision
        emin, emax = (-2, 2) if fmt.emin is None or fmt.emax is None else (fmt.emin, fmt.emax)
        gradual = fmt.emin is not None and fmt.subnormal
        reach = 2 * max(-emin, emax) + 2 * t + 2  # enough for products, quotients and all digits of small differences
        self.scale, least = base**reach, base ** (t - 1)
        # As if there were no limit above, and without subnormal numbers none below.
        last = range(emin - t + 1 if gradual else -reach, reach)
        table = [(m * base ** (e + reach), m, e) for e in last for m in range(least, base * least)]
        table += [(m * base ** (last[0] + reach), m, last[0]) for m in range(1, least)] if gradual else []
        self.table, m, e = np.array([(0, 0, 0), *sorted(table)]).T
        self.odd = m % 2 == 1
        while (short := (m > 0) & (m < least)).any():
            m, e = np.where(short, m * base, m), e - short
        self.m, self.e = m, e
        below, above = base ** (emin + reach), (base * least - 1) * base ** (emax - t + 1 + reach)
        normal = self.table[(self.table >= below) & (self.table <= above)]
        held = self.table[(self.table > 0) & (self.table < below)] if gradual else normal[:0]
        self.counts = np.concatenate([[0], normal, held, -normal, -held])
        self.below, self.above = (0 if gradual else below, above) if fmt.emin is not None else (0, self.table[-1])

    def fractions(self) -> list[Fraction]:
        return [Fraction(int(count), self.scale) for count in self.counts]

    def rounded(self, p: Any, q: Any, mode: Rounding) -> tuple[Any, Any, Any]:
        """The exact results rounded, as significands and exponents, and whether they are within the range."""
        below = np.searchsorted(self.table, abs(p) // q, side="right") - 1
        low, high = self.table[below] * q, self.table[below + 1] * q
        found = below + up(mode, p < 0, self.odd[below], low < abs(p), 2 * abs(p) - low - high)
        found = np.where(self.table[found] < self.below, 0, found)
        return np.sign(p) * self.m[found], self.e[found], self.table[found] <= self.above


small = cache(Small)


def same(found: Any, m: Any, e: Any) -> bool:
    """Whether an array has these significands and exponents, both normalized."""
    return all(np.array_equal(*parts) for parts in zip(found.to_pairs(), (m, e), strict=True))


@pytest.mark.parametrize("tiny", TINY, ids=str)
def test_every_pair_of_a_small_format(tiny: FloatFormat) -> None:
    for mode in DETERMINISTIC:
        fmt, every = replace(tiny, rounding=mode), small(tiny)
        assert len(set(every.counts)) == len(every.counts)
        x = fmt.array(every.fractions())
        assert x.to_fractions().tolist() == every.fractions()
        overflows = 0
        for operation in BINARY:
            i, j, p, q = pairs(operation, every.counts, Fraction(every.scale))
            m, e, held = every.rounded(p, q, mode)
            assert same(operation(x[i[held]], x[j[held]]), m[held], e[held])
            exactly = held & (every.counts[i] >= 0)  # which gives results of either sign
            found = operation(x[i[exactly]].on_exact_backend(), x[j[exactly]].on_exact_backend())
            assert same(found, m[exactly], e[exactly])
            overflows += int(np.count_nonzero(~held))
            for k in some(~held, p, q):
                with pytest.raises(OverflowError):
                    operation(x[i[k]], x[j[k]])
        assert (overflows > 0) is (fmt.emin is not None)


@pytest.mark.parametrize("tiny", [TINY[0], TINY[3], TINY[6]], ids=str)
def test_fused_multiply_add_of_every_triple(tiny: FloatFormat) -> None:
    for mode in DETERMINISTIC:
        fmt, every = replace(tiny, rounding=mode), small(tiny)
        kept = slice(None, None, 1 if fmt.base == 10 else 3)
        x, counts = fmt.array(every.fractions()[kept]), every.counts[kept]
        # In base 10 on Python integers; there a product of either sign needs no first factor of either sign.
        first = counts >= 0 if fmt.base == 10 else counts == counts
        a, b, c = (part.ravel() for part in np.meshgrid(*map(np.arange, [len(x)] * 3), indexing="ij"))
        a, b, c = a[first[a]], b[first[a]], c[first[a]]
        p = counts[a] * counts[b] + counts[c] * every.scale
        m, e, held = every.rounded(p, np.full(p.shape, every.scale), mode)
        assert same(x[a[held]].multiply_add(x[b[held]], x[c[held]]), m[held], e[held])


@pytest.mark.parametrize("base", [2, 3, 10])
def test_numbers_far_below_the_smallest(base: int) -> None:
    """They become zero or the smallest number, as texts, quotients and integers times a power of the base."""
    for subnormal in [True, False]:
        for mode in DETERMINISTIC:
            fmt = FloatFormat(base, 3, mode, emin=-3, emax=3, subnormal=subnormal)
            for digits, power in itertools.product((-3, 2, 11), (5, 12, 25, 26, 27, 28, 29, 31, 40, 400)):
                exact = digits * Fraction(1, base) ** power
                assert fmt.round(exact) == expected(exact, fmt)
                pair = fmt.kernel.from_ratio(digits, 1, -power)
                assert fmt.kernel.to_fraction(*pair) == expected(exact, fmt)
                if base == 10:
                    assert fmt.array(f"{digits}e-{power}").to_fractions() == expected(exact, fmt)


CONVERTED = [named.BINARY16, named.BFLOAT16, named.TF32, named.FP8_E4M3, FloatFormat(2, 11), FloatFormat(2, 52)]


@pytest.mark.parametrize("fmt", [*CONVERTED, replace(named.BINARY16, subnormal=False)], ids=str)
def test_conversion_of_every_power_of_two(fmt: FloatFormat) -> None:
    fmt = replace(fmt, rounding=Rounding.EVEN)
    rng = np.random.default_rng(5)
    powers = np.ldexp(1.0, rng.integers(-1074, 1024, 300))
    ties = np.ldexp(rng.integers(2 ** (fmt.precision - 1), 2**fmt.precision, 300) + 0.5, 1 - fmt.precision)
    x = np.concatenate([powers, powers * rng.uniform(1, 2, 300), powers * ties, powers * rng.choice([0.5, 1.5], 300)])
    largest = 2.0**900 if fmt.limits is None else float(fmt.limits.largest)
    edge = largest * (1 + np.arange(9) / 4 * 2.0**-fmt.precision)
    x = np.concatenate([[0.0], x, -x, edge, -edge])
    x = x[np.isfinite(x)]
    results = [expected(Fraction(float(value)), fmt) for value in x]
    held = [result is not None for result in results]
    # An array with a number out of reach of the compiled loop is converted by the exact kernel as a whole.
    large, small = np.abs(x) > 2.0**-900, np.abs(x) < 2.0**960
    for part in (large & small, large, np.full(x.shape, True)):
        kept = np.array(held) & part
        found = fmt.array(x[kept]).to_fractions().tolist()
        assert found == [result for result, keep in zip(results, kept, strict=True) if keep]
    for value in x[~np.array(held)][-20:]:
        with pytest.raises(OverflowError):
            fmt.array([value])
    with pytest.raises((OverflowError, ValueError)):
        fmt.array([np.inf])


def test_named_formats_have_their_published_limits() -> None:
    def limits(fmt: FloatFormat) -> tuple[Fraction, Fraction]:
        assert fmt.limits is not None
        return fmt.limits.largest, Fraction(fmt.base) ** fmt.limits.emin

    for fmt, dtype in ((named.BINARY16, np.float16), (named.BINARY32, np.float32), (named.BINARY64, np.float64)):
        about = np.finfo(dtype)
        assert limits(fmt) == (Fraction(float(about.max)), Fraction(float(about.smallest_normal)))
        assert fmt.round(Fraction(float(about.smallest_subnormal))) == Fraction(float(about.smallest_subnormal))
    assert limits(named.FP8_E4M3) == (448, Fraction(1, 64))
    assert limits(named.FP8_E5M2) == (57344, Fraction(1, 2**14))
    assert limits(named.IBM_HEX32) == (Fraction(16) ** 63 * (1 - Fraction(1, 16**6)), Fraction(1, 16**65))
    assert limits(named.IBM_704) == (2**127 * (1 - Fraction(1, 2**27)), Fraction(1, 2**129))
    assert limits(named.DECIMAL32) == (Fraction("9.999999e96"), Fraction("1e-95"))


class TestStochastic:
    FMT = replace(named.BFLOAT16, rounding=Rounding.STOCHASTIC, seed=11)

    def test_the_mean_is_exact(self) -> None:
        count = 40_000
        self.FMT.restart()
        x = self.FMT.array(np.full(count, 1 + 2.0**-7 * 0.3)).to_float()
        up = np.mean(x > 1)
        assert set(x) == {1.0, 1 + 2.0**-7}
        assert abs(up - 0.3) < 5 * math.sqrt(0.3 * 0.7 / count)  # five standard errors

    @pytest.mark.parametrize("seed", range(8))
    def test_the_first_24_bits_of_splitmix64_decide(self, seed: int) -> None:
        """Steele, Lea and Flood 2014. A number as near to the next one as the bits say is not rounded up."""
        z = (seed + 0x9E3779B97F4A7C15) % 2**64
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            z = (z ^ (z >> shift)) * factor % 2**64
        drawn = Fraction((z ^ (z >> 31)) >> 40, 2**24)
        fmt = replace(self.FMT, seed=seed)
        for share, result in ((drawn, 1), (drawn + Fraction(1, 2**26), 1 + Fraction(1, 128))):
            x = 1 + share / 128
            assert x == Fraction(float(x))
            for given in ([x], np.array([float(x)])):
                fmt.restart()
                assert fmt.array(given).to_fractions().tolist() == [result]

    def test_the_same_seed_gives_the_same_digits_on_either_backend(self) -> None:
        rng = np.random.default_rng(5)
        x = named.BFLOAT16.array(rng.normal(size=(2, 300))).to_float()
        for operation in BINARY:
            results = []
            for exactly in (False, False, True):
                self.FMT.restart()
                a, b = (self.FMT.array(row) for row in x)
                if exactly:
                    a, b = a.on_exact_backend(), b.on_exact_backend()
                self.FMT.restart()
                results.append(operation(a, b).to_float())
            assert np.array_equal(results[0], results[1])
            assert np.array_equal(results[0], results[2])
        other = replace(self.FMT, seed=12)
        other.restart()
        assert not np.array_equal((other.array(x[0]) * other.array(x[1])).to_float(), results[0])


class TestSums:
    @pytest.mark.parametrize(
        "shapes", [((4, 2, 3), (4, 3, 2)), ((2, 3), (3, 3, 2)), ((3,), (2, 3, 2)), ((4, 2, 3), (3,))]
    )
    def test_stacks_are_summed_in_the_same_order(self, shapes: Any) -> None:
        rng = np.random.default_rng(3)
        a, b = (named.BFLOAT16.array(rng.normal(size=shape)) for shape in shapes)
        differ = []
        for options in ({"order": "pairwise"}, {"order": "blocked", "block": 2}, {"fused": True}):
            found = linalg.matmul(a, b, **options)
            assert found.shape == (a @ b).shape
            for k in range(max(shapes)[0] if len(shapes[0]) == len(shapes[1]) else len(found)):
                one = linalg.matmul(a[k] if a.ndim == 3 else a, b[k] if b.ndim == 3 else b, **options)
                assert np.array_equal(found[k], one)
            differ.append(not np.array_equal(found, a @ b))
        assert any(differ)


class TestFixed:
    @pytest.mark.parametrize("bits", [(1, 3), (0, 4), (3, 0), (-1, 5)])
    def test_every_pair(self, bits: tuple[int, int]) -> None:
        for mode in DETERMINISTIC:
            for overflow in ["raise", "saturate", "wrap"]:
                fmt = FixedFormat(*bits, mode, overflow)
                count = 2 ** (sum(bits) + 1)
                counts = np.arange(count) - count // 2
                every = [int(k) * fmt.unit for k in counts]
                assert (every[0], every[-1]) == (fmt.lowest, fmt.largest)
                x = fmt.array(every)
                assert x.to_fractions().tolist() == every
                for operation in BINARY:
                    i, j, p, q = pairs(operation, counts, 1 / fmt.unit)
                    size, rest = np.divmod(abs(p), q)
                    result = np.sign(p) * (size + up(mode, p < 0, size % 2 == 1, rest > 0, 2 * rest - q))
                    held = (result >= counts[0]) & (result <= counts[-1])
                    if overflow == "raise":
                        for k in some(~held, p, q):
                            with pytest.raises(OverflowError):
                                operation(x[i[k]], x[j[k]])
                        i, j, result = i[held], j[held], result[held]
                    elif overflow == "saturate":
                        result = np.clip(result, counts[0], counts[-1])
                    else:
                        result = (result - counts[0]) % count + counts[0]
                    found = operation(x[i], x[j])
                    assert type(found) is type(x)
                    assert np.array_equal(found.to_float(), result * float(fmt.unit))
