"""Search for the smallest precision that is sufficient."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Generic, NamedTuple, TypeVar

from gpbnb.arithmetic.conversion import MaybeNone
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.kernels.selection import LARGEST_PRECISION
from gpbnb.arithmetic.rounding import Rounding, digits_text

Kind = TypeVar("Kind", FloatFormat, FixedFormat)
"""Floating point or fixed point."""

CHECKED: dict[int, tuple[int, ...]] = {2: (24, 53), 10: (7, 16), 16: (6, 13)}
"""Precisions like those of binary32 and binary64, which are always tried if they are above the answer."""


MOST_BITS = 200
"""Highest precision, in bits, that is tried where no compiled loops are needed and a call gives no other limit."""


def largest_by_default(base: int) -> int:
    """Return the highest precision within :data:`MOST_BITS`: 200 bits, 60 decimal or 50 hexadecimal digits."""
    return math.floor(MOST_BITS / math.log2(base))


def smallest_precision(
    meets: Callable[[FloatFormat], bool],
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    least: int = 1,
    largest: int | None = None,
    monotone: bool = False,
) -> FloatFormat | MaybeNone:
    """Find the smallest precision with which a computation meets a requirement.

    Rounding errors do not shrink monotonically with the precision, so a precision qualifies only if the next higher one
    also meets the requirement. The search is a bisection: it assumes that all precisions above a qualifying one meet
    the requirement. In any case, the answer and the next higher precision have been tried and meet it, and the next
    lower one has been tried and does not qualify.

    Parameters
    ----------
    meets : whether a format meets the requirement; called at most once per format.
    base, rounding : base and rounding of the formats.
    least, largest : range of the precisions. Without `largest`, the range doubles until a precision meets the
        requirement; use this only if some precision does.
    monotone : whether every precision above one that meets the requirement meets it, too, as for a bound proportional
        to the unit roundoff; the next higher precision is then not tried.

    Returns
    -------
    fmt : the format, or None if no precision up to `largest` meets the requirement.

    Examples
    --------
    >>> from gpbnb.arithmetic.formats import FloatFormat
    >>> smallest_precision(lambda fmt: fmt.unit_roundoff < 1e-7).precision
    24
    """

    @cache
    def suffices(precision: int) -> bool:
        return meets(FloatFormat(base, precision, rounding))

    answer = _smallest(suffices, least, largest, monotone)
    return None if answer is None else FloatFormat(base, answer, rounding)


def _smallest(suffices: Callable[[int], bool], least: int, largest: int | None, monotone: bool) -> int | None:
    if largest is None:
        largest = least
        while not suffices(largest):
            largest *= 2
    if largest < least:
        raise ValueError(f"got precisions from {least} to {largest}; needed the largest to be at least the least")
    answer = least + bisect_left(range(least, largest), True, key=suffices)
    while answer < largest and not (suffices(answer) and (monotone or suffices(answer + 1))):
        answer += 1
    return answer if suffices(answer) else None


def largest_compiled(like: Kind) -> int:
    """Return the largest precision of formats such as `like` that have compiled loops; at least 2."""
    largest = LARGEST_PRECISION[like.base]
    while largest > 2 and not isinstance(_with_digits(like, largest).backend, Compiled):
        largest -= 1  # stochastic rounding has fewer digits
    return largest


def _with_digits(like: Kind, digits: int) -> Kind:
    """Return a format such as `like` with another precision, or in fixed point with other fraction bits."""
    if isinstance(like, FixedFormat):
        return replace(like, fraction_bits=digits)
    return replace(like, precision=digits)


def least_from_which_on(met: Mapping[int, bool]) -> int | None:
    """Return the smallest precision that meets a requirement together with all higher ones that were run, or None.

    This is the rule of :class:`Search` for precisions that were chosen before.

    Examples
    --------
    >>> least_from_which_on({20: True, 22: False, 24: True, 53: True})
    24
    """
    missed = max((digits for digits, meets in met.items() if not meets), default=0)
    return min((digits for digits in met if digits > missed), default=None)


class Outcome(NamedTuple):
    """What a precision gives: error / tolerance, and why it is infinite; and whether a number overflowed."""

    ratio: float
    why: str = ""
    overflow: bool = False


class Search(Generic[Kind]):
    """The smallest precision that meets a tolerance, and above which every precision tried meets it.

    Parameters
    ----------
    error : function that returns error / tolerance in a format, and why it is infinite.
    like : a format of any precision, with the base, the rounding and the range of those to try. In fixed point, the
        precision that is searched is the number of fraction bits, and `largest` must be given.
    checks : precisions that are tried if they lie above the answer.
    tick : called after each run.
    bounds : whether the errors are bounds, which may not exist. Precisions above the answer that have no bound are
        then listed as undecided and do not invalidate the answer.
    largest : highest precision to try; by default the largest with compiled loops, see :func:`largest_compiled`.
        Precisions without compiled loops are tried only if none below qualifies.
    least : lowest precision to try.
    proof : function that returns the outcome that is proved in a format, where `error` is a guess. It is asked of the
        answer alone; if it proves no answer, the search goes on above it.
    """

    def __init__(
        self,
        error: Callable[[Kind], Outcome],
        like: Kind,
        checks: Sequence[int],
        tick: Callable[[], object] = lambda: None,
        bounds: bool = False,
        largest: int | None = None,
        least: int = 2,
        proof: Callable[[Kind], Outcome] | None = None,
    ) -> None:
        self._ratios, self._why = dict[int, float](), dict[int, str]()
        #: What the search says of a format, proved if it can be.
        self.error: Callable[[Kind], Outcome] = error if proof is None else proof
        self._like: Kind = like
        self._given = largest is not None
        #: Precisions above the answer for which there is no bound.
        self.undecided: tuple[int, ...] = ()
        #: Precisions that met the tolerance although a higher one missed it; usually empty.
        self.irregular: tuple[int, ...] = ()
        #: The answer, or None.
        self.fmt: Kind | None = None
        fast = largest_compiled(like) if largest is None or isinstance(like, FloatFormat) else largest
        #: The highest precision that may be tried.
        self.largest = fast if largest is None else largest
        if self.largest < least:
            raise ValueError(f"got largest={largest}; needed at least {self._counted(least)}")

        def meets(digits: int) -> bool:
            if digits not in self._ratios:
                self._ratios[digits], self._why[digits], _ = error(_with_digits(like, digits))
                tick()
            return self._ratios[digits] <= 1

        for top in sorted({min(fast, self.largest), self.largest}):
            answer = self._answer(meets, least, top, checks, bounds)
            while answer is not None and proof is not None:
                self._ratios[answer], self._why[answer], _ = proof(_with_digits(like, answer))
                if self._ratios[answer] <= 1:
                    break
                answer = self._answer(meets, least, top, checks, bounds)
            if answer is not None and (answer < top or top == self.largest):
                self.fmt = _with_digits(like, answer)
                return
            least = top

    def _answer(
        self, meets: Callable[[int], bool], least: int, largest: int, checks: Sequence[int], bounds: bool
    ) -> int | None:
        """Return the smallest precision from `least` to `largest` that qualifies, and test the precisions above it."""
        answer = _smallest(meets, least, largest, monotone=False)
        if answer is None or not checks:
            return answer
        above = {digits for digits in (answer + 2, *checks) if answer < digits <= largest}
        missed = [digits for digits in sorted(above) if not meets(digits)]
        if not missed:
            return answer
        if bounds and all(math.isinf(self._ratios[digits]) for digits in missed):
            self.undecided = tuple(missed)
            return answer
        most = max(digits for digits in range(answer, largest + 1) if not meets(digits))
        self.irregular = tuple(digits for digits, ratio in self.tried if ratio <= 1 and digits < most)
        # a single precision above could be chance
        return most + 1 if most + 1 < largest else None

    def _counted(self, digits: int) -> str:
        return digits_text(digits, self._like.base)

    @property
    def limit(self) -> str:
        """Return what sets the highest precision that may be tried."""
        if self._given:
            return f"where highest={self.largest} ends the search"
        return f"the most with compiled loops in base {self._like.base}, rounded {self._like.rounding.value}"

    @property
    def tried(self) -> tuple[tuple[int, float], ...]:
        """Return each precision tried, and its error / tolerance."""
        return tuple(sorted(self._ratios.items()))

    def is_bounded(self) -> bool:
        """Whether a precision that was tried has a finite error."""
        return any(math.isfinite(ratio) for ratio in self._ratios.values())

    @property
    def reasons(self) -> dict[int, str]:
        """Return for each precision tried why its error is infinite, empty if it is not."""
        return dict(self._why)

    @property
    def why(self) -> str:
        """Return why the largest precision that has no finite error, below the answer, has none."""
        below = math.inf if self.fmt is None else self.fmt.precision
        reasons = [
            f"in {self._counted(digits)} {reason}"
            for digits, reason in sorted(self._why.items())
            if reason and digits < below
        ]
        return reasons[-1] if reasons else ""
