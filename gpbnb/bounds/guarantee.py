r"""The guarantee: a bound on the effect of rounding for all measurements within their limits.

:mod:`gpbnb.bounds.guess` guesses a bound, and :mod:`gpbnb.bounds.check` proves it, which is the only proof. A guarantee
assumes, and checks where it can, that

* the rounding is deterministic; a linear filter with fixed coefficients may also round at random;
* sums run from left to right, each product and each sum is rounded in the format, and none is fused or compensated: the
  run is ``Run(model, fmt, form)``, without its further options;
* the run opens with the model as given, see :mod:`gpbnb.filters.opening`, and the exact filter has the stored model and
  the stored measurements;
* the first estimate, as stored, is within the limits on the state;
* exponents suffice. With a limited range, underflow is part of the bound, and no bound exists if a number of a step
  might exceed the largest. A covariance beyond the range ends the emulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.certificate import of_filter, proved
from gpbnb.bounds.gains import MOST, Schedule, schedule
from gpbnb.bounds.guess import FilterLimits, Guess, filter_guess, linear_steps, loop_radius
from gpbnb.bounds.system import Recursion
from gpbnb.bounds.units import stored_sizes
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LARGEST_EXPONENT, LinearModel
from gpbnb.filters.named import whole_number
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.word_formats import WordFormats

PARTS = ("roundings of the estimate", "roundings of the closed loop", "errors of the gain")
"""Names of the parts of a bound, in the order in which a guarantee lists them."""

MOST_EMULATED = 1_000_000
"""Largest number of steps to emulate while a gain settles."""

EFFORT = 9e6
"""The most that a proof may take, in about the products of its steps; more if more steps are asked for."""


@dataclass(frozen=True, eq=False, repr=False)
class Guarantee:
    """A bound on the effect of rounding on estimates or outputs, for all measurements or inputs within limits.

    Parameters
    ----------
    bound : bound of the error of each state or output after every step; infinite if there is none.
    steps : None if the bound holds for ever; otherwise the number of steps for which it holds.
    why : why the bound does not hold for ever; empty if it does.
    format : the format or formats.
    text : what :mod:`gpbnb.bounds.check` proved, as JSON; empty if there is no bound, or if a system limits its values.
    """

    bound: NDArray[np.float64]
    steps: int | None
    why: str
    format: FloatFormat | FixedFormat | WordFormats
    text: str = ""

    @property
    def for_ever(self) -> bool:
        """Whether the bound holds for any number of steps."""
        return self.steps is None

    def certificate(self) -> str:
        """Return what was proved as JSON, which :mod:`gpbnb.bounds.check` verifies without the rest of this package.

        Raises
        ------
        ValueError : there is no bound, or a system limits its values.
        """
        if not self.text:
            raise ValueError(
                f"got no certificate for the bound {self.bound}: {self.why or 'the system limits its values'}"
            )
        return self.text

    def __repr__(self) -> str:
        numbers = ", ".join(f"{b:.3g}" for b in self.bound)
        time = "for ever" if self.for_ever else f"for {self.steps} steps only, because {self.why};"
        fmt = str(self.format) if isinstance(self.format, WordFormats) else arithmetic(self.format)
        if self.steps == 0:
            return f"no bound, because {self.why}; in {fmt}"
        return f"within {numbers} {time}{',' * self.for_ever} in {fmt}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FilterGuarantee(Guarantee):
    """A bound on the estimates of a filter, and what it was computed from.

    Parameters
    ----------
    parts : (n, 3), shares of each state's bound at the step where it is largest; see :data:`PARTS`.
    limits : limits on the filter without rounding: those given, and those that follow from them.
    schedule : the filter's coefficients.
    radius : growth of an error per step, averaged over a period.
    asked : limits as given.
    lags : how many earlier steps the checker sums one by one, for fixed coefficients.
    """

    parts: NDArray[np.float64]
    limits: FilterLimits
    schedule: Schedule
    radius: float
    asked: FilterLimits
    lags: int = 1

    def __repr__(self) -> str:
        settled = self.for_ever and self.schedule.repeat is not None
        return super().__repr__() + (f"; the gain repeats from step {self.schedule.repeat}" if settled else "")


def limits(*, state: Any = math.inf, innovation: Any = math.inf, measurement: Any = math.inf) -> FilterLimits:
    """Set limits on the states, innovations or measurements of the exact filter.

    Each limit is one number for all entries, or one number per entry; those that float64 does not hold are rounded up.

    Raises
    ------
    ValueError : a limit is negative, NaN, or neither one number nor a list of numbers; or too few limits are finite.
    """
    found = []
    for name, each in (("state", state), ("innovation", innovation), ("measurement", measurement)):
        try:
            given = np.atleast_1d(all_above(each))
        except (TypeError, ValueError):
            raise ValueError(f"got {each!r} on the {name}; needed one number for all, or a list of numbers") from None
        if given.ndim > 1 or not given.size:
            raise ValueError(f"got limits of shape {given.shape} on the {name}; needed one number, or a list of them")
        found.append(given)
    _check_numbers(FilterLimits(*found))
    return FilterLimits(*found)


def _check_numbers(within: FilterLimits) -> None:
    """Reject limits that are negative, too large or too small for sums in float64, or too few."""
    X, V, Z = within
    for name, each in zip(within._fields, within, strict=True):
        if np.isnan(each).any() or (each < 0).any():
            raise ValueError(f"got a limit {each} on the {name}; needed numbers that are not negative")
    if not np.isfinite(Z).all() and not (np.isfinite(X).all() and np.isfinite(V).all()):
        raise ValueError(
            f"got limits {X} on the state, {V} on the innovation and {Z} on the measurement; needed a finite limit for "
            "each measurement, or for each state and each innovation"
        )
    least, most = 2.0**-LARGEST_EXPONENT, 2.0**LARGEST_EXPONENT
    for name, each in zip(within._fields, within, strict=True):
        if (((each > 0) & (each < least)) | (np.isfinite(each) & (each > most))).any():
            raise ValueError(
                f"got a limit {each} on the {name}; needed 0, infinity, or 2**-{LARGEST_EXPONENT} to "
                f"2**{LARGEST_EXPONENT}, or sums leave the range of float64; scale the model by powers of two"
            )


def sized_limits(within: Any, n: int, m: int, x0: Sequence[Any] | NDArray[Any] = ()) -> FilterLimits:
    """Return limits with one entry for each of n states, m innovations and m measurements.

    The exact filter must be within its limits from the beginning, at its first estimate (n,).
    """
    if not isinstance(within, FilterLimits):
        raise TypeError(f"got within={within!r}; needed the result of limits(...)")
    _check_numbers(within)
    found = []
    for name, each, size in zip(within._fields, within, (n, m, m), strict=True):
        if np.shape(each) not in ((1,), (size,)):
            raise ValueError(
                f"got {len(each)} limits on the {name}; needed one, or {size}: this filter has {n} "
                f"state{'s' * (n != 1)} and {m} measurement{'s' * (m != 1)}"
            )
        found.append(np.array(np.broadcast_to(each, (size,))))
    for i, (value, most) in enumerate(zip(x0, found[0], strict=False)):
        if abs(value) > most:
            raise ValueError(
                f"got a first estimate {float(value)!r} of state {i}, beyond its limit {float(most)!r}; needed a first "
                "estimate within its limit, from which the exact filter starts; raise the limit, or change x0"
            )
    return FilterLimits(*found)


def guarantee(
    model: LinearModel,
    fmt: FloatFormat | FixedFormat,
    within: FilterLimits,
    form: Form | str = Form.INNOVATION,
    most: int | None = None,
    horizon: int = 1_000,
    proved: bool = True,
) -> FilterGuarantee:
    """Bound the effect of rounding on the estimates of a Kalman filter, for every admissible measurement sequence.

    The bound is for a run of the model as given, with sums from left to right and no fused multiply-add. Its
    assumptions are listed in :mod:`gpbnb.bounds.guarantee`.

    Parameters
    ----------
    model, fmt, form : the filter. The bound covers the distance of its estimates from those of the exact filter with
        the same stored model and measurements. If the model has a number of `steps`, the bound holds for these steps.
    within : limits on the exact filter, from :func:`limits`; limits on the measurements apply to the values before they
        are stored.
    most : the largest number of steps to emulate while the gain settles, 20,000 by default, and fewer for more than 17
        states; at most 1,000,000. A proof takes more steps in proportion to a larger number.
    horizon : the number of steps that the bound covers if no bound holds for ever.
    proved : whether the bound is proved, or only guessed.
    """
    if not isinstance(model, LinearModel):
        raise TypeError(
            f"got a {type(model).__name__}; needed a LinearModel; for a linear system, ask required_precision(..., "
            'basis="guarantee", within=limits(...))'
        )
    if not isinstance(fmt, (FloatFormat, FixedFormat)):
        raise TypeError(f"got the format {fmt!r}; needed a FloatFormat or a FixedFormat")
    if most is not None:
        whole_number("most", most, most=MOST_EMULATED)
    within = sized_limits(within, model.n, model.m)
    if model.steps is not None:
        most, horizon = min(MOST if most is None else most, model.steps), min(horizon, model.steps)
    effort = EFFORT * max(MOST if most is None else most, MOST) / MOST
    found = from_schedule(schedule(model, fmt, form, most, horizon), within, horizon, False, effort)
    if model.steps is not None and found.steps in (None, model.steps):
        found = replace(found, steps=model.steps, why=f"{model.name} describes no more")
    return _proved(found) if proved else found


def from_schedule(
    given: Schedule, within: FilterLimits, horizon: int = 1_000, proved: bool = True, effort: float = EFFORT
) -> FilterGuarantee:
    """Compute a guarantee for a linear filter of any origin whose coefficients are known; see :func:`guarantee`.

    `effort` limits what a proof may take.
    """
    n, m = given.program.n, given.program.m
    within = sized_limits(within, n, m, given.x0)
    radius, stored = loop_radius(given) if given.settled else math.nan, stored_sizes(given.fmt, within.measurement)
    why, for_ever = given.why, given.settled and radius < 1
    if given.settled and not for_ever:
        why = f"the closed loop is not stable: an error grows by a factor of {radius:.6g} a step"
    steps = None if for_ever else horizon if given.settled else min(horizon, given.steps)
    try:
        if isinstance(given.origin, LinearFilter):
            found = _recursion(given, within, steps).guess(given.fmt)
        else:
            _check_effort(given, steps, radius, effort)
            found = filter_guess(given, within._replace(measurement=stored), steps)
    except (ValueError, OverflowError) as error:
        none = np.full(n, np.inf)
        found, steps, why = Guess(none, none, np.full(m, np.inf), np.zeros((n, 3))), 0, str(error)
    derived = FilterLimits(found.state, found.innovation, stored)
    guess = FilterGuarantee(
        found.bound, steps, why, given.fmt, parts=found.parts, limits=derived, schedule=given, radius=radius,
        asked=within, lags=found.lags,
    )  # fmt: skip
    return _proved(guess) if proved else guess


def _check_effort(given: Schedule, steps: int | None, radius: float, effort: float) -> None:
    """Reject a proof that would take too many steps, before it is tried."""
    n, m = given.program.n, given.program.m
    most = int(effort / (120 + n**2 * (n + m)))
    if steps is not None:
        if steps > most:
            raise ValueError(f"a proof takes each of {steps} steps; needed at most {most} steps")
        return
    period = given.steps - given.first
    later = math.ceil(math.log(2.0**-26) / math.log(min(max(radius, 1e-3), 1 - 1e-15))) * period
    if given.first + later / 4 > most:
        raise ValueError(
            f"the filter is too slow for a proof: its gain takes {given.first} steps to settle, and errors take "
            f"{later} to decay, of which four count as one; needed at most {most} steps; take more process noise, so "
            "that it forgets sooner, or a larger most="
        )


def _recursion(given: Schedule, within: FilterLimits, steps: int | None) -> Recursion:
    assert isinstance(given.origin, LinearFilter)
    return Recursion(given.origin, within.measurement, steps, as_given=False)


def _proved(found: FilterGuarantee) -> FilterGuarantee:
    """Prove a guarantee; return it with its certificate, or without a bound."""
    given, steps = found.schedule, found.steps
    if not np.isfinite(found.bound).all():
        return found
    guess = Guess(found.bound, found.limits.state, found.limits.innovation, found.parts, found.lags)
    F = closed_loops(given)

    def written(claim: Guess) -> dict[str, Any]:
        if isinstance(given.origin, LinearFilter):
            return _recursion(given, found.asked, steps).certificate(given.fmt, claim)
        return of_filter(given, found.asked, claim, steps, F)

    try:
        bound, text = proved(guess, written)
    except ValueError as error:
        return replace(found, bound=np.full(given.program.n, np.inf), steps=0, why=str(error))
    shares = found.parts * (bound / np.where(found.bound > 0, found.bound, 1))[:, None]
    return replace(found, bound=bound, parts=shares, text=text)


def closed_loops(given: Schedule) -> NDArray[np.float64]:
    """Return the closed loop of each step of a schedule, (steps, n, n), in float64."""
    return linear_steps(given, np.arange(given.steps)).F
