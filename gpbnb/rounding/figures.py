"""Figures of the chapter on rounding bounds: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.arithmetic.formats import Rounding
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.display.style import BOUND, OBSERVED, OBSERVED_OTHERS, REFERENCE, STRICT, label, legend, line_styles, loglog
from gpbnb.display.tables import digits
from gpbnb.rounding import theory
from gpbnb.rounding.experiment import Growth, Sawtooth, Trial


def sawtooth(result: Sawtooth, ax: Axes) -> list[Artist]:
    """Relative error of one rounding against the number that is rounded."""
    fmt, beta = result.fmt, float(result.fmt.unit_roundoff)
    artists: list[Artist] = [*ax.plot(result.x, result.error, ".", ms=1.5, color=OBSERVED, label="error")]
    name = "(8)" if fmt.rounding is Rounding.NEAREST else "(13)"
    artists.append(ax.axhline(beta, color=BOUND, label=f"unit roundoff, {name}"))
    if fmt.rounding is Rounding.NEAREST:
        sharp = beta / (1 + beta)
        artists.append(ax.axhline(sharp, color=STRICT, ls=":", label=r"sharp, $\beta/(1+\beta)$"))
    ax.set_xscale("log")
    ax.set_ylim(0, 1.55 * beta)
    legend(ax, loc="upper right")
    label(ax, "number $x$ (no unit)", "relative error (no unit)", f"{fmt.rounding.value}, {digits(fmt)}")
    return artists


def worst_ratios(
    curves: Sequence[Sequence[Trial]], bound: str, ax: Axes, operands: str, bound_name: str
) -> list[Artist]:
    """Largest error over a first-order bound, against the number of operands, a curve a format."""
    artists: list[Artist] = []
    for (marker, colour), curve in zip(line_styles(len(curves)), curves, strict=True):
        n = [len(trial.inputs[0]) for trial in curve]
        ratio = [trial.ratio(bound) for trial in curve]
        name = digits(curve[0].fmt)
        artists += ax.plot(n, ratio, marker=marker, color=colour, lw=0.8, label=name)
    artists.append(ax.axhline(1, color=BOUND, label="bound"))
    legend(ax)
    label(ax, f"{operands} $n$", f"worst error / {bound_name} (no unit)")
    return artists


def growth(results: Sequence[Growth], ax: Axes) -> list[Artist]:
    """Median (points) and largest error (thin lines) of sums of ever more terms, beside both laws."""
    artists: list[Artist] = []
    for (marker, colour), result in zip(line_styles(len(results)), results, strict=True):
        size, n = np.abs(result.errors), np.array(result.lengths)
        name = f"{result.kind}, {result.fmt.rounding.value}"
        artists += ax.plot(n, np.median(size, axis=1), marker, color=colour, label=name)
        artists += ax.plot(n, size.max(axis=1), color=colour, lw=0.8)
    fmt, n = results[0].fmt, np.array(results[0].lengths)
    beta = fmt.unit_roundoff
    law = [theory.probabilistic_sum_factor(int(k), beta) / float(beta) for k in n]
    artists += ax.plot(n, n - 1, color=BOUND, label="bound $n-1$")
    artists += ax.plot(n, law, color=STRICT, ls="--", label=r"$\sqrt{n}$ law, fails in 1 %")
    loglog(ax)
    legend(ax, fontsize=8.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    label(ax, "terms $n$", r"error of the sum / $\beta\sum|x_j|$ (no unit)")
    return artists


def cancellation(trials: Sequence[Trial], ax: Axes) -> list[Artist]:
    """Error of products that cancel, over what (31) says and over the bound (32)."""
    norms = [column_sum_norm(t.inputs[0]) * column_sum_norm(t.inputs[1]) for t in trials]
    lost = [float(norm / column_sum_norm(t.true)) for norm, t in zip(norms, trials, strict=True)]
    artists: list[Artist] = []
    for bound, colour, marker in (("(31)", OBSERVED, "o"), ("(32)", OBSERVED_OTHERS[0], "s")):
        points = [(x, t.ratio(bound)) for x, t in zip(lost, trials, strict=True) if t.error]
        artists += ax.plot(*zip(*points, strict=True), marker, color=colour, label=f"error / {bound}", alpha=0.6)
    artists.append(ax.axhline(1, color=BOUND, label="bound"))
    loglog(ax)
    legend(ax)
    label(ax, r"cancellation $\|M_1\|\,\|M_2\| \,/\, \|M_1 M_2\|$ (no unit)", "error / bound (no unit)")
    return artists


def pessimism(
    groups: Sequence[tuple[str, Sequence[Trial]]], bound: str, ax: Axes, operands: str, bound_name: str
) -> list[Artist]:
    """Distribution of error over bound for groups of trials, as boxes from quartile to quartile."""
    ratios = [[trial.ratio(bound) for trial in trials] for _, trials in groups]
    boxes = ax.boxplot(
        ratios,
        tick_labels=[name for name, _ in groups],
        whis=(0, 100),
        patch_artist=True,
        boxprops={"facecolor": "#DCEBF5", "edgecolor": OBSERVED},
        medianprops={"color": OBSERVED, "lw": 2},
    )
    ax.axhline(1, color=BOUND)
    ax.set_yscale("log")
    ax.axhline(0.1, color=REFERENCE, lw=0.6, ls=":")
    label(ax, f"{operands} $n$", f"error / {bound_name} (no unit)")
    return [artist for group in boxes.values() for artist in group]
