"""Rotations in t digits: digit for digit as with exact arithmetic, within their bounds, and what they cost."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest

from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rolling import experiment, rotations, theory
from tests import oracles

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
FORMATS = [
    FloatFormat(b, t, r)
    for b, t in ((2, 5), (2, 24), (2, 53), (10, 3), (10, 8), (10, 12), (16, 6))
    for r in Rounding.documented()
]
PERIODS = [600.0, 77.5]


def exact_angle(n, period):
    """Cosine and sine of n steps of 10 s, as Fractions; the whole angle, not its part of a turn."""
    with mpmath.workdps(60):
        x = 2 * mpmath.pi * 10 * n / mpmath.mpf(period)
        return [Fraction(mpmath.nstr(f(x), 50)) for f in (mpmath.cos, mpmath.sin)]


def slow(fmt, period, steps):
    fl = oracles.rounds(fmt)
    a, b = (fl(x) for x in exact_angle(1, period))
    c, s = Fraction(1), Fraction(0)
    for n in range(1, steps + 1):
        c, s = fl(fl(c * a) - fl(s * b)), fl(fl(s * a) + fl(c * b))
        yield n, c, s


def error_of(n, c, s, period):
    cosine, sine = exact_angle(n, period)
    return float(mpmath.sqrt(mpmath.mpf(float((c - cosine) ** 2 + (s - sine) ** 2))))


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("period", PERIODS)
def test_the_compiled_recursion_is_that_of_exact_fractions(fmt, period):
    marks = [1, 2, 7, 40, 100]
    found = rotations.recursion(fmt, period, marks)
    expected = [error_of(n, c, s, period) for n, c, s in slow(fmt, period, 100) if n in marks]
    assert found.size == pytest.approx(expected, rel=1e-7, abs=1e-30)
    assert list(found.step) == marks


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("period", PERIODS)
def test_errors_are_within_their_bounds_and_not_far_below(fmt, period):
    marks = np.arange(1, 200, 7)
    beta = fmt.unit_roundoff
    recursive = [theory.recursion_bound(int(n), beta) for n in marks]
    # The rate, the time and their product are rounded, then the cosine and sine.
    direct = 2 * math.pi * marks * (10 / period) * float(gamma(3, beta)) + float(beta)
    for rotate, bound, least in ((rotations.recursion, recursive, 0.005), (rotations.direct, direct, 0.15)):
        ratio = rotate(fmt, period, marks).size / bound
        assert least < np.max(ratio) <= 1


def test_direct_evaluation_is_that_of_the_rounded_product():
    fmt, period, n = FloatFormat(10, 7), 77.5, 123457
    found = rotations.direct(fmt, period, [n])
    angle = fmt.round(fmt.round(theory.roll_rate(period)) * fmt.round(n * 10))
    with mpmath.workdps(50):
        x = mpmath.mpf(angle.numerator) / angle.denominator
        c, s = (fmt.round(Fraction(mpmath.nstr(f(x), 40))) for f in (mpmath.cos, mpmath.sin))
    assert found.size[0] == pytest.approx(error_of(n, c, s, period), rel=1e-9)


def test_a_year_is_within_its_bound():
    marks = np.unique(np.geomspace(1, 3153600, 40).astype(int))
    for fmt in (FloatFormat(10, 10), FloatFormat(2, 40), FloatFormat(10, 12, CHOP)):
        found = rotations.recursion(fmt, 77.5, marks)
        bound = [theory.recursion_bound(int(n), fmt.unit_roundoff) for n in marks]
        ratio = found.size / bound
        assert np.max(ratio) <= 1
        assert np.max(ratio) > 0.005
        assert bound[-1] == pytest.approx(3153600 * (1 + 2 * 2**0.5) * float(fmt.unit_roundoff), rel=0.01)


def test_a_rounded_rotation_may_lock_into_a_cycle():
    """With sixty samples a turn and few digits the error stops growing; the bound knows nothing of it."""
    found = rotations.recursion(FloatFormat(10, 4), 600.0, [60000, 60060, 120000, 600000])
    assert found.size[2] == found.size[0] == found.size[1] == found.size[3]


@pytest.mark.parametrize(("digits", "period", "samples", "locked"), [(10, 600.0, 60, True), (14, 600.0, 60, False)])
def test_where_samples_come_back_the_recursion_may_lock(digits, period, samples, locked):
    year = experiment.YEAR_SAMPLES
    found = rotations.recursion(FloatFormat(10, digits), period, [year - 2 * samples, year - samples, year])
    assert (len(set(found.size)) == 1) is locked
