"""Results beyond the range that become the largest number, against Fractions and ml_dtypes."""

from __future__ import annotations

import operator
from dataclasses import replace
from functools import cache, partial

import ml_dtypes
import numpy as np
import pytest
from test_arithmetic_processors import expected

import gpbnb
from gpbnb import (
    BINARY32,
    DECIMAL32,
    FloatFormat,
)
from gpbnb.arithmetic.kernels.backends import Compiled

OPERATIONS = {"add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv}
NATIVE = {
    "FP8_E4M3": ml_dtypes.float8_e4m3fn,
    "FP6_E3M2": ml_dtypes.float6_e3m2fn,
    "FP6_E2M3": ml_dtypes.float6_e2m3fn,
    "FP4_E2M1": ml_dtypes.float4_e2m1fn,
}


def test_every_pair_saturated():
    """All pairs of finite numbers without a zero divisor, in compiled loops, on Python integers, and by definition."""
    for name in NATIVE:
        for operation in OPERATIONS.values():
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
            rounded = cache(partial(expected, fmt=finite))  # pairs have few different results
            for value, i, j in zip(found.to_fractions().tolist(), a.tolist(), b.tolist(), strict=True):
                exact = operation(numbers[i], numbers[j])
                wanted = rounded(exact)
                beyond += wanted is None
                assert value == (wanted if wanted is not None else fmt.largest if exact > 0 else -fmt.largest)
            assert beyond > 0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: replace(BINARY32, overflow="wrap"), "overflow: got 'wrap'; needed one of 'raise', 'saturate'"),
        (lambda: FloatFormat(2, 8, overflow="saturate"), "or overflow without a range; needed emin and emax as well"),
        (replace(DECIMAL32, overflow="saturate").check_compiled, "got overflow that saturates in base 10; needed"),
    ],
)
def test_what_a_format_does_not_have_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
