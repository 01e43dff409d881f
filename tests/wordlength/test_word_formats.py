"""Formats of data, coefficients and sums in fixed point, found one by one, against a loop over integers."""

from __future__ import annotations

from fractions import Fraction
from math import floor

import numpy as np
import pytest

from gpbnb import FixedFormat, LinearSystem, WordFormats, required_precision
from gpbnb.wordlength.asked import Asked
from gpbnb.wordlength.fixed import MOST_COEFFICIENT_BITS
from gpbnb.wordlength.judges import judge_for


def words_error(system, z, tolerance, basis="emulation"):
    return judge_for(Asked(system, z, len(z), tolerance, basis)).proof


ALPHA = Fraction(1097, 4096)
STEP = [512] * 200


def largest_error(fraction, bits):
    """Largest error of y += alpha (u - y) with data of some fraction bits, floored products, and a short alpha."""
    unit, alpha = Fraction(1, 2**fraction), ALPHA
    while (alpha / 2) >= 1:
        alpha /= 2
    scale = Fraction(1)
    while alpha * scale < 2 ** (bits - 1):
        scale *= 2
    short = Fraction(floor(alpha * scale + Fraction(1, 2))) / scale
    y, true, worst = Fraction(0), Fraction(0), Fraction(0)
    for u in STEP:
        y += floor(short * (u - y) / unit) * unit
        true += ALPHA * (u - true)
        worst = max(worst, abs(y - true))
    return worst


def test_the_smoother_needs_what_a_plain_loop_over_integers_needs():
    system, z = LinearSystem.smoother("1097/4096"), np.array(STEP, float).reshape(-1, 1)
    for tolerance in (3, 0.5):
        found = required_precision(system, z, tolerance, kind="words", rounding="floor")
        words = found.format
        assert words is not None
        assert found.digits == words.data.fraction_bits
        assert isinstance(words.coefficients, int)
        assert largest_error(words.data.fraction_bits, MOST_COEFFICIENT_BITS) <= tolerance
        if words.data.fraction_bits:
            assert largest_error(words.data.fraction_bits - 1, MOST_COEFFICIENT_BITS) > tolerance
        assert found.ratio <= 1
        assert words.accumulator.integer_bits <= words.data.integer_bits + 8


@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_no_format_of_a_biquad_can_be_lowered(basis):
    system = LinearSystem.from_coefficients(["0.01", "0.02", "0.01"], [1, "-1.6", "0.7"])
    z = np.sign(np.sin(np.arange(150.0) ** 1.3)).reshape(-1, 1) + 0.25
    found = required_precision(system, z, 0.01, kind="words", basis=basis)
    words, error = found.format, words_error(system, z, 0.01, basis)
    assert words is not None
    assert found.ratio == error(words).ratio <= 1
    shorter = WordFormats(words.data, words.coefficients - 1, words.sums)
    assert error(shorter).ratio > 1
    assert words.sums.fraction_bits == words.data.fraction_bits or (
        error(
            WordFormats(
                words.data,
                words.coefficients,
                FixedFormat(
                    words.sums.integer_bits, words.sums.fraction_bits - 1, words.sums.rounding, overflow="wrap"
                ),
            )
        ).ratio
        > 1
    )
