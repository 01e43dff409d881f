"""Products of matrices run without range checks only where no result can leave the range."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

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


def chosen(fmt: str, scale: float, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The tag with which a product of two matrices is computed."""
    tags = []
    product = Compiled._product
    monkeypatch.setattr(Compiled, "_product", lambda self, tag, a, b: tags.append(tag) or product(self, tag, a, b))
    a = FORMATS[fmt].array(scale * np.random.default_rng(1).uniform(0.5, 1, (30, 30)))
    exact = a.on_exact_backend()
    assert all(map(np.array_equal, (a @ a).to_pairs(), (exact @ exact).to_pairs()))
    return tags[0]


def test_products_without_range_checks_are_those_that_cannot_leave_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(chosen("bfloat16", 1.0, monkeypatch), Free)
    assert isinstance(chosen("bfloat16", 2.0**61.5, monkeypatch), Limited)
    assert chosen("24 bits, even", 1.0, monkeypatch) == Free(Hardware32())
    assert isinstance(chosen("24 bits, even", 2.0**-60, monkeypatch).tag, Limited)
    assert isinstance(chosen("24 bits, even", 2.0**-475, monkeypatch), Limited)
    assert isinstance(chosen("24 bits, even, flushed", 2.0**-48, monkeypatch), Limited)
    assert isinstance(chosen("24 bits, even, small", 2.0**-10, monkeypatch).tag, Limited)
    assert chosen("53 bits, even", 1.0, monkeypatch) == Free(Hardware64())
    assert isinstance(chosen("53 bits, even, small", 2.0**-30, monkeypatch), Limited)
