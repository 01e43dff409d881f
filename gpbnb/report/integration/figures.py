"""Figures of the chapter on digital integration: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.style import (
    BLACK,
    OBSERVED,
    OBSERVED_OTHERS,
    REFERENCE,
    REFUTED,
    TEXT,
    VALID,
    bits_colour,
    colours,
    label,
    legend,
    loglog,
    name_ends,
)
from gpbnb.report.display.style import name as write
from gpbnb.report.integration import theory
from gpbnb.report.integration.experiment import Accuracy, IntegrationErrors, RateSweep, WalkSweep

SERIES = (OBSERVED, OBSERVED_OTHERS[1], OBSERVED_OTHERS[3], OBSERVED_OTHERS[2])
"""Colours of series whose names are written in the same colour. They are dark enough to be read as text."""


def block_diagram(ax: Axes) -> list[Artist]:
    """Draw Fig. 1 of savage2016 from (1), (2) and (11): the same input integrated exactly and digitally."""
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set_xlim(0, 14.2)
    ax.set_ylim(0.2, 4.4)
    artists: list[Artist] = []

    def box(x: float, y: float, width: float, text: str) -> None:
        artists.append(ax.add_patch(Rectangle((x, y - 0.55), width, 1.1, fill=False, ec=OBSERVED, lw=1.4)))
        artists.append(ax.text(x + width / 2, y, text, ha="center", va="center", fontsize=TEXT))

    def arrow(*points: tuple[float, float]) -> None:
        for start, end in pairwise(points[:-1]):
            artists.extend(ax.plot(*zip(start, end, strict=True), color=BLACK, lw=1.1))
        style: dict[str, Any] = {
            "arrowstyle": "-|>",
            "mutation_scale": 12,
            "color": BLACK,
            "lw": 1.1,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        artists.append(ax.add_patch(FancyArrowPatch(points[-2], points[-1], **style)))

    def sign(x: float, y: float) -> None:
        artists.append(ax.add_patch(Circle((x, y), 0.26, fill=False, ec=BLACK, lw=1.1)))

    def text(x: float, y: float, words: str) -> None:
        artists.append(ax.text(x, y, words, ha="center", va="center", fontsize=TEXT))

    text(0.5, 3.95, "$n_{p1}$")
    arrow((0.1, 3.6), (1.34, 3.6))
    sign(1.6, 3.6)
    arrow((1.86, 3.6), (2.3, 3.6))
    box(2.3, 3.6, 1.1, r"$\int dt$")
    arrow((3.4, 3.6), (5.9, 3.6))
    text(4.8, 3.95, "$x_1$")
    # The feedback that makes white noise band-limited.
    arrow((4.2, 3.6), (4.2, 2.35), (3.4, 2.35))
    box(2.3, 2.35, 1.1, r"$\omega_{bw}$")
    arrow((2.3, 2.35), (1.6, 2.35), (1.6, 3.34))
    text(1.85, 3.1, "−")
    box(5.9, 3.6, 2.9, "exact integral\n" r"$\int x_1\,dt$")
    arrow((8.8, 3.6), (12.4, 3.6), (12.4, 2.56))
    text(10.4, 3.95, "$x_2$")
    arrow((5.0, 3.6), (5.0, 1.0), (5.7, 1.0))
    box(5.7, 1.0, 5.4, "trapezoidal rule, every $T$ s\n" r"$x_{3_n}=x_{3_{n-1}}+\frac{1}{2}(x_{1_n}+x_{1_{n-1}})T$")
    arrow((11.1, 1.0), (12.4, 1.0), (12.4, 2.04))
    text(11.7, 1.4, "$x_{3_n}$")
    sign(12.4, 2.3)
    text(12.7, 2.8, "−")
    text(12.7, 1.8, "+")
    arrow((12.66, 2.3), (14.1, 2.3))
    text(13.5, 2.65, "$e_n$")
    return artists


def accuracy(results: Mapping[str, Accuracy], ax: Axes) -> list[Artist]:
    """Draw errors of evaluations in units in the last place; results without a correct digit are at the top line."""
    artists: list[Artist] = []
    top = 2.0**53
    for (form, result), colour, marker in zip(results.items(), (REFUTED, VALID), ("x", "o"), strict=False):
        ulp = np.clip(result.ulp, 1e-2, top)
        artists += ax.plot(result.mu, ulp, marker, color=colour, ms=3, alpha=0.7, label=form, ls="none")
        fifth = len(result.mu) // 5
        up = -8 if ulp[fifth] == top else 14
        artists.append(write(ax, form, (float(result.mu[fifth]), float(ulp[fifth])), colour, (0, up)))
    artists.append(ax.axhline(top, color=REFERENCE, ls=":", label="no digit correct"))
    last = float(max(result.mu.max() for result in results.values()))
    artists.append(write(ax, "no digit correct", (last, top), REFERENCE, (0, 3), ha="right"))
    loglog(ax)
    ax.set_ylim(5e-3, 1e18)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "error (units in the last place)")
    return artists


def approximations(terms: int, ax: Axes) -> list[Artist]:
    """Draw the error of (39), and of the series with up to `terms` terms, relative to (35)."""
    mu = np.geomspace(0.01, 100, 600)
    exact, total = theory.walk_factor(mu), np.zeros_like(mu)
    artists: list[Artist] = []
    for k, (c, colour) in enumerate(zip(theory.series(terms), colours(terms, (REFUTED, *SERIES)), strict=True)):
        total = total + float(c) * mu ** (2 * k + 1)
        error = np.abs(np.sqrt(np.where(total > 0, total, np.nan) / exact) - 1)
        shown = np.where((error > 1e-8) & (error < 10), error, np.nan)  # below are rounding errors
        artists += ax.plot(mu, shown, color=colour, ls="-" if k else "--", label=f"{k + 1} terms" if k else "(39)")
        last = k + 1 == terms
        at = int(np.argmax(error > (1e-5 if k else 1e-4)))
        words = f"{k + 1}" + " terms" * last if k else "(39)"
        artists.append(write(ax, words, (float(mu[at]), float(error[at])), colour, (6, -2) if last else (-6, 2)))
    artists.append(ax.axvline(2 * np.pi, color=REFERENCE, ls=":", label=r"$\mu=2\pi$"))
    artists.append(write(ax, r"$2\pi$", (2 * np.pi, 2e-6), REFERENCE, (8, 0)))
    loglog(ax)
    ax.set_ylim(1e-6, 10)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "relative error")
    return artists


def powers(ax: Axes) -> list[Artist]:
    """Draw the powers of bandwidth and rate in (35), next to the constant powers that the abstract claims."""
    mu = np.geomspace(0.01, 100, 200)
    artists: list[Artist] = []
    for power, printed, quantity, up in zip(
        theory.exponents(mu), (0.5, -1.0), ("bandwidth", "iteration rate"), (-1, 1), strict=True
    ):
        artists += ax.plot(mu, power, color=VALID, label=quantity)
        artists.append(ax.axhline(printed, color=REFUTED, ls="--", lw=1.2))
        artists.append(write(ax, f"power of the {quantity}", (0.012, printed), VALID, (0, 5 * up), ha="left"))
        artists.append(write(ax, "abstract", (100, printed), REFUTED, (0, 4), ha="right"))
    ax.set_xscale("log")
    ax.set_ylim(-1.15, 0.85)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "power in (35)")
    return artists


def random_walk(result: WalkSweep, ax: Axes) -> list[Artist]:
    """Draw the simulated random walk at many μ, next to (35) and (39)."""
    line = np.geomspace(result.mu.min() / 1.5, result.mu.max() * 1.5, 300)
    artists: list[Artist] = [
        *ax.plot(line, np.sqrt(theory.walk_factor(line)), color=VALID, label="(35)"),
        *ax.plot(line, np.sqrt(line / 6), color=REFUTED, ls="--", lw=1.4, label="(39)"),
        *ax.plot(result.mu, np.sqrt(result.walk), "o", color=OBSERVED, label="simulation"),
    ]
    last, first = float(line[-1]), float(line[0])
    artists.append(write(ax, "(35)", (last, float(np.sqrt(theory.walk_factor(last)))), VALID, (0, -6), ha="right"))
    artists.append(write(ax, "(39)", (last / 4, float(np.sqrt(last / 24))), REFUTED, (-6, 4)))
    artists.append(write(ax, "simulation", (10 * first, float(np.sqrt(10 * first / 6))), OBSERVED, (-6, 6)))
    loglog(ax)
    ax.set_ylim(8e-3, 6)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "random walk per cycle\n" r"($\sigma_x T$)")
    return artists


def deviations(result: WalkSweep, ax: Axes) -> list[Artist]:
    """Draw the deviations of the observed variances from (35) and from (39), in standard errors."""
    against = result.deviations_from(result.mu / 6)
    seen = np.abs(against) < 6
    artists: list[Artist] = [
        ax.axhspan(-2, 2, color="#8080802B", lw=0),
        *ax.plot(result.mu, result.deviations(), "o", color=OBSERVED, label="from (35)"),
        *ax.plot(result.mu[seen], against[seen], "s", mfc="none", color=REFUTED, label="from (39)"),
    ]
    ax.set_xscale("log")
    ax.set_xlim(result.mu.min() / 1.5, result.mu.max() * 1.5)
    ax.set_ylim(-6.5, 6.5)
    edge = float(result.mu.min()) / 1.3
    artists.append(write(ax, "grey band: 95 % of all deviations", (edge, 2), REFERENCE, (0, 4), ha="left"))
    artists.append(write(ax, "dots: from (35)", (edge, -2), OBSERVED, (0, -4), ha="left"))
    artists.append(write(ax, "squares: from (39)", (edge, -2), REFUTED, (0, -20), ha="left"))
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "deviation\n(standard errors)")
    return artists


def build_up(runs: Sequence[IntegrationErrors], mu: float, ax: Axes) -> list[Artist]:
    """Draw the rms error against the number of cycles, for a first-order input.

    Parameters
    ----------
    runs : simulations of the trapezoidal rule and of a rectangular one, in this order.
    """
    artists: list[Artist] = []
    n = np.geomspace(1, max(run.n[-1] for run in runs), 200)
    unit = runs[0].process.sigma / runs[0].f_c
    walk = n * float(theory.walk_factor(mu))
    for run, marker, colour in zip(runs, "os", (OBSERVED, OBSERVED_OTHERS[1]), strict=True):
        observed = np.sqrt(run.variance) / unit
        artists += ax.plot(run.n, observed, marker, color=colour, label=run.rule.name.split(",")[0])
    legend(ax, handles=artists, loc="upper left")
    artists += ax.plot(n, np.sqrt(theory.error_variance(n, mu)), color=VALID, label="exact, trapezoidal")
    artists += ax.plot(n, np.sqrt(theory.rectangle_error_variance(n, mu)), color=VALID, label="exact, rectangular")
    artists += ax.plot(n, np.sqrt(walk), color=REFERENCE, ls=":", lw=1.4, label="random walk (35)")
    loglog(ax)
    title = rf"$\mu = {mu:g}$; green: theory; dotted: random walk only"
    label(ax, "cycles $n$", r"rms error ($\sigma_xT$)", title)
    return artists


def rules_first_order(rules: Sequence[str], ax: Axes) -> list[Artist]:
    """Draw the random walk of rules relative to the trapezoidal one, for a first-order input, against μ."""
    mu = np.geomspace(0.03, 100, 60)
    least = [theory.walk_rate(theory.first_order(1.0, one), 1.0) for one in mu.tolist()]
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    for rule, colour in zip(rules, colours(len(rules), SERIES), strict=True):
        rate = [theory.walk_rate(theory.first_order(1.0, one), 1.0, theory.RULES[rule]) for one in mu.tolist()]
        ratio = np.sqrt(np.array(rate) / least)
        artists += ax.plot(mu, ratio, color=colour, label=rule)
        ends[rule] = float(ratio[-1]), colour
    best = [theory.best_possible_rate(theory.first_order(1.0, one), 1.0) for one in mu.tolist()]
    bound = np.sqrt(np.array(best) / least)
    artists += ax.plot(mu, bound, color=REFERENCE, ls=":", label="scaled samples (lower bound)")
    ends["scaled samples"] = float(bound[-1]), REFERENCE
    ax.set_xscale("log")
    ax.set_ylim(0, 1.35)
    label(ax, r"$\mu=\omega_{bw}/f_c$ (rad)", "random walk relative\nto trapezoidal", "first-order input")
    name_ends(ax, ends)
    return artists


def rules_resonant(rules: Sequence[str], zeta: float, ax: Axes) -> list[Artist]:
    """Draw the random walk of rules for a resonant input, against the iteration rate over the natural frequency."""
    rate = np.geomspace(0.3, 30, 400)
    process = theory.resonant(1.0, 2 * np.pi, zeta)
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    for rule, colour in zip(rules, colours(len(rules), SERIES), strict=True):
        walk = [theory.walk_rate(process, f, theory.RULES[rule]) for f in rate.tolist()]
        artists += ax.plot(rate, np.sqrt(walk), color=colour, label=rule, lw=1.2)
        ends[rule] = float(np.sqrt(walk[-1])), colour
    loglog(ax)
    label(
        ax,
        "iteration rate over natural frequency, $f_c/f_0$",
        "random walk\n" r"($\sigma_x/\sqrt{f_0}$)",
        rf"resonant input, damping {zeta:g}",
    )
    name_ends(ax, ends)
    return artists


def _points_of(fmt: FloatFormat) -> dict[str, Any]:
    """Return the colour of a format, and open markers if it chops."""
    colour = bits_colour(fmt)
    return {"color": colour, "mfc": "none" if fmt.rounding is Rounding.CHOP else colour}


def errors_over_rate(result: RateSweep, ax: Axes) -> list[Artist]:
    """Draw discretization and rounding errors against the iteration rate: observed (points) and theory (lines)."""
    rates = np.geomspace(result.rates[0], result.rates[-1], 40)
    artists: list[Artist] = []
    artists += ax.plot(result.rates, result.discretization[0], "x", color=OBSERVED, label="discretization")
    artists += ax.plot(rates, result.theory(result.formats[0], rates)[0], color=VALID, lw=1)
    ends = {"discretization": (float(result.discretization[0][-1]), OBSERVED)}
    for i, (fmt, marker) in enumerate(zip(result.formats, "sD^v", strict=False)):
        style = _points_of(fmt)
        artists += ax.plot(result.rates, result.rounding[i], marker, label=f"rounding, {arithmetic(fmt)}", **style)
        ends[arithmetic(fmt)] = float(result.rounding[i][-1]), style["color"]
        artists += ax.plot(rates, result.theory(fmt, rates)[1], color=VALID, lw=1)
    loglog(ax)
    label(
        ax,
        "iteration rate $f_c$ (Hz)",
        "rms error\n" r"(unit of $x_1$ $\times$ s)",
        "discretization and rounding error",
    )
    name_ends(ax, ends)
    return artists


def totals(result: RateSweep, ax: Axes) -> list[Artist]:
    """Draw the total error against the iteration rate, and mark the best rate of each format with a star."""
    rates = np.geomspace(result.rates[0], result.rates[-1], 40)
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    for i, (fmt, marker) in enumerate(zip(result.formats, "sD^v", strict=False)):
        style = _points_of(fmt)
        artists += ax.plot(result.rates, result.total[i], marker, label=arithmetic(fmt), **style)
        ends[arithmetic(fmt)] = float(result.total[i][-1]), style["color"]
        artists += ax.plot(rates, result.theory(fmt, rates)[2], color=VALID, lw=1)
        best = theory.best_rate(result.omega_bw, result.duration, fmt)
        if rates[0] <= best <= rates[-1]:
            least = theory.two_errors(1.0, result.omega_bw, best, result.duration, fmt).total
            artists += ax.plot([best], [least], "*", color=style["color"], ms=14, mfc="none")
    loglog(ax)
    label(
        ax,
        "iteration rate $f_c$ (Hz)",
        "total error, rms\n" r"(unit of $x_1$ $\times$ s)",
        "total error; stars mark the best rate",
    )
    name_ends(ax, ends)
    return artists


def _best_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    """Return the best rate, or NaN if every rate loses the integral."""
    try:
        return theory.best_rate(omega_bw, duration, fmt)
    except ValueError:
        return float("nan")


def best_rates(omega_bw: float, durations: Mapping[str, float], precisions: Sequence[int], ax: Axes) -> list[Artist]:
    """Draw the best iteration rate against the number of bits, for several durations in s."""
    ends: dict[str, tuple[float, str]] = {}
    artists: list[Artist] = []
    for (duration, seconds), colour in zip(durations.items(), colours(len(durations), SERIES), strict=True):
        for rounding, style in ((Rounding.NEAREST, "-"), (Rounding.CHOP, ":")):
            rate = [_best_rate(omega_bw, seconds, FloatFormat(2, t, rounding)) for t in precisions]
            named: dict[str, Any] = {"label": duration} if style == "-" else {}
            artists += ax.plot(precisions, rate, style, color=colour, **named)
            if style == "-":
                ends[duration] = rate[-1], colour
    ax.set_yscale("log")
    label(ax, "wordlength $t$ (bits)", "best rate $f_c$ (Hz)", "solid: rounded; dotted: chopped")
    name_ends(ax, ends)
    return artists


def needed_bits(omega_bw: float, durations: Mapping[str, float], rates: Sequence[float], ax: Axes) -> list[Artist]:
    """Draw the bits at which the rounding error is a tenth of the discretization error, for durations in s."""
    ends: dict[str, tuple[float, str]] = {}
    artists: list[Artist] = []
    for (duration, seconds), colour in zip(durations.items(), colours(len(durations), SERIES), strict=True):
        for rounding, style in ((Rounding.NEAREST, "-"), (Rounding.CHOP, ":")):
            bits = [theory.needed_precision(omega_bw, f, seconds, 2, rounding) for f in rates]
            named: dict[str, Any] = {"label": duration} if style == "-" else {}
            artists += ax.plot(rates, bits, style, drawstyle="steps-mid", color=colour, **named)
            if style == "-":
                ends[duration] = float(bits[-1]), colour
    ax.set_xscale("log")
    ax.set_ylim(5, 60)
    label(ax, "iteration rate $f_c$ (Hz)", "bits needed", "solid: rounded; dotted: chopped")
    name_ends(ax, ends)
    return artists
