"""The answers at a glance: digits for a year of Gravity Probe B, as printed, observed and guaranteed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, BINARY64
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b import answers, horizon, threshold
from gpbnb.report.gravity_probe_b.threshold import Share
from gpbnb.report.kalman import report_bounds

DRIFT = 6606
"""Drift in a year that relativity predicts, in mas; the reports compare errors with an estimate of this size."""
OF_THE_MISSION = ("One simulated year", "Closer to the mission", "Same, step every 2 s")
"""Answers that the front page leaves to the chapter on a hundred years."""


class YearAnswer(NamedTuple):
    """One answer to the question how many digits a year needs.

    Parameters
    ----------
    source : who or what gives the answer.
    decimal : decimal digits, if the answer is in these.
    bits : bits, if it is in these.
    deviation : bits if the filter estimates deviations from the predicted drift; None if that was not asked.
    meaning : what the answer rests on, or allows.
    """

    source: str
    meaning: str
    decimal: tuple[int, ...] = ()
    bits: int | None = None
    deviation: int | None = None


@cache
def find() -> tuple[YearAnswer, ...]:
    """Collect the answers from the printed example, the stored years and the stored guarantee."""
    printed = tuple(int(report_bounds.PRINTED[f"{term} digits"]) for term in ("first", "second"))
    formula = report_bounds.coefficients(*report_bounds.EXAMPLE)
    within = tuple(report_bounds.precision_for_coefficient(each, Fraction(1, DRIFT)) for each in formula)
    simple = [each for each in threshold.shares(threshold.SWEEP.load()) if _as_in_the_report(each)]
    real = [each for each in threshold.shares(threshold.MISSION_SWEEP.load()) if _as_in_the_report(each)]
    absolute, deviation = (_least(simple, "simple", states) for states in threshold.STATES)
    closer, closer_deviation = (_least(real, "mission", states) for states in threshold.STATES)
    flown = _least(real, "steps and roll as flown", "deviation")
    bound = {row.states: horizon.bits(row) for row in horizon.load()}
    least = min(deviation.fmt.precision, closer_deviation.fmt.precision)
    sizes = {name: fmt.precision for name, fmt in (("float32", BINARY32), ("double", BINARY64))}
    verdicts = {
        name: "too few" if t < least else "ample" if t >= max(bound.values()) else "enough" for name, t in sizes.items()
    }
    return (
        YearAnswer("Report, own criterion", "error equals the drift", printed),
        YearAnswer("The same, simulated", _met(DRIFT), (), answers.fewest_bits(DRIFT)),
        YearAnswer("Report, for 1 mas", "(125) is not a bound", within),
        YearAnswer("One simulated year", "observed", (), answers.fewest_bits()),
        _of_shares(f"{absolute.records} simulated years", absolute, deviation),
        _of_shares("Closer to the mission", closer, closer_deviation),
        YearAnswer("Same, step every 2 s", _passed(flown), deviation=flown.fmt.precision),
        YearAnswer(
            "Every admissible record", "scaled from a proof in 53 bits", (), bound["absolute"], bound["deviation"]
        ),
        YearAnswer("binary32 (float32)", verdicts["float32"], (), sizes["float32"]),
        YearAnswer("binary64 (double)", verdicts["double"], (), sizes["double"]),
    )


def _of_shares(source: str, absolute: Share, deviation: Share) -> YearAnswer:
    return YearAnswer(source, _passed(absolute, deviation), (), absolute.fmt.precision, deviation.fmt.precision)


def table() -> Table:
    """Tabulate the answers of the front page in bits and in decimal digits, converted by equal unit roundoff."""
    shown = [each for each in find() if each.source not in OF_THE_MISSION]
    header = ("answer", "bits", "decimal digits", "basis")
    body = tuple((each.source, *_both_bases(each), each.meaning) for each in shown)
    return Table("digits for a year of Gravity Probe B", header, body)


def deviation_table() -> Table:
    """Tabulate the answers for estimates of the drift and for estimates of the deviation from the predicted drift."""
    shown = [each for each in find() if each.deviation is not None]
    header = ("answer", "bits", "decimal digits", "bits, deviations", "basis")
    body = tuple((each.source, *_both_bases(each), str(each.deviation), each.meaning) for each in shown)
    return Table("digits for estimates of the drift and of deviations", header, body)


def _both_bases(answer: YearAnswer) -> tuple[str, str]:
    """Write an answer in bits and in decimal digits."""
    if answer.bits is not None:
        return str(answer.bits), f"{answers.decimal_digits(FloatFormat(2, answer.bits)):.1f}"
    bits = " or ".join(f"{binary_digits(t):.1f}" for t in answer.decimal)
    return bits or "–", " or ".join(map(str, answer.decimal)) or "–"


def _met(tolerance: float) -> str:
    """Say how far the fewest bits stay below a tolerance, and by how much one bit less exceeds it."""
    errors, bits = answers.errors(), answers.fewest_bits(tolerance)
    return f"one year: {errors[bits]:,.0f} mas; {bits - 1} bits: {errors[bits - 1]:,.0f}"


def _passed(*found: Share) -> str:
    """Say how many simulated years stay within the tolerance, in a text that is short if all do."""
    counts = {(each.within, each.records) for each in found}
    texts = [f"all {records}" if within == records else f"{within} of {records}" for within, records in sorted(counts)]
    return f"{' and '.join(texts)} within 1 mas"


def binary_digits(decimal: int) -> float:
    """Return the number of bits with the same unit roundoff as so many decimal digits."""
    return 1 + (decimal - 1) * math.log2(10)


def _as_in_the_report(share: Share) -> bool:
    fmt = share.fmt
    return fmt.base == 2 and fmt.rounding is Rounding.NEAREST and share.form == "hung"


def _least(found: Sequence[Share], setting: str, states: str) -> Share:
    """Return the share of the smallest precision with which 99 % of the records stay within a milliarcsecond."""
    kept = [each for each in found if (each.setting, each.states) == (setting, states)]
    precision = threshold.needed(kept)
    return next(each for each in kept if each.fmt.precision == precision)
