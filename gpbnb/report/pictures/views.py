"""The pictures of the book: their inputs, their data from the package, and the figures that stand for them on paper."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.display import style
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.model import YEAR as STEPS
from gpbnb.report.gravity_probe_b.summary import DRIFT
from gpbnb.report.measurement import YEAR
from gpbnb.report.pictures.operations import STEP
from gpbnb.report.pictures.picture import Input, Picture, short_number
from gpbnb.report.rolling import theory

TOLERANCE = 1
"""Tolerance of the drift rate, mas a year."""
INTERVAL = int(YEAR) // STEPS
"""Seconds between two steps of the filter."""
_RULES = ("to nearest", "chopped")


# -- rounding on a number line -------------------------------------------------------------------


def _spacings() -> Figure:
    fig, (ax,) = style.figure(height=2.2)
    formats = {"1 decimal digit": FloatFormat(10, 1), "2 bits": FloatFormat(2, 2), "3 bits": FloatFormat(2, 3)}
    for height, (words, fmt) in enumerate(formats.items()):
        numbers = sorted({float(fmt.round(value)) for value in np.geomspace(1, 16, 600)} - {20.0})
        ax.hlines(height, 1, 16, color=style.REFERENCE, lw=0.8)
        ax.plot(numbers, [height] * len(numbers), "|", ms=14, color=style.OBSERVED)
        style.name(ax, words, (1, height), style.BLACK, (0, 9), ha="left")
    ax.set_ylim(-0.6, 2.9)
    ax.set_xlim(0.6, 16.4)
    ax.grid(visible=False)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    style.label(ax, "number $x$", "")
    return fig


NUMBER_LINE = Picture(
    id="numberline",
    title="Rounding a number",
    inputs=(
        Input("base", "Base", 0, 2, choices=("2", "10", "16")),
        Input("t", "Digits t", 1, 12, (1, 6), whole=True),
        Input("chop", "Rounding", 0, 1, choices=_RULES),
        Input("x", "Number x", 1e-6, 1e6, (1, 10)),
    ),
    start={"base": "10", "t": "1", "chop": "to nearest", "x": "2.4"},
    sentence="In {digits}, {x} becomes {written} = {rounded}: a relative error of {error}, which is {share} β.",
    caption="Move x with its slider, or drag in the lower graph. The upper graph enlarges the shaded part of the lower "
    "one. The lower graph covers one power of the base on a logarithmic axis; its horizontal line is β, which no "
    "relative error exceeds. From two digits on, the error is largest just above a power of the base, where numbers "
    "are small and the gaps between them have just widened.",
    data=dict,
    still=_spacings,
    alt="Three number lines from 1 to 16. The numbers of one decimal digit are 1 apart up to 10 and then 10 apart. "
    "The gaps between the numbers of 2 and of 3 bits double at 2, 4 and 8.",
)


# -- a year in t bits ----------------------------------------------------------------------------


@cache
def _runs() -> list[year.Year]:
    found = [run for run in year.load() if run.case.model == year.MODELS[0] and run.case.base == 2]
    return sorted((run for run in found if run.case.form is Form.HUNG), key=lambda run: run.case.precision)


def year_data() -> dict[str, Any]:
    """Return the drift of a year and the stored runs of Hung's form in binary formats, with their errors."""
    runs = _runs()
    exponent = math.floor(math.log2(DRIFT)) + 1
    return {
        "tolerance": TOLERANCE,
        "interval": INTERVAL,
        "drift": DRIFT,
        "step": short_number(DRIFT * INTERVAL / YEAR),
        "exponent": exponent,
        "angle_bound": 2**exponent,
        "steps": [int(step) for step in runs[0].steps],
        "runs": [
            {
                "t": run.case.precision,
                "chop": int(run.case.rounding is Rounding.CHOP),
                "errors": [
                    [short_number(error, 3) for error in np.abs(each).max(axis=1)] for each in (run.rate, run.drift)
                ],
            }
            for run in runs
        ],
    }


def _year_still() -> Figure:
    """Draw the error of the drift rate against the step, one curve for each of some runs."""
    fig, (ax,) = style.figure(height=4.2)
    ends: dict[str, tuple[float, str]] = {}
    for run in _runs():
        if run.case.rounding is Rounding.NEAREST and run.case.precision in (18, 24, 32, 40) and run.case.fmt:
            values, colour = np.abs(run.rate).max(axis=1), style.bits_colour(run.case.fmt)
            ax.plot(run.steps[values > 0], values[values > 0], "o-", color=colour, lw=0.8)
            ends[arithmetic(run.case.fmt)] = float(values[-1]), colour
    ax.axhline(TOLERANCE, color=style.REFERENCE, ls=":")
    style.loglog(ax)
    style.label(ax, "step $k$", "error of the drift rate (mas/yr)")
    style.name_ends(ax, ends | {"tolerance": (TOLERANCE, style.REFERENCE)})
    return fig


A_YEAR = Picture(
    id="year",
    title="A year of filtering",
    inputs=(
        Input("t", "Bits t", 14, 53, (14, 53), whole=True),
        Input("chop", "Rounding", 0, 1, choices=_RULES),
        Input("quantity", "Error shown", 0, 1, choices=("drift rate", "drift angle")),
    ),
    start={"t": "24", "chop": "to nearest", "quantity": "drift rate"},
    sentence="{stored}With {bits} bits, the error of the {name} {when}. At the end of the year it is {end} {unit}. "
    "{place}.",
    caption="Above, one run of the filter with circles at its checkpoints, and the other stored runs in grey. The "
    "number at the end of each curve gives its bits. Below, what one step adds to a drift angle, beside the last place "
    "of that angle. Short grey lines mark the last place for the other runs.",
    data=year_data,
    still=_year_still,
    alt="Error of the drift rate over a year, on logarithmic axes, for 18, 24, 32 and 40 bits. More bits give smaller "
    "errors; those with 18 and 24 bits end above the tolerance of one milliarcsecond a year.",
)


# -- roll and deroll -----------------------------------------------------------------------------

MOST_PHASE = 36000
"""Largest phase error, arcseconds."""


def roll_data() -> dict[str, Any]:
    """Return the noise level, the drifts, the error without rolling, and the length of the record."""
    return {
        "level": short_number(theory.LEVEL),
        "year": YEAR,
        "interval": theory.INTERVAL,
        "unrolled": short_number(theory.drift_error_unrolled(theory.LEVEL, at_rest=True)),
        "drifts": theory.DRIFTS,
        "tolerance": TOLERANCE,
        "most_phase": MOST_PHASE,
    }


def _roll_still() -> Figure:
    fig, (ax,) = style.figure(height=3.4)
    f = np.geomspace(1 / YEAR, 0.5 / theory.INTERVAL, 100)
    ax.plot(f, theory.flicker_density(theory.LEVEL, f, theory.INTERVAL), color=style.VALID)
    style.loglog(ax)
    periods = {"600 s, reports": theory.PERIOD, "77.5 s, flown": theory.PERIOD_FLOWN}
    marks = {"not rolled": 1 / YEAR, **{words: 1 / period for words, period in periods.items()}}
    shifts = ((10.0, 2.0), (-10.0, -2.0), (-10.0, 0.0))
    for (words, at), shift in zip(marks.items(), shifts, strict=True):
        height = float(theory.flicker_density(theory.LEVEL, at, theory.INTERVAL))
        ax.plot([at], [height], "o", color=style.OBSERVED, ms=7)
        style.name(ax, words, (at, height), style.OBSERVED, shift)
    style.label(ax, "frequency (Hz)", "noise (mas²/Hz)")
    return fig


DEROLL = Picture(
    id="roll",
    title="Roll and deroll",
    inputs=(
        Input("period", "Roll period (s)", 20, 1e6, (20, 1e6), log=True),
        Input("phase", "Error of the phase (arcseconds)", 1, MOST_PHASE, (1, MOST_PHASE), log=True),
    ),
    start={"period": "77.5", "phase": "31"},
    sentence="Rolling in {period} s moves the drift to a density of {density} mas²/Hz. Its standard error falls from "
    "{unrolled} to {rolled} mas a year, by a factor of {gain}. A phase that is wrong by {phase} arcseconds adds a "
    "false drift of {across} mas a year.",
    caption="Above, rolling moves the drift to the right, where 1/f noise is weak. Below, the deroll brings it back, "
    "and an error of the roll angle turns a small part of the large drift into the direction of the small one. The "
    "roll period changes only the upper graph, and the phase error only the lower one.",
    data=roll_data,
    still=_roll_still,
    alt="Density of the samples of 1/f noise against frequency on logarithmic axes. A drift that is not rolled lies at "
    "one cycle a year, where the density is highest. Rolled in 600 s and 77.5 s, it lies where the density is lower by "
    "factors of about fifty thousand and four hundred thousand.",
)

PICTURES = (NUMBER_LINE, A_YEAR, DEROLL, STEP)
