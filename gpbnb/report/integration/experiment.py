"""Simulate integrals that are exact at the sampling times, and run integrators in t-digit arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import add, load, multiply, round_, store
from gpbnb.arithmetic.kernels.tags import Double
from gpbnb.arithmetic.rounding import digit_unit
from gpbnb.report.integration import theory
from gpbnb.report.integration.arguments import positive_number
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

    def deviations_from(self, factor: Floats) -> Floats:
        """Return deviations from another formula for the variance per cycle, in standard errors."""
        return np.asarray((self.walk / factor - 1) / self.standard_error)


def sweep(mu: ArrayLike, cycles: int, paths: int, rng: np.random.Generator) -> WalkSweep:
    """Simulate the random walk of the trapezoidal rule at many ratios of bandwidth to iteration rate."""
    values = np.atleast_1d(np.asarray(mu, dtype=np.float64))
    bar = tqdm(values.tolist(), desc="sweep", **BAR)
    runs = [simulate(theory.first_order(1.0, one), 1.0, [cycles], rng, paths) for one in bar]
    return WalkSweep(values, cycles, paths, np.array([run.variance[0] for run in runs]) / cycles)


# -- the integrator in t-digit arithmetic ---------------------------------------------------------


@compiled
def _integrate(fmt: Any, half: Any, x: Any, total: Any) -> None:
    """Apply (2) to each path: add T/2 times the sum of two samples to the accumulator, with every operation rounded.

    x is (samples, paths) in the format, its first row the sample before; `half` and `total` are (1,) and (paths,).
    """
    factor = load(fmt, half, 0)
    for path in range(x.shape[1]):
        s = load(fmt, total, path)
        old = load(fmt, x, (0, path))
        for k in range(1, x.shape[0]):
            new = load(fmt, x, (k, path))
            s = add(fmt, s, multiply(fmt, factor, add(fmt, new, old)))
            old = new
        store(fmt, total, path, s)


@compiled
def _integrate_rounding(fmt: Any, half: Any, x: Any, total: Any) -> None:
    """Do the same for float64 samples, each of which is rounded first."""
    factor = load(fmt, half, 0)
    for path in range(x.shape[1]):
        s = load(fmt, total, path)
        old = round_(fmt, x[0, path])
        for k in range(1, x.shape[0]):
            new = round_(fmt, x[k, path])
            s = add(fmt, s, multiply(fmt, factor, add(fmt, new, old)))
            old = new
        store(fmt, total, path, s)


class Integrator:
    """Run the trapezoidal rule (2) in a format, chunk by chunk."""

    def __init__(self, fmt: FloatFormat, period: float, paths: int) -> None:
        backend = fmt.backend
        if not isinstance(backend, Compiled):
            raise ValueError(f"got {fmt}; needed base 2 to 53 bits, base 10 to 18 digits, or base 16 to 13 digits")
        self.fmt, self.backend = fmt, backend
        self._half = backend.pack(fmt.array([period / 2]).components)
        self._total = backend.pack(fmt.array(np.zeros(paths)).components)

    def feed(self, x: Floats) -> None:
        """Continue with the samples x, (samples, paths); the first row repeats the last row of the previous chunk."""
        if self.fmt.base == 10:
            packed = self.backend.pack(self.fmt.array(x).components)
            _integrate(self.backend.tag, self._half, packed, self._total)
        else:
            _integrate_rounding(self.backend.tag, self._half, x, self._total)

    @property
    def value(self) -> Floats:
        """Current integrals (paths,), rounded to float64."""
        return self.backend.to_float(self.backend.unpack(self._total))


@dataclass(frozen=True)
class Emulation:
    """Errors (paths,) of integrals computed in a format, in the unit of the input times seconds."""

    fmt: FloatFormat
    omega_bw: float
    f_c: float
    duration: float
    discretization: Floats
    rounding: Floats

    @property
    def rms(self) -> theory.Errors:
        """Root mean square of each of the two errors."""
        return theory.Errors(*(math.sqrt(float(np.mean(e**2))) for e in (self.discretization, self.rounding)))

    @property
    def rms_total(self) -> float:
        """Root mean square of the total error."""
        return math.sqrt(float(np.mean((self.discretization + self.rounding) ** 2)))


def emulate(
    omega_bw: float,
    f_c: float,
    duration: float,
    formats: Sequence[FloatFormat],
    rng: np.random.Generator,
    paths: int = 64,
    sigma_x: float = 1.0,
) -> tuple[Emulation, ...]:
    """Run the integrator in several formats on the same samples, and compare with float64 and the exact integral.

    The rounding error is the difference from the same rule in float64 with unrounded samples. The rounding error of
    float64 itself is neglected, so formats may have at most 40 bits or 12 decimal digits.
    """
    for fmt in formats:
        if fmt.precision * math.log2(fmt.base) > 40:
            raise ValueError(
                f"got {fmt}; needed at most 40 bits, or float64 is no reference; use fewer {digit_unit(fmt.base)}"
            )
    process = theory.first_order(sigma_x, omega_bw)
    cycles = round(positive_number("duration", duration) * positive_number("f_c", f_c))
    running = [Integrator(fmt, 1 / f_c, paths) for fmt in formats]
    error, reference, half = np.zeros(paths), np.zeros(paths), np.array([0.5 / f_c])
    for chunk in chunks(process, f_c, cycles, rng, paths):
        error = error + chunk.d.sum(axis=0)
        _integrate_rounding(Double(), half, chunk.x, reference)
        for one in running:
            one.feed(chunk.x)
    return tuple(
        Emulation(one.fmt, omega_bw, f_c, duration, error, np.asarray(one.value - reference)) for one in running
    )
