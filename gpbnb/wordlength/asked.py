"""A question about a model, and how a strategy answers it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.gains import check_deterministic
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.forms import AnyForm, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.wordlength.answer import (
    Basis,
    evidence,
)
from gpbnb.wordlength.strategies import strategy_for
from gpbnb.wordlength.strategy import Data, Strategy

Found = TypeVar("Found")


@dataclass(frozen=True)
class Asked:
    """What is asked about a model, apart from the formats to try."""

    model: Any
    data: Data
    tolerance: Any
    basis: Basis = "emulation"
    within: FilterLimits | None = None
    form: AnyForm = Form.INNOVATION
    highest: int | None = None
    progress: bool = False

    def strategy(self, base: int = 2, most: int = 0) -> Strategy:
        """Return the strategy that answers; `base` and `most` are those of the formats to try."""
        return strategy_for(self.model, self.data, self.tolerance, self.basis, self.form, self.within, base, most)

    def of_filter(self) -> bool:
        """Whether the model is a Kalman filter."""
        return isinstance(self.model, LinearModel | NonlinearModel)

    def evidence(self, ends: bool) -> tuple[str, str]:
        """Return how an error is known, and what had to meet the tolerance."""
        return evidence(self.basis, self.data.steps, ends)


def check_sizes(asked: Asked, like: FloatFormat | FixedFormat) -> None:
    """Reject a filter that compiled loops do not hold, or a rounding that a basis does not cover."""
    if asked.of_filter():
        if like.limits is None:
            asked.model.check_sizes()
        if asked.basis in ("guarantee", "probable"):
            check_deterministic(like)


def for_ever_or_over(
    steps: int, strategy: Strategy, ask: Callable[[Strategy], Found], has_bound: Callable[[Found], bool]
) -> tuple[Found, bool]:
    """Ask a strategy for a bound for ever and, if it has none, for one over some steps.

    Returns
    -------
    found : what `ask` returns.
    ends : whether it holds only for the steps.
    """
    found = ask(strategy)
    if not has_bound(found) and (later := strategy.over(steps)) is not None:
        ended = ask(later)
        if has_bound(ended):
            return ended, True
    return found, strategy.steps is not None
