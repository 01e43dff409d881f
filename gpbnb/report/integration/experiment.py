"""Simulate the error of digital integration, exactly in distribution at the sampling times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
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
    cycles, paths, size = normal.shape
    m = size - 1
    new = np.empty(size)
    for k in range(cycles):
        for path in range(paths):
            for i in range(size):
                total = 0.0
                for j in range(m):
                    total += a[i, j] * state[path, j]
                for j in range(i + 1):
                    total += b[i, j] * normal[k, path, j]
                new[i] = total
            for i in range(m):
                state[path, i] = new[i]
            x[k, path] = new[0]
            d[k, path] = new[m]


@compiled
def _advance_one(a: Any, b: Any, state: Any, normal: Any, x: Any, d: Any) -> None:
    """Do the same for a first-order input, with identical digits."""
    phi, h, b00, b10, b11 = a[0, 0], a[1, 0], b[0, 0], b[1, 0], b[1, 1]
    cycles, paths, _ = normal.shape
    for k in range(cycles):
        for path in range(paths):
            old, first = state[path, 0], normal[k, path, 0]
            new = phi * old + b00 * first
            d[k, path] = h * old + b10 * first + b11 * normal[k, path, 1]
            x[k, path] = new
            state[path, 0] = new


def advance(step: Cycle, state: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Compute samples and trapezoid errors, cycle by cycle, from standard normal numbers."""
    x, d = np.empty(normal.shape[:2]), np.empty(normal.shape[:2])
    (_advance_one if state.shape[1] == 1 else _advance)(step.a, step.b, state, normal, x, d)
    return x, d


class Chunk(NamedTuple):
    """Some cycles of a simulation: `first` is the number of the first one.

    d (cycles, paths) holds the errors. x (cycles + 1, paths) holds the samples, from the one before the first cycle on.
    """

    first: int
    x: NDArray[np.float64]
    d: NDArray[np.float64]


def chunks(process: Process, f_c: float, cycles: int, rng: np.random.Generator, paths: int = 1) -> Iterator[Chunk]:
    """Simulate a process and the error of the trapezoidal rule, exact in distribution at the sampling times.

    No step is subdivided: the sample and the integral over a cycle are drawn from their joint distribution, given the
    previous sample. The simulation starts in the steady state. Its memory is bounded for any number of cycles, and its
    numbers do not depend on the size of the chunks.
    """
    step = theory.exact_step(process, f_c)
    m = len(process.drift)
    state = process.sigma * rng.standard_normal((paths, m))
    past = state[np.newaxis, :, 0].copy()
    length = max(1, CHUNK // (paths * (m + 1)))
    for first in range(1, cycles + 1, length):
        x, d = advance(step, state, rng.standard_normal((min(length, cycles + 1 - first), paths, m + 1)))
        x = np.concatenate([past, x])
        past = x[-1:]
        yield Chunk(first, x, d)


@dataclass(frozen=True)
class IntegrationErrors:
    """Errors of an integrator after `n` cycles: `errors` is (len(n), paths), in the unit of the input times seconds."""

    process: Process
    f_c: float
    n: tuple[int, ...]
    errors: Floats

    @property
    def variance(self) -> Floats:
        """Mean square of the errors; their mean is known to be zero."""
        return np.asarray(np.mean(self.errors**2, axis=1))

    @property
    def relative_standard_error(self) -> float:
        r"""Relative standard error of :attr:`variance`, :math:`\sqrt{2/\mathrm{paths}}` for normal errors."""
        return math.sqrt(2 / self.errors.shape[1])

    def deviations(self, variance: ArrayLike) -> Floats:
        """Return the deviation of the observed variance from a theoretical one, in standard errors."""
        expected = np.asarray(variance, dtype=np.float64)
        return np.asarray((self.variance / expected - 1) / self.relative_standard_error)


def simulate(
    process: Process,
    f_c: float,
    n: Sequence[int],
    rng: np.random.Generator,
    paths: int = 1,
) -> IntegrationErrors:
    """Simulate the error of the trapezoidal rule, and record it after increasing numbers of cycles."""
    wanted = tuple(int(k) for k in n)
    total, kept = np.zeros(paths), []
    bar = tqdm(total=wanted[-1], desc="cycles", unit_scale=True, **BAR)
    for chunk in chunks(process, f_c, wanted[-1], rng, paths):
        bar.update(len(chunk.d))
        added = chunk.d
        last = chunk.first + len(added) - 1
        cuts = [k for k in wanted if chunk.first <= k <= last]
        begin = 0
        for k in cuts:
            end = k - chunk.first + 1
            total = total + added[begin:end].sum(axis=0)
            kept.append(total)
            begin = end
        total = total + added[begin:].sum(axis=0)
    bar.close()
    return IntegrationErrors(process, f_c, wanted, np.array(kept))


@dataclass(frozen=True)
class WalkSweep:
    r"""Simulated random walks at many :math:`\mu`: variance per cycle, divided by :math:`\sigma_x^2T^2`."""

    mu: Floats
    cycles: int
    paths: int
    walk: Floats

    @property
    def standard_error(self) -> float:
        """Relative standard error of `walk`."""
        return math.sqrt(2 / self.paths)

    def deviations(self) -> Floats:
        """Return deviations from the exact variance after the same number of cycles, in standard errors."""
        exact = np.array([float(theory.error_variance(self.cycles, mu)) for mu in self.mu.tolist()]) / self.cycles
        return np.asarray((self.walk / exact - 1) / self.standard_error)


def sweep(mu: ArrayLike, cycles: int, paths: int, rng: np.random.Generator) -> WalkSweep:
    """Simulate the random walk of the trapezoidal rule at many ratios of bandwidth to iteration rate."""
    values = np.atleast_1d(np.asarray(mu, dtype=np.float64))
    bar = tqdm(values.tolist(), desc="sweep", **BAR)
    runs = [simulate(theory.first_order(1.0, one), 1.0, [cycles], rng, paths) for one in bar]
    return WalkSweep(values, cycles, paths, np.array([run.variance[0] for run in runs]) / cycles)
