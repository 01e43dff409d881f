"""How many digits does a year need? The printed answers, the corrected and the observed one, and what choices add."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.threshold import Share
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


_USUAL = ("deviation", "hung", "2", "nearest")


class Moved(NamedTuple):
    """One changed choice, before and after, and the resulting change in bits of the precision for the tolerance."""

    choice: str
    before: str
    after: str
    bits: float
    records: int


def median_precision(found: Sequence[Share], tolerance: float = 1.0) -> float:
    """Return the precision at which the median error would equal the tolerance, for one kind of formats.

    Between a format whose median exceeds the tolerance and the next, the logarithm of the error is interpolated.
    If all medians lie on one side of the tolerance, the estimate starts from the nearest on a logarithmic scale, and
    assumes that each further digit divides the error by the base.
    """
    if not found:
        raise ValueError("got no formats; needed at least one")
    distances = _distances(found, tolerance)
    for (t, high), (next_t, low) in reversed([*pairwise(distances)]):
        if high > 0 >= low:
            return t + (next_t - t) * high / (high - low)
    t, away = min(distances, key=lambda each: abs(each[1]))
    return t + away


def _distances(found: Sequence[Share], tolerance: float = 1.0) -> list[tuple[int, float]]:
    """List precisions, and by how many digits each median exceeds the tolerance."""
    return sorted((each.fmt.precision, math.log(each.quantile(0.5) / tolerance, each.fmt.base)) for each in found)


def sensitivity(found: Sequence[Share]) -> tuple[Moved, ...]:
    """Change one choice at a time, starting from deviation states, Hung's form, base 2 and rounding to nearest.

    A choice is omitted if no such formats were run.

    Parameters
    ----------
    found : shares for the simple model, in the setting "simple", and for settings of the mission model.
    """
    groups: dict[tuple[str, ...], list[Share]] = {}
    for each in found:
        fmt = each.fmt
        groups.setdefault((each.setting, each.states, each.form, str(fmt.base), fmt.rounding.value), []).append(each)
    pairs = []
    for setting in ("simple", "mission"):
        usual = (setting, *_USUAL)
        for choice, place, after in (("states", 1, "absolute"), ("form", 2, "innovation"), ("rounding", 4, "chop")):
            pairs.append((f"{choice}, {setting} model", usual, (*usual[:place], after, *usual[place + 1 :]), place))
    for setting in dict.fromkeys(each.setting for each in found if each.setting != "simple"):
        before = "simple" if setting == "mission" else "mission"
        pairs.append(("model", (before, *_USUAL), (setting, *_USUAL), 0))
    return tuple(
        _moved(choice, usual[place], other[place], groups[usual], groups[other])
        for choice, usual, other, place in pairs
        if usual in groups and other in groups
    )


def _moved(choice: str, before: str, after: str, usual: Sequence[Share], other: Sequence[Share]) -> Moved:
    """Compare two kinds of formats: both where they meet the tolerance, else in the formats that both have."""
    common = {each.fmt.precision for each in usual} & {each.fmt.precision for each in other}
    if common and not (_on_both_sides(usual) and _on_both_sides(other)):
        usual = [each for each in usual if each.fmt.precision in common]
        other = [each for each in other if each.fmt.precision in common]
    bits = median_precision(other) - median_precision(usual)
    return Moved(choice, before, after, bits, min(each.records for each in (*usual, *other)))


def _on_both_sides(found: Sequence[Share]) -> bool:
    """Whether medians lie on both sides of the tolerance."""
    sides = [away > 0 for _, away in _distances(found)]
    return any(sides) and not all(sides)


def single_record(runs: Sequence[year.Year], precision: int = 24) -> tuple[Moved, ...]:
    """Change one choice at a time for one record of the simple model, with absolute angles.

    Parameters
    ----------
    runs : years from :mod:`gpbnb.report.gravity_probe_b.year`.
    precision : precision in bits; each bit is assumed to halve the error.
    """
    by_case = {run.case: run for run in runs}
    usual = year.YearCase(year.MODELS[0], 2, precision, Rounding.NEAREST, Form.HUNG)
    changes = [
        *(("roll and process noise", usual.model, name, usual._replace(model=name)) for name in year.MODELS[1:]),
        ("rounding", "nearest", "chop", usual._replace(rounding=Rounding.CHOP)),
        *(("form", "hung", form.name.lower(), usual._replace(form=form)) for form in (Form.INNOVATION, Form.UD)),
    ]
    error = largest(by_case[usual])
    return tuple(
        Moved(choice, before, after, math.log2(largest(by_case[case]) / error), 1)
        for choice, before, after, case in changes
    )
