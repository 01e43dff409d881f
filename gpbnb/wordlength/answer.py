"""The answer to a question about a wordlength, with its evidence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text, rounding_text
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.forms import Form
from gpbnb.filters.word_formats import WordFormats

Basis = Literal["emulation", "bound", "guarantee", "probable"]

Kind = Literal["float", "fixed", "words", "blocks"]

PROOFS: tuple[Basis, ...] = ("bound", "guarantee")
"""Bases on which an error has a proved bound; one above the tolerance does not prove that the error is, too."""


@dataclass(frozen=True, repr=False)
class Requirement:
    """The format with the fewest digits that meets a tolerance, or whether one format does, with the evidence.

    An answer is true if it is met. At a prompt it is a sentence.

    Parameters
    ----------
    format : the format or formats; None if no format that was tried meets the tolerance.
    ratio : largest error or bound / tolerance over states and steps in this format; infinite without one.
    basis : how the error is known, as in :func:`gpbnb.required_precision`.
    steps : steps of the run, or for which a guarantee holds; None if it holds for ever.
    tried : digits, and largest error or bound / tolerance; infinite if the run stopped, a number overflowed, a variance
        was no longer positive, or no bound exists. In fixed point, digits are fraction bits.
    text : the sentence.
    why : why the next smaller format fails, or why no format meets the tolerance; may be empty.
    notes : what else there is to say: advice, repaired covariances, reasons why the answer may not hold for other
        inputs, the limits that a run leaves.
    form : form of a Kalman filter.
    irregular : precisions that meet the tolerance although a higher one that was run misses it; usually empty.
    processor_format : "binary32" or "binary64", the smaller that meets the tolerance; empty if none is known to.
    alone : for each block of a Kalman filter, the digits that it needs while all others have the most; else empty.
    """

    format: FloatFormat | FixedFormat | WordFormats | BlockFormats | MaybeNone
    ratio: float
    basis: Basis
    steps: int | None
    tried: tuple[tuple[int, float], ...]
    text: str
    why: str = ""
    notes: tuple[str, ...] = ()
    form: Form | None = None
    irregular: tuple[int, ...] = ()
    processor_format: str = ""
    alone: dict[str, int | None] = field(default_factory=dict)

    @property
    def met(self) -> bool:
        """Whether the format meets the tolerance."""
        return self.format is not None and self.ratio <= 1

    def __bool__(self) -> bool:
        return self.met

    @property
    def digits(self) -> int | None:
        """Digits of the format, fraction bits in fixed point, or the most digits of a block; None without a format."""
        return None if self.format is None else digits_of(self.format)

    @property
    def limiting(self) -> tuple[str, ...]:
        """The blocks that need the most digits when lowered alone."""
        most = max((digits for digits in self.alone.values() if digits is not None), default=None)
        return tuple(name for name, digits in self.alone.items() if digits == most)

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__


_EVIDENCE = {
    "emulation": ("observed in {}", "in a run of {}"),
    "bound": ("proved for this run of {}", "by a bound on this run of {}"),
    "guarantee": ("guaranteed for ever", "by a guarantee for ever"),
    "probable": ("as three times the probable error", "by three times the probable error"),
}
"""For each basis, how the error of an answer is known, and what had to meet the tolerance."""


def evidence(basis: Basis, steps: int | None, ends: bool = False) -> tuple[str, str]:
    """Return how an error is known, as "observed in 60 steps", and what had to meet the tolerance.

    `ends` is whether a guarantee holds for these steps only.
    """
    texts = ("guaranteed for {}", "by a guarantee for {}") if ends and basis == "guarantee" else _EVIDENCE[basis]
    known, needed = (text.format(f"{steps} step{'s' * (steps != 1)}") for text in texts)
    return known, needed


def share_text(ratio: float) -> str:
    """Describe an error as a share or a multiple of its tolerance."""
    return f"{ratio:.2g} of the tolerance" if ratio <= 1 else f"{ratio:.3g} times the tolerance"


def joined(text: str, notes: Sequence[str]) -> str:
    """Return a sentence with notes after it."""
    return "; ".join([text, *filter(None, notes)])


def listed(numbers: Sequence[int]) -> str:
    """Format ascending whole numbers as text, with three or more in a row as ranges: "2, 5–8"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    texts = [f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(texts)


def format_in_words(fmt: FloatFormat | FixedFormat | WordFormats) -> str:
    """Describe a format as the subject of a sentence, such as "16-bit fixed point (15 fraction bits)"."""
    if isinstance(fmt, WordFormats):
        return str(fmt)
    if not isinstance(fmt, FixedFormat):
        return format_text(fmt)
    rounding = "" if fmt.rounding is Rounding.NEAREST else f", {rounding_text(fmt.rounding)}"
    overflow = {"saturate": ", saturated", "wrap": ", wrapped around"}.get(fmt.overflow, "")
    fraction = digits_text(fmt.fraction_bits, kind="fraction")
    return f"{1 + fmt.precision}-bit fixed point ({fraction}{rounding}{overflow})"


def digits_of(fmt: FloatFormat | FixedFormat | WordFormats | BlockFormats) -> int:
    """Return the digits of a format, fraction bits in fixed point, or the most digits of a block."""
    if isinstance(fmt, BlockFormats):
        return max(getattr(fmt, name).precision for name in BLOCKS)
    fmt = fmt.data if isinstance(fmt, WordFormats) else fmt
    return fmt.fraction_bits if isinstance(fmt, FixedFormat) else int(fmt.precision)


def judgement(
    fmt: FloatFormat | FixedFormat | WordFormats, basis: Basis, steps: int, ratio: float, why: str, ends: bool = False
) -> str:
    """Say whether one format meets a tolerance."""
    name = format_in_words(fmt)
    many = isinstance(fmt, FloatFormat) and name[0].isdigit() and fmt.precision > 1
    meets, misses = ("meet", "miss") if many else ("meets", "misses")
    missed = f"nothing is proved for {name}" if basis in PROOFS else f"{name} {misses} the tolerance"
    known, needed = evidence(basis, steps, ends)
    if math.isinf(ratio):
        return f"{missed}, {needed if basis == 'emulation' else needed.replace('by', 'without', 1)}: {why}"
    if ratio <= 1:
        return f"{name} {meets} the tolerance: {ratio:.2g} of it, {known}"
    if basis == "emulation":
        return f"{missed}: its error is {ratio:.3g} times as large, {known}"
    what = f"the guaranteed bound for {needed.rpartition(' for ')[2] if ends else 'ever'}"
    if basis != "guarantee":
        what = needed.removeprefix("by ").replace("a bound", "the bound", 1)
    return f"{missed}: {what} is {ratio:.3g} times the tolerance"
