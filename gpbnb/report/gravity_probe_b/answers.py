"""How many digits does a year need? What the emulated years say."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.year import YearCase


def decimal_digits(fmt: FloatFormat) -> float:
    """Return the t for which the unit roundoff of a format is β = 0.5 × 10^(1-t), (8) of hung1984, ch. II."""
    return 1 - math.log10(2 * float(fmt.unit_roundoff))


def largest(run: year.Year) -> float:
    """Return the largest error of the drift angles (mas) and their rates (mas/yr) at any checkpoint of a year.

    The error at the end alone is not enough, because a run may be near the truth there by chance.
    """
    return float(max(np.abs(run.drift).max(), np.abs(run.rate).max()))


@cache
def errors() -> dict[int, float]:
    """Return the largest error of each stored year of Hung's form, rounded to nearest, by its bits."""
    usual = YearCase(year.MODELS[0], 2, 0, Rounding.NEAREST, Form.HUNG)
    return {run.case.precision: largest(run) for run in year.load() if run.case._replace(precision=0) == usual}


def fewest_bits(tolerance: float = 1.0) -> int:
    """Return the fewest bits of a stored year within a tolerance of drift angles and rates, in mas and mas/yr."""
    enough = [bits for bits, error in errors().items() if error <= tolerance]
    if not enough:
        raise ValueError(
            f"got a tolerance of {tolerance}; needed at least the least error, {min(errors().values()):.2g}"
        )
    return min(enough)
