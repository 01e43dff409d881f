"""How many digits does a year need? The printed answers, the corrected ones, and the observed one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.kalman import report_bounds, year, year_cases


def decimal_digits(fmt: FloatFormat) -> float:
    """The t for which β = 0.5 × 10^(1-t), (8) of hung1984, ch. II, is the unit roundoff of a format."""
    return 1 - math.log10(2 * float(fmt.unit_roundoff))


def largest(run: year.Year) -> float:
    """The largest error of drift angles (mas) and of their rates (mas/yr), at the end of a year or a step kept before.

    Not at the end alone: there a run may be near the truth by luck.
    """
    return float(max(np.abs(run.drift).max(), np.abs(run.rate).max()))


class Answers(NamedTuple):
    """Decimal digits that a year asks for, by the two terms of (125) and by emulation."""

    #: in mas and mas/yr, for what was observed.
    goal: float
    #: the emulated years of the usual model.
    runs: tuple[year.Year, ...]
    #: of the closing example.
    printed: tuple[int, int]
    #: what its formula gives.
    formula: tuple[int, int]
    #: the formula with all its faults mended.
    mended: tuple[int, int]
    #: the fewest with which an emulated year stayed within the goal, of the formats that were run.
    observed: dict[Rounding, float]


def find(goal: float = 1.0) -> Answers:
    """Collect the answers to the closing example of hung1984, ch. II, section 12.

    Parameters
    ----------
    goal : largest error of drift angles and rates in the year; mas and mas/yr, above 0.

    Raises
    ------
    ValueError : no emulated year meets the goal, with one of the roundings.
    """
    runs = tuple(run for run in year.load() if run.case.model == year_cases.MODELS[0])
    observed = {}
    for rounding in Rounding.documented():
        enough = [decimal_digits(fmt) for run in runs if (fmt := _good(run, rounding, goal)) is not None]
        if not enough:
            raise ValueError(
                f"got a goal of {goal}; needed one that some year meets: the best rounds to {_best(runs):.2g}"
            )
        observed[rounding] = min(enough)
    mended = report_bounds.coefficients(*report_bounds.EXAMPLE, **report_bounds.MENDINGS["and errors carried on"])
    return Answers(
        goal,
        runs,
        (int(report_bounds.PRINTED["first digits"]), int(report_bounds.PRINTED["second digits"])),
        _both(report_bounds.coefficients(*report_bounds.EXAMPLE)),
        _both(mended),
        observed,
    )


def _good(run: year.Year, rounding: Rounding, goal: float) -> FloatFormat | None:
    return run.case.fmt if run.case.rounding is rounding and largest(run) <= goal else None


def _best(runs: tuple[year.Year, ...]) -> float:
    return max(min(largest(run) for run in runs if run.case.rounding is rounding) for rounding in Rounding.documented())


def _both(counts: report_bounds.Coefficients) -> tuple[int, int]:
    return report_bounds.required_precision(counts.first), report_bounds.required_precision(counts.second)
