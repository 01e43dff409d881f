"""Ten million cycles of a process and its integration error beside SciPy's filter, from given noise and from drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from scipy.signal import lfilter

from benchmarks.timing import Row, medians, rows
from gpbnb.report.integration import experiment, theory

COUNT = 10_000_000
CHUNK = 1 << 19  # cycles at a time, as in experiment.chunks
PROCESS = theory.first_order(1.0, 0.1)


def drawn() -> Iterator[Any]:
    """Normal numbers, a chunk at a time."""
    rng = np.random.default_rng(1)
    for first in range(0, COUNT, CHUNK):
        yield rng.standard_normal((min(CHUNK, COUNT - first), 1, 2))


def with_gpbnb(parts: Iterable[Any]) -> float:
    """The error in the end, from the compiled recursion."""
    step, state, total = theory.exact_step(PROCESS, 1.0), np.zeros(1), 0.0
    for part in parts:
        _, d = experiment.advance(step, state, part)
        total += float(d.sum())
    return total


def with_scipy(parts: Iterable[Any]) -> float:
    """The same with ``scipy.signal.lfilter`` for the process and NumPy for the rest."""
    a, b = theory.exact_step(PROCESS, 1.0)
    phi, h = float(a[0, 0]), float(a[1, 0])
    last, total = 0.0, 0.0
    for part in parts:
        first, second = part[:, 0, 0], part[:, 0, 1]
        x, _ = lfilter([1.0], [1.0, -phi], b[0, 0] * first, zi=[phi * last])
        d = b[1, 0] * first + b[1, 1] * second
        d[1:] += h * x[:-1]
        total += float(d.sum()) + h * last
        last = float(x[-1])
    return total


def measure() -> list[Row]:
    """The recursion alone from numbers at hand, and with their drawing."""
    at_hand = list(drawn())
    ours, theirs = with_gpbnb(at_hand), with_scipy(at_hand)
    # Sums of 10⁷ numbers of about one, in two orders.
    if abs(ours - theirs) > 1e-6 * max(1.0, abs(ours)):
        raise RuntimeError(f"gpbnb and scipy differ: {ours!r}, {theirs!r}")
    table = []
    for task, parts, turns in (
        ("10⁷ cycles integrated", lambda: at_hand, 7),
        ("10⁷ cycles drawn and integrated", drawn, 5),
    ):
        works = {"gpbnb": lambda p=parts: with_gpbnb(p()), "scipy lfilter": lambda p=parts: with_scipy(p())}
        table += rows(task, medians(works, turns), "gpbnb", {"scipy lfilter": 1})
    return table
