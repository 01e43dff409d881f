"""What a strategy is: one way to find out how well a format does, for data and tolerances that were checked."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.search import Outcome
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.words import WordFormats
from gpbnb.wordlength.answer import Basis

AnyFormat = FloatFormat | FixedFormat | WordFormats | BlockFormats
Function = Callable[..., Any]
"""A function ``run(fmt, z)``, or ``run(fmt)`` without z, that returns the outputs of all steps in the format."""


class Strategy(ABC):
    """One way to find out how well a format does."""

    #: Steps for which a bound holds; None if it holds for ever.
    steps: int | None = None
    #: Why a user's function cannot be traced; empty if it can be.
    untraced: str = ""
    #: Whether errors are guesses, which a proof must confirm.
    guesses: ClassVar[bool] = False

    @abstractmethod
    def error(self, fmt: Any) -> Outcome:
        """Return the largest error or bound as a multiple of the tolerance; or infinity, with the reason."""

    def proof(self, fmt: Any) -> Outcome:
        """Return what is proved of a format."""
        return self.error(fmt)

    def over(self, steps: int) -> Strategy | None:
        """Return what bounds the errors over some steps where nothing bounds them for ever; None if nothing does."""
        return None

    def warnings(self) -> tuple[str, ...]:
        """Return why the errors may say little about other runs."""
        return ()


class Data(NamedTuple):
    """What a model is run with: measurements or inputs, (steps, m), or their number; and the seed to simulate them."""

    z: Any
    steps: int
    seed: int = 0


def tolerances_of(tolerance: Any, count: int, what: str) -> NDArray[np.float64]:
    """Return the tolerance of each of `count` states or outputs, rounded down."""
    needed = f"needed an error above 0 for each of the {count} {what}, one finite"
    try:
        given = np.asarray(tolerance)
        if given.dtype.kind not in "iufOU":
            raise ValueError("no real numbers")
        negative = [-_exactly(each) for each in given.ravel().tolist()]
        above = np.array([each < 0 for each in negative]).reshape(given.shape)
        tolerances = -all_above(np.array(negative, dtype=object)).reshape(given.shape)
    except (TypeError, ValueError, ArithmeticError):
        raise ValueError(f"got tolerance {tolerance!r}; {needed}") from None
    if tolerances.shape not in ((), (1,), (count,)):
        got = f"tolerance {tolerance}" if tolerances.size <= 2 * count else "a tolerance"
        raise ValueError(f"got {got} of shape {tolerances.shape}; {needed}: one number, or {count} in a row")
    if ((tolerances == 0) & above).any():
        raise ValueError(f"got tolerance {tolerance}; needed at least 2**-1074, which float64 holds; scale the {what}")
    if not (tolerances > 0).all() or not np.isfinite(tolerances).any():
        raise ValueError(f"got tolerance {tolerance}; {needed}")
    return np.broadcast_to(tolerances, (count,))


def _exactly(number: Any) -> Any:
    """Return a number as given, and text as a Fraction, or as infinity."""
    if isinstance(number, bool):
        raise ValueError("a truth value is no number")
    if not isinstance(number, str):
        return number
    return math.inf if number.strip().lower() in ("inf", "infinity") else Fraction(number)


def checked_basis(basis: Any) -> Basis:
    """Return a basis, or raise ValueError for another."""
    if not isinstance(basis, str) or basis not in get_args(Basis):
        raise ValueError(f"got basis {basis!r}; needed one of {', '.join(map(repr, get_args(Basis)))}")
    return basis  # type: ignore[return-value]


def largest_ratio(errors: NDArray[np.float64], tolerances: NDArray[np.float64]) -> float:
    """Return the largest error over its tolerance; infinite beyond the range of float64."""
    with np.errstate(over="ignore"):
        return float((errors / tolerances).max())
