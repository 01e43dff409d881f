"""Simulations: 1/f noise with roll and deroll, an uneven roll rate, and rotations computed in t digits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.flicker import flicker
from gpbnb.report.rolling.rotations import Rotation, digits_needed_observed, direct, recursion, rounded_rate_error
from gpbnb.report.rolling.spectra import (
    HANN,
    YEAR_SAMPLES,
    Slope,
    Spectra,
    Spectrum,
    derolled_record,
    fit_slope,
    in_bands,
    noise_spectrum,
    periodogram,
    samples_in,
    spectra,
    welch,
)
from gpbnb.report.rolling.theory import INTERVAL, LEVEL, PERIOD, PERIOD_FLOWN
from gpbnb.sweeps import Column, Sweep

__all__ = [
    "HANN",
    "SURVEY",
    "SURVEY_COLUMNS",
    "SURVEY_GYROS",
    "SURVEY_PERIODS",
    "YEAR_SAMPLES",
    "DriftStudy",
    "FilterStudy",
    "LowPass",
    "Rotation",
    "Slope",
    "Spectra",
    "Spectrum",
    "clean_drift_error",
    "derolled_record",
    "digits_needed_observed",
    "direct",
    "drift_rates",
    "filter_study",
    "fit_drift",
    "fit_slope",
    "image_behind",
    "in_bands",
    "noise_spectrum",
    "periodogram",
    "rate_sines",
    "rate_walks",
    "recursion",
    "roll_rate_errors",
    "rounded_rate_error",
    "spectra",
    "survey",
    "survey_rng",
    "survey_rows",
    "welch",
]


def fit_drift(derolled: NDArray[np.complex128], interval: float = INTERVAL) -> NDArray[np.float64]:
    """Fit straight lines to a derolled record by least squares; return the drifts (2,) of x and y in mas a year."""
    weights = theory.slope_weights(len(derolled), interval)
    return np.array([float(np.sum(weights * part)) * YEAR for part in (derolled.real, derolled.imag)])


def clean_drift_error(
    drift: tuple[float, float],
    phase_error: Callable[[Any], Any],
    period: float = PERIOD,
    duration: float = YEAR,
    interval: float = 100.0,
) -> NDArray[np.float64]:
    """Return the errors (2,) of both drifts, in mas a year, for a noise-free record derolled with a phase error."""
    stages = derolled_record(
        drift, 0.0, period, np.random.default_rng(0), samples_in(duration, interval), interval, phase_error
    )
    return fit_drift(stages["derolled"], interval) - np.array(drift)


# -- drift rates ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class DriftStudy:
    """Errors of fitted drift rates of x and y in mas a year, (periods, gyros, 2); a period of None means no roll."""

    periods: tuple[float | MaybeNone, ...]
    level: float
    samples: int
    interval: float
    errors: NDArray[np.float64]

    def standard_error(self) -> NDArray[np.float64]:
        """Root mean square of the errors for each period; the estimates have no bias."""
        return np.sqrt(np.mean(self.errors**2, axis=(1, 2)))

    def uncertainty(self) -> float:
        """Relative standard error of :meth:`standard_error`, from the number of simulated errors."""
        return 1 / math.sqrt(2 * self.errors[0].size)


@compiled
def _add_sums(first, noise, cosines, sines, slope, kx, ky, sums):  # type: ignore[no-untyped-def]
    # One pass rolls the signal, adds noise, derolls, and sums with the centred and scaled times.
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
    """Roll, measure, deroll and fit both drifts of gyros with two readouts each, in blocks that bound the memory.

    All periods use the same noise.

    Parameters
    ----------
    periods : roll periods, s; None for no rolling.
    gyros : number of gyros; gyro i has the same noise for any number.
    rng : source of the noise.
    level : level of the noise of each readout, mas².
    duration, interval : length of the record and time between samples, s.
    drift : drifts of x and y, mas a year.
    progress : show a progress bar.
    """
    n = samples_in(duration, interval)
    if gyros < 1 or not periods:
        raise ValueError(f"got {gyros} gyros and {len(periods)} roll periods; needed at least 1 of each")
    for period in periods:
        if period is not None and not 0 < period < math.inf:
            raise ValueError(f"got a roll period of {period} s; needed more than 0, or None for no rolling")
    if not all(map(math.isfinite, drift)):
        raise ValueError(f"got drifts {drift}; needed finite numbers, in mas a year")
    sums = np.zeros((len(periods), gyros, 2))
    slope = 2 / (n - 1)  # times run from -1 to 1
    half = (n - 1) * interval / YEAR / 2  # length of the record in years
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
"""Errors of the drift rates of `SURVEY_GYROS` gyros, a year each."""

SURVEY_PERIODS = (None, 6000.0, 600.0, 200.0, 77.5)
SURVEY_GYROS = 128


def survey_rng() -> np.random.Generator:
    """Return the generator of the survey in its initial state."""
    return np.random.default_rng(1984)


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
    return DriftStudy(SURVEY_PERIODS, LEVEL, YEAR_SAMPLES, INTERVAL, errors)


def survey_rows(study: DriftStudy) -> list[tuple[str, ...]]:
    """Return a study as rows of the stored file, one for each gyro, with six digits."""
    table = study.errors.transpose(1, 0, 2).reshape(study.errors.shape[1], -1)
    return [(str(gyro), *(f"{value:.5e}" for value in row)) for gyro, row in enumerate(table)]


def survey_of(gyros: int, directory: Path | None = None) -> list[tuple[str, ...]]:
    """Simulate a year for each of several gyros; the noise of each does not depend on their number."""
    return survey_rows(drift_rates(SURVEY_PERIODS, gyros, survey_rng(), progress=directory is not None))


def first_gyros(gyros: int, rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the rows of the first one to three gyros."""
    return survey_of(int(rng.integers(1, 4)))


SWEEP: Sweep[int] = Sweep(
    name="rolling/drift_rates",
    file=SURVEY,
    columns=SURVEY_COLUMNS,
    key=1,
    cells=lambda: (SURVEY_GYROS,),
    compute=survey_of,
    command="python -m gpbnb.report.stored recompute rolling/drift_rates",
    seed=1984,
    sample=first_gyros,
)


# -- filters -------------------------------------------------------------------------------------


class LowPass(Enum):
    """A kind of low-pass filter: a single pole or a moving average."""

    SINGLE_POLE = "single pole"
    MOVING_AVERAGE = "moving average"


@dataclass(frozen=True)
class FilterStudy:
    """Mean square errors (filters, records) in mas², after low-pass filters that have settled.

    `lag` and `bandwidth` are those of the filters; `error` is the mean over the records.
    """

    drift: float
    period: float
    kinds: tuple[LowPass, ...]
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
    """Measure the error of a drift after a single pole and after a moving average, for each noise bandwidth in Hz.

    Each component of each gyro, rolled and derolled, is a record. Averages start after ten time constants.
    """
    n = samples_in(duration, interval)
    kinds = (*(LowPass.SINGLE_POLE for _ in bandwidths), *(LowPass.MOVING_AVERAGE for _ in bandwidths))
    if not len(bandwidths) or not min(bandwidths) > 0:
        raise ValueError(f"got bandwidths {tuple(bandwidths)} Hz; needed at least one, and each above 0")
    longest = 10 / (4 * min(bandwidths))
    if longest > duration / 2:
        raise ValueError(
            f"got bandwidths {tuple(bandwidths)} Hz for {duration:g} s; needed each above {5 / duration:.3g} Hz; take "
            "a longer record"
        )
    skip = math.ceil(longest / interval)
    squares = np.zeros((len(kinds), 2 * gyros))
    filters = [theory.single_pole(1 / (4 * b), interval) for b in bandwidths]
    filters += [theory.moving_average(1 / (2 * b), interval) for b in bandwidths]
    for g, child in enumerate(rng.spawn(gyros)):
        stages = derolled_record((drift, drift), level, period, child, n, interval)
        for c, part in enumerate((np.real, np.imag)):
            derolled, truth = part(stages["derolled"]), part(stages["signal"])
            for i, weights in enumerate(filters):
                if kinds[i] is LowPass.SINGLE_POLE:
                    out = scipy.signal.lfilter([weights[0]], [1, weights[0] - 1], derolled)
                else:
                    total = np.concatenate([np.zeros(len(weights)), np.cumsum(derolled)])
                    out = (total[len(weights) :] - total[: -len(weights)]) / len(weights)
                squares[i, 2 * g + c] = np.mean((out - truth)[skip:] ** 2)
    lag = np.array([theory.filter_lag(weights, interval) for weights in filters])
    width = np.array([theory.noise_bandwidth(weights, interval) for weights in filters])
    return FilterStudy(drift, period, kinds, lag, width, squares)


def image_behind(
    weights: NDArray[np.float64], drift: float, period: float, samples: int, interval: float = INTERVAL
) -> NDArray[np.float64]:
    """Return the double-frequency term that remains after filtering a ramp rolled and derolled in one dimension; mas.

    The filter gets twice the derolled signal, so that the ramp has its full strength. The filtered ramp itself is then
    subtracted. The function returns the last turn.
    """
    n = np.arange(samples)
    ramp = drift / YEAR * interval * n
    phase = theory.roll_phase(n, period, interval)
    image = 2 * ramp * np.cos(phase) * np.cos(phase) - ramp
    turn = max(1, round(period / interval))
    if samples < len(weights) + turn:
        raise ValueError(f"got {samples} samples for a filter of {len(weights)}; needed {turn} more than the filter")
    return np.asarray(scipy.signal.fftconvolve(image[-len(weights) - turn :], weights, mode="valid")[-turn:])


# -- an uneven roll rate -------------------------------------------------------------------------


def roll_rate_errors(
    drift: float,
    rates: Iterator[NDArray[np.float64]],
    step: float,
    resets: Sequence[int | None],
) -> NDArray[np.float64]:
    """Fit the cross drift rates of a ramp that is derolled at the nominal rate; mas a year.

    Parameters
    ----------
    drift : k, mas a year.
    rates : deviations (n,) of the roll rate from the nominal rate, rad/s, one array for each trial.
    step : time between two rates, s; each rate lasts for one step.
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
            # A reset sets the phase to that of the spacecraft.
            wrong = middle if reset is None else middle - np.repeat(begin[::reset], reset)[:n]
            line.append(float(np.sum(weights * ramp * np.sin(-wrong))))
        errors.append(line)
    return np.array(errors).T


def rate_walks(
    intensity: float, trials: int, steps: int, step: float, rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Draw roll rates that are random walks from zero, whose variance is `intensity` (rad²/s³) times the time."""
    for _ in range(trials):
        yield np.cumsum(rng.standard_normal(steps)) * math.sqrt(intensity * step)


def rate_sines(
    amplitude: float, period: float, trials: int, steps: int, step: float, rng: np.random.Generator
) -> Iterator[NDArray[np.float64]]:
    """Draw roll rates that are sinusoids of random phase; amplitude in rad/s, period in s."""
    t = np.arange(steps) * step
    for _ in range(trials):
        yield amplitude * np.cos(2 * np.pi * (t / period + rng.random()))
