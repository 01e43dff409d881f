"""Judge one format for a filter: whether it meets a tolerance, in place of a search for the smallest precision."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text, rounding_text
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.bounds.guarantee import check_limits, check_within
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import compiled_form, form_named
from gpbnb.filters.system import LinearSystem
from gpbnb.wordlength.precision import Guaranteed, Probable, survey_formats
from gpbnb.wordlength.requirement import (
    PROOFS,
    Asked,
    Basis,
    Strategy,
    WordlengthAnswer,
    bound_in_words,
    checked_tolerance,
    evidence,
    for_ever_or_over,
    proved,
    without_evidence,
)
from gpbnb.wordlength.system import EmulatedSystem, system_strategy


@dataclass(frozen=True)
class Judgement(WordlengthAnswer):
    """Whether a format meets a tolerance.

    Parameters
    ----------
    ends : whether a guarantee holds for the steps only, because there is none for ever.
    """

    fmt: FloatFormat | FixedFormat
    steps: int
    ends: bool = False

    @property
    def ratio(self) -> float:
        """Largest error or bound / tolerance; infinite if there is none."""
        return self.tried[0][1]

    @property
    def met(self) -> bool:
        """Whether the format meets the tolerance."""
        return self.ratio <= 1

    def __str__(self) -> str:
        name, times = format_in_words(self.fmt), f"{self.ratio:.3g} times"
        missed = f"nothing is proved for {name}" if self.basis in PROOFS else f"{name} misses the tolerance"
        how = evidence(self.basis, self.steps, self.ends)
        if math.isinf(self.ratio):
            return f"{missed}, {without_evidence(self.basis, self.steps, self.ends)}: {self.why}"
        if self.met:
            verdict = f"{name} meets the tolerance: {self.ratio:.2g} of it, {how}"
        elif self.basis == "emulation":
            verdict = f"{missed}: its error is {times} as large, {how}"
        else:
            verdict = f"{missed}: {bound_in_words(self.basis, self.steps, self.ends)} is {times} the tolerance"
        return "; ".join([verdict, *self.warnings])


def format_in_words(fmt: FloatFormat | FixedFormat) -> str:
    """Describe a format as the subject of a sentence, such as "16-bit fixed point (15 fraction bits)"."""
    if not isinstance(fmt, FixedFormat):
        return format_text(fmt)
    rounding = "" if fmt.rounding is Rounding.NEAREST else f", {rounding_text(fmt.rounding)}"
    overflow = {"saturate": ", saturated", "wrap": ", wrapped around"}.get(fmt.overflow, "")
    fraction = digits_text(fmt.fraction_bits, kind="fraction")
    return f"{1 + fmt.precision}-bit fixed point ({fraction}{rounding}{overflow})"


def judge(
    model: LinearModel | LinearSystem,
    fmt: FloatFormat | FixedFormat,
    steps: int,
    tolerance: Any,
    form: Any = Form.INNOVATION,
    basis: Basis = "emulation",
    z: Any = None,
    within: FilterLimits | None = None,
) -> Judgement:
    """Judge one format; for the arguments, see :func:`gpbnb.wordlength.precision.required_precision`.

    Raises
    ------
    ValueError : for a reason given there; a format without compiled loops.
    """
    check_within(within, basis)
    fmt.check_compiled()
    kind = cast(FloatFormat, fmt)  # strategies take fixed point, too, where there are loops for it
    asked = Asked(steps, basis, kind, None, False)
    if isinstance(model, LinearModel) and basis in ("emulation", "bound"):
        (found,) = survey_formats(model, z, tolerance, [kind], form_named(form), basis)
        return Judgement(fmt, basis, steps, ((fmt.precision, found.ratio),), found.why)
    strategy: Strategy
    if isinstance(model, LinearSystem):
        strategy = system_strategy(model, asked, tolerance, z, within)
    else:
        if within is None:
            raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
        check_limits(within, model.n, model.m, model.x0)
        tolerances = checked_tolerance(tolerance, model.n, "states", basis)
        limited = Guaranteed if basis == "guarantee" else Probable
        strategy = limited(model, compiled_form(form), within, tolerances)
    found, ends = for_ever_or_over(
        steps, strategy, lambda each: proved(each, kind), lambda outcome: not math.isinf(outcome.ratio)
    )
    warnings = strategy.warnings() if isinstance(strategy, EmulatedSystem) else ()
    return Judgement(fmt, basis, steps, ((fmt.precision, found.ratio),), found.why, warnings, ends)
