"""The ways to find out how well a format does for a model: by a run, or by one of the bounds."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.search import Outcome
from gpbnb.bounds.guarantee import FilterGuarantee, check_within, guarantee, guessed, sized_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.probable import probable_error, probable_output_errors
from gpbnb.bounds.system import guessed_errors, output_errors
from gpbnb.bounds.words import WordGuarantee
from gpbnb.filters.forms import AnyForm, ArrayForm, Form
from gpbnb.filters.model import LinearModel, stored_measurements
from gpbnb.filters.named import named
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.nonlinear_run import check_form, nonlinear_checkpoints, opened, simulated, true_states
from gpbnb.filters.poles import eigenvalues
from gpbnb.filters.run import reference
from gpbnb.filters.system import LinearSystem, is_stable, system_inputs
from gpbnb.filters.words import WordFormats, run_words
from gpbnb.wordlength.answer import Basis
from gpbnb.wordlength.functions import function_strategy
from gpbnb.wordlength.strategy import AnyFormat, Data, Strategy, largest_ratio, tolerances_of


def strategy_for(
    model: Any,
    data: Data,
    tolerance: Any,
    basis: Basis,
    form: AnyForm = Form.INNOVATION,
    within: FilterLimits | None = None,
    base: int = 2,
    most: int = 0,
) -> Strategy:
    """Check a question about a model, and return the strategy that answers it.

    Parameters
    ----------
    base, most : base and most digits of the formats to try, for the reference of a function.

    Raises
    ------
    ValueError, TypeError, OverflowError : for a reason given in :func:`gpbnb.required_precision`.
    """
    check_within(within, basis)
    if isinstance(model, LinearSystem):
        return _of_system(model, data, tolerance, basis, within)
    if not isinstance(model, LinearModel | NonlinearModel):
        return function_strategy(model, data, tolerance, base, most)
    tolerances = tolerances_of(tolerance, model.n, "states")
    if basis in ("emulation", "bound"):
        return recorded_strategy(model, data, tolerances, form, basis)
    if not isinstance(model, LinearModel):
        raise TypeError(f"got {model.name}; needed a LinearModel")
    return _for_ever(model, data, tolerances, basis, form, within)


# -- Kalman filters ---------------------------------------------------------------------------------------------------


def measured(model: AnyModel, data: Data) -> tuple[AnyModel, NDArray[Any]]:
    """Return a model for the measurements that are present, and the measurements (steps, m), perhaps simulated."""
    z = _simulated(model, data) if data.z is None else data.z
    sound, filled = model.without_missing(z)
    found = np.asarray(filled)
    if found.ndim != 2 or found.shape[1] != model.m or not len(found):
        length = f"{len(found)} measurements of shape {found.shape[1:]}" if found.ndim else "a single number"
        raise ValueError(
            f"got {length}; needed one measurement for each of the steps, at least one, of shape ({model.m},)"
        )
    if found.dtype.kind == "f" and not np.isfinite(found).all():
        k, i = np.argwhere(~np.isfinite(found))[0]
        which = named("measurement", int(i), model.measurement_names)
        if data.z is None:
            raise ValueError(
                f"the simulated measurements grow beyond float64 by step {k + 1}: {model.name} is not stable; give "
                "measurements, or fewer steps"
            )
        raise ValueError(
            f"got {found[k, i]} for {which} of step {k + 1}; needed finite numbers, or NaN where one is missing"
        )
    sound.check_steps(len(found))
    return sound, found


def _simulated(model: AnyModel, data: Data) -> NDArray[Any]:
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return simulated(model, data.steps, data.seed)
    except OverflowError:
        raise ValueError(
            f"the simulated measurements of {model.name} grow beyond float64: it is not stable; give measurements, or "
            "fewer steps"
        ) from None


@dataclass(frozen=True, eq=False)
class Recorded(Strategy):
    """The errors of one run with a measurement record, z (steps, m), in a form; each state has its tolerance, (n,)."""

    model: AnyModel
    z: NDArray[Any]
    form: AnyForm
    tolerances: NDArray[np.float64]
    bounded: ClassVar[bool] = False

    def error(self, fmt: Any) -> Outcome:
        """Return the largest error or bound over its tolerance, or infinity and the reason."""
        asked = np.isfinite(self.tolerances)
        try:
            stored = stored_measurements(self.z, fmt)
            steps = range(1, len(self.z) + 1) if self.bounded else ()
            run = opened(self.model, fmt, self.form, steps, self.bounded)
        except ValueError as error:  # with so few digits, a covariance is not definite
            return Outcome(math.inf, str(error))
        except OverflowError as error:
            return Outcome(math.inf, f"overflow: {error}", True)
        errors = self._errors(run, stored)
        if run.stopped is not None:
            return Outcome(math.inf, f"the run is refused: {run.reason}", run.reason.startswith("overflow"))
        if run.indefinite is not None and not self.bounded:
            lost = f"a computed variance was not positive at step {run.indefinite}"
            return Outcome(math.inf, lost + (self.without_variance if run.indefinite == 1 else ""))
        ratio = largest_ratio(np.abs(errors[:, asked]), self.tolerances[asked])
        return Outcome(ratio, "the bound says nothing" if math.isinf(ratio) else "")

    @cached_property
    def without_variance(self) -> str:
        """Return in words which state has no variance after the first step without rounding; empty if none lacks it."""
        first = self.z[:1]
        if isinstance(self.model, NonlinearModel):
            found = nonlinear_checkpoints(self.model, first, [1])
        else:
            found = reference(self.model, first, [1])
        lacking = [named("state", i, self.model.state_names) for i in range(self.model.n) if not found.P[0, i, i] > 0]
        cure = "whatever the precision; give it a little in P0 or Q"
        return f"; the model gives {' and '.join(lacking)} no variance, {cure}" if lacking else ""

    @abstractmethod
    def _errors(self, run: Any, z: Any) -> NDArray[np.float64]:
        """Take all steps, and return errors, or bounds, of each state after the steps done, (steps, n)."""


@dataclass(frozen=True, eq=False)
class Emulated(Recorded):
    """Errors relative to `true`, (steps, n, 2), the estimates of the filter without rounding."""

    true: NDArray[np.float64]

    def _errors(self, run: Any, z: Any) -> NDArray[np.float64]:
        states = run.states(z)
        return np.asarray((states - self.true[: len(states)]).sum(axis=2))


class Bounded(Recorded):
    """The contraction bound of each step of the run."""

    bounded = True

    def _errors(self, run: Any, z: Any) -> NDArray[np.float64]:
        run.take(z)
        return np.asarray(run.bounds[0])


def recorded_strategy(
    model: AnyModel, data: Data, tolerances: NDArray[np.float64], form: AnyForm, basis: Basis
) -> Recorded:
    """Return the strategy that answers a question about one measurement record."""
    sound, z = measured(model, data)
    if basis == "bound":
        return Bounded(sound, z, form, tolerances)
    if isinstance(sound, NonlinearModel):
        check_form(sound, form)
    return Emulated(sound, z, form, tolerances, true_states(sound, z))


@dataclass(frozen=True, eq=False)
class Guaranteed(Strategy):
    """The guarantee for all measurements within limits, over some steps or for ever; `outside` is what a run leaves."""

    model: LinearModel
    form: Form
    within: FilterLimits
    tolerances: NDArray[np.float64]
    outside: tuple[str, ...] = ()
    steps: int | None = None
    guesses = True

    def error(self, fmt: Any) -> Outcome:
        """Return the largest error or bound over its tolerance, or infinity and the reason."""
        return self._outcome(fmt, guessed)

    def proof(self, fmt: Any) -> Outcome:
        """Return the largest bound over its tolerance as it is proved, or infinity and the reason."""
        return self._outcome(fmt, guarantee)

    def _outcome(self, fmt: Any, bounded: Callable[..., FilterGuarantee]) -> Outcome:
        asked = np.isfinite(self.tolerances)
        try:
            if self.steps is None:
                found = bounded(self.model, fmt, self.within, self.form, horizon=1)
            else:
                found = bounded(self.model, fmt, self.within, self.form, max(self.steps, 1), self.steps)
        except ValueError as error:
            return Outcome(math.inf, str(error))
        except OverflowError as error:
            if isinstance(fmt, FloatFormat) and fmt.limits is None:
                raise
            return Outcome(math.inf, f"overflow: {error}", True)
        if not found.for_ever and found.steps != self.steps:
            return Outcome(math.inf, found.why, "exceed the largest" in found.why)
        return Outcome(largest_ratio(self._errors(found)[asked], self.tolerances[asked]))

    def over(self, steps: int) -> Strategy | None:
        """Return the bound over some steps."""
        return replace(self, steps=steps) if self.steps is None else None

    def warnings(self) -> tuple[str, ...]:
        """Return why the errors may say little about other runs, or what this run leaves."""
        return self.outside

    def _errors(self, found: FilterGuarantee) -> NDArray[np.float64]:
        """Return the error of each state, (n,)."""
        return found.bound


class Probable(Guaranteed):
    """Three standard deviations of the error that independent roundings would cause."""

    guesses = False

    def over(self, steps: int) -> None:
        """Return None: the probable error is that of a steady state."""

    def _errors(self, found: FilterGuarantee) -> NDArray[np.float64]:
        return 3 * probable_error(found)


def _for_ever(
    model: LinearModel, data: Data, tolerances: Any, basis: Basis, form: AnyForm, within: FilterLimits | None
) -> Strategy:
    if within is None:
        raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
    sized = sized_limits(within, model.n, model.m, model.x0)
    if isinstance(form, ArrayForm):
        raise ValueError(f'got the {form} form and basis "{basis}"; needed one of {", ".join(map(str, Form))}')
    if model.steps is not None:
        raise ValueError(f'got a model of {model.steps} steps and basis "{basis}"; needed one that goes on for ever')
    outside: tuple[str, ...] = ()
    if data.z is not None:
        sound, z = measured(model, data)
        if sound is not model:
            raise ValueError(
                f'got missing measurements and basis "{basis}"; needed none: it does not depend on a record'
            )
        outside = _outside(model, z, sized)
    kind = Guaranteed if basis == "guarantee" else Probable
    return kind(model, form, sized, tolerances, outside)


def _outside(model: LinearModel, z: NDArray[Any], within: FilterLimits) -> tuple[str, ...]:
    """Return in words which limits the filter without rounding leaves in a run, one sentence at most."""
    x = true_states(model, z)[..., 0]
    before = np.concatenate([model.x0.astype(np.float64)[None], x[:-1]])
    at = np.arange(len(z))
    Phi, H = (each.astype(np.float64)[at % len(each)] for each in (model.Phi, model.H))
    numbers = z.astype(np.float64)
    expected = np.einsum("kij,kjl,kl->ki", H, Phi, before)
    seen = {"state": x, "innovation": numbers - expected, "measurement": numbers}
    for name, values in seen.items():
        most = getattr(within, name)
        over = np.abs(values) > most * (1 + 2.0**-30)
        if over.any():
            k, i = np.argwhere(over)[0].tolist()
            which = named(name, i, model.state_names if name == "state" else model.measurement_names)
            return (
                f"the given run leaves the limits at step {k + 1}: {which} is {values[k, i]:.4g}, above {most[i]:.4g}",
            )
    return ()


# -- linear systems ---------------------------------------------------------------------------------------------------


def system_pairs(system: LinearSystem, u: Any, fmt: AnyFormat) -> NDArray[np.float64]:
    """Return states and outputs after each step in any format, (steps, n + p, 2), each as a sum of two float64."""
    if isinstance(fmt, FixedFormat):
        fmt = WordFormats(fmt)
    if isinstance(fmt, WordFormats):
        return run_words(system, u, fmt).outputs(system.n + system.p)
    return system.states(u, fmt)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class EmulatedSystem(Strategy):
    """Errors of the outputs for given inputs, (steps, m), against `true`, the outputs of the system as given."""

    system: LinearSystem
    u: Any
    true: NDArray[np.float64]
    tolerances: NDArray[np.float64]

    def warnings(self) -> tuple[str, ...]:
        """Return why the errors may say little about other runs, or what this run leaves."""
        return weak_evidence(self.system, self.true, self.tolerances)

    def error(self, fmt: Any) -> Outcome:
        """Return the largest error or bound over its tolerance, or infinity and the reason."""
        try:
            found = system_pairs(self.system, self.u, fmt)[:, self.system.n :]
        except ValueError as fault:
            return Outcome(math.inf, str(fault))
        except OverflowError as fault:
            return Outcome(math.inf, str(fault), True)
        error = (found[..., 0] - self.true[..., 0]) + (found[..., 1] - self.true[..., 1])
        largest = np.abs(error).max(axis=0)
        return _share(np.where(np.isnan(largest), np.inf, largest), self.tolerances)


@dataclass(frozen=True, eq=False)
class BoundedSystem(Strategy):
    """Bounds of the errors of the outputs for all inputs up to the largest, (m,), over some steps or for ever."""

    system: LinearSystem
    largest: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    outside: tuple[str, ...] = ()
    steps: int | None = None
    guesses = True

    def error(self, fmt: Any) -> Outcome:
        """Return the largest error or bound over its tolerance, or infinity and the reason."""
        return self._outcome(fmt, lambda each: self._bounds(each))

    def proof(self, fmt: Any) -> Outcome:
        """Return the largest bound over its tolerance as it is proved, or infinity and the reason."""
        return self._outcome(fmt, lambda each: output_errors(self.system, each, self.largest, self.steps), proves=True)

    def _outcome(self, fmt: Any, bounds: Callable[[Any], NDArray[np.float64]], proves: bool = False) -> Outcome:
        if isinstance(fmt, FixedFormat) and self.system.as_filter().program.is_linear:
            fmt = WordFormats(fmt)
        try:
            if isinstance(fmt, WordFormats):
                return _share((self._words.errors if proves else self._words.guessed)(fmt), self.tolerances)
            return _share(bounds(fmt), self.tolerances)
        except ValueError as fault:
            return Outcome(math.inf, str(fault))
        except OverflowError as fault:
            return Outcome(math.inf, str(fault), True)

    @cached_property
    def _words(self) -> WordGuarantee:
        return WordGuarantee(self.system, self.largest, self.steps)

    def over(self, steps: int) -> Strategy | None:
        """Return the bound over some steps of a system that limits its values; a linear one has it from the start."""
        limited = self.steps is None and not self.system.as_filter().program.is_linear
        return replace(self, steps=steps) if limited else None

    def warnings(self) -> tuple[str, ...]:
        """Return why the errors may say little about other runs, or what this run leaves."""
        return self.outside

    def _bounds(self, fmt: Any) -> NDArray[np.float64]:
        """Guess the error of each output, (p,)."""
        return guessed_errors(self.system, fmt, self.largest, self.steps)


class ProbableSystem(BoundedSystem):
    """As :class:`BoundedSystem`, with three standard deviations of the error of rounding in place of its bound."""

    guesses = False

    def proof(self, fmt: Any) -> Outcome:
        """Return the largest bound over its tolerance as it is proved, or infinity and the reason."""
        return self.error(fmt)

    def over(self, steps: int) -> None:
        """Return None: the probable error is that of a steady state."""

    def _bounds(self, fmt: Any) -> NDArray[np.float64]:
        return probable_output_errors(self.system, fmt, self.largest)


def _of_system(system: LinearSystem, data: Data, tolerance: Any, basis: Basis, within: FilterLimits | None) -> Strategy:
    tolerances, u = tolerances_of(tolerance, system.p, "outputs"), None
    if data.z is not None:
        u = system_inputs(system, data.z)
    elif within is None:
        how = "" if basis == "emulation" else '; or basis "guarantee" and within=limits(measurement=...)'
        raise ValueError(
            f"got a number of steps for {system.name}, a linear system; needed inputs of shape (steps, {system.m}), "
            f"whose size decides how large errors are{how}"
        )
    if basis == "emulation":
        return EmulatedSystem(system, u, system.outputs(u), tolerances)
    outside: tuple[str, ...] = ()
    if within is None:
        if basis == "probable":
            raise ValueError(f'got basis "{basis}" without limits; needed within=limits(measurement=...)')
        most = all_above(np.abs(np.asarray(u)).max(axis=0))
    else:
        most = largest_inputs(system, within)
        if u is not None:
            reached = np.abs(u).astype(np.float64).max(axis=0)
            outside = tuple(
                f"the given run leaves the limits: {named('input', i, system.input_names)} reaches {size:.4g}, above "
                f"{limit:.4g}"
                for i, (size, limit) in enumerate(zip(reached.tolist(), most.tolist(), strict=True))
                if size > limit
            )[:1]
    if any(system.x0):
        raise ValueError(f'got a first state {system.x0.tolist()} and basis "{basis}"; needed x0 = 0 for a bound')
    if basis == "probable":
        return ProbableSystem(system, most, tolerances, outside)
    keeps = system.as_filter().program.is_linear and not is_stable(system.A)
    return BoundedSystem(system, most, tolerances, outside, data.steps if keeps else None)


def largest_inputs(system: LinearSystem, within: FilterLimits) -> NDArray[np.float64]:
    """Return the limits on the inputs of a system, (m,).

    Raises
    ------
    TypeError : `within` is not a result of :func:`gpbnb.bounds.guarantee.limits`.
    ValueError : limits for another number of states or inputs, or limits on the states or innovations.
    """
    if isinstance(within, FilterLimits) and (np.isfinite(within.state).any() or np.isfinite(within.innovation).any()):
        raise ValueError(
            f"got limits on states or innovations for {system.name}; needed limits on its inputs alone: write "
            "limits(measurement=...)"
        )
    return sized_limits(within, system.n, system.m).measurement


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
            f"the run of {len(true)} step{'s' * (len(true) != 1)} is shorter than the memory of the system, whose "
            f"{slow}: take as many, or ask for a guarantee"
        )
    largest = np.abs(true[..., 0]).max(axis=0)
    for i in np.flatnonzero((largest <= tolerances) & np.isfinite(tolerances)):
        found.append(
            f"{named('output', int(i), system.output_names)} never exceeds {largest[i]:.3g} in this run, so that zero "
            f"would be within the tolerance of {tolerances[i]:.3g}: take larger inputs, or a smaller tolerance"
        )
    return tuple(found)


def _share(errors: NDArray[np.float64], tolerances: NDArray[np.float64]) -> Outcome:
    """Return the largest error over its tolerance, and why it is infinite."""
    ratio = largest_ratio(errors, tolerances)
    if ratio < math.inf:
        return Outcome(ratio)
    what = "an error over its tolerance" if np.isfinite(errors).all() else "an output or a bound"
    return Outcome(math.inf, f"{what} is beyond the range of float64")
