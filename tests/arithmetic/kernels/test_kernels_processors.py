"""A tenth of a percent of the processors' part of ``make exactness``, and whether it can find a wrong digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import processors
from benchmarks.journal import Journal


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


def test_a_wrong_format_is_found_in_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    right, wrong = processors.SMALL["FP8 E4M3"], processors.SMALL["FP8 E5M2"]
    monkeypatch.setitem(processors.SMALL, "FP8 E4M3", (wrong[0], right[1]))
    counts = list(processors.pairs("FP8 E4M3", 1, np.random.default_rng(0)))
    assert all(count.different > 1000 for count in counts)


def test_a_journal_resumes_where_it_ended(tmp_path: Path) -> None:
    file = tmp_path / "journal.csv"
    journal = Journal(file, "12345678")
    first = list(processors.pairs("FP8 E5M2", 1, np.random.default_rng(0), journal))
    again = Journal(file, "12345678")
    assert again.parts == journal.parts != {}
    marked = next(iter(again.parts))
    again.parts[marked][-1] = "7"  # taken as it stands, not compared anew
    assert sum(count.different for count in first) == 0
    assert sum(c.different for c in processors.pairs("FP8 E5M2", 1, np.random.default_rng(0), again)) == 7
    assert Journal(file, "00000000").parts == {}


def test_float16_is_rounded_as_numpy_rounds_it() -> None:
    patterns = np.arange(2**16, dtype=np.uint32) << 16
    x = np.concatenate([(patterns | low).view(np.float32) for low in (0, 0x1000, 0x1001, 0x0FFF)])
    x = x[np.isfinite(x)]
    found = processors.operate("add", np.float16, np.float32(0), x)
    with np.errstate(all="ignore"):
        expected = x.astype(np.float16)
    same = found.view(np.float16) == expected
    assert same.all()
