"""Figures of the chapter on digital integration: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.display.style import BOUND, COLOURS, OBSERVED, REFERENCE, STRICT, colours, label, legend, line_styles, loglog
from gpbnb.display.tables import arithmetic
from gpbnb.integration import theory
from gpbnb.integration.experiment import Accuracy, RateSweep, Simulation, Sweep


def block_diagram(ax: Axes) -> list[Artist]:
    """Fig. 1 of savage2016, drawn from (1), (2) and (11): the same input integrated truly and digitally."""
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set_xlim(0, 14.2)
    ax.set_ylim(0.2, 4.4)
    artists: list[Artist] = []

    def box(x: float, y: float, width: float, text: str) -> None:
        artists.append(ax.add_patch(Rectangle((x, y - 0.55), width, 1.1, fill=False, ec=OBSERVED, lw=1.4)))
        artists.append(ax.text(x + width / 2, y, text, ha="center", va="center", fontsize=9.5))

    def arrow(*points: tuple[float, float]) -> None:
        for start, end in pairwise(points[:-1]):
            artists.extend(ax.plot(*zip(start, end, strict=True), color=STRICT, lw=1.1))
        style: dict[str, Any] = {
            "arrowstyle": "-|>",
            "mutation_scale": 12,
            "color": STRICT,
            "lw": 1.1,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        artists.append(ax.add_patch(FancyArrowPatch(points[-2], points[-1], **style)))

    def sign(x: float, y: float) -> None:
        artists.append(ax.add_patch(Circle((x, y), 0.26, fill=False, ec=STRICT, lw=1.1)))

    def text(x: float, y: float, words: str) -> None:
        artists.append(ax.text(x, y, words, ha="center", va="center", fontsize=10.5))

    text(0.5, 3.95, "$n_{p1}$")
    arrow((0.1, 3.6), (1.34, 3.6))
    sign(1.6, 3.6)
    arrow((1.86, 3.6), (2.3, 3.6))
    box(2.3, 3.6, 1.1, r"$\int dt$")
    arrow((3.4, 3.6), (6.2, 3.6))
    text(4.8, 3.95, "$x_1$")
    # The feedback that makes white noise band-limited.
    arrow((4.2, 3.6), (4.2, 2.35), (3.4, 2.35))
    box(2.3, 2.35, 1.1, r"$\omega_{bw}$")
    arrow((2.3, 2.35), (1.6, 2.35), (1.6, 3.34))
    text(1.85, 3.1, "−")
    box(6.2, 3.6, 2.6, "true integral\n" r"$\int x_1\,dt$")
    arrow((8.8, 3.6), (12.0, 3.6), (12.0, 2.56))
    text(10.4, 3.95, "$x_2$")
    arrow((5.4, 3.6), (5.4, 1.0), (6.2, 1.0))
    box(6.2, 1.0, 4.3, "trapezoidal, every $T$ s\n" r"$x_{3_n}=x_{3_{n-1}}+\frac{1}{2}(x_{1_n}+x_{1_{n-1}})T$")
    arrow((10.5, 1.0), (12.0, 1.0), (12.0, 2.04))
    text(11.2, 1.35, "$x_{3_n}$")
    sign(12.0, 2.3)
    text(12.3, 2.8, "−")
    text(12.3, 1.8, "+")
    arrow((12.26, 2.3), (13.9, 2.3))
    text(13.2, 2.65, "$e_n$")
    return artists


def accuracy(results: Mapping[str, Accuracy], ax: Axes) -> list[Artist]:
    """Errors of evaluations in units in the last place; at the top edge what has no right digit, or none at all."""
    artists: list[Artist] = []
    top = 2.0**53
    for (name, result), colour, marker in zip(results.items(), (BOUND, OBSERVED), ("x", "o"), strict=False):
        ulp = np.clip(result.ulp, 1e-2, top)
        artists += ax.plot(result.mu, ulp, marker, color=colour, ms=3, alpha=0.7, label=name, ls="none")
    artists.append(ax.axhline(top, color=REFERENCE, ls=":", label="no digit right"))
    loglog(ax)
    ax.set_ylim(5e-3, 1e18)
    legend(ax, fontsize=9)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "error (units in the last place)")
    return artists


def approximations(terms: int, ax: Axes) -> list[Artist]:
    """Errors of (39), and of the series with up to `terms` terms, relative to (35)."""
    mu = np.geomspace(0.1, 20, 300)
    exact, total = theory.walk_factor(mu), np.zeros_like(mu)
    artists: list[Artist] = []
    for k, (c, colour) in enumerate(zip(theory.series(terms), colours(terms, (STRICT, *COLOURS)), strict=True)):
        total = total + float(c) * mu ** (2 * k + 1)
        error = np.abs(np.sqrt(np.where(total > 0, total, np.nan) / exact) - 1)
        artists += ax.plot(mu, error, color=colour, label=f"{k + 1} terms" if k else "(39)")
    artists.append(ax.axvline(2 * np.pi, color=REFERENCE, ls=":", label=r"$\mu=2\pi$"))
    loglog(ax)
    ax.set_ylim(1e-6, 10)
    legend(ax, fontsize=9)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "error relative to (35) (no unit)")
    return artists


def powers(ax: Axes) -> list[Artist]:
    """Powers with which the random walk goes with bandwidth and rate, beside those of the abstract."""
    mu = np.geomspace(0.01, 100, 200)
    artists: list[Artist] = []
    for power, printed, colour, name in zip(
        theory.exponents(mu), (0.5, -1.0), COLOURS, ("bandwidth", "iteration rate"), strict=False
    ):
        artists += ax.plot(mu, power, color=colour, label=f"of the {name}")
        artists.append(ax.axhline(printed, color=colour, ls="--", lw=1))
    ax.set_xscale("log")
    ax.set_ylim(-1.1, 0.8)
    legend(ax, fontsize=9, title="dashed: abstract", title_fontsize=9)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "power in (35) (no unit)")
    return artists


def random_walk(result: Sweep, ax: Axes) -> list[Artist]:
    """Random walk observed at many μ, beside (35) and (39)."""
    line = np.geomspace(result.mu.min() / 1.5, result.mu.max() * 1.5, 300)
    artists: list[Artist] = [
        *ax.plot(line, np.sqrt(theory.walk_factor(line)), color=BOUND, label="(35), exact"),
        *ax.plot(line, np.sqrt(line / 6), color=STRICT, ls="--", lw=1, label=r"(39), small $\mu$"),
        *ax.plot(result.mu, np.sqrt(result.walk), "o", color=OBSERVED, label="simulation"),
    ]
    loglog(ax)
    ax.set_ylim(8e-3, 6)
    legend(ax)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", r"$\sigma_{e_{rw}}\,/\,\sigma_x\sqrt{T}$ (no unit)")
    return artists


def deviations(result: Sweep, ax: Axes) -> list[Artist]:
    """The same observations as deviations from the exact variance, in standard errors."""
    artists: list[Artist] = [
        ax.axhspan(-2, 2, color="#E8EEF4", label="95 % of all"),
        *ax.plot(result.mu, result.deviations(), "o", color=OBSERVED, label="from the exact variance"),
    ]
    against = result.deviations_from(result.mu / 6)
    seen = np.abs(against) < 6
    artists += ax.plot(result.mu[seen], against[seen], "s", mfc="none", color=STRICT, label="from (39)")
    ax.set_xscale("log")
    ax.set_xlim(result.mu.min() / 1.5, result.mu.max() * 1.5)
    ax.set_ylim(-6, 9)
    legend(ax, loc="upper left", fontsize=9)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "deviation (standard errors)")
    return artists


def build_up(runs: Sequence[Simulation], mu: float, ax: Axes) -> list[Artist]:
    """Standard deviation of the error against the number of cycles, for an input of first order."""
    artists: list[Artist] = []
    n = np.geomspace(1, max(run.n[-1] for run in runs), 200)
    unit = runs[0].process.sigma / runs[0].f_c
    walk = n * float(theory.walk_factor(mu))
    for run, (marker, colour) in zip(runs, line_styles(len(runs)), strict=True):
        artists += ax.plot(run.n, np.sqrt(run.variance) / unit, marker, color=colour, label=run.rule.name)
    artists += ax.plot(n, np.sqrt(theory.error_variance(n, mu)), color=BOUND, label="exact, trapezoidal")
    artists += ax.plot(n, np.sqrt(theory.rectangle_error_variance(n, mu)), color=BOUND, ls=":", label="rectangular")
    artists += ax.plot(n, np.sqrt(walk), color=STRICT, ls="--", lw=1, label="random walk (35)")
    loglog(ax)
    low = float(min(np.sqrt(run.variance).min() for run in runs)) / unit
    ax.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(np.sqrt(walk[-1])) + 0.5))
    legend(ax, fontsize=8.5)
    label(ax, "cycles $n$", r"error, rms $/\,\sigma_xT$ (no unit)", rf"$\mu = {mu:g}$")
    return artists


def rules_first_order(rules: Sequence[str], ax: Axes) -> list[Artist]:
    """Random walk of rules over that of the trapezoidal one, for an input of first order, against μ."""
    mu = np.geomspace(0.03, 100, 60)
    least = [theory.walk_rate(theory.first_order(1.0, one), 1.0) for one in mu.tolist()]
    artists: list[Artist] = []
    for name, colour in zip(rules, colours(len(rules)), strict=True):
        rate = [theory.walk_rate(theory.first_order(1.0, one), 1.0, theory.RULES[name]) for one in mu.tolist()]
        artists += ax.plot(mu, np.sqrt(np.array(rate) / least), color=colour, label=name)
    best = [theory.best_possible_rate(theory.first_order(1.0, one), 1.0) for one in mu.tolist()]
    artists += ax.plot(mu, np.sqrt(np.array(best) / least), color=STRICT, ls=":", label="scaled samples (bound)")
    ax.set_xscale("log")
    ax.set_ylim(0, 1.5)
    legend(ax, fontsize=8.5, loc="lower left")
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", r"$\sigma_{e_{rw}}$ / trapezoidal (no unit)", "first order")
    return artists


def rules_resonant(rules: Sequence[str], zeta: float, ax: Axes) -> list[Artist]:
    """Random walk for a resonant input against the iteration rate over the natural frequency."""
    rate = np.geomspace(0.3, 30, 400)
    process = theory.resonant(1.0, 2 * np.pi, zeta)
    artists: list[Artist] = []
    for name, colour in zip(rules, colours(len(rules)), strict=True):
        walk = [theory.walk_rate(process, f, theory.RULES[name]) for f in rate.tolist()]
        artists += ax.plot(rate, np.sqrt(walk), color=colour, label=name, lw=1.2)
    loglog(ax)
    label(
        ax,
        "$f_c$ / natural frequency $f_0$ (no unit)",
        r"$\sigma_{e_{rw}}\sqrt{f_0}\,/\,\sigma_x$ (no unit)",
        rf"resonant, $\zeta = {zeta:g}$",
    )
    return artists


def errors_over_rate(result: RateSweep, ax: Axes) -> list[Artist]:
    """Discretization and rounding errors over the iteration rate, observed (points) beside theory (lines)."""
    rates = np.geomspace(result.rates[0], result.rates[-1], 40)
    artists: list[Artist] = []
    artists += ax.plot(result.rates, result.discretization[0], "o", color=REFERENCE, label="discretization")
    artists += ax.plot(rates, result.theory(result.formats[0], rates)[0], color=REFERENCE)
    for i, (fmt, (marker, colour)) in enumerate(
        zip(result.formats, line_styles(len(result.formats), "sD^vo"), strict=True)
    ):
        artists += ax.plot(result.rates, result.rounding[i], marker, color=colour, label=f"rounding, {arithmetic(fmt)}")
        artists += ax.plot(rates, result.theory(fmt, rates)[1], color=colour, lw=1)
    loglog(ax)
    ax.set_ylim(result.rounding.min() / 300, result.discretization.max() * 3)
    legend(ax, fontsize=8, loc="lower left")
    label(ax, "iteration rate $f_c$ (Hz)", r"error, rms (unit of $x_1$ $\times$ s)")
    return artists


def totals(result: RateSweep, ax: Axes) -> list[Artist]:
    """Both errors together, and the best rate (star) of each format."""
    rates = np.geomspace(result.rates[0], result.rates[-1], 40)
    artists: list[Artist] = []
    for i, (fmt, (marker, colour)) in enumerate(
        zip(result.formats, line_styles(len(result.formats), "sD^vo"), strict=True)
    ):
        artists += ax.plot(result.rates, result.total[i], marker, color=colour, label=arithmetic(fmt))
        artists += ax.plot(rates, result.theory(fmt, rates)[2], color=colour, lw=1)
        best = theory.best_rate(result.omega_bw, result.duration, fmt)
        if rates[0] <= best <= rates[-1]:
            least = theory.two_errors(1.0, result.omega_bw, best, result.duration, fmt).total
            artists += ax.plot([best], [least * 1.6], "*", color=colour, ms=12, mfc="none")
    loglog(ax)
    legend(ax, fontsize=8, loc="lower left")
    label(ax, "iteration rate $f_c$ (Hz)", r"total error, rms (unit of $x_1$ $\times$ s)")
    return artists


def _best_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    """The best rate; NaN where no rate saves the integral."""
    try:
        return theory.best_rate(omega_bw, duration, fmt)
    except ValueError:
        return float("nan")


def best_rates(omega_bw: float, durations: Mapping[str, float], precisions: Sequence[int], ax: Axes) -> list[Artist]:
    """The best iteration rate against the number of bits, for several durations in s."""
    artists: list[Artist] = []
    for (name, duration), colour in zip(durations.items(), colours(len(durations)), strict=True):
        for rounding, style in ((Rounding.NEAREST, "-"), (Rounding.CHOP, ":")):
            rate = [_best_rate(omega_bw, duration, FloatFormat(2, t, rounding)) for t in precisions]
            named: dict[str, Any] = {"label": name} if style == "-" else {}
            artists += ax.plot(precisions, rate, style, color=colour, **named)
    ax.set_yscale("log")
    legend(ax, fontsize=9, title="rounded (dotted: chopped)", title_fontsize=9)
    label(ax, "wordlength $t$ (bits)", "best rate $f_c$ (Hz)")
    return artists


def needed_bits(omega_bw: float, durations: Mapping[str, float], rates: Sequence[float], ax: Axes) -> list[Artist]:
    """Bits with which rounding is a tenth of the discretization error, against the rate, for durations in s."""
    artists: list[Artist] = []
    for (name, duration), colour in zip(durations.items(), colours(len(durations)), strict=True):
        for rounding, style in ((Rounding.NEAREST, "-"), (Rounding.CHOP, ":")):
            bits = [theory.needed_precision(omega_bw, f, duration, 2, rounding) for f in rates]
            named: dict[str, Any] = {"label": name} if style == "-" else {}
            artists += ax.plot(rates, bits, style, drawstyle="steps-mid", color=colour, **named)
    ax.set_xscale("log")
    ax.set_ylim(5, 75)
    legend(ax, fontsize=9, title="rounded (dotted: chopped)", title_fontsize=9)
    label(ax, "iteration rate $f_c$ (Hz)", "bits for rounding ≤ 0.1 discretization")
    return artists
