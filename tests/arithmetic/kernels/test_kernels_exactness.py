"""A tenth of a percent of ``make exactness``, and whether its operands are hard enough to find wrong shortcuts."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import exactness
from gpbnb.arithmetic.kernels.backends import backend
from gpbnb.arithmetic.rounding import Rounding, Rules


@pytest.mark.parametrize("base", [2, 10, 16])
def test_a_thousandth_of_all(base: int) -> None:
    todo = [job for job in exactness.jobs(0.001, seed=2016) if job.base == base]
    outcomes = [exactness.compare(job) for job in todo]
    assert [text for outcome in outcomes for text in outcome.mismatches] == []
    assert sum(outcome.compared for outcome in outcomes) >= 0.0019 * exactness.PER_BASE_AND_ROUNDING[base]


def operands(job: exactness.Job) -> list[np.ndarray]:
    m1, e1, m2, e2 = exactness.pairs(job)
    return [np.ldexp(m.astype(float), e.astype(np.int64)) for m, e in ((m1, e1), (m2, e2))]


@pytest.mark.parametrize(
    ("operation", "precision", "nearest", "found"),
    [
        ("add", 11, False, True),
        ("add", 24, False, True),
        ("subtract", 53, False, True),
        ("add", 25, True, False),  # the shortcut the kernel takes
        ("add", 27, True, True),
        ("add", 53, True, True),
        ("multiply", 26, False, False),
        ("multiply", 27, True, True),
        ("multiply", 40, False, True),
        ("multiply", 53, True, True),
        ("divide", 25, False, False),
        ("divide", 30, False, True),
        ("divide", 30, True, True),
    ],
)
def test_rounding_twice_is_found_where_it_is_wrong(operation: str, precision: int, nearest: bool, found: bool) -> None:
    job = exactness.Job(2, precision, nearest, operation, 20_000, (1, precision))
    x, y = operands(job)
    y = np.where(y == 0, 1.0, y) if operation == "divide" else y
    kernel = backend(job.rules)
    once = kernel.apply(operation, (x,), (y,))[0]
    twice = kernel.apply("round_", (getattr(np, operation)(x, y),))[0]
    assert bool(np.any(once != twice)) is found


def test_roots_rounded_twice_are_found() -> None:
    for precision, found in ((25, False), (35, True)):
        job = exactness.Job(2, precision, False, "sqrt", 20_000, (2,))
        m, e = exactness.radicands(job)
        x = np.ldexp(m.astype(float), e.astype(np.int64))
        kernel = backend(job.rules)
        once, twice = kernel.apply("sqrt", (x,))[0], kernel.apply("round_", (np.sqrt(x),))[0]
        assert bool(np.any(once != twice)) is found


@pytest.mark.parametrize("base", [2, 10])
def test_a_wrong_digit_is_reported(base: int, monkeypatch: pytest.MonkeyPatch) -> None:
    job = exactness.Job(base, 8, True, "add", 500, (3,))
    wrong = backend(Rules(base, 8, Rounding.CHOP))
    monkeypatch.setattr(exactness.backends, "backend", lambda *_: wrong)
    mismatches = exactness.compare(job).mismatches
    assert mismatches
    assert ("decimal" if base == 10 else "MPFR") in mismatches[0]
