"""Searches in fixed point: fraction bits for all numbers, or formats for data, coefficients and sums."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.named import BINARY64, arithmetic, format_named
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.arithmetic.search import Outcome, Search
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.recording import system_step
from gpbnb.filters.sections import scaled
from gpbnb.filters.stepping import RunningStep
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.answer import Requirement, evidence, joined, share_text
from gpbnb.wordlength.asked import Asked, is_filter
from gpbnb.wordlength.judges import Judge, for_ever_or_over, judge_for, measured, slowest_response

LARGEST_FRACTION = 60
"""Fraction bits that no search reaches."""

COEFFICIENT_BITS = 15
"""Significant bits of a coefficient in fixed point if none are given, as in a word of 16 bits."""

MOST_COEFFICIENT_BITS = 24
"""Significant bits of a coefficient with which a search over words begins."""

LONGEST_COEFFICIENT = 53
"""Significant bits of a coefficient up to which more of them are tried where the coefficients limit a filter."""

MORE_INTEGER_BITS = 40
"""Integer bits beyond those of the model and its data that a run in fixed point may need."""

_WIDER = "; needed more integer bits: without like=, the search finds as many as a run needs"
_SCALED = "with its sections scaled by powers of two (scale=True; in a TOML file, scale = true beside sos)"


def fixed_like(like: Any, model: Any) -> FixedFormat | WordFormats | None:
    """Return formats with the integer bits to use, or None if the search is to find them."""
    found = format_named(like)
    if found is None or isinstance(found, FixedFormat):
        return found
    if not isinstance(found, WordFormats):
        raise TypeError(f'got like={like!r}; needed a FixedFormat or a name such as "Q3.12"')
    if not isinstance(model, LinearSystem):
        raise ValueError(f"got like={like!r}; needed a FixedFormat: only a linear system has formats of words")
    return found


def in_fixed_point(
    asked: Asked, like: FixedFormat | WordFormats | None, rounding: Rounding, coefficient_bits: int | None
) -> Requirement:
    """Find the fewest fraction bits of a model of any kind."""
    of_system = isinstance(asked.model, LinearSystem)
    if coefficient_bits is not None and (like is not None or not of_system):
        raise ValueError(
            "got coefficient_bits beside like, or without a linear system; needed them for a linear system"
        )
    data = like.data if isinstance(like, WordFormats) else like
    if data is None:
        data = FixedFormat(_integer_bits(asked), LARGEST_FRACTION, rounding)
    asked.check_sizes(data)
    search = _FixedSearch(asked, _judge(asked, data), data, like is None)
    if of_system and like is None:
        bits, blamed = coefficient_bits or COEFFICIENT_BITS, "coefficient_bits, or --coefficients in the command"
        search = replace(search, words_of=lambda fmt: WordFormats(fmt, bits), blamed=blamed)
    elif of_system:
        words = like if isinstance(like, WordFormats) else WordFormats(data)
        words_of: Any = lambda fmt: with_fraction_bits(words, fmt.fraction_bits)  # noqa: E731
        search = replace(search, words_of=words_of, blamed="coefficients of WordFormats")
    return search.answer()


def _judge(asked: Asked, like: FixedFormat) -> Judge:
    return judge_for(asked, 2, LARGEST_FRACTION + max(like.integer_bits, 0))


@dataclass(frozen=True)
class _FixedSearch:
    """A search over fraction bits, with as many integer bits as each run needs.

    Parameters
    ----------
    judge : what answers the question.
    like : a format with the integer bits, the rounding and the overflow of those to try.
    widens : whether a format in which a number overflows gets more integer bits.
    words_of : function that returns what is run for a format of the data.
    blamed : what sets the bits of coefficients.
    more : integer bits that a number of fraction bits needs beyond those of `like`.
    """

    asked: Asked
    judge: Judge
    like: FixedFormat
    widens: bool
    words_of: Callable[[FixedFormat], Any] = lambda fmt: fmt
    blamed: str = ""
    more: dict[int, int] = field(default_factory=dict)

    @property
    def made(self) -> LinearFilter | None:
        """A linear system as a filter; None for another model."""
        return self.asked.model.as_filter() if isinstance(self.asked.model, LinearSystem) else None

    @property
    def least(self) -> int:
        """The fewest fraction bits of a format."""
        return max(0, 1 - self.like.integer_bits)

    def error(self, fmt: FixedFormat, prove: bool = False) -> Outcome:
        """Return the largest error over its tolerance in the narrowest format without an overflow."""
        ask, found = self.judge.proof if prove else self.judge.error, Outcome(math.inf)
        start = max(self.more.values(), default=0) - 1 if not self.made else 0
        for more in range(max(start, 0), 1 + MORE_INTEGER_BITS) if self.widens else (0,):
            found = ask(self.words_of(replace(fmt, integer_bits=fmt.integer_bits + more)))
            if not found.overflow:
                self.more[fmt.fraction_bits] = more
                return found
        return found

    def formats(self, fmt: FixedFormat) -> Any:
        """Return the formats of an answer, with the integer bits that its fraction bits need."""
        return self.words_of(replace(fmt, integer_bits=fmt.integer_bits + self.more.get(fmt.fraction_bits, 0)))

    def search(self, largest: int) -> Search[FixedFormat]:
        """Search up to some fraction bits."""
        proof = partial(self.error, prove=True) if self.judge.proved else None
        return Search(self.error, self.like, (), self.asked.ran, largest=largest, least=self.least, proof=proof)

    def answer(self) -> Requirement:
        """Return the smallest number of fraction bits that meets the tolerance."""
        asked, largest = self.asked, LARGEST_FRACTION - 1
        most = f"{largest} fraction bits are the most tried"
        if isinstance(asked.model, LinearModel):
            if not self.widens:
                replace(self.like, fraction_bits=self.least).check_compiled()
            if (compiled := _compiled_fraction(self.like)) < largest:
                largest = max(compiled, self.least)
                most = f"{digits_text(largest, kind='fraction')} are the most with compiled loops"
        found, judge = for_ever_or_over(
            asked, self.judge, lambda each: replace(self, judge=each).search(largest), Search.is_bounded
        )
        return replace(self, judge=judge)._answer(found, largest, most)

    def _answer(self, found: Search[FixedFormat], largest: int, most: str) -> Requirement:
        asked, ratios, reasons, ends = self.asked, dict(found.tried), found.reasons, self.judge.steps is not None

        def rejection(bits: int) -> str:
            text = digits_text(bits, kind="fraction")
            if reasons[bits]:
                cure = "" if self.widens or "overflow" not in reasons[bits] else _WIDER
                return f"{text} {'fails' if bits == 1 else 'fail'}: {reasons[bits]}{cure}"
            return f"{text} {'gives' if bits == 1 else 'give'} {ratios[bits]:.3g} times the tolerance"

        known, needed = evidence(asked.basis, asked.steps, ends)
        if found.fmt is None:
            cause = self.blame(largest) or self.unstable()
            why = cause or f"{rejection(largest)}; {most}"
            text = f"no fixed-point format meets the tolerance {needed}: {why}"
            return asked.answer(
                None, math.inf, found.tried, ends, text, why, ["" if cause else self.scaled_advice(None)]
            )
        bits = found.fmt.fraction_bits
        why = rejection(bits - 1) if bits > self.least else ""
        formats = self.formats(found.fmt)
        data = formats.data if isinstance(formats, WordFormats) else formats
        if formats == WordFormats(data):
            formats = data
        subject = f"{digits_text(bits, kind='fraction')} in a word of {1 + data.precision} bits"
        text = joined(f"{subject}: {share_text(ratios[bits])}, {known}", [why])
        notes = (self.scaled_advice(data), *self.judge.warnings())
        return asked.answer(formats, ratios[bits], found.tried, ends, text, why, notes)

    def unstable(self) -> str:
        """Return in words that errors of a linear system never decay; empty for another model."""
        model = self.asked.model
        if not isinstance(model, LinearSystem) or not model.as_filter().program.is_linear or not model.unstable():
            return ""
        return f"{model.unstable()}, so that errors grow with every step, whatever the word: take fewer steps"

    def blame(self, fraction: int) -> str:
        """Return in words that the coefficients limit the filter, and how many of their bits are enough."""
        if self.made is None:
            return ""
        fmt = replace(self.like, fraction_bits=fraction)
        given = self.words_of(fmt).coefficients
        if given is None:
            return ""

        def error(bits: FloatFormat) -> Outcome:
            words_of = lambda each: replace(self.words_of(each), coefficients=bits.precision)  # noqa: E731
            return replace(self, words_of=words_of).error(fmt)

        found = Search(error, FloatFormat(2, 2), (), self.asked.ran, largest=LONGEST_COEFFICIENT)
        if found.fmt is None:
            return ""
        stored = digits_text(given, kind="significant") if isinstance(given, int) else arithmetic(given)
        ratio, refused, _ = self.error(fmt)
        misses = f"words are refused: {refused}" if refused else f"they give {ratio:.3g} times the tolerance"
        return (
            f"the coefficients limit the filter, whatever the fraction bits of the data: stored in {stored}, {misses}; "
            f"{digits_text(found.fmt.precision, kind='significant')} of each coefficient are enough ({self.blamed})"
        )

    def scaled_advice(self, fmt: FixedFormat | None) -> str:
        """Return in words that scaled sections need a shorter word, or what limits these; empty if neither helps."""
        other = None if self.made is None else scaled_sections(self.asked.model)
        largest = LARGEST_FRACTION - 1 if fmt is None else fmt.fraction_bits - 1
        if other is None:
            slow = self.made is not None and fmt is None and self.judge.proved is not None
            text = slowest_response(self.asked.model, self.asked.steps) if slow else ""
            return text and f"errors add up because the system is slow: its {text}"
        asked = replace(self.asked, model=other)
        like = replace(self.like, integer_bits=_integer_bits(asked)) if self.widens else self.like
        better = replace(self, asked=asked, judge=_judge(asked, like), like=like, more={})
        if largest < better.least:
            return ""
        found = better.search(largest)
        if found.fmt is None:
            limit = "" if fmt is not None else better.blame(largest)
            return limit and f"{_SCALED}, {limit}"
        data = better.formats(found.fmt).data
        if fmt is not None and data.precision >= fmt.precision:
            return ""
        fraction = digits_text(data.fraction_bits, kind="fraction")
        return f"{_SCALED}, {fraction} in a word of {1 + data.precision} bits are enough"


def _compiled_fraction(like: FixedFormat) -> int:
    """Return the most fraction bits with compiled loops; 0 if the integer bits alone are too many."""
    fraction = LARGEST_FRACTION - 1
    while fraction > 0 and not isinstance(replace(like, fraction_bits=fraction).backend, Compiled):
        fraction -= 1
    return fraction


def _integer_bits(asked: Asked, stored: bool = False) -> int:
    """Return the integer bits that a model and its data need at least, or only what a linear system stores of them."""
    model, z = asked.model, asked.z
    if isinstance(model, LinearSystem):
        if z is None:
            return 0 if asked.within is None else bits_for(float(np.max(asked.within.measurement)))
        program, of_values = model.as_filter().program, _sizes(model, z)
        kept = np.concatenate([np.ones(program.n + program.m, np.bool_), ~(program.wide & stored)])
        return _holding_limits(model, bits_for(float(of_values[kept].max())))
    sizes = [0.0]
    if is_filter(model):
        noise = model.noise if isinstance(model, NonlinearModel) else model
        sizes += [
            abs(float(each)) for letter in ("Phi", "H", "Q", "R", "x0", "P0") for each in getattr(noise, letter).flat
        ]
        _, z = measured(asked)
    if z is not None and not hasattr(z, "to_fractions"):
        sizes.append(float(np.abs(np.asarray(z, dtype=np.float64)).max()))
    return bits_for(max(sizes))


def _holding_limits(system: LinearSystem, bits: int) -> int:
    """Return integer bits, or more if the limits of a system need more, whether or not a run reaches them."""
    limits = system.as_filter().limits_in(FixedFormat(1100, 0)).values()
    return max([bits, *(math.frexp(each if each > 0 else math.nextafter(each, 0))[1] for each in limits)])


def _sizes(system: LinearSystem, z: Any) -> NDArray[np.float64]:
    """Return the largest size of each value of a linear system without rounding."""
    start = np.concatenate([system.x0.astype(np.float64), np.zeros(system.p)])
    made, given = system.as_filter(), np.asarray(z, dtype=np.float64)
    coefficients = made.coefficients.astype(np.float64)
    steps, at = RunningStep(system_step(made.program, whole=True), [BINARY64], [coefficients[None]]), 0
    sizes = np.zeros(len(made.program.places))
    while at < len(given):
        (states, values), _, stop, _ = steps.take(at, [start], given[at : at + steps.longest])
        if stop is not None:
            raise OverflowError(f"the run without rounding: {system.beyond()}")
        start, at = states[-1], at + len(states)
        np.maximum(sizes, np.abs(values).max(axis=0), out=sizes)
    return sizes


def bits_for(largest: float) -> int:
    """Return the smallest k with `largest` < 2**k; 0 for zero, as a format of integer bits k holds numbers."""
    if not math.isfinite(largest):
        raise OverflowError(
            "the run without rounding leaves the range of float64: the system is not stable; take fewer steps"
        )
    return math.frexp(largest)[1] if largest > 0 else 0


def scaled_sections(system: LinearSystem) -> LinearSystem | None:
    """Return a cascade with its sections scaled as by ``scale=True``; None if it is none at rest, or scaled already."""
    made = system.made
    if made is None or made.cascade is None or any(system.x0):
        return None
    try:
        found = scaled(made.cascade.sections(made.coefficients), made.cascade.form)
    except ValueError:  # the filter does not decay
        return None
    coefficients = exact([each for b, a in found for each in (*b, *a)])
    if (coefficients == made.coefficients).all():
        return None
    return LinearSystem.from_filter(replace(made, coefficients=coefficients))


def with_fraction_bits(words: WordFormats, fraction: int) -> WordFormats:
    """Return formats whose data have other fraction bits; those of the sums move by the same number."""
    moved, sums = fraction - words.data.fraction_bits, words.sums
    return replace(
        words,
        data=replace(words.data, fraction_bits=fraction),
        sums=None if sums is None else replace(sums, fraction_bits=sums.fraction_bits + moved),
    )


def exact_sums(made: LinearFilter, data: FixedFormat, coefficient_bits: int) -> WordFormats:
    """Return formats whose sums are exact and are rounded once, when they are stored."""
    stored = FloatFormat(2, coefficient_bits).array(made.coefficients).to_fractions()
    fraction = data.fraction_bits + max((each.denominator.bit_length() - 1 for each in stored), default=0)
    sums = FixedFormat(max(63 - fraction, data.integer_bits + 8), fraction, overflow="wrap")
    return WordFormats(data, coefficient_bits, sums)


def in_words(asked: Asked, rounding: Rounding, bits: int) -> Requirement:
    """Lower the formats of data, coefficients and sums of a linear system in this order."""
    made, like = asked.model.as_filter(), FixedFormat(_integer_bits(asked, stored=True), LARGEST_FRACTION, rounding)
    blamed = "coefficient_bits=, which is the most to try"
    search = _FixedSearch(asked, _judge(asked, like), like, True, lambda fmt: exact_sums(made, fmt, bits), blamed)
    data, judge = search.answer(), search.judge
    if data.format is None:
        return data
    words = cast(WordFormats, data.format)

    def least(error: Callable[[Any], Any], like: Any, largest: int, fewest: int = 2) -> Any:
        return Search(lambda fmt: judge.proof(error(fmt)), like, (), asked.ran, largest=largest, least=fewest).fmt

    if (found := least(lambda fmt: exact_sums(made, words.data, fmt.precision), FloatFormat(2, 2), bits)) is not None:
        words = exact_sums(made, words.data, found.precision)
    sums, fraction = words.accumulator, words.data.fraction_bits
    if (found := least(lambda fmt: replace(words, sums=fmt), sums, sums.fraction_bits, fraction)) is not None:
        words = replace(words, sums=found)
    for more in range(9):  # sums that wrap may overflow on the way if what is stored fits
        narrow = replace(words, sums=replace(words.accumulator, integer_bits=words.data.integer_bits + more))
        if judge.proof(narrow).ratio <= 1:
            words = narrow
            break
    ratio = judge.proof(words).ratio
    known, _ = evidence(asked.basis, asked.steps, judge.steps is not None)
    text, notes = f"{words}: {share_text(ratio)}, {known}", judge.warnings()
    return replace(data, format=words, ratio=ratio, text=joined(text, notes), why="", notes=notes)
