"""Simulated records for several checks of hung1984, ch. III."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import experiment, theory
from gpbnb.report.rolling.theory import DRIFTS, FLOWN_DENSITY, LEVEL, PERIOD


@cache
def spectra() -> experiment.Spectra:
    """Return a short record, 600 turns, with the signal-to-noise ratio of a year."""
    samples = 36000
    return experiment.spectra(DRIFTS[1] * YEAR / (10.0 * samples), np.random.default_rng(3), 4, samples=samples)


@cache
def noise_spectrum() -> tuple[experiment.Spectrum, experiment.Slope]:
    found = experiment.noise_spectrum(np.random.default_rng(1), 2**17, 8, 2**15, bands=16)
    return found, experiment.fit_slope(found)


@cache
def stages() -> dict[str, np.ndarray]:
    """Return a drift with noise passed through (5)-(7), for 20 turns of 600 s."""
    return experiment.derolled_record((2e6, 1e6), 400.0, PERIOD, np.random.default_rng(2), 1200)


@cache
def filter_study() -> experiment.FilterStudy:
    best = theory.best_bandwidth(DRIFTS[0], FLOWN_DENSITY)
    rng = np.random.default_rng(8)
    return experiment.filter_study(DRIFTS[0], [best / 3, best, 3 * best], 8, rng, duration=YEAR / 16)


@cache
def walk_errors() -> np.ndarray:
    """Return drift errors for 200 random walks of the roll rate, without resets and with one per 100 steps of 600 s."""
    walks = experiment.rate_walks(WALK, 200, 52560, 600.0, np.random.default_rng(9))
    return experiment.roll_rate_errors(DRIFTS[0], walks, 600.0, [None, 100])


WALK = 3e-6 / YEAR**3
"""Intensity of a roll rate, rad²/s³, at which the phase is off by a milliradian after a year."""


def deviation(found: float, expected: float, error: float) -> float:
    """Return the difference in standard errors."""
    return (found - expected) / error


def expected_squares(study: experiment.FilterStudy, duration: float = YEAR / 16) -> np.ndarray:
    """Return the mean square error of each filter of a study: the square of its lag, plus the exact noise.

    The noise grows with the logarithm of time. It is taken at T/e, where the logarithm has its mean over a record of
    length T.
    """
    middle = round(duration / theory.INTERVAL / math.e)
    expected = []
    for kind, lag, width in zip(study.kinds, study.lag, study.bandwidth, strict=True):
        if kind is experiment.LowPass.SINGLE_POLE:
            weights = theory.single_pole(lag_constant(lag))
        else:
            weights = theory.moving_average(1 / (2 * width))
        noise = theory.filtered_variance(weights, LEVEL, middle, study.period)
        expected.append((study.drift / YEAR * lag) ** 2 + noise)
    return np.array(expected)


def lag_constant(lag: float, interval: float = theory.INTERVAL) -> float:
    """Return the time constant of a single pole with a given lag."""
    return interval / math.log1p(interval / lag)
