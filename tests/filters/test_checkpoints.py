"""Differences of checkpoints without Fractions: those that Fractions give, correctly rounded."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.filters import checkpoints as module
from gpbnb.filters.checkpoints import Checkpoints, Packed

COUNT = 3000


def double_double(rng):
    """Random numbers, some with low parts that are zero or far below the high parts."""
    high = rng.standard_normal(COUNT) * 2.0 ** rng.integers(-60, 60, COUNT)
    low = high * 2.0**-53 * rng.uniform(-0.5, 0.5, COUNT) * rng.choice([0, 1, 1, 2.0**-300], COUNT)
    total = high + low
    return np.stack([total, low - (total - high)], axis=-1)


def difference(numbers, fmt, true):
    """State minus reference, as a run with one checkpoint has it; and the same by Fractions."""
    each = [Packed(part.reshape(1, COUNT, *part.shape[1:]), of) for part, of in ((numbers, fmt), (true, None))]
    run, reference = (Checkpoints((1,), x, Packed(x.numbers[:0], x.fmt), Packed(x.numbers[:0], x.fmt)) for x in each)
    found = run.minus(reference)[0]
    assert np.array_equal(reference.to_float("x"), reference.x.astype(float))
    assert not np.signbit(found[found == 0]).any()
    return found, (run.x - reference.x).astype(float)


def of_floats(rng):
    """Numbers of 53 bits and what is subtracted: near, equal, neighbours, far, subnormal, halfway, and huge."""
    true = double_double(rng)
    yield rng.standard_normal(COUNT), true
    yield true[:, 0].astype(np.float32).astype(float), true
    yield true[:, 0], true
    yield np.nextafter(true[:, 0], np.inf), true
    yield true[:, 0] * 2.0 ** rng.integers(-54, 54, COUNT), true
    tiny = rng.integers(-5, 5, COUNT) * 2.0**-1070
    yield rng.integers(-5, 5, COUNT) * 2.0 ** rng.integers(-1074, -1000, COUNT), np.stack([tiny, 0 * tiny], axis=-1)
    whole = rng.integers(1, 2**20, COUNT).astype(float)
    half = -(2.0 ** (np.floor(np.log2(whole)) - 53))
    yield whole, np.stack([half, rng.choice([-1, 0, 1], COUNT) * 2.0**-700], axis=-1)
    yield rng.choice([0.0, 1.0, -(2.0**1010)], COUNT), np.stack([rng.choice([0.0, -(2.0**999)], COUNT), 0 * whole], -1)


def test_differences_of_float64_are_those_of_fractions():
    rng = np.random.default_rng(1)
    for numbers, true in of_floats(rng):
        found, expected = difference(numbers, FloatFormat(2, 53), true)
        assert np.array_equal(found, expected)
        other = np.where(rng.random((COUNT, 1)) < 0.5, true, np.stack([true[:, 0], true[:, 1] / 2], axis=-1))
        found, expected = difference(other, None, true)
        assert np.array_equal(found, expected)


@pytest.mark.parametrize("precision", [3, 8, 17])
def test_differences_of_decimals_are_those_of_fractions(precision, monkeypatch):
    """Also where the reference is the nearest double-double, whose distance is below what double-double resolves."""
    rng, fmt = np.random.default_rng(precision), FloatFormat(10, precision)
    given = rng.standard_normal(COUNT) * 10.0 ** rng.integers(-25, 25, COUNT)
    given[:100], given[100:200] = 0, rng.integers(-9, 9, 100)
    x = fmt.array(given)
    true = double_doubles(x.to_fractions())
    true[::2] = double_double(rng)[::2]
    true[1::4] = np.stack([np.nextafter(true[1::4, 0], 1), 0 * true[1::4, 1]], axis=-1)
    packed = fmt.backend.pack(x.components)
    found, expected = difference(packed, fmt, true)
    assert np.array_equal(found, expected)
    if precision == 8:  # a difference that is not certain is asked of Fractions
        monkeypatch.setattr(module, "_SHARE", 0.0)
        assert not np.array_equal(difference(packed, fmt, true)[0], expected)
