"""Find the digits that each block of a Kalman filter needs, and the formats of a filter in fixed point, one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from gpbnb.arithmetic.conversion import MaybeNone, Numbers
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding, rounding_named
from gpbnb.arithmetic.search import CHECKED, Outcome, Search, largest_compiled
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import compiled_form, whole_number
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.nonlinear_run import check_form, simulated
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.words import WordFormats
from gpbnb.wordlength.fixed_point import Basis as FixedBasis
from gpbnb.wordlength.fixed_point import FixedAnswer, exact_sums, required_fraction_bits, words_error
from gpbnb.wordlength.precision import checked_question, recorded_strategy
from gpbnb.wordlength.requirement import Asked, Requirement, format_like


@dataclass(frozen=True)
class BlockRequirement:
    """The digits that each block needs.

    Parameters
    ----------
    formats : formats of all blocks that together meet the tolerance, each lowered in its turn as far as the others
        allow; None if one format for all blocks does not meet it.
    ratio : largest error / tolerance with these formats.
    uniform : the answer with one format for all blocks.
    alone : for each block, the smallest precision while all others have the highest precision; None if none is enough.
    tried : formats of the blocks, and largest error / tolerance, in the order in which they were run.
    """

    formats: BlockFormats | MaybeNone
    ratio: float
    uniform: Requirement
    alone: dict[str, int | None]
    tried: tuple[tuple[BlockFormats, float], ...]

    @property
    def met(self) -> bool:
        """Whether some formats meet the tolerance."""
        return self.formats is not None

    def __bool__(self) -> bool:
        """Whether some formats meet the tolerance, as :attr:`met`."""
        return self.met

    @property
    def limiting(self) -> tuple[str, ...]:
        """The blocks that need the most digits when lowered alone."""
        most = max((digits for digits in self.alone.values() if digits is not None), default=None)
        return tuple(name for name, digits in self.alone.items() if digits == most)

    def __str__(self) -> str:
        if self.formats is None:
            return str(self.uniform)
        each = ", ".join(f"{name} {digits}" for name, digits in self.alone.items())
        limits = " and ".join(f"the {name}" for name in self.limiting)
        verb = "limit" if len(self.limiting) > 1 else "limits"
        return (
            f"{self.formats}: {self.ratio:.2g} of the tolerance; {limits} {verb} the filter: lowered one "
            f"at a time, the blocks need {each}; one format for all needs {self.uniform.precision}"
        )

    __repr__ = __str__


def required_block_precisions(
    model: AnyModel,
    steps: int,
    tolerance: Numbers,
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    form: Form | str = Form.INNOVATION,
    z: Numbers | None = None,
    seed: int = 0,
    sums: bool = False,
    emin: int | None = None,
    emax: int | None = None,
    subnormal: bool = True,
) -> BlockRequirement:
    """Lower each block of a Kalman filter to its smallest precision within a tolerance, and name the limiting block.

    The search first finds one format for all blocks, as :func:`gpbnb.wordlength.precision.required_precision` does with
    the basis "emulation". Then it lowers one block at a time, while all other blocks keep the highest precision.
    Finally it starts from the common format and lowers the blocks one after the other, without raising any again. The
    first to be lowered is the block that needed the fewest digits when it was lowered alone.

    Parameters
    ----------
    model, steps, tolerance, base, rounding, z, seed, emin, emax, subnormal : as for ``required_precision``.
    form : a form with compiled loops; the innovation form, Joseph's or UD for a nonlinear filter.
    sums : whether sums of products have a format of their own. This format keeps the highest precision while the
        blocks are lowered. It is lowered last, but never below the precision of any block.

    Raises
    ------
    TypeError : `model` is neither a ``LinearModel`` nor a ``NonlinearModel``.
    ValueError : as for ``required_precision``; a form without compiled loops; stochastic rounding; sums in base 10.

    Examples
    --------
    >>> from gpbnb import LinearModel
    >>> model = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[100]])
    >>> print(required_block_precisions(model, 50, 0.05).formats)
    state 5, gain 10, covariance 9, innovation 7 bits
    """
    if not isinstance(model, LinearModel | NonlinearModel):
        raise TypeError(f"got a {type(model).__name__}; needed a LinearModel or a NonlinearModel")
    form, like = compiled_form(form), format_like(base, rounding_named(rounding), emin, emax, subnormal)
    asked = Asked(whole_number("steps", steps), "emulation", like)
    if isinstance(model, NonlinearModel):
        check_form(model, form, blocks=True)
        if sums:
            raise ValueError("got sums=True for a nonlinear filter; needed False: its blocks round each sum")
    else:
        model.refuse_inputs("a search over blocks")
    tolerances = checked_question(model, [like], tolerance, asked.basis)
    if z is None:
        z = simulated(model, asked.steps, whole_number("seed", seed, 0))
    strategy = recorded_strategy(model, z, tolerances, form, asked.basis, asked.steps)
    most = replace(like, precision=largest_compiled(like))
    tried = list[tuple[BlockFormats, float]]()

    def error(formats: BlockFormats) -> Outcome:
        found = strategy.error(formats)
        tried.append((formats, found.ratio))
        return found

    def lowered(formats: BlockFormats, name: str, least: int = 2) -> int | None:
        """Return the smallest precision of a block, up to that which it has; None if this is not enough."""
        largest = getattr(formats, name).precision
        search = Search(lambda fmt: error(formats.with_block(name, fmt)), like, (), largest=largest, least=least)
        return None if search.fmt is None else search.fmt.precision

    wide = most if sums else None
    with asked.search(CHECKED[base]) as search:
        if sums:
            found = Search(lambda fmt: error(BlockFormats.uniform(fmt, wide)), like, CHECKED[base])
        else:
            found = search(strategy)
    uniform = asked.answer(found, form)
    alone = {name: lowered(BlockFormats.uniform(most, wide), name) for name in BLOCKS}
    if found.fmt is None:
        return BlockRequirement(None, float("inf"), uniform, alone, tuple(tried))
    formats, least = BlockFormats.uniform(found.fmt, wide), found.fmt.precision
    for name in _by_need(alone):
        digits = lowered(formats, name)
        formats = formats.with_block(name, replace(like, precision=least if digits is None else digits))
    if sums:
        least = max(getattr(formats, name).precision for name in BLOCKS)
        digits = lowered(formats, "sums", least)
        formats = formats.with_block("sums", replace(like, precision=most.precision if digits is None else digits))
    return BlockRequirement(formats, error(formats).ratio, uniform, alone, tuple(tried))


def _by_need(alone: dict[str, int | None]) -> Sequence[str]:
    """Return the blocks in ascending order of the digits that they need."""
    needs = {name: float("inf") if digits is None else digits for name, digits in alone.items()}
    return sorted(needs, key=lambda name: needs[name])


@dataclass(frozen=True)
class WordRequirement:
    """The formats of data, coefficients and sums that a linear system needs in fixed point.

    Parameters
    ----------
    words : the formats; None if no number of fraction bits of the data meets the tolerance.
    ratio : largest error or bound / tolerance with these formats.
    data : the answer with :data:`MOST_COEFFICIENT_BITS` for each coefficient and exact sums.
    """

    words: WordFormats | MaybeNone
    ratio: float
    data: FixedAnswer

    @property
    def met(self) -> bool:
        """Whether the formats meet the tolerance."""
        return self.words is not None

    def __bool__(self) -> bool:
        """Whether the formats meet the tolerance, as :attr:`met`."""
        return self.met

    def __str__(self) -> str:
        if self.words is None:
            return str(self.data)
        return f"{self.words}: {self.ratio:.2g} of the tolerance, by {self.data.basis}"

    __repr__ = __str__


MOST_COEFFICIENT_BITS = 24
"""Significant bits of a coefficient with which a search over words begins."""


def required_word_formats(
    system: LinearSystem,
    z: Any,
    tolerance: Sequence[float] | float,
    basis: FixedBasis = "emulation",
    rounding: Rounding | str = Rounding.NEAREST,
) -> WordRequirement:
    """Lower the formats of data, coefficients and sums in this order to the smallest within a tolerance.

    The data are lowered with 24 bits for each coefficient and exact sums that are rounded once
    when they are stored. Then the significant bits of the coefficients are lowered, and last the fraction bits of the
    sums, to no fewer than those of the data, and their integer bits. Sums wrap around.

    Parameters
    ----------
    system, z, tolerance, basis, rounding : as of :func:`gpbnb.wordlength.fixed_point.required_fraction_bits`.

    Raises
    ------
    ValueError, OverflowError : as of that function.

    Examples
    --------
    >>> import numpy as np
    >>> from gpbnb import LinearSystem
    >>> smoother = LinearSystem.smoother("0.3")
    >>> print(required_word_formats(smoother, np.ones((50, 1)), 0.01).words.coefficients)
    5
    """
    data = required_fraction_bits(system, z, tolerance, basis, rounding, MOST_COEFFICIENT_BITS, wide=True)
    if data.words is None:
        return WordRequirement(None, float("inf"), data)
    words, error = data.words, words_error(system, z, tolerance, basis)
    of_data = words.data

    def with_coefficients(bits: int) -> WordFormats:
        return exact_sums(system, of_data, bits)

    found = Search(
        lambda fmt: error(with_coefficients(fmt.precision)), FloatFormat(2, 2), (), largest=MOST_COEFFICIENT_BITS
    )
    if found.fmt is not None:
        words = with_coefficients(found.fmt.precision)
    sums = words.accumulator
    shorter = Search(
        lambda fmt: error(replace(words, sums=fmt)),
        sums,
        (),
        largest=sums.fraction_bits,
        least=words.data.fraction_bits,
    )
    if shorter.fmt is not None:
        words = replace(words, sums=shorter.fmt)
    for more in range(9):  # sums that wrap may overflow on the way if what is stored fits
        narrow = replace(words, sums=replace(words.accumulator, integer_bits=of_data.integer_bits + more))
        if error(narrow).ratio <= 1:
            words = narrow
            break
    return WordRequirement(words, error(words).ratio, data)
