"""A tenth of a percent of the processors' part of ``make exactness``, and whether it can find a wrong digit."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import processors


def test_a_thousandth_of_all() -> None:
    counts = list(processors.run(0.001, seed=16))
    assert sum(count.compared for count in counts) > 8 * 0.0005 * 63_487**2
    assert [count for count in counts if count.different] == []
    assert {count.fmt for count in counts} == {*processors.SMALL, *processors.MACHINE}


@pytest.mark.parametrize(("name", "other"), [("binary16", "bfloat16"), ("FP8 E4M3", "FP8 E5M2")])
def test_results_of_another_format_differ(name: str, other: str) -> None:
    fmt, dtype = processors.SMALL[other][0], processors.SMALL[name][1]
    x = np.linspace(0.5, 3, 100).astype(dtype)
    found = processors.computed(fmt, "multiply", x.astype(float), x.astype(float))
    assert processors.differing(found, x * x) > 20


def test_an_overflow_that_is_not_found_differs() -> None:
    expected = np.array([np.inf, 1.0], np.float16)
    assert processors.differing(np.array([65504.0, 1.0]), expected) == 1
    assert processors.differing(np.array([np.nan, 1.0]), expected) == 0
    assert processors.differing(np.array([np.nan, np.nan]), expected) == 1
    assert processors.differing(np.array([np.nan, -0.0]), np.array([np.inf, 0.0], np.float16)) == 1
