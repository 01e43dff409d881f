"""Searches in fixed point: fraction bits for all numbers, or formats for data, coefficients and sums."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.named import arithmetic, format_named
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding, digits_text
from gpbnb.arithmetic.search import Outcome, Search
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.sections import scaled
from gpbnb.filters.system import LinearFilter, LinearSystem
from gpbnb.filters.words import WordFormats, largest_values
from gpbnb.wordlength.answer import (
    Requirement,
    joined,
    share_text,
)
from gpbnb.wordlength.asked import Asked, check_sizes
from gpbnb.wordlength.strategies import measured, slowest_response

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
    model = asked.model
    if coefficient_bits is not None and (like is not None or not isinstance(model, LinearSystem)):
        raise ValueError(
            "got coefficient_bits beside like, or without a linear system; needed them for a linear system"
        )
    of_system = isinstance(model, LinearSystem)
    if isinstance(like, FixedFormat) and of_system:
        like = WordFormats(like)
    data_like = like.data if isinstance(like, WordFormats) else like
    if data_like is None:
        data_like = FixedFormat(_integer_bits(asked), LARGEST_FRACTION, rounding)
    check_sizes(asked, data_like)
    search = _FixedSearch(asked, data_like, like is None)
    if of_system:
        made, bits = model.as_filter(), coefficient_bits or COEFFICIENT_BITS
        search.words_of = (
            (lambda fmt: with_fraction_bits(like, fmt.fraction_bits))
            if isinstance(like, WordFormats)
            else (lambda fmt: WordFormats(fmt, bits))
        )
        search.blamed = (
            "coefficients of WordFormats" if like is not None else "coefficient_bits, or --coefficients in the command"
        )
        search.made = made
    return search.answer()


class _FixedSearch:
    """A search over fraction bits, with as many integer bits as each run needs.

    Parameters
    ----------
    like : a format with the integer bits, the rounding and the overflow of those to try.
    widens : whether a format in which a number overflows gets more integer bits.
    """

    def __init__(self, asked: Asked, like: FixedFormat, widens: bool) -> None:
        self.asked, self.like, self.widens = asked, like, widens
        self.strategy = asked.strategy(2, LARGEST_FRACTION + max(like.integer_bits, 0))
        self.least = max(0, 1 - like.integer_bits)
        self.words_of: Callable[[FixedFormat], Any] = lambda fmt: fmt
        self.blamed = ""
        self.made: LinearFilter | None = None
        self._more = dict[int, int]()  # integer bits that a number of fraction bits needs beyond those of `like`

    def error(self, fmt: FixedFormat, prove: bool = False) -> Outcome:
        """Return the largest error over its tolerance in the narrowest format without an overflow."""
        ask, found = self.strategy.proof if prove else self.strategy.error, Outcome(math.inf)
        start = max((more for more in self._more.values()), default=0) - 1 if not self.made else 0
        for more in range(max(start, 0), 1 + MORE_INTEGER_BITS) if self.widens else (0,):
            found = ask(self.words_of(replace(fmt, integer_bits=fmt.integer_bits + more)))
            if not found.overflow:
                self._more[fmt.fraction_bits] = more
                return found
        return found

    def formats(self, fmt: FixedFormat) -> Any:
        """Return the formats of an answer, with the integer bits that its fraction bits need."""
        return self.words_of(replace(fmt, integer_bits=fmt.integer_bits + self._more.get(fmt.fraction_bits, 0)))

    def search(self, largest: int) -> Search[FixedFormat]:
        """Search up to some fraction bits."""
        proof = (lambda fmt: self.error(fmt, prove=True)) if self.strategy.guesses else None
        return Search(self.error, self.like, (), largest=largest, least=self.least, proof=proof)

    def answer(self) -> Requirement:
        """Return the smallest number of fraction bits that meets the tolerance."""
        asked, largest = self.asked, LARGEST_FRACTION - 1
        most = f"{largest} fraction bits are the most tried"
        if isinstance(asked.model, LinearModel) and not self.widens:
            replace(self.like, fraction_bits=self.least).check_compiled()
        if isinstance(asked.model, LinearModel) and (compiled := _compiled_fraction(self.like)) < largest:
            largest = max(compiled, self.least)
            most = f"{digits_text(largest, kind='fraction')} are the most with compiled loops"
        found = self.search(largest)
        ends = self.strategy.steps is not None
        if not any(math.isfinite(ratio) for _, ratio in found.tried):
            later = self.strategy.over(asked.data.steps)
            if later is not None:
                self.strategy, ends = later, True
                found = self.search(largest)
        ratios, reasons = dict(found.tried), found.reasons

        def rejection(bits: int) -> str:
            text = digits_text(bits, kind="fraction")
            if reasons[bits]:
                cure = "" if self.widens or "overflow" not in reasons[bits] else _WIDER
                return f"{text} {'fails' if bits == 1 else 'fail'}: {reasons[bits]}{cure}"
            return f"{text} {'gives' if bits == 1 else 'give'} {ratios[bits]:.3g} times the tolerance"

        known, needed = asked.evidence(ends)
        steps = asked.data.steps if ends or asked.basis == "emulation" else None
        if found.fmt is None:
            blame = self.blame(largest)
            cause = self.unstable() if not blame else ""
            why = blame or cause or f"{rejection(largest)}; {most}"
            notes = () if blame or cause else tuple(filter(None, [self.scaled_advice(None)]))
            text = joined(f"no fixed-point format meets the tolerance {needed}: {why}", notes)
            return Requirement(None, math.inf, asked.basis, steps, found.tried, text, why, notes)
        bits = found.fmt.fraction_bits
        why = rejection(bits - 1) if bits > self.least else ""
        formats = self.formats(found.fmt)
        data = formats.data if isinstance(formats, WordFormats) else formats
        if formats == WordFormats(data):
            formats = data
        notes = tuple(filter(None, [self.scaled_advice(data), *self.strategy.warnings()]))
        subject = f"{digits_text(bits, kind='fraction')} in a word of {1 + data.precision} bits"
        text = joined(f"{subject}: {share_text(ratios[bits])}, {known}", [why, *notes])
        form = asked.form if asked.of_filter() else None
        return Requirement(formats, ratios[bits], asked.basis, steps, found.tried, text, why, notes, form)

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
        words_of = self.words_of
        given = words_of(fmt).coefficients
        if given is None:
            return ""

        def error(bits: FloatFormat) -> Outcome:
            self.words_of = lambda each: replace(words_of(each), coefficients=bits.precision)
            return self.error(fmt)

        found = Search(error, FloatFormat(2, 2), (), largest=LONGEST_COEFFICIENT)
        self.words_of = words_of
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
            slow = self.made is not None and fmt is None and self.strategy.guesses
            text = slowest_response(self.asked.model, self.asked.data.steps) if slow else ""
            return text and f"errors add up because the system is slow: its {text}"
        asked = replace(self.asked, model=other)
        like = replace(self.like, integer_bits=_integer_bits(asked)) if self.widens else self.like
        better = _FixedSearch(asked, like, self.widens)
        better.words_of, better.blamed, better.made = self.words_of, self.blamed, other.as_filter()
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


def _integer_bits(asked: Asked) -> int:
    """Return the integer bits that a model and its data need at least."""
    model, data = asked.model, asked.data
    if isinstance(model, LinearSystem):
        if data.z is None:
            return 0 if asked.within is None else bits_for(float(np.max(asked.within.measurement)))
        return bits_for(float(_sizes(model, data.z).max()))
    sizes = [0.0]
    if asked.of_filter():
        noise = model.noise if isinstance(model, NonlinearModel) else model
        sizes += [
            abs(float(each)) for letter in ("Phi", "H", "Q", "R", "x0", "P0") for each in getattr(noise, letter).flat
        ]
        data = data._replace(z=measured(model, data)[1])
    if data.z is not None and not hasattr(data.z, "to_fractions"):
        sizes.append(float(np.abs(np.asarray(data.z, dtype=np.float64)).max()))
    return bits_for(max(sizes))


def _sizes(system: LinearSystem, z: Any) -> NDArray[np.float64]:
    """Return the largest size of each value of a linear system without rounding."""
    start = np.concatenate([system.x0.astype(np.float64), np.zeros(system.p)])
    try:
        return largest_values(system.as_filter(), np.ascontiguousarray(np.asarray(z, dtype=np.float64)), start)
    except OverflowError:
        raise OverflowError(f"the run without rounding: {system.beyond()}") from None


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
    fraction = data.fraction_bits + max(each.denominator.bit_length() - 1 for each in stored)
    sums = FixedFormat(max(63 - fraction, data.integer_bits + 8), fraction, overflow="wrap")
    return WordFormats(data, coefficient_bits, sums)


def in_words(asked: Asked, rounding: Rounding, bits: int) -> Requirement:
    """Lower the formats of data, coefficients and sums of a linear system in this order."""
    made = asked.model.as_filter()
    search = _FixedSearch(asked, FixedFormat(_stored_integer_bits(asked), LARGEST_FRACTION, rounding), True)
    search.words_of, search.made = lambda fmt: exact_sums(made, fmt, bits), made
    search.blamed = "coefficient_bits=, which is the most to try"
    data = search.answer()
    if data.format is None:
        return data
    strategy, words = search.strategy, cast(WordFormats, data.format)
    found = Search(
        lambda fmt: strategy.proof(exact_sums(made, words.data, fmt.precision)), FloatFormat(2, 2), (), largest=bits
    )
    if found.fmt is not None:
        words = exact_sums(made, words.data, found.fmt.precision)
    sums = words.accumulator
    shorter = Search(
        lambda fmt: strategy.proof(replace(words, sums=fmt)),
        sums,
        (),
        largest=sums.fraction_bits,
        least=words.data.fraction_bits,
    )
    if shorter.fmt is not None:
        words = replace(words, sums=shorter.fmt)
    for more in range(9):  # sums that wrap may overflow on the way if what is stored fits
        narrow = replace(words, sums=replace(words.accumulator, integer_bits=words.data.integer_bits + more))
        if strategy.proof(narrow).ratio <= 1:
            words = narrow
            break
    ratio = strategy.proof(words).ratio
    known, _ = asked.evidence(strategy.steps is not None)
    text = joined(f"{words}: {share_text(ratio)}, {known}", strategy.warnings())
    return replace(data, format=words, ratio=ratio, text=text, why="", notes=strategy.warnings())


def _stored_integer_bits(asked: Asked) -> int:
    """Return the integer bits of what a run without rounding stores; sums need not fit."""
    model = asked.model
    if asked.data.z is None:
        return _integer_bits(asked)
    program, sizes = model.as_filter().program, _sizes(model, asked.data.z)
    kept = np.concatenate([np.ones(program.n + program.m, np.bool_), ~program.wide])
    return bits_for(float(sizes[kept].max()))
