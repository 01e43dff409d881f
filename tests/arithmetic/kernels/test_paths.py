"""Products of matrices run without range checks only where no result can leave the range."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb import BFLOAT16, FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.kernels.tags import Free, Hardware32, Hardware64, Limited

FORMATS = {
    "bfloat16": BFLOAT16,
    "24 bits, even": FloatFormat(2, 24, "even"),
    "24 bits, even, flushed": FloatFormat(2, 24, "even", emin=-100, emax=100, subnormal=False),
    "24 bits, even, small": FloatFormat(2, 24, "even", emin=-40, emax=40),
    "53 bits, even": FloatFormat(2, 53, "even"),
    "53 bits, even, small": FloatFormat(2, 53, "even", emin=-100, emax=100),
}


def chosen(name: str, scale: float) -> Any:
    """The tag with which a product of two matrices is computed."""
    a = FORMATS[name].array(scale * np.random.default_rng(1).uniform(0.5, 1, (30, 30)))
    assert isinstance(a.backend, Compiled)
    return a.backend._product_tag(a.components[0], a.components[0])


def test_products_without_range_checks_are_those_that_cannot_leave_the_range() -> None:
    assert isinstance(chosen("bfloat16", 1.0), Free)
    assert isinstance(chosen("bfloat16", 2.0**61.5), Limited)
    assert chosen("24 bits, even", 1.0) == Free(Hardware32())
    assert isinstance(chosen("24 bits, even", 2.0**-60).tag, Limited)
    assert isinstance(chosen("24 bits, even", 2.0**-475), Limited)
    assert isinstance(chosen("24 bits, even, flushed", 2.0**-48), Limited)
    assert isinstance(chosen("24 bits, even, small", 2.0**-10).tag, Limited)
    assert chosen("53 bits, even", 1.0) == Free(Hardware64())
    assert isinstance(chosen("53 bits, even, small", 2.0**-30), Limited)


def test_a_product_without_range_checks_has_the_digits_of_the_exact_backend() -> None:
    a = FORMATS["24 bits, even"].array(np.random.default_rng(1).uniform(0.5, 1, (30, 30)))
    exact = a.on_exact_backend()
    assert all(map(np.array_equal, (a @ a).to_pairs(), (exact @ exact).to_pairs()))
