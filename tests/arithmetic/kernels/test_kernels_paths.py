"""A few arrays of the comparison of whole compiled loops with the exact kernel, and whether it can find a wrong one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks import paths
from gpbnb.arithmetic.kernels.backends import Compiled, Floats
from gpbnb.arithmetic.kernels.tags import Free, Hardware32, Hardware64, Limited

# One format for each tag and each way of choosing it; the command compares all.
CHOSEN = (
    "bfloat16", "FP8 E4M3", "binary32", "binary64", "24 bits, even", "24 bits, even, flushed", "24 bits, even, small",
    "26 bits, even", "53 bits, even, small", "11 bits, even, flushed", "24 bits, nearest", "53 bits, chop",
    "6 hexadecimal, chop", "8 decimal, nearest", "17 decimal, chop", "Q3.12, even",
)  # fmt: skip
WHOLLY = ("bfloat16", "binary32", "24 bits, nearest", "8 decimal, nearest")


@pytest.mark.parametrize("fmt", CHOSEN)
def test_one_array_of_each_format(fmt: str) -> None:
    kinds = ("product", "LU", "quotient", "conversion") if fmt not in WHOLLY else paths.KINDS
    counts = list(paths.run(1, 2026, (fmt,), kinds))
    assert [count for count in counts if count.different] == []
    assert len(counts) == len(kinds)


def chosen(fmt: str, scale: float, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The tag with which a product of two matrices is computed."""
    tags = []
    product = Compiled._product
    monkeypatch.setattr(Compiled, "_product", lambda self, tag, a, b: tags.append(tag) or product(self, tag, a, b))
    a = paths.FORMATS[fmt].array(scale * np.random.default_rng(1).uniform(0.5, 1, (30, 30)))
    result = a @ a
    assert paths.same(paths.outcome(lambda x: x @ x, a.on_exact_backend()), paths.outcome(lambda: result))
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


def test_a_product_that_leaves_the_range_unseen_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Floats, "_extents", lambda self, a, b: (1.0, 1.0, 1.0, 1.0))
    for fmt in ("binary16", "24 bits, even", "24 bits, even, flushed", "24 bits, even, small"):
        assert paths.compare(fmt, "product", 300_000, 3).different


def test_a_wrong_digit_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def other(self: Any, tag: Any, a: Any, b: Any) -> Any:
        return tuple(np.nextafter(part, np.inf) for part in product(self, tag, a, b) or ())

    product = Compiled._product
    monkeypatch.setattr(Compiled, "_product", other)
    assert paths.compare("24 bits, nearest", "product", 60_000, 1).different
