"""Blocks that share a scale, against the text of the specification in Fractions, and words against ml_dtypes."""

from __future__ import annotations

import math
from fractions import Fraction

import ml_dtypes
import numpy as np
import pytest
from test_arithmetic_processors import expected

from gpbnb import (
    BINARY32,
    FP4_E2M1,
    FP6_E2M3,
    FP6_E3M2,
    FP8_E4M3,
    FP8_E5M2,
    FixedFormat,
    FloatFormat,
    MicroscalingFormat,
    microscaling_dot,
)

#: Each element format, and the exponent of its largest power of two in table 2 of the specification.
ELEMENTS = [(FP8_E4M3, 8), (FP8_E5M2, 15), (FP6_E3M2, 4), (FP6_E2M3, 2), (FP4_E2M1, 2)]


def converted(block, fmt, most):
    """Section 6.3: floor(log2(max)) - emax of the elements, then each number over the scale, saturated."""
    largest = max(map(abs, block))
    exponent = -127
    if largest:
        exponent = math.floor(math.log2(largest.numerator)) - math.ceil(math.log2(largest.denominator)) - 2
        while largest >= Fraction(2) ** (exponent + 1):
            exponent += 1
        exponent = max(exponent - most, -127)
    found = []
    for each in block:
        value = each / Fraction(2) ** exponent
        near = expected(value, fmt)
        found.append(near if near is not None else fmt.largest * (1 if value > 0 else -1))
    return exponent, found


@pytest.mark.parametrize(("fmt", "most"), ELEMENTS, ids=str)
def test_blocks_of_32_are_those_of_the_specification(fmt, most):
    rng = np.random.default_rng(5)
    given = rng.normal(size=(2, 96)) * 2.0 ** rng.integers(-12, 12, (2, 96))
    given[0, :32] = 0
    given[1, :32] *= 2.0**-140
    given[1, 40] = float(fmt.largest) * 1.06  # which saturates in most formats
    found = MicroscalingFormat(fmt).array(given)
    assert found.elements.shape == (2, 3, 32)
    for i in range(2):
        for j in range(3):
            exponent, elements = converted(
                [Fraction(each) for each in given[i, 32 * j : 32 * j + 32].tolist()], fmt, most
            )
            assert found.exponents[i, j] == exponent
            assert found.elements[i, j].to_fractions().tolist() == elements
            values = found.to_fractions()[i, 32 * j : 32 * j + 32].tolist()
            assert values == [each * Fraction(2) ** exponent for each in elements]


def test_every_word_of_a_scale_is_that_of_ml_dtypes():
    mx = MicroscalingFormat(FP4_E2M1, block=1)
    words = np.arange(255)
    found = mx.from_bits(words, np.full((255, 1), 0b0010))  # 1.0 in E2M1
    theirs = words.astype(np.uint8).view(ml_dtypes.float8_e8m0fnu).astype(np.float64)
    assert found.to_fractions().tolist() == [Fraction(each) for each in theirs.tolist()]
    scales, elements = found.to_bits()
    assert scales.tolist() == words.tolist()
    assert elements.ravel().tolist() == [0b0010] * 255
    assert np.isnan(np.array(255, np.uint8).view(ml_dtypes.float8_e8m0fnu).astype(np.float64))
    with pytest.raises(ValueError, match="got a scale that is NaN"):
        mx.from_bits([255], [[0]])


def eighth_bits(value):
    """Two's complement of 8 bits with 6 after the point, ties to even, saturated."""
    return Fraction(min(max(round(value * 64), -128), 127), 64)


def test_elements_of_mxint8():
    """From -2 to 1 63/64; the scale is the largest power of two not above the largest number of the block."""
    mx = MicroscalingFormat(FixedFormat(1, 6, "even"))
    rng = np.random.default_rng(7)
    given = rng.normal(size=320) * np.repeat(2.0 ** rng.integers(-150, 100, 10), 32)
    given[:32] = np.linspace(-1.9999, 1.9999, 32)  # both ends round beyond 127/64
    given[32:64] = np.arange(-63, 1, 2) / 64 / 2  # ties
    found = mx.array(given)
    for j, block in enumerate(given.reshape(10, 32).tolist()):
        exponent = max(math.frexp(max(map(abs, block)))[1] - 1, -127)
        assert found.exponents[j] == exponent
        elements = [eighth_bits(Fraction(each) / Fraction(2) ** exponent) for each in block]
        assert found.elements[j].to_fractions().tolist() == elements
        words = [int(each * 64) % 256 for each in elements]
        assert found.to_bits()[1][j].tolist() == words
    assert {Fraction(-2), Fraction(127, 64)} <= {*found.elements.to_fractions().ravel().tolist()}
    words = np.arange(256).reshape(8, 32)
    every = mx.from_bits(np.full(8, 127), words)
    assert every.to_fractions().tolist() == [Fraction((w + 128) % 256 - 128, 64) for w in range(256)]
    assert every.to_bits()[1].tolist() == words.tolist()
    total = microscaling_dot(found, found, FloatFormat(2, 1000))
    assert total.to_fractions() == sum(each * each for each in found.to_fractions().tolist())
    with pytest.raises(ValueError, match="which does not hold every element"):
        microscaling_dot(found, found, FloatFormat(2, 5))


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize(("fmt", "most"), ELEMENTS, ids=str)
def test_the_inner_product_is_its_loop(fmt, most, fused):
    sums = FloatFormat(2, 9)
    rng = np.random.default_rng(6)
    a, b = (MicroscalingFormat(fmt).array(rng.normal(size=96) * scale) for scale in (1, 1e-3))
    total = None
    for j in range(3):
        inner = None
        for p, q in zip(a.elements[j].to_fractions(), b.elements[j].to_fractions(), strict=True):
            product = p * q if fused and inner is not None else expected(p * q, sums)
            inner = product if inner is None else expected(inner + product, sums)
        scaled = expected(inner * Fraction(2) ** int(a.exponents[j] + b.exponents[j]), sums)
        total = scaled if total is None else expected(total + scaled, sums)
    assert microscaling_dot(a, b, sums, fused=fused).to_fractions() == total
    wide = microscaling_dot(a, b, FloatFormat(2, 400))
    assert wide.to_fractions() == sum(p * q for p, q in zip(a.to_fractions(), b.to_fractions(), strict=True))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: MicroscalingFormat(FP4_E2M1).array([1] * 33),
            ValueError,
            "needed a multiple of 32 along the last axis",
        ),
        (lambda: MicroscalingFormat(FP4_E2M1, 0), ValueError, "block: got 0; needed at least 1"),
        (lambda: MicroscalingFormat(FloatFormat(2, 4)), ValueError, "needed a format of base 2 with a range"),
        (
            lambda: MicroscalingFormat(FP4_E2M1, 1).array([2**131]),
            OverflowError,
            r"got a scale of 2\*\*129; needed at mo",
        ),
        (lambda: MicroscalingFormat(FP4_E2M1, 1).array([math.inf]), ValueError, "needed a finite number"),
        (
            lambda: microscaling_dot(*[MicroscalingFormat(FP8_E4M3, 1).array([1.125])] * 2, FloatFormat(2, 2)),
            ValueError,
            "which does not hold every element",
        ),
        (
            lambda: microscaling_dot(
                MicroscalingFormat(FP4_E2M1, 1).array([1]), MicroscalingFormat(FP4_E2M1, 2).array([1, 1]), BINARY32
            ),
            ValueError,
            "needed two equal vectors",
        ),
    ],
)
def test_what_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
