"""Figures of the chapters on the year of Gravity Probe B: results in, artists out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from gpbnb.arithmetic.named import BINARY32, BINARY64, arithmetic
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.display.style import (
    BLACK,
    OBSERVED,
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
from gpbnb.report.gravity_probe_b.summary import DRIFT, YearAnswer, binary_digits
from gpbnb.report.gravity_probe_b.year import Year

_QUANTITIES = {
    "drift": "error of the drift angle (mas)",
    "rate": "error of the drift rate (mas/yr)",
    "gain": "relative error of the gain",
    "covariance": "relative error of the covariance",
}


class Limit(NamedTuple):
    """A bound to draw beside the errors: its name, and its value after each of some steps or after all of them."""

    name: str
    steps: ArrayLike
    values: ArrayLike
    holds: bool = False


def years(
    runs: Sequence[Year], quantity: str, ax: Axes, tolerance: float | None = None, limits: Sequence[Limit] = ()
) -> list[Artist]:
    """Draw the error of one quantity against the step, one curve for each run, with bounds.

    Parameters
    ----------
    quantity : "drift" or "rate", the larger of two errors; "gain" or "covariance", norms.
    tolerance : tolerance to draw as a line, in the unit of the quantity.
    limits : at most two that fail, and any number that hold.
    """
    if quantity not in _QUANTITIES:
        raise ValueError(f"got quantity {quantity!r}; needed one of {', '.join(_QUANTITIES)}")
    artists: list[Artist] = []
    ends: dict[str, tuple[float, str]] = {}
    for run in runs:
        values = np.abs(getattr(run, quantity))
        if values.ndim > 1:
            values = values.max(axis=1)
        if run.case.fmt is None:
            raise ValueError(
                "got the reference among the runs; needed only rounded runs, because the reference has no error"
            )
        seen, colour, name = values > 0, bits_colour(run.case.fmt), _name(run)
        face = "none" if run.case.rounding is Rounding.CHOP else colour
        artists += ax.plot(run.steps[seen], values[seen], "o-", color=colour, mfc=face, lw=0.8, label=name)
        ends[name] = float(values[seen][-1]), colour
    broken = iter(("--", "-."))
    for limit in limits:
        values = np.broadcast_to(limit.values, np.shape(limit.steps))
        colour = VALID if limit.holds else REFUTED
        artists += ax.plot(limit.steps, values, color=colour, ls="-" if limit.holds else next(broken), label=limit.name)
        ends[limit.name] = float(values[-1]), colour
    if tolerance is not None:
        artists.append(ax.axhline(tolerance, color=REFERENCE, ls=":", label="tolerance"))
        ends["tolerance"] = tolerance, REFERENCE
    loglog(ax)
    label(ax, "step $k$", _QUANTITIES[quantity])
    name_ends(ax, ends)
    return artists


def _name(run: Year) -> str:
    fmt = run.case.fmt
    if fmt is None:
        return "reference"
    return arithmetic(fmt) + ("" if run.case.form is Form.HUNG else f", {run.case.form}")


def answer_line(found: Sequence[YearAnswer], ax: Axes) -> list[Artist]:
    """Draw the answers of the front page over bits, one line for each tolerance, and ring the answer to the title."""
    own, simulated, formula, years, every = (
        next(each for each in found if each.source.startswith(source))
        for source in ("Report, own", "The same", "Report, for", "300", "Every")
    )
    fewest, answer, enough = (float(each.bits or 0) for each in (simulated, years, every))
    artists: list[Artist] = []
    for height, printed, seen in ((1, own, fewest), (0, formula, answer)):
        places = [binary_digits(t) for t in printed.decimal]
        artists += ax.plot(places, [height] * 2, "o", mfc="none", mec=REFUTED, ms=9, mew=1.5)
        artists += ax.plot([seen], [height], "o", color=OBSERVED, ms=8)
        marks = [*((place, f"{t} digits", REFUTED) for place, t in zip(places, printed.decimal, strict=True))]
        for place, words, colour in [*marks, (seen, f"{seen:.0f} bits", OBSERVED)]:
            side = "right" if place < BINARY32.precision else "center" if height == 0 else "left"
            artists.append(name(ax, words, (place, height), colour, (0, 11), ha=side))
    (every_mark,) = ax.plot([enough], [0], "|", color=VALID, ms=16, mew=3)
    artists.append(every_mark)
    artists.append(name(ax, f"{enough:.0f} bits", (enough, 0), VALID, (0, -22), ha="center"))
    artists += ax.plot([answer], [0], "o", mfc="none", mec=BLACK, ms=18, mew=2)
    for word, fmt in (("binary32", BINARY32), ("binary64", BINARY64)):
        artists.append(ax.axvline(fmt.precision, color=REFERENCE, ls=":"))
        artists.append(name(ax, word, (fmt.precision, -0.75), REFERENCE, (4, 0)))
    for line, word in zip((artists[0], artists[1], every_mark), ("report", "simulated", "every record"), strict=True):
        line.set_label(word)
    ax.set(xlim=(12, 69), ylim=(-0.9, 2.5), yticks=[1, 0], yticklabels=[f"{DRIFT:,} mas", "1 mas"])
    ax.set_xticks(range(20, 70, 10))
    legend(ax, loc="upper right", ncols=3)
    label(ax, "bits", "allowed")
    return artists
