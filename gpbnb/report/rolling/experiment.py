"""Simulations: records of a rolled ramp in 1/f noise and their spectra, fitted drifts, filters, an uneven roll rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.theory import INTERVAL, LEVEL, PERIOD, PERIOD_FLOWN
from gpbnb.report.stored_table import Column
from gpbnb.report.sweep import Sweep

YEAR_SAMPLES = round(YEAR / INTERVAL)


def record(level: float, samples: int, channels: int, rng: np.random.Generator) -> NDArray[np.float64]:
    r"""Generate independent records of 1/f noise (samples, channels); each starts at rest.

    White noise passes through :func:`gpbnb.report.rolling.theory.impulse_response` (Kasdin 1995). The one-sided density
    of samples taken Δt apart is :math:`\pi A\,\Delta t/\sin(\pi f\Delta t)`, and A/f at low frequencies, whatever Δt.
    A channel's noise does not depend on the number of channels.
    """
    white = np.stack([source.standard_normal(samples) for source in rng.spawn(channels)], axis=1)
    response = math.sqrt(math.pi * level) * theory.impulse_response(samples)[:, np.newaxis]
    return np.asarray(scipy.signal.fftconvolve(white, response, axes=0)[:samples])


def derolled_record(
    drift: tuple[float, float],
    level: float,
    period: float,
    rng: np.random.Generator,
    samples: int = YEAR_SAMPLES,
    interval: float = INTERVAL,
    phase_error: Callable[[Any], Any] | None = None,
) -> dict[str, NDArray[np.complex128]]:
    """Simulate one gyro with two readouts through (5)-(7), with x and y as real and imaginary part.

    `phase_error` gives the angle in rad by which the deroll is ahead, for times in s. The stages are "signal",
    "rolled", "noise", "measured" and "derolled", each in mas.
    """
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
    """Fit straight lines to a derolled record by least squares; return the drifts (2,) of x and y in mas a year."""
    weights = theory.slope_weights(len(derolled), interval)
    return np.array([float(np.sum(weights * part)) * YEAR for part in (derolled.real, derolled.imag)])


def clean_drift_error(drift: tuple[float, float], phase_error: Callable[[Any], Any]) -> NDArray[np.float64]:
    """Return the errors (2,) of both drifts, in mas a year, for a noise-free record derolled with a phase error."""
    interval = 100.0
    stages = derolled_record(
        drift, 0.0, PERIOD, np.random.default_rng(0), round(YEAR / interval), interval, phase_error
    )
    return fit_drift(stages["derolled"], interval) - np.array(drift)


# -- spectra -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Spectrum:
    """One-sided density in mas²/Hz, averaged in bands; `averages` is the number of independent values in each band."""

    frequency: NDArray[np.float64]
    density: NDArray[np.float64]
    averages: NDArray[np.float64]

    @property
    def error(self) -> NDArray[np.float64]:
        """Relative standard error of the density, a mean of `averages` chi-square values of two degrees of freedom."""
        return 1 / np.sqrt(self.averages)


def in_bands(frequency: Any, density: Any, averages: float, first: float, last: float, bands: int) -> Spectrum:
    """Average a density over bands of equal logarithmic width; bands without a frequency are left out."""
    edges = np.geomspace(first, last, bands + 1)
    place = np.digitize(frequency, edges) - 1
    counts = np.array([np.count_nonzero(place == i) for i in range(bands)])
    full = np.flatnonzero(counts)
    middle = np.array([math.exp(np.mean(np.log(frequency[place == i]))) for i in full])
    # Average f times the density, so that 1/f noise has no bias within a band.
    mean = np.array([np.mean((frequency * density)[place == i]) for i in full]) / middle
    return Spectrum(middle, mean, averages * counts[full])


def welch(records: NDArray[np.float64], interval: float, segment: int) -> tuple[Any, Any, float]:
    """Estimate the density of records (samples, channels) by Welch's method, with Hann windows that overlap by half."""
    f, p = scipy.signal.welch(records, 1 / interval, "hann", segment, axis=0)
    count = 2 * (len(records) // segment) - 1
    # Periodograms of Hann-windowed segments that overlap by half have a correlation of 1/36 (Welch 1967), and
    # neighbouring frequencies are correlated too: a sum over a band is worth 18/35 of its number (see below).
    worth = count / (1 + 2 * (count - 1) / count / 36)
    return f[3:], np.mean(p[3:], axis=1), worth * records.shape[1] * HANN


HANN = 18 / 35
r"""Independent values per frequency in a band of a Hann-windowed periodogram, :math:`1/(1 + 2(4/9) + 2/36)`."""


@dataclass(frozen=True)
class Slope:
    """Exponent of a power law fitted to a density, and its standard error."""

    value: float
    error: float
    decades: float


def fit_slope(spectrum: Spectrum) -> Slope:
    """Fit a line to log density against log frequency, with a weight for each band, and correct for sampling."""
    x = np.log10(spectrum.frequency)
    # The logarithm of a mean of m values is too low by 1/(2m). Sampling raises the density by x/sin x, x = πfΔt.
    y = np.log10(spectrum.density * np.sinc(spectrum.frequency * INTERVAL)) + np.log10(np.e) / (2 * spectrum.averages)
    w = spectrum.averages
    x = x - np.sum(w * x) / np.sum(w)
    square = np.sum(w * x**2)
    return Slope(float(np.sum(w * x * y) / square), 1 / math.log(10) / math.sqrt(square), float(np.ptp(x)))


def noise_spectrum(
    rng: np.random.Generator,
    samples: int = 2**21,
    channels: int = 4,
    segment: int = 2**19,
    bands: int = 24,
) -> Spectrum:
    """Estimate the density of generated noise by Welch's method, in bands from 4 cycles a segment to f = 0.12/Δt."""
    records = record(LEVEL, samples, channels, rng)
    f, p, averages = welch(records, INTERVAL, segment)
    return in_bands(f, p, averages, 4 / (segment * INTERVAL), 0.12 / INTERVAL, bands)


@dataclass(frozen=True)
class Spectra:
    """One-sided densities in mas²/Hz of a record of `duration` s, from one cycle per record on.

    `ramp` is a drift, `noise` that of a readout, `line_noise` the same around the roll frequency, and `base_noise` that
    of a derolled component.
    """

    duration: float
    ramp: NDArray[np.float64]
    noise: NDArray[np.float64]
    line_noise: NDArray[np.float64]
    base_noise: NDArray[np.float64]


OFFSETS = 25
"""Frequencies on either side of the roll frequency that count as near it."""


def _periodogram(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the one-sided density of a record, without a window, from one cycle per record on."""
    return np.asarray(2 * np.abs(np.fft.rfft(x)[1:]) ** 2 * INTERVAL / len(x))


def spectra(
    drift: float,
    rng: np.random.Generator,
    gyros: int = 4,
    samples: int = YEAR_SAMPLES,
) -> Spectra:
    """Simulate a drift, and the noise of gyros with two readouts each, for a whole number of turns."""
    duration = samples * INTERVAL
    turns = round(duration / PERIOD)
    offset = np.concatenate([np.arange(-OFFSETS, 0), np.arange(1, OFFSETS + 1)])
    before, after = np.zeros((2, samples // 2))
    for child in rng.spawn(gyros):
        stages = derolled_record((0.0, 0.0), LEVEL, PERIOD, child, samples)
        before += (_periodogram(stages["noise"].real) + _periodogram(stages["noise"].imag)) / 2
        after += (_periodogram(stages["derolled"].real) + _periodogram(stages["derolled"].imag)) / 2
    ramp = _periodogram(np.asarray(drift * (np.arange(samples) * INTERVAL / YEAR)))
    around, below = before[turns + offset - 1] / gyros, after[:OFFSETS] / gyros
    return Spectra(duration, ramp, before / gyros, around, below)


# -- drift rates ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class DriftStudy:
    """Errors of fitted drift rates of x and y in mas a year, (periods, gyros, 2); a period of None means no roll."""

    periods: tuple[float | MaybeNone, ...]
    errors: NDArray[np.float64]

    def standard_error(self) -> NDArray[np.float64]:
        """Root mean square of the errors for each period; the estimates have no bias."""
        return np.sqrt(np.mean(self.errors**2, axis=(1, 2)))

    def uncertainty(self) -> float:
        """Relative standard error of :meth:`standard_error`, from the number of simulated errors."""
        return 1 / math.sqrt(2 * self.errors[0].size)


def drift_rates(
    periods: Sequence[float | None],
    gyros: int,
    rng: np.random.Generator,
    samples: int = YEAR_SAMPLES,
) -> DriftStudy:
    """Roll, measure, deroll and fit both drifts of gyros with two readouts each; all periods use the same noise."""
    index = np.arange(samples)
    ramp = complex(*theory.DRIFTS) * (index * INTERVAL / YEAR)
    phases = [np.zeros(samples) if p is None else theory.roll_phase(index, p) for p in periods]
    errors = np.empty((len(periods), gyros, 2))
    for g in tqdm(range(gyros), desc="gyros", ncols=80, disable=None):
        noise = record(LEVEL, samples, 2, rng) @ (1, 1j)
        for p, phase in enumerate(phases):
            turn = np.exp(1j * phase)
            errors[p, g] = fit_drift((ramp * turn.conj() + noise) * turn) - np.array(theory.DRIFTS)
    return DriftStudy(tuple(periods), errors)


SURVEY_PERIODS = (None, 6000.0, 600.0, 200.0, 77.5)
SURVEY_GYROS = 128


#: Columns of the stored survey, errors of the drift rates of x and y, mas/yr, for each roll period.
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
    table = np.array([row[1:] for row in SWEEP.load().rows], dtype=np.float64)
    errors = table.reshape(len(table), len(SURVEY_PERIODS), 2).transpose(1, 0, 2)
    return DriftStudy(SURVEY_PERIODS, errors)


def survey_rows(study: DriftStudy) -> list[tuple[str, ...]]:
    """Return a study as rows of the stored file, one for each gyro, with six digits."""
    table = study.errors.transpose(1, 0, 2).reshape(study.errors.shape[1], -1)
    return [(str(gyro), *(f"{value:.5e}" for value in row)) for gyro, row in enumerate(table)]


def survey_of(gyros: int) -> list[tuple[str, ...]]:
    """Simulate a year for each of several gyros; the noise of each does not depend on their number."""
    rng = np.random.default_rng(1984)
    return survey_rows(drift_rates(SURVEY_PERIODS, gyros, rng))


SWEEP = Sweep(
    "rolling/drift_rates",
    SURVEY_COLUMNS,
    1,
    lambda: (SURVEY_GYROS,),
    survey_of,
    seed=1984,
    sample=lambda gyros, rng: survey_of(int(rng.integers(1, 4))),
)


# -- filters -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FilterStudy:
    """Mean square errors (filters, records) in mas², after low-pass filters that have settled.

    `filters` are their weights, newest first; `error` is the mean over the records.
    """

    drift: float
    filters: tuple[NDArray[np.float64], ...]
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
    duration: float,
) -> FilterStudy:
    """Measure the error of a drift after a single pole and after a moving average, for each noise bandwidth in Hz.

    Each component of each gyro, rolled and derolled, is a record. Averages start after ten time constants.
    """
    n = round(duration / INTERVAL)
    skip = math.ceil(10 / (4 * min(bandwidths)) / INTERVAL)
    if n <= skip:
        raise ValueError(
            f"got a duration of {duration:g} s; needed more than {skip * INTERVAL:g} s, ten time constants"
        )
    filters = [theory.single_pole(1 / (4 * b)) for b in bandwidths]
    filters += [theory.moving_average(1 / (2 * b)) for b in bandwidths]
    squares = np.zeros((len(filters), 2 * gyros))
    for g, child in enumerate(rng.spawn(gyros)):
        stages = derolled_record((drift, drift), LEVEL, PERIOD_FLOWN, child, n)
        for i, weights in enumerate(filters):
            late = scipy.signal.oaconvolve(stages["derolled"], weights)[:n] - stages["signal"]
            squares[i, 2 * g : 2 * g + 2] = np.mean(late.real[skip:] ** 2), np.mean(late.imag[skip:] ** 2)
    return FilterStudy(drift, tuple(filters), squares)


# -- an uneven roll rate -------------------------------------------------------------------------


def roll_rate_errors(
    drift: float,
    intensity: float,
    trials: int,
    steps: int,
    step: float,
    resets: Sequence[int | None],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Fit the cross drift rates (resets, trials) of a ramp that is derolled at the nominal rate; mas a year.

    The roll rate is a random walk from zero in steps of `step` s; its variance is `intensity` (rad²/s³) times the time.
    `resets` are steps between resets of the phase by the star sensor; None for never.
    """
    weights = theory.slope_weights(steps, step)
    ramp = drift * step * (np.arange(steps) + 0.5)
    errors = np.empty((len(resets), trials))
    for trial in range(trials):
        rate = np.cumsum(rng.standard_normal(steps)) * math.sqrt(intensity * step)
        begin = np.concatenate([[0.0], np.cumsum(rate)[:-1]]) * step
        middle = begin + rate * (step / 2)
        for i, reset in enumerate(resets):
            # A reset sets the phase to that of the spacecraft.
            wrong = middle if reset is None else middle - np.repeat(begin[::reset], reset)[:steps]
            errors[i, trial] = np.sum(weights * ramp * np.sin(-wrong))
    return errors
