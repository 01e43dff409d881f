"""What does happen: records of 1/f noise rolled and derolled, an uneven roll rate, and rotations in t digits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from scipy import signal
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import LARGEST_PRECISION, Compiled
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import add, load, multiply, store, subtract
from gpbnb.measurement import YEAR
from gpbnb.rolling import theory
from gpbnb.rolling.flicker import flicker, record
from gpbnb.rolling.theory import INTERVAL, LEVEL, PERIOD, PERIOD_FLOWN
from gpbnb.sweeps import Column, read

YEAR_SAMPLES = round(YEAR / INTERVAL)


def _samples(duration: float, interval: float) -> int:
    if not (0 < interval < math.inf and 0 < duration < math.inf):
        raise ValueError(f"got {duration} s with a sample every {interval} s; needed two finite positive numbers")
    n = round(duration / interval)
    if n < 2:
        raise ValueError(f"got {duration:g} s with a sample every {interval:g} s; needed at least 2 samples")
    return n


# -- spectra -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Spectrum:
    """One-sided density, mas²/Hz, averaged in bands: `averages` is the number of independent values in each."""

    frequency: NDArray[np.float64]
    density: NDArray[np.float64]
    averages: NDArray[np.float64]

    @property
    def error(self) -> NDArray[np.float64]:
        """Relative standard error of the density, a mean of so many values that are chi-square of two degrees."""
        return 1 / np.sqrt(self.averages)


def in_bands(frequency: Any, density: Any, averages: float, first: float, last: float, bands: int) -> Spectrum:
    """Average a density over bands of equal logarithmic width; bands without a frequency are left out."""
    edges = np.geomspace(first, last, bands + 1)
    place = np.digitize(frequency, edges) - 1
    counts = np.array([np.count_nonzero(place == i) for i in range(bands)])
    full = np.flatnonzero(counts)
    middle = np.array([math.exp(np.mean(np.log(frequency[place == i]))) for i in full])
    # Of f times the density, so that 1/f noise has no bias within a band.
    mean = np.array([np.mean((frequency * density)[place == i]) for i in full]) / middle
    return Spectrum(middle, mean, averages * counts[full])


def welch(records: NDArray[np.float64], interval: float, segment: int) -> tuple[Any, Any, float]:
    """Welch's estimate, Hann windows overlapping by half, of records (samples, channels).

    Returns
    -------
    frequency, density : without that of frequency zero, and of the two next to it, into which the mean leaks.
    averages : number of independent periodograms that it is worth.
    """
    f, p = signal.welch(records, 1 / interval, "hann", segment, axis=0)
    count = 2 * (len(records) // segment) - 1
    # Overlapping by half, Hann-windowed segments have a correlation of their periodograms of 1/36 (Welch 1967); and
    # neighbouring frequencies are correlated too: a sum over a band is worth 18/35 of its number (see below).
    worth = count / (1 + 2 * (count - 1) / count / 36)
    return f[3:], np.mean(p[3:], axis=1), worth * records.shape[1] * HANN


HANN = 18 / 35
r"""Independent values in a band of a Hann-windowed periodogram, a frequency, :math:`1/(1 + 2(4/9) + 2/36)`."""


@dataclass(frozen=True)
class Slope:
    """Exponent of a power law fitted to a density, and its standard error."""

    value: float
    error: float
    decades: float


def fit_slope(spectrum: Spectrum, interval: float = INTERVAL) -> Slope:
    """Fit a line to log density against log frequency, each band with its weight; sampling is accounted for."""
    x = np.log10(spectrum.frequency)
    # The logarithm of a mean of m values is low by 1/(2m); samples have a density higher by x/sin x, x = πfΔt.
    y = np.log10(spectrum.density * np.sinc(spectrum.frequency * interval)) + np.log10(np.e) / (2 * spectrum.averages)
    w = spectrum.averages
    x = x - np.sum(w * x) / np.sum(w)
    square = np.sum(w * x**2)
    return Slope(float(np.sum(w * x * y) / square), 1 / math.log(10) / math.sqrt(square), float(np.ptp(x)))


def noise_spectrum(
    rng: np.random.Generator,
    samples: int = 2**21,
    channels: int = 4,
    segment: int = 2**19,
    interval: float = INTERVAL,
    bands: int = 24,
) -> Spectrum:
    """Density of the generated noise by Welch's method, in bands from 4 cycles a segment to f = 0.12/Δt."""
    records = record(LEVEL, samples, channels, rng)
    f, p, averages = welch(records, interval, segment)
    return in_bands(f, p, averages, 4 / (segment * interval), 0.12 / interval, bands)


@dataclass(frozen=True)
class Spectra:
    """One-sided densities, mas²/Hz, of a year of a drift and of the noise, before rolling, rolled, and derolled.

    `ramp`, `noise` and `derolled` (noise) are averages in bands. `offset` is in cycles a record, as distance from the
    roll frequency of one readout (`line_signal`, `line_noise`), or as frequency of a derolled component
    (`base_signal`, `base_noise`, from one cycle on).
    """

    drift: float
    level: float
    period: float
    duration: float
    interval: float
    ramp: Spectrum
    noise: Spectrum
    derolled: Spectrum
    offset: NDArray[np.int64]
    line_signal: NDArray[np.float64]
    line_noise: NDArray[np.float64]
    base_signal: NDArray[np.float64]
    base_noise: NDArray[np.float64]


def periodogram(x: NDArray[np.float64], interval: float) -> NDArray[np.float64]:
    """One-sided density of a whole record without a window, from one cycle a record on; the record is real."""
    return np.asarray(2 * np.abs(np.fft.rfft(x)[1:]) ** 2 * interval / len(x))


def spectra(
    drift: float,
    rng: np.random.Generator,
    gyros: int = 4,
    level: float = LEVEL,
    period: float = PERIOD,
    samples: int = YEAR_SAMPLES,
    interval: float = INTERVAL,
    offsets: int = 25,
    bands: int = 40,
) -> Spectra:
    """Simulate what Figures III-1 and III-3 sketch: a drift along x, and noise of gyros with two readouts each.

    The record is a whole number of turns.
    """
    duration = samples * interval
    turns = round(duration / period)
    if abs(turns * period - duration) > 1e-9 * duration or turns <= offsets:
        raise ValueError(f"got {duration / period:g} turns; needed a whole number above {offsets}")
    offset = np.concatenate([np.arange(-offsets, 0), np.arange(1, offsets + 1)])
    near, base = turns + offset - 1, np.arange(offsets)
    frequency = np.arange(1, samples // 2 + 1) / duration

    def banded(density: NDArray[np.float64], averages: int) -> Spectrum:
        return in_bands(frequency, density, averages, 0.99 / duration, 0.5 / interval, bands)

    before, after = np.zeros((2, samples // 2))
    for child in rng.spawn(gyros):
        stages = derolled_record((0.0, 0.0), level, period, child, samples, interval)
        before += (periodogram(stages["noise"].real, interval) + periodogram(stages["noise"].imag, interval)) / 2
        after += (periodogram(stages["derolled"].real, interval) + periodogram(stages["derolled"].imag, interval)) / 2
    clean = derolled_record((drift, 0.0), 0.0, period, rng, samples, interval)
    ramp, rolled = (periodogram(clean[name].real, interval) for name in ("signal", "measured"))
    back = periodogram(clean["derolled"].real, interval)
    return Spectra(
        drift,
        level,
        period,
        duration,
        interval,
        banded(ramp, 1),
        banded(before / gyros, 2 * gyros),
        banded(after / gyros, 2 * gyros),
        offset,
        rolled[near],
        before[near] / gyros,
        back[base],
        after[base] / gyros,
    )


def derolled_record(
    drift: tuple[float, float],
    level: float,
    period: float,
    rng: np.random.Generator,
    samples: int = YEAR_SAMPLES,
    interval: float = INTERVAL,
    phase_error: Callable[[Any], Any] | None = None,
) -> dict[str, NDArray[np.complex128]]:
    """One gyro with two readouts through (5)-(7), x and y as real and imaginary part.

    Parameters
    ----------
    drift : of x and y, mas a year.
    level : of the noise of each readout, mas²; 0 for none.
    period, interval : of roll and between samples, s.
    phase_error : by how much the deroll is ahead, rad, a function of times (n,) in s; None for not.

    Returns
    -------
    stages : "signal", "rolled", "noise", "measured" and "derolled", each (samples,) complex, in mas.
    """
    if not all(map(math.isfinite, drift)):
        raise ValueError(f"got drifts {drift}; needed finite numbers, in mas a year")
    n = np.arange(samples)
    ramp = np.asarray(complex(*drift) * (n * interval / YEAR))
    pair = record(level, samples, 2, rng)
    noise = pair[:, 0] + 1j * pair[:, 1]
    turn = np.exp(1j * theory.roll_phase(n, period, interval))
    rolled = ramp * np.conj(turn)
    if phase_error is not None:
        turn = turn * np.exp(1j * np.asarray(phase_error(n * interval)))
    measured = rolled + noise
    return {"signal": ramp, "rolled": rolled, "noise": noise, "measured": measured, "derolled": measured * turn}


def fit_drift(derolled: NDArray[np.complex128], interval: float = INTERVAL) -> NDArray[np.float64]:
    """Drifts (2,) of x and y, mas a year, of straight lines fitted to a derolled record by least squares."""
    weights = theory.slope_weights(len(derolled), interval)
    return np.array([float(np.sum(weights * part)) * YEAR for part in (derolled.real, derolled.imag)])


def clean_drift_error(
    drift: tuple[float, float],
    phase_error: Callable[[Any], Any],
    period: float = PERIOD,
    duration: float = YEAR,
    interval: float = 100.0,
) -> NDArray[np.float64]:
    """Errors (2,) of both drifts, mas a year, of a record without noise that is derolled with a phase error."""
    stages = derolled_record(
        drift, 0.0, period, np.random.default_rng(0), _samples(duration, interval), interval, phase_error
    )
    return fit_drift(stages["derolled"], interval) - np.array(drift)


# -- drift rates ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class DriftStudy:
    """Errors of fitted drift rates, mas a year: (periods, gyros, 2), of x and y; a period of None is without roll."""

    periods: tuple[float | None, ...]
    level: float
    samples: int
    interval: float
    errors: NDArray[np.float64]

    def standard_error(self) -> NDArray[np.float64]:
        """Root mean square of the errors, for each period; the estimates have no bias."""
        return np.sqrt(np.mean(self.errors**2, axis=(1, 2)))

    def uncertainty(self) -> float:
        """Relative standard error of :meth:`standard_error`, from the number of errors."""
        return 1 / math.sqrt(2 * self.errors[0].size)


@compiled
def _add_sums(first, noise, cosines, sines, slope, kx, ky, sums):  # type: ignore[no-untyped-def]
    # One pass: signal rolled, noise added, derolled, and summed with the times, which are centred and scaled.
    for p in range(cosines.shape[0]):
        for i in range(noise.shape[0]):
            t = slope * (first + i) - 1.0
            c, s = cosines[p, i], sines[p, i]
            x, y = kx * t, ky * t
            for g in range(noise.shape[1] // 2):
                m1 = c * x + s * y + noise[i, 2 * g]
                m2 = -s * x + c * y + noise[i, 2 * g + 1]
                sums[p, g, 0] += t * (c * m1 - s * m2)
                sums[p, g, 1] += t * (s * m1 + c * m2)


def drift_rates(
    periods: Sequence[float | None],
    gyros: int,
    rng: np.random.Generator,
    level: float = LEVEL,
    duration: float = YEAR,
    interval: float = INTERVAL,
    drift: tuple[float, float] = theory.DRIFTS,
    progress: bool = False,
) -> DriftStudy:
    """Roll, measure, deroll and fit both drifts of gyros with two readouts each, in blocks: in bounded memory.

    The same noise serves each period.

    Parameters
    ----------
    periods : of roll, s; None for no rolling.
    gyros : number of them; gyro i has the same noise whatever the number.
    rng : source of the noise.
    level : of the noise of each readout, mas².
    duration, interval : of the record and between samples, s.
    drift : of x and y, mas a year.
    progress : show a bar.
    """
    n = _samples(duration, interval)
    if gyros < 1 or not periods:
        raise ValueError(f"got {gyros} gyros and {len(periods)} roll periods; needed at least 1 of each")
    for period in periods:
        if period is not None and not 0 < period < math.inf:
            raise ValueError(f"got a roll period of {period} s; needed more than 0, or None for no rolling")
    if not all(map(math.isfinite, drift)):
        raise ValueError(f"got drifts {drift}; needed finite numbers, in mas a year")
    sums = np.zeros((len(periods), gyros, 2))
    slope = 2 / (n - 1)  # times run from -1 to 1
    half = (n - 1) * interval / YEAR / 2  # of the record, in years
    first = 0
    block = max(1, 2**18 // gyros)
    blocks = flicker(level, n, 2 * gyros, rng, block)
    for noise in tqdm(blocks, total=-(-n // block), desc=f"{gyros} gyros", ncols=80, disable=not progress):
        index = np.arange(first, first + len(noise))
        phases = [np.zeros(len(noise)) if p is None else theory.roll_phase(index, p, interval) for p in periods]
        _add_sums(first, noise, np.cos(phases), np.sin(phases), slope, drift[0] * half, drift[1] * half, sums)
        first += len(noise)
    squares = n * (n + 1) / (3 * (n - 1))  # sum of squares of the times
    rates = sums / squares / half
    return DriftStudy(tuple(periods), level, n, interval, rates - np.array(drift))


SURVEY = Path(__file__).with_name("drift_rates.csv")
"""Errors of drift rates of `SURVEY_GYROS` gyros, a year each; ``python -m gpbnb.rolling`` writes it again."""

SURVEY_PERIODS = (None, 6000.0, 600.0, 200.0, 77.5)
SURVEY_GYROS = 128


def survey_rng() -> np.random.Generator:
    """The generator of the survey, as at its beginning."""
    return np.random.default_rng(1984)


#: Columns of the stored survey: errors of the drift rates of x and y, mas/yr, for each roll period.
SURVEY_COLUMNS = (
    Column("gyro", "integer", 0, SURVEY_GYROS - 1),
    *(
        Column(f"{'none' if period is None else format(period, 'g')} s {xy}", low=-1000, high=1000)
        for period in SURVEY_PERIODS
        for xy in "xy"
    ),
)


def survey() -> DriftStudy:
    """Read the stored survey."""
    rows = read(SURVEY, SURVEY_COLUMNS, "python -m gpbnb.rolling").rows
    table = np.array([row[1:] for row in rows], dtype=np.float64)
    errors = table.reshape(len(table), len(SURVEY_PERIODS), 2).transpose(1, 0, 2)
    return DriftStudy(SURVEY_PERIODS, LEVEL, YEAR_SAMPLES, INTERVAL, errors)


def survey_rows(study: DriftStudy) -> list[tuple[str, ...]]:
    """A study as rows of the stored file, one for each gyro, with six digits."""
    table = study.errors.transpose(1, 0, 2).reshape(study.errors.shape[1], -1)
    return [(str(gyro), *(f"{value:.5e}" for value in row)) for gyro, row in enumerate(table)]


# -- filters -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FilterStudy:
    """Mean square errors, mas², behind low-pass filters: (filters, records), after their start.

    `lag` and `bandwidth` are those of the filters, `error` is the mean over the records.
    """

    drift: float
    period: float
    names: tuple[str, ...]
    lag: NDArray[np.float64]
    bandwidth: NDArray[np.float64]
    squares: NDArray[np.float64]

    @property
    def error(self) -> NDArray[np.float64]:
        """Mean square error of each filter."""
        return np.mean(self.squares, axis=1)

    @property
    def uncertainty(self) -> NDArray[np.float64]:
        """Standard error of the mean square errors, from their spread over the records."""
        return np.std(self.squares, axis=1, ddof=1) / math.sqrt(self.squares.shape[1])


def filter_study(
    drift: float,
    bandwidths: Sequence[float],
    gyros: int,
    rng: np.random.Generator,
    period: float = PERIOD_FLOWN,
    level: float = LEVEL,
    duration: float = YEAR,
    interval: float = INTERVAL,
) -> FilterStudy:
    """Measure the error of a drift behind a single pole and a moving average of each noise bandwidth, in Hz.

    Both components of each gyro, rolled and derolled, are a record. Averages are taken from ten time constants on.
    """
    n = _samples(duration, interval)
    names = [*("single pole" for _ in bandwidths), *("moving average" for _ in bandwidths)]
    if not len(bandwidths) or not min(bandwidths) > 0:
        raise ValueError(f"got bandwidths {tuple(bandwidths)} Hz; needed at least one, and each above 0")
    longest = 10 / (4 * min(bandwidths))
    if longest > duration / 2:
        raise ValueError(
            f"got bandwidths {tuple(bandwidths)} Hz for {duration:g} s; needed each above {5 / duration:.3g} Hz; take "
            "a longer record"
        )
    skip = math.ceil(longest / interval)
    squares = np.zeros((len(names), 2 * gyros))
    filters = [theory.single_pole(1 / (4 * b), interval) for b in bandwidths]
    filters += [theory.moving_average(1 / (2 * b), interval) for b in bandwidths]
    for g, child in enumerate(rng.spawn(gyros)):
        stages = derolled_record((drift, drift), level, period, child, n, interval)
        for c, part in enumerate((np.real, np.imag)):
            derolled, truth = part(stages["derolled"]), part(stages["signal"])
            for i, weights in enumerate(filters):
                if names[i] == "single pole":
                    out = signal.lfilter([weights[0]], [1, weights[0] - 1], derolled)
                else:
                    total = np.concatenate([np.zeros(len(weights)), np.cumsum(derolled)])
                    out = (total[len(weights) :] - total[: -len(weights)]) / len(weights)
                squares[i, 2 * g + c] = np.mean((out - truth)[skip:] ** 2)
    lag = np.array([theory.filter_lag(weights, interval) for weights in filters])
    width = np.array([theory.noise_bandwidth(weights, interval) for weights in filters])
    return FilterStudy(drift, period, tuple(names), lag, width, squares)


def image_behind(
    weights: NDArray[np.float64], drift: float, period: float, samples: int, interval: float = INTERVAL
) -> NDArray[np.float64]:
    """The double-frequency term that a filter leaves of a ramp that is rolled and derolled in one dimension, mas.

    Twice the derolled signal, so that its strength is one, is filtered; what the ramp itself gives behind the filter
    is taken off. The last turn is returned.
    """
    n = np.arange(samples)
    ramp = drift / YEAR * interval * n
    phase = theory.roll_phase(n, period, interval)
    image = 2 * ramp * np.cos(phase) * np.cos(phase) - ramp
    turn = max(1, round(period / interval))
    if samples < len(weights) + turn:
        raise ValueError(f"got {samples} samples for a filter of {len(weights)}; needed {turn} more than the filter")
    return np.asarray(signal.fftconvolve(image[-len(weights) - turn :], weights, mode="valid")[-turn:])


# -- an uneven roll rate -------------------------------------------------------------------------


def roll_rate_errors(
    drift: float,
    rates: Iterator[NDArray[np.float64]],
    step: float,
    resets: Sequence[int | None],
) -> NDArray[np.float64]:
    """Drift rates across a drift, fitted to a ramp that is derolled at the nominal rate, mas a year.

    Parameters
    ----------
    drift : k, mas a year.
    rates : departures (n,) of the roll rate from the nominal one, rad/s, one array a trial.
    step : s between two rates; each is kept for one step.
    resets : steps between resets of the phase by the star sensor; None for never.

    Returns
    -------
    errors : (resets, trials).
    """
    errors = []
    for rate in rates:
        n = len(rate)
        weights = theory.slope_weights(n, step)
        begin = np.concatenate([[0.0], np.cumsum(rate)[:-1]]) * step
        middle = begin + rate * (step / 2)
        ramp = drift * step * (np.arange(n) + 0.5)
        line = []
        for reset in resets:
            # At a reset the phase is again that of the spacecraft.
            wrong = middle if reset is None else middle - np.repeat(begin[::reset], reset)[:n]
            line.append(float(np.sum(weights * ramp * np.sin(-wrong))))
        errors.append(line)
    return np.array(errors).T


def rate_walks(
    intensity: float, trials: int, steps: int, step: float, rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Roll rates that are random walks from zero, of variance `intensity` (rad²/s³) times the time."""
    for _ in range(trials):
        yield np.cumsum(rng.standard_normal(steps)) * math.sqrt(intensity * step)


def rate_sines(
    amplitude: float, period: float, trials: int, steps: int, step: float, rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Roll rates that are sinusoids of random phase: amplitude in rad/s, period in s."""
    t = np.arange(steps) * step
    for _ in range(trials):
        yield amplitude * np.cos(2 * np.pi * (t / period + rng.random()))


# -- rotations in t digits -----------------------------------------------------------------------


def rounded_rate_error(period: float, fmt: FloatFormat) -> float:
    """What the register of a format does to ω_r = 2π/T: the rounded less the true, rad/s."""
    rate = theory.roll_rate(period)
    return float(fmt.round(rate) - rate)


@dataclass(frozen=True)
class Rotation:
    """A rotation (cos nδ, sin nδ) computed in a format: relative amplitude and phase errors, and size of both.

    `method` is "recursion" or "direct", `step` the samples n looked at, `bound` that of the size.
    """

    fmt: FloatFormat
    period: float
    interval: float
    method: str
    step: NDArray[np.int64]
    amplitude: NDArray[np.float64]
    phase: NDArray[np.float64]
    size: NDArray[np.float64]
    bound: NDArray[np.float64]

    def drift_error(self, drift: float) -> float:
        """Largest error in mas of a ramp of `drift` mas a year, derolled with this rotation."""
        return float(np.max(self.size * self.step * (drift * self.interval / YEAR)))


@compiled
def _rotate(fmt, step, state, marks, out):  # type: ignore[no-untyped-def]
    a, b = load(fmt, step, 0), load(fmt, step, 1)
    c, s = load(fmt, state, 0), load(fmt, state, 1)
    n = 0
    for k in range(len(marks)):
        for _ in range(marks[k] - n):
            c, s = (
                subtract(fmt, multiply(fmt, c, a), multiply(fmt, s, b)),
                add(fmt, multiply(fmt, s, a), multiply(fmt, c, b)),
            )
        n = marks[k]
        store(fmt, out, (k, 0), c)
        store(fmt, out, (k, 1), s)


def _exact_turn(n: int, period: float, interval: float) -> tuple[Fraction, Fraction]:
    """Cosine and sine of n steps, to 60 digits."""
    turns = n * Fraction(interval) / Fraction(period) % 1
    with mpmath.workdps(60):
        angle = 2 * mpmath.mpf(turns.numerator) / turns.denominator
        return _fraction(mpmath.cospi(angle)), _fraction(mpmath.sinpi(angle))


def _fraction(x: Any) -> Fraction:
    sign, mantissa, exponent, _ = x._mpf_
    return Fraction(-int(mantissa) if sign else int(mantissa)) * Fraction(2) ** exponent


def _compared(
    fmt: FloatFormat, period: float, interval: float, method: str, steps: Any, values: Any, bounds: Any
) -> Rotation:
    """Errors of computed pairs (m, 2) of exact Fractions."""
    errors = []
    for n, (c, s) in zip(steps, values, strict=True):
        cosine, sine = _exact_turn(int(n), period, interval)
        # z e^{-inδ} - 1, without cancellation
        errors.append(complex((c - cosine) * cosine + (s - sine) * sine, (s - sine) * cosine - (c - cosine) * sine))
    e = np.array(errors)
    amplitude = np.hypot(1 + e.real, e.imag) - 1
    small = np.abs(e) < 1e-8
    amplitude[small] = e.real[small]
    return Rotation(
        fmt, period, interval, method, np.asarray(steps), amplitude, np.arctan2(e.imag, 1 + e.real), np.abs(e), bounds
    )


def recursion(
    fmt: FloatFormat,
    period: float,
    steps: Sequence[int],
    interval: float = INTERVAL,
) -> Rotation:
    """Rotate by one sample's angle again and again, with every operation rounded: the deroll of (7), recursively.

    Parameters
    ----------
    fmt : base 2, 10 or 16 of a precision that has compiled loops.
    period, interval : of roll and between samples, s.
    steps : samples to look at, ascending.

    Raises
    ------
    ValueError : a format without compiled loops; steps that do not ascend.
    """
    marks = np.asarray(steps, dtype=np.int64)
    if marks.ndim != 1 or not len(marks) or marks[0] < 0 or np.any(np.diff(marks) <= 0):
        raise ValueError(f"got steps {steps!r}; needed numbers of samples that ascend from 0 or later")
    backend = fmt.backend
    if not isinstance(backend, Compiled):
        raise ValueError(f"got {fmt}; needed base 2, 10 or 16 and at most 53, 18 or 13 digits; take fewer")
    angle = fmt.array(list(_exact_turn(1, period, interval)))
    start = fmt.array([1, 0])
    step, state = (backend.pack(a.components) for a in (angle, start))
    out = np.empty((len(marks), *step.shape), dtype=step.dtype)
    _rotate(backend.tag, step, state, marks, out)
    values = FloatArray.from_components(backend, backend.unpack(out), fmt).to_fractions()
    bounds = np.array([theory.recursion_bound(int(n), fmt.unit_roundoff) for n in marks])
    return _compared(fmt, period, interval, "recursion", marks, values, bounds)


def direct(fmt: FloatFormat, period: float, steps: Sequence[int], interval: float = INTERVAL) -> Rotation:
    """Cosine and sine of the product of a rounded roll rate and a rounded time, each rounded: in any format."""
    marks = np.asarray(steps, dtype=np.int64)
    rate = fmt.array(theory.roll_rate(period))
    values = []
    for n in marks:
        angle = Fraction((rate * fmt.array(int(n) * Fraction(interval))).to_fractions())
        with mpmath.workdps(60):
            x = mpmath.mpf(angle.numerator) / angle.denominator
            values.append([fmt.round(_fraction(mpmath.cos(x))), fmt.round(_fraction(mpmath.sin(x)))])
    phases = 2 * np.pi * marks * (interval / period)
    bounds = np.array([theory.direct_bound(float(phase), fmt.unit_roundoff) for phase in phases])
    return _compared(fmt, period, interval, "direct", marks, values, bounds)


def digits_needed_observed(
    method: str, base: int, drift: float, period: float, steps: Sequence[int], error: float = 1.0
) -> int:
    """Least precision from which on a year's deroll of a drift stays within `error` mas.

    Tried downwards from what the bound proves to be enough, and no further than to the first that is not: with fewer
    digits still, it may stay within by luck.
    """
    bound = theory.rotation_bound(method, period, steps[-1])
    rotate = {"recursion": recursion, "direct": direct}[method]
    enough = theory.digits_needed(bound, base, error / (drift * steps[-1] * INTERVAL / YEAR))
    for precision in range(min(LARGEST_PRECISION[base], enough), 1, -1):
        if rotate(FloatFormat(base, precision), period, steps).drift_error(drift) > error:
            return precision + 1
    return 2
