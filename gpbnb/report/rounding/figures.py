"""Figures of the chapter on rounding bounds: ``(result, ax)`` in, artists out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from gpbnb.arithmetic.named import digits
from gpbnb.arithmetic.rational import column_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.style import (
    OBSERVED,
    REFERENCE,
    REFUTED,
    VALID,
    bits_colour,
    label,
    line_styles,
    loglog,
    name,
    name_ends,
)
from gpbnb.report.rounding import theory
from gpbnb.report.rounding.experiment import Growth, Sawtooth, Trial


def sawtooth(result: Sawtooth, ax: Axes) -> list[Artist]:
    """Draw the relative error of one rounding against the number that is rounded."""
    fmt, beta = result.fmt, float(result.fmt.unit_roundoff)
    artists: list[Artist] = [*ax.plot(result.x, result.error, ".", ms=1.5, color=OBSERVED, label="error")]
    nearest = fmt.rounding is Rounding.NEAREST
    artists.append(ax.axhline(beta, color=VALID, label="bound"))
    artists.append(ax.axhline(beta / (1 + beta), color=REFERENCE, ls=":", label="largest error"))
    ax.set_xscale("log")
    ax.set_ylim(0, 0.13)
    title = rf"{fmt.rounding.value}, {digits(fmt)}: bound $\beta$, {'(8)' if nearest else '(13)'}"
    label(ax, "number $x$", "relative error", title)
    middle = float(np.sqrt(result.x.min() * result.x.max()))
    name(ax, r"bound $\beta$", (middle, beta), VALID, (0, 2))
    return artists


def worst_ratios(
    curves: Sequence[Sequence[Trial]], bound: str, ax: Axes, operands: str, bound_name: str
) -> list[Artist]:
    """Draw the largest error over a first-order bound against the number of operands, one curve for each format."""
    artists: list[Artist] = []
    ends = {bound_name: (1.0, REFUTED)}
    for (marker, _), curve in zip(line_styles(len(curves)), curves, strict=True):
        colour = bits_colour(curve[0].fmt)
        n = [len(trial.inputs[0]) for trial in curve]
        ratio = [trial.ratio(bound) for trial in curve]
        ends[digits(curve[0].fmt)] = ratio[-1], colour
        artists += ax.plot(n, ratio, marker=marker, color=colour, lw=0.8, label=digits(curve[0].fmt))
    artists.append(ax.axhline(1, color=REFUTED, ls="--", label=bound_name))
    label(ax, f"{operands} $n$", f"worst error / {bound_name}")
    name_ends(ax, ends)
    return artists


def growth(results: Sequence[Growth], ax: Axes) -> list[Artist]:
    """Draw median (points) and largest error (thin lines) of sums against length, with the bound and the √n law."""
    artists: list[Artist] = []
    ends = {}
    for (marker, colour), result in zip(line_styles(len(results)), results, strict=True):
        size, n = np.abs(result.errors), np.array(result.lengths)
        text = f"{result.kind},\n{result.fmt.rounding.value}"
        ends[text] = float(size[-1].max()), colour
        median, largest = np.median(size, axis=1), size.max(axis=1)
        seen, some = median > 0, largest > 0
        face = "none" if result.fmt.rounding is Rounding.CHOP else colour
        artists += ax.plot(n[seen], median[seen], marker, color=colour, mfc=face, label=text.replace("\n", " "))
        artists += ax.plot(n[some], largest[some], color=colour, lw=0.8)
    fmt, n = results[0].fmt, np.array(results[0].lengths)
    beta = fmt.unit_roundoff
    law = [theory.probabilistic_sum_factor(int(k), beta) / float(beta) for k in n]
    artists += ax.plot(n, n - 1, color=VALID, label="bound $n-1$")
    artists += ax.plot(n, law, color=REFUTED, ls="--", label=r"$\sqrt{n}$ law")
    loglog(ax)
    label(ax, "terms $n$", r"error of the sum / $\beta\sum|x_j|$")
    middle = len(n) // 2
    name(ax, "bound $n-1$", (float(n[middle]), float(n[middle] - 1)), VALID, (-6, 6))
    name(ax, r"$\sqrt{n}$ law", (float(n[1]), law[1]), REFUTED, (-4, 6))
    name_ends(ax, ends)
    return artists


def cancellation(trials: Sequence[Trial], ax: Axes) -> list[Artist]:
    """Draw the error of cancelling products over the norms of the factors, with (31) as printed and bound (32)."""
    norms = [column_sum_norm(t.inputs[0]) * column_sum_norm(t.inputs[1]) for t in trials]
    lost = np.array([float(norm / column_sum_norm(t.true)) for norm, t in zip(norms, trials, strict=True)])
    scaled = {
        bound: np.array([float(t.bounds[bound] / norm) for norm, t in zip(norms, trials, strict=True)])
        for bound in ("(31)", "(32)")
    }
    error = np.array([float(t.error / norm) for norm, t in zip(norms, trials, strict=True)])
    order, seen = np.argsort(lost), error > 0
    artists: list[Artist] = [*ax.plot(lost[seen], error[seen], "o", color=OBSERVED, alpha=0.6, label="error")]
    artists += ax.plot(lost[order], scaled["(31)"][order], color=REFUTED, ls="--", label="(31)")
    artists += ax.plot(lost[order], scaled["(32)"][order], color=VALID, label="(32)")
    loglog(ax)
    label(ax, r"cancellation $\|M_1\|\,\|M_2\| \,/\, \|M_1 M_2\|$", r"error / $\|M_1\|\,\|M_2\|$")
    ends = {"bound (32)": ("(32)", VALID), "(31) as\nprinted": ("(31)", REFUTED)}
    named = {text: (float(scaled[bound][order[-1]]), colour) for text, (bound, colour) in ends.items()}
    name_ends(ax, {**named, "error": (float(np.median(error[seen])), OBSERVED)})
    return artists


def pessimism(
    groups: Sequence[tuple[str, Sequence[Trial]]], bound: str, ax: Axes, operands: str, bound_name: str
) -> list[Artist]:
    """Draw the distribution of error / bound for groups of trials, as boxes from quartile to quartile."""
    ratios = [[trial.ratio(bound) for trial in trials] for _, trials in groups]
    boxes = ax.boxplot(
        ratios,
        tick_labels=[name for name, _ in groups],
        whis=(0, 100),
        patch_artist=True,
        boxprops={"facecolor": "#DCEBF5", "edgecolor": OBSERVED},
        medianprops={"color": OBSERVED, "lw": 2},
    )
    ax.axhline(1, color=VALID)
    ax.set_yscale("log")
    ax.set_ylim(top=6)
    label(ax, f"{operands} $n$", "error / bound")
    name(ax, bound_name, (len(groups) / 2 + 0.5, 1), VALID, (0, 2))
    return [artist for group in boxes.values() for artist in group]
