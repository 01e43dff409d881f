"""Simulate the error of digital integration, exactly in distribution at the sampling times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.report.integration import theory
from gpbnb.report.integration.theory import Cycle, Process

Floats = NDArray[np.float64]

CHUNK = 1 << 20  # normal numbers in memory at a time
BAR: dict[str, Any] = {"disable": None, "delay": 2, "leave": False}  # progress bar: on a terminal, after two seconds


# -- simulation, exact at the sampling times ------------------------------------------------------


@compiled
def _advance(a: Any, b: Any, state: Any, normal: Any, x: Any, d: Any) -> None:
    """Move all paths; x[k] and d[k] are the new sample and the error of the trapezoid that ends there."""
    phi, h, b00, b10, b11 = a[0, 0], a[1, 0], b[0, 0], b[1, 0], b[1, 1]
    cycles, paths, _ = normal.shape
    for k in range(cycles):
        for path in range(paths):
            old, first = state[path], normal[k, path, 0]
            new = phi * old + b00 * first
            d[k, path] = h * old + b10 * first + b11 * normal[k, path, 1]
            x[k, path] = new
            state[path] = new


def advance(step: Cycle, state: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Compute samples and trapezoid errors of a first-order input, cycle by cycle, from standard normal numbers."""
    x, d = np.empty(normal.shape[:2]), np.empty(normal.shape[:2])
    _advance(step.a, step.b, state, normal, x, d)
    return x, d


class Chunk(NamedTuple):
    """Some cycles of a simulation: `first` is the number of the first one.

    d (cycles, paths) holds the errors. x (cycles + 1, paths) holds the samples, from the one before the first cycle on.
    """

    first: int
    x: NDArray[np.float64]
    d: NDArray[np.float64]


def chunks(process: Process, f_c: float, cycles: int, rng: np.random.Generator, paths: int = 1) -> Iterator[Chunk]:
    """Simulate a first-order input and the error of the trapezoidal rule, exact in distribution at the sampling times.

    No step is subdivided: the sample and the integral over a cycle are drawn from their joint distribution, given the
    previous sample. The simulation starts in the steady state. Its memory is bounded for any number of cycles, and its
    numbers do not depend on the size of the chunks.
    """
    step = theory.exact_step(process, f_c)
    state = process.sigma * rng.standard_normal((paths, 1))[:, 0]
    past = state[np.newaxis].copy()
    length = max(1, CHUNK // (paths * 2))
    for first in range(1, cycles + 1, length):
        x, d = advance(step, state, rng.standard_normal((min(length, cycles + 1 - first), paths, 2)))
        x = np.concatenate([past, x])
        past = x[-1:]
        yield Chunk(first, x, d)


def simulate(process: Process, f_c: float, n: Sequence[int], rng: np.random.Generator, paths: int = 1) -> Floats:
    """Return the errors of the trapezoidal rule after increasing numbers of cycles, (len(n), paths)."""
    total, kept = np.zeros(paths), []
    bar = tqdm(total=n[-1], desc="cycles", unit_scale=True, **BAR)
    for chunk in chunks(process, f_c, n[-1], rng, paths):
        bar.update(len(chunk.d))
        begin = 0
        for k in n:
            if chunk.first <= k < chunk.first + len(chunk.d):
                end = k - chunk.first + 1
                total = total + chunk.d[begin:end].sum(axis=0)
                kept.append(total)
                begin = end
        total = total + chunk.d[begin:].sum(axis=0)
    bar.close()
    return np.array(kept)


def deviations(errors: Floats, variance: ArrayLike) -> Floats:
    r"""Return how far the mean square of errors (k, paths) is from a variance, in standard errors √(2/paths).

    The errors are normal, and their mean is known to be zero.
    """
    observed = np.mean(errors**2, axis=-1)
    return np.asarray((observed / np.asarray(variance) - 1) / math.sqrt(2 / errors.shape[-1]))


def sweep(mu: ArrayLike, cycles: int, paths: int, rng: np.random.Generator) -> Floats:
    """Simulate the trapezoidal rule at many ratios of bandwidth to iteration rate; return the errors, (k, paths)."""
    runs = [simulate(theory.first_order(1.0, one), 1.0, [cycles], rng, paths)[0] for one in np.asarray(mu).tolist()]
    return np.array(runs)
