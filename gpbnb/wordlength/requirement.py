"""The required number of digits, and the basis of this answer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import LARGEST_PRECISION
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.array_forms import AnyForm

ANY_BINARY = FloatFormat(2, 2)
"""A binary format; its precision does not matter."""

Basis = Literal["emulation", "bound", "guarantee", "probable"]


@dataclass(frozen=True)
class Requirement:
    """The smallest precision that meets a tolerance, and the basis of this answer.

    Parameters
    ----------
    fmt : None if no precision up to the limit of the search meets the tolerance.
    basis : "emulation", for the observed errors with these measurements; or "bound", for the largest possible errors.
    steps : steps of the filter.
    tried : precision, and largest error / tolerance over states and steps; infinite if the run stopped, a
        variance was no longer positive, or no bound exists.
    why : why, below the answer, the largest precision without a finite error has none; empty if all have one. It is
        shown if it prevented a smaller answer.
    form : form of the filter.
    irregular : precisions that meet the tolerance although a higher one that was run misses it; usually empty.
    advice : if more digits fail where fewer do not, another form that meets the tolerance; precisions without a bound.
    repairs : changes of the model's covariances, each as text.
    cause : why there is no answer in any precision; the limit of the search then does not matter.
    limit : why no higher precision than the last of `tried` was tried; it is shown if there is no answer.
    """

    fmt: FloatFormat | None
    basis: Basis
    steps: int
    tried: tuple[tuple[int, float], ...]
    why: str = ""
    form: AnyForm | None = None
    irregular: tuple[int, ...] = ()
    advice: str = ""
    repairs: tuple[str, ...] = ()
    limit: str = ""
    cause: str = ""

    @property
    def precision(self) -> int | None:
        """Digits of the answer, or None."""
        return None if self.fmt is None else self.fmt.precision

    def __str__(self) -> str:
        notes = [*self.repairs]
        if self.irregular:
            missed = [digits for digits, ratio in self.tried if not ratio <= 1 and digits > self.irregular[0]]
            notes.insert(0, f"{listed(self.irregular)} digits meet it, but {listed(missed)} do not")
        if self.advice:
            notes.append(self.advice)
        end = "".join(f"; {note}" for note in notes)
        if self.fmt is None and self.cause:
            return f"no precision meets the tolerance ({self.basis}, {self.steps} steps): {self.cause}{end}"
        if self.fmt is None:
            most, why = f"{self.tried[-1][0]} digits", f"; {self.why}" if self.why else ""
            if self.limit:
                most += f", {self.limit},"
            met = "meets the tolerance reliably" if self.irregular else "meets the tolerance"
            return f"no precision up to {most} {met} ({self.basis}, {self.steps} steps){why}{end}"
        tried = dict(self.tried)
        why = f"; {self.why}" if self.why and math.isinf(tried.get(self.fmt.precision - 1, 0.0)) else ""
        return (
            f"{self.fmt.precision} digits of base {self.fmt.base}, {self.fmt.rounding.value}: "
            f"{tried[self.fmt.precision]:.2g} of the tolerance ({self.basis}, {self.steps} steps){why}{end}"
        )


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


def checked_tolerance(tolerance: Any, count: int, what: str, base: int, basis: str) -> NDArray[np.float64]:
    """Check tolerance, base and basis, and return the tolerance of each of `count` states or outputs.

    Raises
    ------
    ValueError : a check fails; the message states what is needed.
    """
    needed = f"needed an error above 0 for each of the {count} {what}, one finite"
    try:
        if isinstance(tolerance, (str, bool)):
            raise ValueError("text and truth values are no numbers")
        tolerances = np.asarray(tolerance)
        if tolerances.dtype.kind not in "iufO":
            raise ValueError("no real numbers")
        tolerances = tolerances.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"got tolerance {tolerance!r}; {needed}") from None
    if tolerances.shape not in ((), (count,)):
        raise ValueError(
            f"got tolerance {tolerance} of shape {tolerances.shape}; {needed}: one number, or {count} in a row"
        )
    if not (tolerances > 0).all() or not np.isfinite(tolerances).any():
        raise ValueError(f"got tolerance {tolerance}; {needed}")
    if not isinstance(basis, str) or basis not in get_args(Basis):
        raise ValueError(f"got basis {basis!r}; needed one of {', '.join(map(repr, get_args(Basis)))}")
    check_base(base)
    return np.broadcast_to(tolerances, (count,))


def check_base(base: Any) -> None:
    """Reject a base without compiled loops.

    Raises
    ------
    ValueError : another base.
    """
    if isinstance(base, bool) or not isinstance(base, int) or base not in LARGEST_PRECISION:
        raise ValueError(f"got base {base!r}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}")


def format_like(
    base: Any, rounding: Rounding, emin: int | None = None, emax: int | None = None, subnormal: bool = True
) -> FloatFormat:
    """Return a format with base, rounding and range of those to try; its precision does not matter.

    Raises
    ------
    ValueError : a base without compiled loops; a range that ``FloatFormat`` refuses.
    """
    check_base(base)
    return FloatFormat(base, 2, rounding, emin, emax, subnormal)


def largest_ratio(errors: NDArray[np.float64], tolerances: NDArray[np.float64]) -> float:
    """The largest error over its tolerance; infinite beyond the range of float64."""
    with np.errstate(over="ignore"):
        return float((errors / tolerances).max())
