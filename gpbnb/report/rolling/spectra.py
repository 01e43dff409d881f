"""Estimate spectra of signal and noise from records, and simulate records of a rolled ramp."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.flicker import record
from gpbnb.report.rolling.theory import INTERVAL, LEVEL, PERIOD

YEAR_SAMPLES = round(YEAR / INTERVAL)


def samples_in(duration: float, interval: float) -> int:
    """How many samples a record has, at least two."""
    if not (0 < interval < math.inf and 0 < duration < math.inf):
        raise ValueError(f"got {duration} s with a sample every {interval} s; needed two finite positive numbers")
    n = round(duration / interval)
    if n < 2:
        raise ValueError(f"got {duration:g} s with a sample every {interval:g} s; needed at least 2 samples")
    return n


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
    """Estimate the density of records (samples, channels) by Welch's method, with Hann windows that overlap by half.

    Returns
    -------
    frequency, density : without frequency zero and the two frequencies next to it, into which the mean leaks.
    averages : equivalent number of independent periodograms.
    """
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


def fit_slope(spectrum: Spectrum, interval: float = INTERVAL) -> Slope:
    """Fit a line to log density against log frequency, with a weight for each band, and correct for sampling."""
    x = np.log10(spectrum.frequency)
    # The logarithm of a mean of m values is too low by 1/(2m). Sampling raises the density by x/sin x, x = πfΔt.
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
    """Estimate the density of generated noise by Welch's method, in bands from 4 cycles a segment to f = 0.12/Δt."""
    records = record(LEVEL, samples, channels, rng)
    f, p, averages = welch(records, interval, segment)
    return in_bands(f, p, averages, 4 / (segment * interval), 0.12 / interval, bands)


@dataclass(frozen=True)
class Spectra:
    """One-sided densities in mas²/Hz of a year of drift and noise: before rolling, rolled, and derolled.

    `ramp`, `noise` and `derolled` (noise) are averages in bands. `offset` is in cycles per record. For one readout
    (`line_signal`, `line_noise`) it is the distance from the roll frequency; for a derolled component (`base_signal`,
    `base_noise`) it is the frequency, from one cycle on.
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
    """Return the one-sided density of a whole real record without a window, from one cycle per record on."""
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
    """Simulate Figures III-1 and III-3: a drift along x, and the noise of gyros with two readouts each.

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
    """Simulate one gyro with two readouts through (5)-(7), with x and y as real and imaginary part.

    Parameters
    ----------
    drift : drifts of x and y, mas a year.
    level : level of the noise of each readout, mas²; 0 for none.
    period, interval : roll period and time between samples, s.
    phase_error : angle in rad by which the deroll is ahead, a function of times (n,) in s; None for no error.

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
