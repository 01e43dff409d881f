"""Figures of the chapter on roll and deroll: ``(result, ax)`` in, artists out.

Blue points show simulated noise and errors, purple points the drift signal. Solid lines are theory that holds; dashed
lines are printed formulas that fail.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer

from gpbnb.arithmetic.named import digits
from gpbnb.report.display.style import (
    OBSERVED,
    OBSERVED_OTHERS,
    REFERENCE,
    REFUTED,
    VALID,
    bits_colour,
    label,
    legend,
    loglog,
    name,
    name_ends,
)
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import theory
from gpbnb.report.rolling.experiment import DriftStudy, FilterStudy, LowPass, Rotation, Slope, Spectra, Spectrum

DENSITY = "density (mas²/Hz)"
Drawn = Artist | ErrorbarContainer
SIGNAL = OBSERVED_OTHERS[0]


def density(spectrum: Spectrum, level: float, slope: Slope, ax: Axes) -> list[Drawn]:
    """Draw the measured density of the generated noise, with two standard errors, and A/f."""
    artists: list[Drawn] = [
        ax.errorbar(
            spectrum.frequency,
            spectrum.density,
            2 * spectrum.error * spectrum.density,
            fmt="o",
            color=OBSERVED,
            label="measured",
        )
    ]
    artists += ax.plot(
        spectrum.frequency, theory.flicker_density(level, spectrum.frequency), color=VALID, label="$A/f$"
    )
    loglog(ax)
    label(ax, "frequency (Hz)", DENSITY)
    f = spectrum.frequency
    middle = len(f) // 2
    theoretical = f"$A/f$; measured slope {slope.value:.3f} ± {slope.error:.3f}".replace("-", "−")
    name(ax, theoretical, (float(f[middle]), level / float(f[middle])), VALID, (-40, 24), ha="left")
    return artists


def residual(spectrum: Spectrum, level: float, interval: float, ax: Axes) -> list[Drawn]:
    """Draw the ratio of measured to expected density, with two standard errors."""
    ratio = spectrum.density / theory.flicker_density(level, spectrum.frequency, interval)
    artists: list[Drawn] = [
        ax.errorbar(spectrum.frequency, ratio, 2 * spectrum.error, fmt="o", color=OBSERVED, label="measured")
    ]
    artists.append(ax.axhline(1, color=VALID, label="expected for the samples"))
    ax.set_xscale("log")
    label(ax, "frequency (Hz)", "measured / expected")
    return artists


def before_rolling(result: Spectra, ax: Axes) -> list[Drawn]:
    """Draw Figure III-1(a): the drift lies where the noise is strongest."""
    artists = _points(result.noise, "noise", OBSERVED, ax)
    artists += _points(result.ramp, "drift", SIGNAL, ax)
    f = np.geomspace(1 / result.duration, 0.5 / result.interval, 300)
    artists += ax.plot(f, theory.flicker_density(result.level, f, result.interval), color=VALID, label="theory")
    ramp = theory.ramp_density(result.drift, result.duration, f)
    artists += ax.plot(f, ramp, color=VALID)
    low = f < 30 / result.duration
    printed = theory.printed_ramp_density(result.drift, f[low])
    artists += ax.plot(f[low], printed, color=REFUTED, ls="--", label="drift as printed")
    loglog(ax)
    label(ax, "frequency (Hz)", DENSITY, "(a) without rolling")
    at = len(f) // 2
    noise = theory.flicker_density(result.level, f, result.interval)
    name(ax, "noise", (float(f[at]), float(noise[at])), OBSERVED, (6, 10))
    name(ax, "drift", (float(f[at]), float(ramp[at])), SIGNAL, (6, 10))
    name(ax, r"drift as printed, $k^2/\omega^4$", (float(f[low][-1]), float(printed[-1])), REFUTED, (6, 8))
    return artists


def after_rolling(result: Spectra, ax: Axes) -> list[Drawn]:
    """Draw Figure III-1(b): rolling moves the drift to the roll frequency, where there is little noise."""
    artists = _points(result.noise, "noise", OBSERVED, ax)
    f = 1 / result.period + result.offset / result.duration
    artists += ax.plot(f, result.line_signal, "s", color=SIGNAL, ms=3.5, label="drift, rolled")
    wide = np.geomspace(1 / result.duration, 0.5 / result.interval, 300)
    artists += ax.plot(wide, theory.flicker_density(result.level, wide, result.interval), color=VALID, label="theory")
    distance = np.geomspace(1 / result.duration, 0.3 / result.period, 200)
    for side in (-1, 1):
        line = theory.ramp_density(result.drift, result.duration, distance) / 4
        artists += ax.plot(1 / result.period + side * distance, line, color=VALID)
    loglog(ax)
    label(ax, "frequency (Hz)", DENSITY, "(b) rolled")
    at = len(wide) // 3
    noise = theory.flicker_density(result.level, wide, result.interval)
    name(ax, "noise", (float(wide[at]), float(noise[at])), OBSERVED, (6, 8))
    name(ax, "drift, rolled", (1 / result.period, float(np.max(result.line_signal))), SIGNAL, (-8, 0))
    return artists


def around_roll(result: Spectra, ax: Axes) -> list[Drawn]:
    """Draw Figure III-3(a): drift and noise of one readout around the roll frequency."""
    artists: list[Drawn] = [
        *ax.plot(result.offset, result.line_noise, "o", color=OBSERVED, label="noise"),
        *ax.plot(result.offset, result.line_signal, "s", color=SIGNAL, label="drift, rolled"),
    ]
    x = np.linspace(result.offset[0], result.offset[-1], 501)
    f = x / result.duration
    noise = theory.flicker_density(result.level, 1 / result.period + f, result.interval)
    artists += ax.plot(x, noise, color=VALID, label="theory")
    artists += ax.plot(x, theory.ramp_density(result.drift, result.duration, f) / 4, color=VALID)
    ax.set_yscale("log")
    label(ax, "$f - f_r$ (cycles a year)", DENSITY, "(a) rolled")
    near = float(np.max(result.line_signal))
    name(ax, "drift, rolled", (0, near), SIGNAL, (14, 4))
    name(ax, "noise", (0, float(np.mean(result.line_noise))), OBSERVED, (0, 12))
    return artists


def at_base(result: Spectra, ax: Axes) -> list[Drawn]:
    """Draw Figure III-3(b): drift and noise after derolling, which moves the noise near the roll frequency as well."""
    x = np.arange(1, len(result.base_noise) + 1)
    artists: list[Drawn] = [
        *ax.plot(x, result.base_noise, "o", color=OBSERVED, label="noise, derolled"),
        *ax.plot(x, result.base_signal, "s", color=SIGNAL, label="drift, derolled"),
    ]
    fine = np.linspace(0, x[-1], 501)
    f = fine / result.duration
    noise = theory.derolled_density(result.level, result.period, f, result.interval)
    artists += ax.plot(fine, noise, color=VALID, label="theory")
    artists += ax.plot(fine, theory.ramp_density(result.drift, result.duration, f), color=VALID)
    ax.set_yscale("log")
    label(ax, "$f$ (cycles a year)", DENSITY, "(b) derolled")
    name(ax, "drift, derolled", (float(x[0]), float(result.base_signal[0])), SIGNAL, (12, 2))
    name(ax, "noise, derolled", (float(x[-1]), float(np.min(result.base_noise))), OBSERVED, (-2, -6))
    return artists


def trace(t: np.ndarray, pair: np.ndarray, expected: np.ndarray | None, title: str, ax: Axes) -> list[Drawn]:
    """Draw one stage of Figure III-2: both components against time in hours, and their values without noise."""
    artists: list[Drawn] = []
    for part, colour, text in ((np.real, OBSERVED, "x"), (np.imag, SIGNAL, "y")):
        artists += ax.plot(t, part(pair), ".", ms=1.8, color=colour, label=text)
        if expected is not None:
            artists += ax.plot(t, part(expected), color=VALID, lw=1.2)
    label(ax, "time (h)", "angle (mas)", title)
    return artists


def drift_errors(study: DriftStudy, ax: Axes) -> list[Drawn]:
    """Draw the standard error of a drift rate against the roll period, simulated and in theory."""
    found, spread = study.standard_error(), 2 * study.uncertainty()
    rolled = [i for i, period in enumerate(study.periods) if period is not None]
    periods = np.array([study.periods[i] for i in rolled], dtype=np.float64)
    artists: list[Drawn] = [
        ax.errorbar(periods, found[rolled], spread * found[rolled], fmt="o", color=OBSERVED, label="simulated, rolled")
    ]
    duration = study.samples * study.interval
    x = np.geomspace(periods.min() / 1.5, periods.max() * 1.5, 100)
    line = [theory.drift_error_rolled(study.level, p, duration, study.interval) for p in x]
    artists += ax.plot(x, line, color=VALID, label=r"$\sqrt{6S(f_r)/T^3}$")
    for i, period in enumerate(study.periods):
        if period is None:
            artists.append(ax.axhline(found[i], color=OBSERVED, ls=":", label="simulated, not rolled"))
            level = theory.drift_error_unrolled(study.level, duration, at_rest=True)
            artists.append(ax.axhline(level, color=VALID, label=r"$\sqrt{8A}/T$"))
    artists.append(ax.axhline(theory.DRIFTS[1], color=REFERENCE, lw=1.2, ls=":", label="frame dragging"))
    loglog(ax)
    label(ax, "roll period (s)", "standard error of drift (mas a year)")
    name(ax, r"theory, $\sqrt{6S(f_r)/T^3}$", (float(x[60]), float(line[60])), VALID, (6, -4))
    first = float(periods.min())
    name(ax, "simulated", (first, float(found[rolled][periods.argmin()])), OBSERVED, (0, 22), ha="left")
    name(ax, "frame dragging itself, 40 mas a year", (first, theory.DRIFTS[1]), REFERENCE, (0, -3), ha="left")
    if None in study.periods:
        name(ax, r"not rolled: simulated (dotted), and $\sqrt{8A}/T$", (first, level), VALID, (0, 3), ha="left")
    return artists


def bandwidths(study: FilterStudy, density: float, ax: Axes) -> list[Drawn]:
    """Draw the rms error after low-pass filters against their bandwidth, with two standard errors, and theory."""
    artists: list[Drawn] = []
    for kind, colour, marker in ((LowPass.SINGLE_POLE, OBSERVED, "o"), (LowPass.MOVING_AVERAGE, SIGNAL, "s")):
        chosen = [i for i, each in enumerate(study.kinds) if each is kind]
        size = np.sqrt(study.error[chosen])
        artists.append(
            ax.errorbar(
                study.bandwidth[chosen],
                size,
                study.uncertainty[chosen] / size,
                fmt=marker,
                color=colour,
                markerfacecolor="none" if marker == "s" else colour,
                label=kind.value,
            )
        )
    b = np.geomspace(study.bandwidth.min() / 1.5, study.bandwidth.max() * 1.5, 200)
    slope = study.drift / YEAR
    artists += ax.plot(b, np.sqrt(theory.filtered_error(study.drift, density, b)), color=VALID, label="lag and noise")
    artists += ax.plot(b, slope / (4 * b), color=REFERENCE, lw=0.8, label="lag")
    artists += ax.plot(b, np.sqrt(density * b), color=REFERENCE, lw=0.8, label="noise in band")
    best = theory.best_bandwidth(study.drift, density)
    artists.append(ax.axvline(best, color=REFERENCE, ls=":", label="optimum"))
    loglog(ax)
    ax.set_ylim(bottom=0.3 * float(np.sqrt(study.error.min())))
    label(ax, "noise bandwidth $B$ (Hz)", "rms error (mas)")
    high = ax.get_ylim()[1]
    name(ax, "best $B$", (best, high), REFERENCE, (5, -2))
    name(ax, "lag", (best, slope / (4 * best)), REFERENCE, (-7, -3))
    name(ax, "noise in band", (best, float(np.sqrt(density * best))), REFERENCE, (10, -12))
    name(
        ax, "theory", (float(b[30]), float(np.sqrt(theory.filtered_error(study.drift, density, b[30])))), VALID, (8, 0)
    )
    legend(ax, handles=artists[:2], loc="upper right")
    return artists


def resets(
    reset: Sequence[float], errors: np.ndarray, drift: float, intensity: float, never: float, ax: Axes
) -> list[Drawn]:
    """Draw the drift error of a random roll rate against the time between resets, with two standard errors."""
    size = np.sqrt(np.mean(errors**2, axis=1))
    artists: list[Drawn] = [
        ax.errorbar(reset, size, 2 * size / np.sqrt(2 * errors.shape[1]), fmt="o", color=OBSERVED, label="simulated")
    ]
    x = np.geomspace(min(reset) / 1.5, max(reset) * 1.5, 50)
    line = [theory.rate_walk_error(drift, intensity, YEAR, p) for p in x]
    artists += ax.plot(x, line, color=VALID, label="theory")
    artists.append(ax.axhline(never, color=OBSERVED, ls=":", label="simulated, never reset"))
    free = theory.rate_walk_error(drift, intensity)
    artists.append(ax.axhline(free, color=VALID, label="theory, never reset"))
    loglog(ax)
    label(ax, "time between resets (s)", "rms drift error (mas a year)")
    name(ax, "theory", (float(x[25]), float(line[25])), VALID, (8, -4))
    name(ax, "simulated", (float(reset[0]), float(size[0])), OBSERVED, (8, -2))
    name(ax, "never reset: simulated (dotted) and theory", (float(x[0]), min(never, free)), VALID, (1, -4), ha="left")
    return artists


def rotations(results: Sequence[Rotation], drift: float, ax: Axes, title: str = "") -> list[Drawn]:
    """Draw the error of a derolled drift over the year in mas: points for each format, the bound as a line."""
    artists: list[Drawn] = []
    ends = {}
    for result in results:
        colour = bits_colour(result.fmt)
        t = result.step * result.interval
        scale = drift * t / YEAR
        shown = result.size > 0
        artists += ax.plot(
            t[shown] / 86400, (scale * result.size)[shown], ".", ms=4, color=colour, label=digits(result.fmt)
        )
        within = result.bound < 2
        artists += ax.plot(t[within] / 86400, (scale * result.bound)[within], color=VALID, lw=0.9)
        ends[digits(result.fmt)] = float((scale * result.size)[shown][-1]), colour
    artists.append(ax.axhline(1, color=REFERENCE, ls=":"))
    loglog(ax)
    label(ax, "time (days)", "error (mas)", title)
    name_ends(ax, {**ends, "1 mas": (1.0, REFERENCE)})
    return artists


def phase_costs(angle: np.ndarray, found: np.ndarray, drift: tuple[float, float], ax: Axes) -> list[Drawn]:
    """Draw the error of both drifts against a constant phase error: simulated without noise, and theory."""
    line = np.geomspace(angle.min(), angle.max(), 200)
    cost = np.array([theory.phase_error_cost(drift, a) for a in line])
    artists: list[Drawn] = []
    ends = {}
    for i, (colour, text) in enumerate(((OBSERVED, "geodetic\ndrift"), (SIGNAL, "frame\ndragging"))):
        artists += ax.plot(np.degrees(angle), np.abs(found[:, i]), "o", color=colour, label=text)
        artists += ax.plot(np.degrees(line), np.abs(cost[:, i]), color=VALID, label="theory" if i else None)
        ends[text] = float(abs(cost[-1, i])), colour
    artists.append(ax.axhline(1, color=REFERENCE, ls=":", label="1 mas a year"))
    loglog(ax)
    label(ax, "phase error (degrees)", "error of drift (mas a year)")
    name_ends(ax, {**ends, "1 mas a year": (1.0, REFERENCE)})
    return artists


def _points(spectrum: Spectrum, text: str, colour: str, ax: Axes) -> list[Drawn]:
    marker = "s" if colour == SIGNAL else "o"
    return list(ax.plot(spectrum.frequency, spectrum.density, marker, ms=3.5, color=colour, label=text))
