"""Rules of a number format: its digits, how it rounds, and its range."""

from __future__ import annotations

from enum import Enum
from fractions import Fraction
from typing import Literal, NamedTuple


def digit_unit(base: int, count: int | str = "") -> str:
    """Name what a precision counts in a base, as "bits" or "decimal digits"; without the plural if `count` is 1."""
    unit = {2: "bit", 10: "decimal digit"}.get(base, f"base-{base} digit")
    return unit if str(count) == "1" else f"{unit}s"


def digits_text(count: int | str, base: int = 2, kind: str = "") -> str:
    """Count digits in words, as "27 bits" or "1 decimal digit"; `count` may be a text, and `kind` says which digits.

    Examples
    --------
    >>> digits_text(27), digits_text(1, 10), digits_text("6, 7", 16), digits_text(1, kind="fraction")
    ('27 bits', '1 decimal digit', '6, 7 base-16 digits', '1 fraction bit')
    """
    return " ".join(filter(None, (str(count), kind, digit_unit(base, count))))


class Rounding(Enum):
    """How a number with too many digits is rounded to a format."""

    #: To nearest, ties away from zero; hung1984, ch. II, (3).
    NEAREST = "nearest"
    #: Toward zero, by dropping further digits; hung1984, ch. II, (9). IEEE 754 calls it roundTowardZero.
    CHOP = "chop"
    #: To nearest, ties to the neighbour with an even last digit, the default of IEEE 754.
    EVEN = "even"
    #: To nearest, ties toward plus infinity, as ``(p + half) >> n`` does in C.
    HALF_UP = "half up"
    #: Toward plus infinity.
    UP = "up"
    #: Toward minus infinity.
    DOWN = "down"
    #: Inexact results go to the neighbour with an odd last digit, so that a second rounding is correct.
    ODD = "odd"
    #: Up or down at random, with probabilities that make the expected value exact.
    STOCHASTIC = "stochastic"

    @classmethod
    def _missing_(cls, value: object) -> Rounding:
        """Find the member that a name means, so that ``Rounding("floor")`` and ``Rounding("UP")`` are roundings."""
        return rounding_named(value)

    @property
    def to_nearest(self) -> bool:
        """Whether a result moves by at most half a unit of its last digit."""
        return self in (Rounding.NEAREST, Rounding.EVEN, Rounding.HALF_UP)

    @staticmethod
    def documented() -> tuple[Rounding, Rounding]:
        """The two roundings of the reports: to nearest with ties away from zero, and chopping."""
        return Rounding.NEAREST, Rounding.CHOP


ALIASES = {"floor": Rounding.DOWN, "ceil": Rounding.UP, "ceiling": Rounding.UP, "truncate": Rounding.CHOP}
"""Other names of roundings."""


def rounding_named(rounding: object) -> Rounding:
    """Return a rounding, or the rounding with this name; case is ignored.

    Examples
    --------
    >>> rounding_named("nearest")
    <Rounding.NEAREST: 'nearest'>
    >>> rounding_named("floor"), Rounding("UP")
    (<Rounding.DOWN: 'down'>, <Rounding.UP: 'up'>)
    """
    if isinstance(rounding, Rounding):
        return rounding
    if isinstance(rounding, str):
        wanted = rounding.strip().lower().replace("_", " ").replace("-", " ")
        if wanted in ALIASES:
            return ALIASES[wanted]
        for each in Rounding:
            if wanted == each.value:
                return each
    names = ", ".join(repr(each.value) for each in Rounding)
    raise ValueError(f"got rounding {rounding!r}; needed a Rounding or one of {names}")


#: Order in which a sum of products is added, from left to right, pairwise, or in blocks.
Order = Literal["left", "pairwise", "blocked"]

#: Number of random bits that stochastic rounding compares with the dropped digits.
DRAW_BITS = 24


#: What happens to a result beyond the limits of a floating-point format.
FLOAT_OVERFLOWS = ("raise", "saturate")


class Limits(NamedTuple):
    """Range of a format."""

    #: Exponent of the smallest normal number, ``base**emin``.
    emin: int
    #: Whether numbers below it keep its spacing (subnormal numbers) or become zero.
    subnormal: bool
    #: The largest number and the most negative one.
    largest: Fraction
    lowest: Fraction
    #: What happens to results beyond these: "raise", "saturate", or in fixed point "wrap".
    overflow: str = "raise"
    #: Whether all numbers have the same spacing, as in fixed point.
    fixed: bool = False


class Rules(NamedTuple):
    """All settings that determine the digits of a result."""

    base: int
    precision: int
    rounding: Rounding
    limits: Limits | None = None
    seed: int = 0
