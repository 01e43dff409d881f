"""A question about a model: what it is asked, of which data, within which tolerances."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_named
from gpbnb.bounds.gains import check_deterministic
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.words import WordFormats
from gpbnb.wordlength.answer import Basis, Requirement, evidence, joined

AnyFormat = FloatFormat | FixedFormat | WordFormats | BlockFormats
Function = Callable[..., Any]
"""A function ``run(fmt, z)``, or ``run(fmt)`` without z, that returns the outputs of all steps in the format."""


class Data(NamedTuple):
    """What a model is run with: measurements or inputs, (steps, m), or their number; and the seed to simulate them."""

    z: Any
    steps: int
    seed: int = 0


@dataclass(frozen=True)
class Asked:
    """What is asked about a model, apart from the formats to try."""

    model: Any
    data: Data
    tolerance: Any
    basis: Basis = "emulation"
    within: FilterLimits | None = None
    form: Form = Form.INNOVATION
    highest: int | None = None
    progress: bool = False

    def of_filter(self) -> bool:
        """Whether the model is a Kalman filter."""
        return isinstance(self.model, LinearModel | NonlinearModel)

    def evidence(self, ends: bool) -> tuple[str, str]:
        """Return how an error is known, and what had to meet the tolerance."""
        return evidence(self.basis, self.data.steps, ends)

    def answer(
        self, fmt: Any, ratio: float, tried: Any, ends: bool, text: str, why: str, notes: Sequence[str], **more: Any
    ) -> Requirement:
        """Return an answer, with its text before notes; `ends` is whether it holds for the steps of the data only."""
        notes, for_ever = tuple(filter(None, notes)), self.basis in ("guarantee", "probable") and not ends
        form = self.form if self.of_filter() else None
        steps = None if for_ever else self.data.steps
        return Requirement(fmt, ratio, self.basis, steps, tried, joined(text, notes), why, notes, form, **more)

    def check_sizes(self, like: FloatFormat | FixedFormat) -> None:
        """Reject a filter that compiled loops do not hold, or a rounding that a basis does not cover."""
        if self.of_filter():
            if like.limits is None:
                self.model.check_sizes()
            if self.basis in ("guarantee", "probable"):
                check_deterministic(like)


def tolerances_of(tolerance: Any, count: int, what: str) -> NDArray[np.float64]:
    """Return the tolerance of each of `count` states or outputs, rounded down."""
    needed = f"needed an error above 0 for each of the {count} {what}, one finite"
    try:
        given = np.asarray(tolerance)
        if given.dtype.kind not in "iufOU":
            raise ValueError("no real numbers")
        negative = [-exactly(each) for each in given.ravel().tolist()]
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


def checked_format(fmt: Any, *more: type) -> Any:
    """Return a format, or that of a name; classes of formats beside FloatFormat and FixedFormat may be allowed, too."""
    found = format_named(fmt)
    if not isinstance(found, (FloatFormat, FixedFormat, *more)):
        others = "".join(f"{each.__name__}, " for each in more)
        why = "; an answer that is not met has no format" if fmt is None else ""
        raise TypeError(
            f'got the format {fmt!r}; needed a FloatFormat, a FixedFormat, {others}or a name such as "float32" or '
            f'"Q3.12"{why}'
        )
    return found


def exactly(number: Any) -> Any:
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
