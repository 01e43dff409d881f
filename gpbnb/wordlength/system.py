"""Find the precision for a linear system: its errors for given inputs, or their bounds for all inputs.

A bound holds for ever, or for the steps asked for if the system never forgets its errors.

The error of an output is the difference from the system with the given coefficients, so it includes the errors of
storing them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import digit_unit, digits_text
from gpbnb.arithmetic.search import CHECKED, Outcome, Search
from gpbnb.bounds.guarantee import check_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.probable import probable_output_errors
from gpbnb.bounds.system import guessed_errors, output_errors
from gpbnb.filters.named import named
from gpbnb.filters.poles import eigenvalues
from gpbnb.filters.system import LinearSystem, system_inputs
from gpbnb.wordlength.requirement import (
    Asked,
    LastingBound,
    Requirement,
    Strategy,
    checked_tolerance,
    for_ever_or_over,
    largest_ratio,
    some_bound,
)


def required_system_precision(
    system: LinearSystem, asked: Asked, tolerance: Any, u: Any = None, within: FilterLimits | None = None
) -> Requirement:
    """Find the smallest precision with which the outputs of a linear system stay within a tolerance.

    Parameters
    ----------
    asked : the question. Its basis "emulation" compares with the system as given, for these inputs. "bound" holds for
        ever and for every input that is never larger than the largest of `u`, from rest; "guarantee" for inputs within
        the limits on the measurement. Both bound rounding, and the errors of storing coefficients and inputs. For a
        system that keeps its errors, such as a clock or an integrator, they hold for the steps asked for. "probable"
        takes three standard deviations of the rounding error in place of its bound.
    tolerance : largest error of each output, in its unit; one number, or (p,).
    u : (steps, m), inputs.
    within : result of :func:`gpbnb.bounds.guarantee.limits`, which limits the measurement only.

    Raises
    ------
    ValueError : inputs are missing or do not fit; the tolerance is not positive; or a bound is required for a system
        that does not start from rest.
    OverflowError : an output of the system as given is beyond the range of float64.
    """
    strategy = system_strategy(system, asked, tolerance, u, within)
    with asked.search(CHECKED[asked.like.base], bounds=asked.basis != "emulation") as search:
        found, ends = for_ever_or_over(asked.steps, strategy, search, some_bound)
    limited = not system.as_filter().program.is_linear
    cause = "" if found.fmt is not None or limited else system.unstable()
    if not cause:
        advice = "" if found.fmt is not None else _too_many_digits(system, found, asked)
        warnings = strategy.warnings() if found.fmt is not None and isinstance(strategy, EmulatedSystem) else ()
        remedy = "" if _is_long(system) else asked.in_more_digits(found)
        return asked.answer(found, advice=advice, ends=ends, warnings=warnings, remedy=remedy)
    if asked.basis == "probable":
        return asked.answer(found, cause=f"{cause}, {_FOR_SOME_STEPS}")
    grow = "grow with every step, whatever the precision" if asked.basis == "emulation" else "add up with every step"
    return asked.answer(
        found, advice=f"{cause}, so that errors {grow}: take fewer steps{_lost_design(system)}", ends=ends
    )


def _is_long(system: LinearSystem) -> bool:
    """Whether one recursion of the structure has an order of 3 or more, so that its coefficients move its poles far."""
    return system.made is not None and "a3" in system.made.program.coefficient_names


def _lost_design(system: LinearSystem) -> str:
    """Return what to do if b and a of a stable design are not stable."""
    if not _is_long(system):
        return ""
    return (
        "; if its design is stable, b and a have lost it in their rounding to float64: take second-order sections from "
        'the design tool, as output="sos" of SciPy gives them'
    )


def _too_many_digits(system: LinearSystem, found: Search[FloatFormat], asked: Asked) -> str:
    """Return how far the largest precision misses the tolerance, why, and which structure needs fewer digits."""
    (digits, ratio), base = found.tried[-1], asked.like.base
    parts = [] if math.isinf(ratio) else [f"{digits_text(digits, base)} give {ratio:.3g} times the tolerance"]
    if _is_long(system):
        fewer = f"fewer {digit_unit(base)}"
        parts.append(f"second-order sections usually need {fewer}: their coefficients move the poles less")
    elif asked.basis != "emulation" and (slow := slowest_response(system, asked.steps)):
        parts.append(f"errors add up because the system is slow: its {slow}")
    return "; ".join(parts)


_FOR_SOME_STEPS = (
    'so that an error of rounding never decays; ask with basis "bound" or "guarantee" for a number of steps instead, '
    "or reset the state now and then"
)


def system_strategy(
    system: LinearSystem, asked: Asked, tolerance: Any, u: Any, within: FilterLimits | None
) -> Strategy:
    """Check the question, and return the strategy that answers it."""
    basis = asked.basis
    tolerances = checked_tolerance(tolerance, system.p, "outputs", basis)
    if u is None and (within is None or basis in ("emulation", "bound")):
        raise ValueError(f'got no inputs for basis "{basis}"; needed z=, of shape ({asked.steps}, {system.m})')
    largest = np.array([np.inf])
    if u is not None:
        u = system_inputs(system, u, asked.steps)
        largest = all_above(np.abs(u).max(axis=0))
    if basis in ("guarantee", "probable"):
        if within is None:
            raise ValueError(f'got basis "{basis}" without limits; needed within=limits(..., measurement=...)')
        largest = largest_inputs(system, within)
    if basis == "emulation":
        return EmulatedSystem(system, u, system.outputs(u), tolerances)
    if any(system.x0):
        raise ValueError(f'got a first state {system.x0.tolist()} and basis "{basis}"; needed x0 = 0 for a bound')
    if basis == "probable":
        return ProbableSystem(system, largest, tolerances)
    keeps = system.as_filter().program.is_linear and system.unstable()
    return BoundedSystem(system, largest, tolerances, asked.steps if keeps else None)


def largest_inputs(system: LinearSystem, within: FilterLimits) -> NDArray[np.float64]:
    """Return the limits on the inputs of a system, (m,).

    Raises
    ------
    TypeError : `within` is not a result of :func:`gpbnb.bounds.guarantee.limits`.
    ValueError : limits for another number of states or inputs, or limits on the states or innovations.
    """
    check_limits(within, system.n, system.m)
    if np.isfinite(within.state).any() or np.isfinite(within.innovation).any():
        raise ValueError(
            f"got limits on states or innovations for {system.name}; needed limits on its inputs alone: write "
            f"limits({system.n}, {system.m}, measurement=...)"
        )
    return within.measurement


_FORGOTTEN = 0.01
"""Share to which the slowest response must decay within a run."""


def slowest_response(system: LinearSystem, steps: int) -> str:
    """Say how long the slowest response of a stable system lasts; nothing if it decays to 1 % within some steps."""
    entries = system.A.astype(np.float64)
    radius = float(np.abs(eigenvalues(entries)).max()) if np.isfinite(entries).all() else math.inf
    if not 0 < radius < 1 or radius**steps <= _FORGOTTEN:
        return ""
    needed = math.log(_FORGOTTEN) / math.log(radius)
    digits = max(len(str(int(needed))) - 2, 0)
    return f"slowest response takes {math.ceil(needed / 10**digits) * 10**digits} steps to decay to 1 %"


def weak_evidence(system: LinearSystem, true: NDArray[np.float64], tolerances: NDArray[np.float64]) -> tuple[str, ...]:
    """Return why the errors of a run may say little about other runs, in a sentence each; empty if nothing does.

    A run that ends before the slowest response has decayed does not show how errors add up. An output that stays within
    its tolerance would also meet it if it were zero.

    Parameters
    ----------
    true : (steps, p, 2), outputs of the system as given.
    tolerances : (p,).
    """
    found = list[str]()
    if slow := slowest_response(system, len(true)):
        found.append(
            f"the run of {len(true)} steps is shorter than the memory of the system, whose {slow}: take as many, or "
            "ask for a guarantee"
        )
    largest = np.abs(true[..., 0]).max(axis=0)
    for i in np.flatnonzero((largest <= tolerances) & np.isfinite(tolerances)):
        found.append(
            f"{named('output', int(i), system.output_names)} never exceeds {largest[i]:.3g} in this run, so that zero "
            f"would be within the tolerance of {tolerances[i]:.3g}: take larger inputs, or a smaller tolerance"
        )
    return tuple(found)


@dataclass(frozen=True, eq=False)
class EmulatedSystem:
    """Errors of the outputs for given inputs, (steps, m), against `true`, the outputs of the system as given."""

    system: LinearSystem
    u: Any
    true: NDArray[np.float64]
    tolerances: NDArray[np.float64]

    def warnings(self) -> tuple[str, ...]:
        """Return why the errors of this run may say little about other runs."""
        return weak_evidence(self.system, self.true, self.tolerances)

    def error(self, fmt: FloatFormat) -> Outcome:
        """Return the largest error over its tolerance, or infinity and the reason."""
        try:
            found = self.system.outputs(self.u, fmt)
        except (ValueError, OverflowError) as fault:
            return Outcome(math.inf, str(fault))
        error = (found[..., 0] - self.true[..., 0]) + (found[..., 1] - self.true[..., 1])
        largest = np.abs(error).max(axis=0)
        return _share(np.where(np.isnan(largest), np.inf, largest), self.tolerances)


@dataclass(frozen=True, eq=False)
class BoundedSystem(LastingBound):
    """Bounds of the errors of the outputs for all inputs up to the largest, (m,), over some steps or for ever."""

    system: LinearSystem
    largest: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    #: None if it holds for ever.
    steps: int | None = None

    def error(self, fmt: FloatFormat) -> Outcome:
        """Return the largest bound over its tolerance as it is guessed, or infinity and the reason."""
        return self._outcome(fmt, self._bounds)

    def proof(self, fmt: FloatFormat) -> Outcome:
        """Return the largest bound over its tolerance as it is proved, or infinity and the reason."""
        return self._outcome(fmt, lambda fmt: output_errors(self.system, fmt, self.largest, self.steps))

    def _outcome(self, fmt: FloatFormat, bounds: Callable[[FloatFormat], NDArray[np.float64]]) -> Outcome:
        try:
            return _share(bounds(fmt), self.tolerances)
        except (ValueError, OverflowError) as fault:
            return Outcome(math.inf, str(fault))

    def over(self, steps: int) -> BoundedSystem | None:
        """Return the bound over some steps of a system that limits its values; a linear one has it from the start."""
        limited = self.steps is None and not self.system.as_filter().program.is_linear
        return replace(self, steps=steps) if limited else None

    def _bounds(self, fmt: FloatFormat) -> NDArray[np.float64]:
        """Guess the error of each output, (p,)."""
        return guessed_errors(self.system, fmt, self.largest, self.steps)


class ProbableSystem(BoundedSystem):
    """As :class:`BoundedSystem`, with three standard deviations of the error of rounding in place of its bound."""

    proof = None  # type: ignore[assignment]

    def over(self, steps: int) -> None:
        """Return None: the probable error is that of a steady state."""

    def _bounds(self, fmt: FloatFormat) -> NDArray[np.float64]:
        if not self.system.as_filter().program.is_linear:
            raise ValueError(f'got {self.system.name}, which limits its values, and basis "probable"; needed "bound"')
        return probable_output_errors(self.system, fmt, self.largest)


def _share(errors: NDArray[np.float64], tolerances: NDArray[np.float64]) -> Outcome:
    """Return the largest error over its tolerance, and why it is infinite."""
    ratio = largest_ratio(errors, tolerances)
    if ratio < math.inf:
        return Outcome(ratio)
    what = "an error over its tolerance" if np.isfinite(errors).all() else "an output or a bound"
    return Outcome(math.inf, f"{what} is beyond the range of float64")
