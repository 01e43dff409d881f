"""Simulate integrals that are exact at the sampling times, and run integrators in t-digit arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import add, load, multiply, round_, store
from gpbnb.arithmetic.kernels.tags import Double
from gpbnb.arithmetic.rounding import Rounding, digit_unit
from gpbnb.report.integration import theory
from gpbnb.report.integration.arguments import positive_number
from gpbnb.report.integration.theory import Cycle, Process, Rule

Floats = NDArray[np.float64]

CHUNK = 1 << 20  # normal numbers in memory at a time
BAR: dict[str, Any] = {"disable": None, "delay": 2, "leave": False}  # progress bar: on a terminal, after two seconds

# -- how exactly the closed form is evaluated -----------------------------------------------------


class Accuracy(NamedTuple):
    """Errors of an evaluation relative to a high-precision reference, in units in the last place of float64."""

    mu: NDArray[np.float64]
    ulp: NDArray[np.float64]


def _exact(name: str, mu: float) -> Any:
    """Evaluate (35), or a coefficient of the discretization, with enough digits to survive cancellation."""
    with mpmath.workdps(60 + 3 * max(0, math.ceil(-math.log10(mu)))):
        m = mpmath.mpf(mu)
        phi = mpmath.exp(-m)
        walk = (1 + phi) / (1 - phi) - 2 / m
        return {
            "walk": lambda: walk,
            "phi11": lambda: phi,
            "phi21": lambda: (1 - phi) / m,
            "q11": lambda: 1 - phi**2,
            "q12": lambda: (1 - phi) ** 2 / m,
            "q22": lambda: (2 * m - 3 + 4 * phi - phi**2) / m**2,
            "bridge": lambda: walk * mpmath.tanh(m / 2) / (m / 2),
        }[name]()


def accuracy(name: str, mu: ArrayLike, printed: bool = False) -> Accuracy:
    """Compare an evaluation with mpmath.

    Parameters
    ----------
    name : "walk" for (35), or a field of ``Discretization``.
    mu : (k,), positive. Numbers of BINARY64 are evaluated with every operation correctly rounded, for "walk", so that
        the errors are the same on every processor; NumPy's exponential function is not.
    printed : evaluate the form that cancels instead of the stable one; for "walk" and "q22".
    """
    if name != "walk" and name not in theory.Discretization._fields:
        raise ValueError(f"got name {name!r}; needed 'walk' or one of {', '.join(theory.Discretization._fields)}")
    if printed and name not in ("walk", "q22"):
        raise ValueError(f"got name {name!r} as printed; needed 'walk' or 'q22'")
    values = np.atleast_1d(np.asarray(mu, dtype=np.float64))
    if name == "walk":
        given = mu if isinstance(mu, FloatArray) else values
        found = np.asarray((theory.printed_walk_factor if printed else theory.walk_factor)(given), np.float64)
    else:
        found = theory.printed_discretization_q22(values) if printed else getattr(theory.discretize(values), name)
    errors = []
    for one, value in zip(values.tolist(), found.tolist(), strict=True):
        exact = _exact(name, one)
        size = abs(float(exact))
        away = abs(mpmath.mpf(value) - exact) if math.isfinite(value) else mpmath.inf
        errors.append(float(away / mpmath.mpf(float(np.spacing(max(size, np.finfo(float).tiny))))))
    return Accuracy(values, np.array(errors))


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
    """Compute samples and trapezoid errors, cycle by cycle, from standard normal numbers.

    Parameters
    ----------
    step : from ``exact_step``.
    state : (paths, m), at the start; overwritten with the state at the end.
    normal : (cycles, paths, m + 1), standard normal numbers.

    Returns
    -------
    x, d : (cycles, paths) each.
    """
    x, d = np.empty(normal.shape[:2]), np.empty(normal.shape[:2])
    (_advance_one if state.shape[1] == 1 else _advance)(step.a, step.b, state, normal, x, d)
    return x, d


class Chunk(NamedTuple):
    """Some cycles of a simulation: `first` is the number of the first one, x and d are (cycles, paths).

    x begins `memory` samples before those of d, so that ``x[memory + k]`` is the sample at the end of cycle
    ``first + k``.
    """

    first: int
    x: NDArray[np.float64]
    d: NDArray[np.float64]


def chunks(
    process: Process, f_c: float, cycles: int, rng: np.random.Generator, paths: int = 1, memory: int = 1
) -> Iterator[Chunk]:
    """Simulate a process and the error of the trapezoidal rule, exact in distribution at the sampling times.

    No step is subdivided: the sample and the integral over a cycle are drawn from their joint distribution, given the
    previous sample. The simulation starts in the steady state. Its memory is bounded for any number of cycles, and its
    numbers do not depend on the size of the chunks.

    Parameters
    ----------
    f_c : iteration rate, Hz.
    memory : samples before the first of a chunk that come with it.

    Yields
    ------
    chunk : the cycles 1, 2, … in order.
    """
    if min(cycles, paths, memory) < 1:
        raise ValueError(f"got {cycles} cycles, {paths} paths, a memory of {memory}; needed at least 1 of each")
    step = theory.exact_step(process, f_c)
    m = len(process.drift)
    state = process.sigma * rng.standard_normal((paths, m))
    before = [state[:, 0].copy()]
    for _ in range(memory - 1):
        x, _ = advance(step, state, rng.standard_normal((1, paths, m + 1)))
        before.append(x[0])
    past = np.array(before)
    length = max(1, CHUNK // (paths * (m + 1)))
    for first in range(1, cycles + 1, length):
        x, d = advance(step, state, rng.standard_normal((min(length, cycles + 1 - first), paths, m + 1)))
        x = np.concatenate([past, x])
        past = x[-memory:]
        yield Chunk(first, x, d)


def rule_errors(rule: Rule, f_c: float, chunk: Chunk) -> Floats:
    """Return the error (cycles, paths) that each cycle of a chunk adds if a rule integrates it."""
    memory, cycles = len(chunk.x) - len(chunk.d), len(chunk.d)
    if memory < rule.memory:
        raise ValueError(f"got a memory of {memory} samples; needed {rule.memory} for the rule {rule.name!r}")
    added = chunk.d.copy()
    period = 1 / f_c
    for r, weights in enumerate(rule.weights):
        rows = np.arange((r + 1 - chunk.first) % rule.period, cycles, rule.period)
        for j in range(max(2, len(weights))):
            w = (float(weights[j]) if j < len(weights) else 0.0) - (0.5 if j < 2 else 0.0)
            if w:
                added[rows] += period * w * chunk.x[memory + rows - j]
    return added


@dataclass(frozen=True)
class IntegrationErrors:
    """Errors of an integrator after `n` cycles: `errors` is (len(n), paths), in the unit of the input times seconds."""

    process: Process
    f_c: float
    rule: Rule
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
    rule: Rule = theory.RULES["trapezoidal"],
) -> IntegrationErrors:
    """Simulate the error of an integrator, and record it after the given numbers of cycles.

    Parameters
    ----------
    n : increasing numbers of cycles, at least 1. Use multiples of the period of the rule; samples of an unfinished
        period count as error.
    """
    wanted = tuple(int(k) for k in n)
    if not wanted or wanted[0] < 1 or list(wanted) != sorted(set(wanted)):
        raise ValueError(f"got n = {tuple(n)}; needed increasing numbers of cycles, at least 1")
    total, kept = np.zeros(paths), []
    bar = tqdm(total=wanted[-1], desc="cycles", unit_scale=True, **BAR)
    for chunk in chunks(process, f_c, wanted[-1], rng, paths, rule.memory):
        bar.update(len(chunk.d))
        added = chunk.d if rule.name == "trapezoidal" else rule_errors(rule, f_c, chunk)
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
    return IntegrationErrors(process, f_c, rule, wanted, np.array(kept))


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
    """Simulate the random walk of the trapezoidal rule at many ratios of bandwidth to iteration rate.

    Parameters
    ----------
    cycles : number in each run; the variance per cycle is below its steady value by a fraction of at most 1/(2 cycles).
    paths : number of independent runs; the relative standard error of a variance is √(2/paths).
    """
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
    """Run the trapezoidal rule (2) in a format, chunk by chunk.

    Parameters
    ----------
    fmt : format with compiled loops: base 2, 10 or 16.
    period : T, s; T/2 is rounded to the format.
    paths : number of integrals that run in parallel.
    """

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

    Parameters
    ----------
    duration : s; rounded to whole cycles.
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


@dataclass(frozen=True)
class RateSweep:
    """Both observed errors against the iteration rate in several formats, (formats, rates)."""

    omega_bw: float
    duration: float
    paths: int
    formats: tuple[FloatFormat, ...]
    rates: Floats
    discretization: Floats
    rounding: Floats
    total: Floats

    @property
    def standard_error(self) -> float:
        r"""Relative standard error of the rms of a rounding error over the paths.

        For a given path the error is normal, with a variance V proportional to :math:`\int x_3^2dt`. For a random walk,
        :math:`E(V^2) = \frac73E(V)^2`, so the mean square has the relative variance
        :math:`(3\cdot\frac73-1)/\mathrm{paths}`.
        """
        return math.sqrt(6 / self.paths) / 2

    def theory(self, fmt: FloatFormat, rates: Floats) -> Floats:
        """Return the theoretical discretization, rounding and total errors, (3, rates)."""
        found = [theory.two_errors(1.0, self.omega_bw, f, self.duration, fmt) for f in rates.tolist()]
        return np.array([(e.discretization, e.rounding, e.total) for e in found]).T

    def ratios(self) -> Floats:
        """Return observed / theoretical rounding error, (formats, rates)."""
        expected = np.array([self.theory(fmt, self.rates)[1] for fmt in self.formats])
        return np.asarray(self.rounding / expected)


def sweep_rates(
    omega_bw: float,
    duration: float,
    formats: Sequence[FloatFormat],
    rates: Sequence[float],
    rng: np.random.Generator,
    paths: int = 64,
) -> RateSweep:
    """Emulate an integrator at several rates in several formats; rates are powers of two, so that T/2 is exact."""
    bar = tqdm(rates, desc="rates", **BAR)
    runs = [emulate(omega_bw, f_c, duration, formats, rng, paths) for f_c in bar]
    table = np.array([[(*run.rms, run.rms_total) for run in at_rate] for at_rate in runs]).transpose(2, 1, 0)
    return RateSweep(omega_bw, duration, paths, tuple(formats), np.array(rates, dtype=np.float64), *table)


#: The formats of the chapter's figure.
FORMATS = (FloatFormat(2, 11), FloatFormat(2, 16), FloatFormat(2, 16, Rounding.CHOP), FloatFormat(2, 24))
