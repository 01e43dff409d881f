"""Figures of the chapter on roll and deroll: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer

from gpbnb.display.style import BOUND, OBSERVED, OBSERVED_OTHERS, REFERENCE, STRICT, colours, label, legend, loglog
from gpbnb.display.tables import digits
from gpbnb.measurement import YEAR
from gpbnb.rolling import theory
from gpbnb.rolling.experiment import DriftStudy, FilterStudy, Rotation, Slope, Spectra, Spectrum

DENSITY = "density (mas²/Hz)"
Drawn = Artist | ErrorbarContainer
SIGNAL, THEORY = OBSERVED_OTHERS[0], BOUND


def density(spectrum: Spectrum, level: float, slope: Slope, ax: Axes) -> list[Drawn]:
    """Measured density of the generated noise, with two standard errors, beside A/f."""
    artists: list[Drawn] = [
        ax.errorbar(
            spectrum.frequency,
            spectrum.density,
            2 * spectrum.error * spectrum.density,
            fmt="o",
            color=OBSERVED,
            label=f"measured, slope {slope.value:.3f} ± {slope.error:.3f}",
        )
    ]
    artists += ax.plot(
        spectrum.frequency, theory.flicker_density(level, spectrum.frequency), color=THEORY, label="$A/f$"
    )
    loglog(ax)
    legend(ax)
    label(ax, "frequency (Hz)", DENSITY)
    return artists


def residual(spectrum: Spectrum, level: float, interval: float, ax: Axes) -> list[Drawn]:
    """Measured density over that of the samples, with two standard errors."""
    ratio = spectrum.density / theory.flicker_density(level, spectrum.frequency, interval)
    artists: list[Drawn] = [
        ax.errorbar(spectrum.frequency, ratio, 2 * spectrum.error, fmt="o", color=OBSERVED, label="measured")
    ]
    artists.append(ax.axhline(1, color=THEORY, label="expected of samples"))
    ax.set_xscale("log")
    legend(ax)
    label(ax, "frequency (Hz)", "measured / expected (no unit)")
    return artists


def before_rolling(result: Spectra, ax: Axes) -> list[Drawn]:
    """Figure III-1(a): the signal lies where the noise is heaviest."""
    artists = _points(result.noise, "noise", OBSERVED, ax)
    artists += _points(result.ramp, "drift", SIGNAL, ax)
    f = np.geomspace(1 / result.duration, 0.5 / result.interval, 300)
    artists += ax.plot(f, theory.flicker_density(result.level, f, result.interval), color=THEORY, label="theory")
    artists += ax.plot(f, theory.ramp_density(result.drift, result.duration, f), color=THEORY)
    loglog(ax)
    legend(ax, fontsize=9)
    label(ax, "frequency (Hz)", DENSITY, "(a) without rolling")
    return artists


def after_rolling(result: Spectra, ax: Axes) -> list[Drawn]:
    """Figure III-1(b): the signal is moved to the roll frequency, where there is little noise."""
    artists = _points(result.noise, "noise", OBSERVED, ax)
    f = 1 / result.period + result.offset / result.duration
    artists += ax.plot(f, result.line_signal, "s", color=SIGNAL, ms=3.5, label="drift, rolled")
    wide = np.geomspace(1 / result.duration, 0.5 / result.interval, 300)
    artists += ax.plot(wide, theory.flicker_density(result.level, wide, result.interval), color=THEORY, label="theory")
    distance = np.geomspace(1 / result.duration, 0.3 / result.period, 200)
    for side in (-1, 1):
        line = theory.ramp_density(result.drift, result.duration, distance) / 4
        artists += ax.plot(1 / result.period + side * distance, line, color=THEORY)
    ax.set_ylim(*_range(result))
    loglog(ax)
    legend(ax, fontsize=9)
    label(ax, "frequency (Hz)", DENSITY, "(b) rolled")
    return artists


def around_roll(result: Spectra, ax: Axes) -> list[Drawn]:
    """Figure III-3(a): signal and noise of a readout around the roll frequency."""
    artists: list[Drawn] = [
        *ax.plot(result.offset, result.line_noise, "o", color=OBSERVED, label="noise"),
        *ax.plot(result.offset, result.line_signal, "s", color=SIGNAL, label="drift, rolled"),
    ]
    x = np.linspace(result.offset[0], result.offset[-1], 501)
    f = x / result.duration
    noise = theory.flicker_density(result.level, 1 / result.period + f, result.interval)
    artists += ax.plot(x, noise, color=THEORY, label="theory")
    artists += ax.plot(x, theory.ramp_density(result.drift, result.duration, f) / 4, color=THEORY)
    ax.set_yscale("log")
    legend(ax, fontsize=9)
    label(ax, "$f - f_r$ (cycles a year)", DENSITY, "(a) rolled")
    return artists


def at_base(result: Spectra, ax: Axes) -> list[Drawn]:
    """Figure III-3(b): both after derolling; the noise near the roll frequency comes along."""
    x = np.arange(1, len(result.base_noise) + 1)
    artists: list[Drawn] = [
        *ax.plot(x, result.base_noise, "o", color=OBSERVED, label="noise, derolled"),
        *ax.plot(x, result.base_signal, "s", color=SIGNAL, label="drift, derolled"),
    ]
    fine = np.linspace(0, x[-1], 501)
    f = fine / result.duration
    noise = theory.derolled_density(result.level, result.period, f, result.interval)
    artists += ax.plot(fine, noise, color=THEORY, label="theory")
    artists += ax.plot(fine, theory.ramp_density(result.drift, result.duration, f), color=THEORY)
    ax.set_yscale("log")
    legend(ax, fontsize=9)
    label(ax, "$f$ (cycles a year)", DENSITY, "(b) derolled")
    return artists


def trace(t: np.ndarray, pair: np.ndarray, expected: np.ndarray | None, title: str, ax: Axes) -> list[Drawn]:
    """One stage of Figure III-2: both components against time in hours, and what theory has them be."""
    artists: list[Drawn] = []
    for part, colour, name in ((np.real, OBSERVED, "x, 1 or 3"), (np.imag, SIGNAL, "y, 2 or 4")):
        artists += ax.plot(t, part(pair), ".", ms=1.8, color=colour, label=name)
        if expected is not None:
            artists += ax.plot(t, part(expected), color=THEORY, lw=1.2)
    label(ax, "time (h)", "angle (mas)", title)
    return artists


def drift_errors(study: DriftStudy, ax: Axes) -> list[Drawn]:
    """Standard error of drift rate against roll period, simulated with two standard errors, beside theory."""
    found, spread = study.standard_error(), 2 * study.uncertainty()
    rolled = [i for i, period in enumerate(study.periods) if period is not None]
    periods = np.array([study.periods[i] for i in rolled], dtype=np.float64)
    artists: list[Drawn] = [
        ax.errorbar(periods, found[rolled], spread * found[rolled], fmt="o", color=OBSERVED, label="simulated, rolled")
    ]
    duration = study.samples * study.interval
    x = np.geomspace(periods.min() / 1.5, periods.max() * 1.5, 100)
    line = [theory.drift_error_rolled(study.level, p, duration, study.interval) for p in x]
    artists += ax.plot(x, line, color=THEORY, label=r"$\sqrt{6S(f_r)/T^3}$")
    for i, period in enumerate(study.periods):
        if period is None:
            artists.append(ax.axhline(found[i], color=OBSERVED, ls=":", label="simulated, not rolled"))
            level = theory.drift_error_unrolled(study.level, duration, at_rest=True)
            artists.append(ax.axhline(level, color=THEORY, ls="--", label=r"$\sqrt{8A}/T$"))
    artists.append(ax.axhline(theory.DRIFTS[1], color=REFERENCE, lw=0.8, label="frame dragging"))
    loglog(ax)
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    label(ax, "roll period (s)", "standard error of drift (mas a year)")
    return artists


def bandwidths(study: FilterStudy, density: float, ax: Axes) -> list[Drawn]:
    """Root mean square error behind filters against their bandwidth, with two standard errors, beside theory."""
    artists: list[Drawn] = []
    for name, colour, marker in (("single pole", OBSERVED, "o"), ("moving average", SIGNAL, "s")):
        chosen = [i for i, each in enumerate(study.names) if each == name]
        size = np.sqrt(study.error[chosen])
        artists.append(
            ax.errorbar(
                study.bandwidth[chosen],
                size,
                study.uncertainty[chosen] / size,
                fmt=marker,
                color=colour,
                markerfacecolor="none" if marker == "s" else colour,
                label=name,
            )
        )
    b = np.geomspace(study.bandwidth.min() / 1.5, study.bandwidth.max() * 1.5, 200)
    slope = study.drift / YEAR
    artists += ax.plot(b, np.sqrt(theory.filtered_error(study.drift, density, b)), color=THEORY, label="lag and noise")
    artists += ax.plot(b, slope / (4 * b), color=STRICT, lw=0.8, ls="--", label="lag")
    artists += ax.plot(b, np.sqrt(density * b), color=STRICT, lw=0.8, ls=":", label="noise in band")
    artists.append(ax.axvline(theory.best_bandwidth(study.drift, density), color=REFERENCE, lw=0.8, label="optimum"))
    loglog(ax)
    ax.set_ylim(bottom=0.3 * float(np.sqrt(study.error.min())))
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    label(ax, "noise bandwidth $B$ (Hz)", "rms error (mas)")
    return artists


def resets(
    reset: Sequence[float], errors: np.ndarray, drift: float, intensity: float, never: float, ax: Axes
) -> list[Drawn]:
    """Drift error of a wandering roll rate against the time between resets, with two standard errors."""
    size = np.sqrt(np.mean(errors**2, axis=1))
    artists: list[Drawn] = [
        ax.errorbar(reset, size, 2 * size / np.sqrt(2 * errors.shape[1]), fmt="o", color=OBSERVED, label="simulated")
    ]
    x = np.geomspace(min(reset) / 1.5, max(reset) * 1.5, 50)
    line = [theory.rate_walk_error(drift, intensity, YEAR, p) for p in x]
    artists += ax.plot(x, line, color=THEORY, label="theory")
    artists.append(ax.axhline(never, color=OBSERVED, ls=":", label="simulated, never reset"))
    free = theory.rate_walk_error(drift, intensity)
    artists.append(ax.axhline(free, color=THEORY, ls="--", label="theory, never reset"))
    loglog(ax)
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    label(ax, "time between resets (s)", "rms drift error (mas a year)")
    return artists


def rotations(results: Sequence[Rotation], drift: float, ax: Axes, title: str = "") -> list[Drawn]:
    """Error in mas of a derolled drift over the year, a colour a format, beside the bound (line)."""
    artists: list[Drawn] = []
    for colour, result in zip(colours(len(results)), results, strict=True):
        t = result.step * result.interval
        scale = drift * t / YEAR
        shown = result.size > 0
        artists += ax.plot(
            t[shown] / 86400, (scale * result.size)[shown], ".", ms=4, color=colour, label=digits(result.fmt)
        )
        within = result.bound < 2
        artists += ax.plot(t[within] / 86400, (scale * result.bound)[within], color=colour, lw=0.9)
    artists.append(ax.axhline(1, color=REFERENCE, lw=0.8, ls="--"))
    loglog(ax)
    legend(ax, fontsize=8.5)
    label(ax, "time (days)", "error (mas)", title)
    return artists


def phase_costs(angle: np.ndarray, found: np.ndarray, drift: tuple[float, float], ax: Axes) -> list[Drawn]:
    """Error of both drifts against a constant phase error: simulated without noise, beside theory."""
    line = np.geomspace(angle.min(), angle.max(), 200)
    cost = np.array([theory.phase_error_cost(drift, a) for a in line])
    artists: list[Drawn] = []
    for i, (colour, name) in enumerate(((OBSERVED, "of the geodetic drift"), (SIGNAL, "of frame dragging"))):
        artists += ax.plot(np.degrees(angle), np.abs(found[:, i]), "o", color=colour, label=name)
        artists += ax.plot(np.degrees(line), np.abs(cost[:, i]), color=THEORY, label="theory" if i else None)
    artists.append(ax.axhline(1, color=REFERENCE, lw=0.8, ls="--", label="1 mas a year"))
    loglog(ax)
    legend(ax, fontsize=9)
    label(ax, "phase error (degrees)", "error of drift (mas a year)")
    return artists


def _points(spectrum: Spectrum, name: str, colour: str, ax: Axes) -> list[Drawn]:
    marker = "s" if colour == SIGNAL else "o"
    return list(ax.plot(spectrum.frequency, spectrum.density, marker, ms=3.5, color=colour, label=name))


def _range(result: Spectra) -> tuple[float, float]:
    low = float(theory.flicker_density(result.level, 0.5 / result.interval)) / 10
    return low, 30 * float(theory.flicker_density(result.level, 1 / result.duration))
