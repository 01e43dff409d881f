"""The rules of a number format: how it rounds, and how far its numbers reach."""

from __future__ import annotations

from enum import Enum
from fractions import Fraction
from typing import Literal, NamedTuple


class Rounding(Enum):
    """How a number with more digits than the format holds is fitted into it."""

    #: To nearest, half away from zero; hung1984, ch. II, (3).
    NEAREST = "nearest"
    #: Toward zero, the further digits dropped; hung1984, ch. II, (9). IEEE 754 calls it roundTowardZero.
    CHOP = "chop"
    #: To nearest, half to the neighbour with an even last digit, the default of IEEE 754.
    EVEN = "even"
    #: Toward plus infinity.
    UP = "up"
    #: Toward minus infinity.
    DOWN = "down"
    #: Inexact results to the neighbour with an odd last digit, so that a second rounding comes out right.
    ODD = "odd"
    #: Up or down at random, with the probability that makes the mean exact.
    STOCHASTIC = "stochastic"

    @staticmethod
    def documented() -> tuple[Rounding, Rounding]:
        """The two roundings of the reports: to nearest with ties away from zero, and chopping."""
        return Rounding.NEAREST, Rounding.CHOP


#: How a sum of products is added up: from left to right, halves of halves, or in blocks.
Order = Literal["left", "pairwise", "blocked"]

#: Stochastic rounding compares so many random bits with the digits that are dropped.
DRAW_BITS = 24


class Limits(NamedTuple):
    """How far the numbers of a format reach."""

    #: Exponent of the least normal number ``base**emin``, written d.dd... * base**e.
    emin: int
    #: Whether numbers below it keep its spacing; else they become zero.
    subnormal: bool
    #: The largest and the lowest number.
    largest: Fraction
    lowest: Fraction
    #: What happens beyond them: "raise", "saturate" or "wrap".
    overflow: str = "raise"
    #: Whether larger numbers have the same spacing too: fixed point.
    fixed: bool = False


class Rules(NamedTuple):
    """Everything that decides the digits of a result."""

    base: int
    precision: int
    rounding: Rounding
    limits: Limits | None = None
    seed: int = 0
