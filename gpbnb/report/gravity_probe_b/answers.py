"""How many digits does a year need? The printed answers, the corrected and the observed one."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.kalman import report_bounds

_REPORT = (2, Form.HUNG, Rounding.NEAREST)


def decimal_digits(fmt: FloatFormat) -> float:
    """Return the t for which the unit roundoff of a format is β = 0.5 × 10^(1-t), (8) of hung1984, ch. II."""
    return 1 - math.log10(2 * float(fmt.unit_roundoff))


def largest(run: year.Year) -> float:
    """Return the largest error of the drift angles (mas) and their rates (mas/yr) at any checkpoint of a year.

    The error at the end alone is not enough, because a run may be near the truth there by chance.
    """
    return float(max(np.abs(run.drift).max(), np.abs(run.rate).max()))


class Answers(NamedTuple):
    """Decimal digits that a year requires, by the two terms of (125) and by emulation."""

    #: In mas and mas/yr, for the observed errors.
    tolerance: float
    #: The emulated years of the usual model.
    runs: tuple[year.Year, ...]
    #: The printed digits of the closing example.
    printed: tuple[int, int]
    #: The digits that its formula gives.
    formula: tuple[int, int]
    #: The digits by the formula with all its errors corrected.
    corrected: tuple[int, int]
    #: The fewest digits with which an emulated year stayed within the tolerance.
    observed: dict[Rounding, float]
    #: The fewest bits with which Hung's form, rounded to nearest, stayed within the tolerance.
    bits: int
    #: Its largest error in the year, in mas or mas/yr.
    error: float


def find_answers(tolerance: float = 1.0) -> Answers:
    """Collect the answers to the closing example of hung1984, ch. II, section 12.

    Parameters
    ----------
    tolerance : largest error of drift angles and rates in the year; mas and mas/yr, above 0.
    """
    runs = tuple(run for run in year.load() if run.case.model == year.MODELS[0])
    observed = {}
    for rounding in Rounding.documented():
        enough = [decimal_digits(fmt) for run in runs if (fmt := _good(run, rounding, tolerance)) is not None]
        if not enough:
            raise ValueError(
                f"got a tolerance of {tolerance}; needed one that at least one run of a year meets: "
                f"the smallest error is {_best(runs):.2g}"
            )
        observed[rounding] = min(enough)
    corrected = report_bounds.coefficients(*report_bounds.EXAMPLE, **report_bounds.ALL_CORRECTED)
    return Answers(
        tolerance,
        runs,
        (int(report_bounds.PRINTED["first digits"]), int(report_bounds.PRINTED["second digits"])),
        _both(report_bounds.coefficients(*report_bounds.EXAMPLE)),
        _both(corrected),
        observed,
        *_fewest_bits(runs, tolerance),
    )


def _good(run: year.Year, rounding: Rounding, tolerance: float) -> FloatFormat | None:
    return run.case.fmt if run.case.rounding is rounding and largest(run) <= tolerance else None


def _fewest_bits(runs: tuple[year.Year, ...], tolerance: float) -> tuple[int, float]:
    """Return the fewest bits of a run in Hung's form, rounded to nearest, within the tolerance, and its error."""
    usual = [run for run in runs if (run.case.base, run.case.form, run.case.rounding) == _REPORT]
    enough = [(int(run.case.precision), largest(run)) for run in usual if largest(run) <= tolerance]
    if not enough:
        raise ValueError(f"got a tolerance of {tolerance}; needed one that a run in bits meets: {_best(runs):.2g}")
    return min(enough)


def _best(runs: tuple[year.Year, ...]) -> float:
    return max(min(largest(run) for run in runs if run.case.rounding is rounding) for rounding in Rounding.documented())


def _both(counts: report_bounds.Coefficients) -> tuple[int, int]:
    return report_bounds.precision_for_coefficient(counts.first), report_bounds.precision_for_coefficient(counts.second)
