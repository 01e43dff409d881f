"""Find the number of digits that your own filter needs."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.named import digits
from gpbnb.arithmetic.rounding import Rounding, digits_text, rounding_named
from gpbnb.arithmetic.search import CHECKED, Outcome, Search, largest_by_default, largest_compiled
from gpbnb.bounds.gains import check_deterministic
from gpbnb.bounds.guarantee import Guarantee, check_limits, check_within, guarantee, guessed
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.probable import probable_error
from gpbnb.filters.array_forms import AnyForm, ArrayForm
from gpbnb.filters.array_run import ArrayRun
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel, stored_measurements
from gpbnb.filters.named import form_named, named, whole_number
from gpbnb.filters.nonlinear import NO_GUARANTEE, AnyModel, NonlinearModel
from gpbnb.filters.nonlinear_run import (
    NonlinearRun,
    check_form,
    nonlinear_checkpoints,
    opened,
    simulated,
    true_states,
)
from gpbnb.filters.run import Run, reference
from gpbnb.filters.system import LinearSystem, unobserved
from gpbnb.wordlength.models import ModelSource, model_or_function
from gpbnb.wordlength.recursion import Recursion, required_recursion_precision, survey_recursion
from gpbnb.wordlength.requirement import (
    Asked,
    Basis,
    LastingBound,
    Requirement,
    Strategy,
    checked_tolerance,
    for_ever_or_over,
    format_like,
    largest_ratio,
    some_bound,
)
from gpbnb.wordlength.system import required_system_precision


def required_precision(
    model: ModelSource | NonlinearModel | Recursion,
    steps: int,
    tolerance: Numbers,
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    form: AnyForm | str = Form.INNOVATION,
    basis: Basis = "emulation",
    z: Numbers | None = None,
    seed: int = 0,
    progress: bool = False,
    within: FilterLimits | None = None,
    emin: int | None = None,
    emax: int | None = None,
    subnormal: bool = True,
    largest: int | None = None,
) -> Requirement:
    """Find the smallest precision with which a filter stays within a tolerance.

    The search is a bisection that checks its own assumption. It runs the answer, the next two precisions, and the
    precisions of binary32 and binary64 if they are higher (:data:`gpbnb.arithmetic.search.CHECKED`); all of these
    meet the tolerance. It also runs the next lower precision, which does not qualify. If a higher precision misses
    the tolerance, the search runs every precision up to the largest, and tries the other forms; the answer is then
    above the highest precision that misses. The text of an answer in bits also says what a run in binary32 itself, or
    in binary64, gives.

    Parameters
    ----------
    model : a Kalman filter; a linear system, whose inputs are `z`; anything that
        :func:`gpbnb.wordlength.models.read_model` reads, such as a ``scipy.signal.dlti``; or a function of a format and
        `z`, written with arrays of the format, such as a
        :class:`gpbnb.filters.nonlinear_system.NonlinearSystem` or a
        :class:`gpbnb.filters.smoothing.FixedIntervalSmoother`; or a nonlinear filter, which only the basis
        "emulation" covers. See
        :func:`gpbnb.wordlength.system.required_system_precision` for systems and
        :func:`gpbnb.wordlength.recursion.required_recursion_precision` for functions. If covariances of a Kalman filter
        were repaired, the answer lists the repairs.
    tolerance : largest acceptable error due to rounding of each state in any step, in the unit of the state; one
        number, or (n,). Give states whose accuracy does not matter an infinite tolerance. For a linear system, it is
        the largest acceptable error of each output.
    base : 2, 10 or 16.
    rounding, form : values or their names, such as "nearest" and "UD"; see :class:`gpbnb.filters.forms.Form` and
        :class:`gpbnb.filters.array_forms.ArrayForm`.
    basis : "emulation" compares a run in each precision with a run in double-double of the model as given, so the
        errors include those of storing the model. The answer holds for these measurements. "bound" uses the
        contraction bound of :mod:`gpbnb.filters.contraction`, which is proved for the arithmetic of this run and
        requires more digits. "guarantee" bounds the error for every measurement sequence within limits; the bound
        holds for ever, or for `steps` steps if the filter never forgets its errors. "probable" takes three standard
        deviations of the error that independent roundings would cause. The last two do not depend on `z`; for them,
        the search checks only the precisions next to the answer, and then that of binary32 or binary64. Both assume
        sums from left to right without fused multiply-add, and refuse stochastic rounding of a Kalman filter.
    within : limits on the filter without rounding, for "guarantee" and "probable" only; see
        :func:`gpbnb.bounds.guarantee.limits`. A linear system has limits on its inputs, `measurement`.
    emin, emax, subnormal : range of the formats, as in a :class:`gpbnb.arithmetic.formats.FloatFormat`; by default
        unlimited. A format in which a number overflows does not meet the tolerance; the answer names the quantity and
        the step.
    z : (steps, m), measurements, NaN or masked if missing; by default simulated with the model, from its first
        estimate, and rounded to :func:`gpbnb.filters.simulation.fine_resolution`.
    seed : seed of the simulation.
    progress : show a progress bar that counts precisions.
    largest : highest precision to try. For a linear model, the default is also the maximum: the highest precision with
        compiled loops, which is 53 bits, 18 decimal digits or 13 hexadecimal digits, and lower for some roundings. A
        function or a nonlinear filter runs in any precision; its default is 200 bits, 60 decimal digits or 50
        hexadecimal digits.

    Raises
    ------
    ValueError : a tolerance that is not positive; an unknown basis, form or rounding; a base without compiled loops;
        for a model, a `largest` beyond the precision of the compiled loops; more or fewer measurements than steps; a
        model with known inputs, or an ``ArrayForm``, together with a basis that does not cover it; limits for another
        filter, or for a basis that does not use them; a first estimate beyond its limit; stochastic rounding with a
        basis that holds for ever.
    TypeError : an unknown kind of model, or limits that are not a result of :func:`~gpbnb.bounds.guarantee.limits`.
    OverflowError : an output of a linear system, or its reference, leaves the range of float64; the entries of a model
        are too large or too small for compiled loops.
    ArithmeticError : the filter is degenerate even without rounding; see :func:`gpbnb.filters.run.reference`.
    """
    form, like = form_named(form), format_like(base, rounding_named(rounding), emin, emax, subnormal)
    model = model_or_function(model)
    if not isinstance(model, LinearModel | NonlinearModel) and form is not Form.INNOVATION:
        raise ValueError(f"got the {form} form; needed none: only a LinearModel or a NonlinearModel has forms")
    asked = Asked(_checked_steps(steps), basis, like, largest, progress)
    if callable(model):
        if within is not None:
            raise ValueError("got limits for a function; needed none: they are for models")
        return required_recursion_precision(model, asked, tolerance, z)
    if not isinstance(model, NonlinearModel):
        check_within(within, basis)
    asked = asked._replace(largest=_checked_largest(model, largest, like))
    if isinstance(model, LinearSystem):
        return required_system_precision(model, asked, tolerance, z, within)
    tolerances = checked_question(model, [like], tolerance, basis)
    if isinstance(model, NonlinearModel):
        if within is not None:
            raise ValueError(f"got limits for {model.name}; needed none: {NO_GUARANTEE}")
    elif basis in ("guarantee", "probable"):
        return _for_ever(model, asked, tolerances, form, z, within)
    if z is None:
        z = simulated(model, asked.steps, whole_number("seed", seed, 0))
    return _for_record(model, asked, tolerances, form, z)


def _checked_steps(steps: Any) -> int:
    """Check the number of steps, and tell measurements in its place by their shape."""
    shape = (len(steps),) if isinstance(steps, list | tuple) else np.shape(steps)
    if shape:
        raise ValueError(
            f"got steps of shape {shape}; needed a whole number; pass measurements by name: "
            "required_precision(model, steps, tolerance, z=z)"
        )
    return whole_number("steps", steps)


def _for_record(model: AnyModel, asked: Asked, tolerances: NDArray[np.float64], form: AnyForm, z: Any) -> Requirement:
    """Find the answer for one measurement record, by emulation or by the bound of each run."""
    strategy = recorded_strategy(model, z, tolerances, form, asked.basis, asked.steps)
    sound = strategy.model
    with asked.search(CHECKED[asked.like.base], bounds=asked.basis == "bound") as search:
        found = search(strategy)
        irregular = found.irregular or found.fmt is None
        advice = _better_form(strategy, search) if irregular else ""
    remedy = ""
    if found.fmt is None and isinstance(sound, LinearModel):
        cause = unobserved(sound.Phi[0], sound.H[0], sound.state_names) if sound.cycle == 1 else ""
        remedy = "" if advice or cause else asked.in_more_digits(found)
        if remedy:
            advice = (
                f"{digits_text(found.tried[-1][0], asked.like.base)} give {found.tried[-1][1]:.3g} times the tolerance"
            )
        advice = "; ".join(filter(None, [advice, cause and f"{cause}, so that its errors never decay"]))
    return asked.answer(found, form, advice, _repairs(model, sound, found.fmt, form), remedy=remedy)


def _for_ever(
    model: LinearModel,
    asked: Asked,
    tolerances: NDArray[np.float64],
    form: AnyForm,
    z: Any,
    within: FilterLimits | None,
) -> Requirement:
    """Find the answer for all measurements within limits, by the guarantee or by the probable error."""
    basis = asked.basis
    if within is None:
        raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
    model.refuse_inputs(f'basis "{basis}"')
    check_deterministic(asked.like)
    check_limits(within, model.n, model.m, model.x0)
    if isinstance(form, ArrayForm):
        raise ValueError(f'got the {form} form and basis "{basis}"; needed one of {", ".join(map(str, Form))}')
    if model.steps is not None:
        raise ValueError(f'got a model of {model.steps} steps and basis "{basis}"; needed one that goes on for ever')
    if z is not None:
        sound, filled = model.without_missing(z)
        if sound is not model:
            raise ValueError(
                f'got missing measurements and basis "{basis}"; needed none: it does not depend on a record'
            )
        _measured(model, filled, asked.steps)
    kind = Guaranteed if basis == "guarantee" else Probable
    strategy = kind(model, form, within, tolerances)
    with asked.search(checks=()) as search:
        found, ends = for_ever_or_over(asked.steps, strategy, search, some_bound)
    cause = ""
    if found.fmt is None and not ends and model.cycle == 1:
        cause = unobserved(model.Phi[0], model.H[0], model.state_names)
    if cause:
        cause += '; ask with basis "bound" for a number of steps instead'
    return asked.answer(found, form, repairs=_repairs(model, model, found.fmt, form), cause=cause, ends=ends)


def _repairs(given: AnyModel, sound: AnyModel, fmt: FloatFormat | None, form: AnyForm) -> tuple[str, ...]:
    """Return the changes of the covariances of a model and, if there is an answer, of its run in the format."""
    more = [] if fmt is None else opened(sound, fmt, form).repairs[len(sound.repairs) :]
    return tuple(map(str, (*given.repairs, *more)))


def _better_form(strategy: Recorded, search: Callable[[Strategy], Search[FloatFormat]]) -> str:
    """Name the form that meets the tolerance with the fewest digits, as advice; empty if there is none."""
    if isinstance(strategy.model, NonlinearModel) and strategy.model.method == "unscented":
        return ""
    others = [each for each in (Form.UD, Form.JOSEPH, Form.INNOVATION) if each is not strategy.form]
    answers = [(other, search(replace(strategy, form=other)).fmt) for other in others]
    met = [(fmt.precision, str(other), digits(fmt)) for other, fmt in answers if fmt is not None]
    return f"the form {min(met)[1]} needs {min(met)[2]}" if met else ""


def survey(
    model: AnyModel | Recursion,
    z: Any,
    tolerance: float | Sequence[float],
    precisions: Sequence[int],
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    form: AnyForm | str = Form.INNOVATION,
    basis: Basis = "emulation",
    emin: int | None = None,
    emax: int | None = None,
    subnormal: bool = True,
) -> tuple[tuple[int, float], ...]:
    """Run a filter in each of the given precisions; the arguments are those of :func:`required_precision`.

    Returns
    -------
    tried : precision, and largest error or bound / tolerance, as in :class:`gpbnb.wordlength.requirement.Requirement`.

    Raises
    ------
    ValueError : for a reason given in :func:`required_precision`; for a model, a precision without compiled loops.
    """
    form, like = form_named(form), format_like(base, rounding_named(rounding), emin, emax, subnormal)
    formats = [replace(like, precision=precision) for precision in precisions]
    if not formats:
        raise ValueError("got no precisions; needed at least one")
    if callable(model):
        if form is not Form.INNOVATION:
            raise ValueError(f"got the {form} form; needed none: only a LinearModel or a NonlinearModel has forms")
        return survey_recursion(model, z, tolerance, formats, basis)
    compiled = [isinstance(model, NonlinearModel) or isinstance(fmt.backend, Compiled) for fmt in formats]
    if beyond := [fmt.precision for fmt, has_loops in zip(formats, compiled, strict=True) if not has_loops]:
        most = digits_text(largest_compiled(like), base)
        raise ValueError(f"got precisions {beyond} in base {base}; needed at most {most}")
    found = survey_formats(model, z, tolerance, formats, form, basis)
    return tuple((fmt.precision, ratio) for fmt, (ratio, _) in zip(formats, found, strict=True))


def survey_formats(
    model: AnyModel,
    z: Any,
    tolerance: Any,
    formats: Sequence[FloatFormat],
    form: AnyForm = Form.INNOVATION,
    basis: Basis = "emulation",
) -> list[Outcome]:
    """Run a filter in each format; return the largest error or bound / tolerance, and the reason if it is infinite."""
    tolerances = checked_question(model, formats, tolerance, basis)
    if isinstance(model, LinearModel):
        for fmt in formats:
            fmt.check_compiled()
    if basis not in ("emulation", "bound"):
        raise ValueError(f'got basis "{basis}"; needed "emulation" or "bound"; the other bases do not depend on a run')
    strategy = recorded_strategy(model, z, tolerances, form, basis)
    return [strategy.error(fmt) for fmt in formats]


def largest_errors(
    model: AnyModel, z: Any, fmt: FloatFormat, form: AnyForm | str = Form.INNOVATION
) -> NDArray[np.float64]:
    """Return the largest error of each state in any step, (n,), of a run that :func:`survey` found finite."""
    run = opened(model, fmt, form_named(form))
    return np.abs((run.states(fmt.array(z)) - true_states(model, z)).sum(axis=2)).max(axis=0)


def _checked_largest(model: AnyModel | LinearSystem, largest: int | None, like: FloatFormat) -> int | None:
    """Check the highest precision to try for a model; None stands for the largest with compiled loops."""
    if isinstance(model, NonlinearModel):
        return largest_by_default(like.base) if largest is None else whole_number("largest", largest, 2)
    if largest is None:
        return None
    largest, most = whole_number("largest", largest, 2), largest_compiled(like)
    if largest > most:
        raise ValueError(
            f"got largest={largest} for a model; needed at most {digits_text(most, like.base)}, the most with compiled "
            f"loops, rounded {like.rounding.value}; a filter written as a function of a format runs in more"
        )
    return largest


def checked_question(
    model: AnyModel, formats: Sequence[FloatFormat | FixedFormat], tolerance: Any, basis: str
) -> NDArray[np.float64]:
    """Check a question about a filter in some formats, and return the tolerance of each state, (n,).

    Raises
    ------
    ValueError, TypeError, OverflowError : for a reason given in :func:`required_precision`.
    """
    if not isinstance(model, LinearModel | NonlinearModel):
        raise TypeError(f"got a model {type(model).__name__}; needed a LinearModel, NonlinearModel or LinearSystem")
    tolerances = checked_tolerance(tolerance, model.n, "states", basis)
    if basis != "emulation" and isinstance(model, NonlinearModel):
        raise ValueError(f'got basis "{basis}" for {model.name}; needed "emulation": {NO_GUARANTEE}')
    if any(fmt.limits is None for fmt in formats):
        model.check_sizes()
    return tolerances


def _measured(model: AnyModel, z: Any, steps: int | None = None) -> NDArray[Any]:
    """Return measurements (steps, m) that are all numbers."""
    measured = np.asarray(z)
    if measured.ndim != 2 or measured.shape[1] != model.m or not len(measured) or steps not in (None, len(measured)):
        count = f"{steps} steps" if steps else "steps, at least one"
        column = "; write z.reshape(-1, 1)" if measured.ndim == model.m == 1 else ""
        length = f"{len(measured)} measurements of shape {measured.shape[1:]}" if measured.ndim else "a single number"
        raise ValueError(f"got {length}; needed one measurement for each of the {count}, of shape ({model.m},){column}")
    if measured.dtype.kind == "f" and not np.isfinite(measured).all():
        k, i = np.argwhere(~np.isfinite(measured))[0]
        which = named("measurement", int(i), model.measurement_names)
        raise ValueError(
            f"got {measured[k, i]} for {which} of step {k + 1}; needed finite numbers, or NaN where one is missing"
        )
    return measured


# -- strategies -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Recorded(ABC):
    """The errors of one run with a measurement record, z (steps, m), in a form; each state has its tolerance, (n,)."""

    model: AnyModel
    z: NDArray[Any]
    form: AnyForm
    tolerances: NDArray[np.float64]
    bounded: ClassVar[bool] = False

    def error(self, fmt: FloatFormat | BlockFormats) -> Outcome:
        """Return the largest error or bound as a multiple of the tolerance; or infinity, with the reason."""
        asked = np.isfinite(self.tolerances)
        try:
            measured = stored_measurements(self.z, fmt)
            steps = range(1, len(self.z) + 1) if self.bounded else ()
            run = opened(self.model, fmt, self.form, steps, self.bounded)
        except ValueError as error:  # with so few digits, a covariance is not definite
            return Outcome(math.inf, str(error))
        except OverflowError as error:
            return Outcome(math.inf, f"overflow: {error}")
        errors = self._errors(run, measured)
        if run.stopped is not None:
            return Outcome(math.inf, f"the run is refused: {run.reason}")
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
    def _errors(self, run: Run | ArrayRun | NonlinearRun, z: Any) -> NDArray[np.float64]:
        """Take all steps, and return errors, or bounds, of each state after the steps done, (steps, n)."""


@dataclass(frozen=True, eq=False)
class Emulated(Recorded):
    """Errors relative to `true`, (steps, n, 2), the estimates of the filter without rounding."""

    true: NDArray[np.float64]

    def _errors(self, run: Run | ArrayRun | NonlinearRun, z: Any) -> NDArray[np.float64]:
        states = run.states(z)
        return np.asarray((states - self.true[: len(states)]).sum(axis=2))


class Bounded(Recorded):
    """The contraction bound of each step of the run."""

    bounded = True

    def _errors(self, run: Any, z: Any) -> NDArray[np.float64]:
        run.take(z)
        return run.bounds[0]


def recorded_strategy(
    model: AnyModel, z: Any, tolerances: NDArray[np.float64], form: AnyForm, basis: Basis, steps: int | None = None
) -> Recorded:
    """Check one measurement record, (steps, m), and return the strategy that answers a question about it.

    Raises
    ------
    ValueError, TypeError : for a reason given in :func:`required_precision`.
    """
    sound, filled = model.without_missing(z)
    measured = _measured(sound, filled, steps)
    sound.check_steps(len(measured))
    if basis == "bound":
        return Bounded(sound, measured, form, tolerances)
    if isinstance(sound, NonlinearModel):
        check_form(sound, form)
    return Emulated(sound, measured, form, tolerances, true_states(sound, measured))


@dataclass(frozen=True, eq=False)
class Guaranteed(LastingBound):
    """The guarantee for all measurements within limits, over some steps or for ever."""

    model: LinearModel
    form: Form
    within: FilterLimits
    tolerances: NDArray[np.float64]
    #: None if it holds for ever.
    steps: int | None = None

    def error(self, fmt: FloatFormat) -> Outcome:
        """Return the largest error over the tolerance as it is guessed, or infinity and the reason."""
        return self._outcome(fmt, guessed)

    def proof(self, fmt: FloatFormat) -> Outcome:
        """Return the largest error over the tolerance as it is proved, or infinity and the reason."""
        return self._outcome(fmt, guarantee)

    def _outcome(self, fmt: FloatFormat, bounded: Callable[..., Guarantee]) -> Outcome:
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
            return Outcome(math.inf, f"overflow: {error}")
        if not found.for_ever and found.steps != self.steps:
            return Outcome(math.inf, found.why)
        return Outcome(largest_ratio(self._errors(found)[asked], self.tolerances[asked]))

    def over(self, steps: int) -> Guaranteed | None:
        """Return the guarantee over some steps, which a filter may have that never forgets its errors."""
        return replace(self, steps=steps) if self.steps is None else None

    def _errors(self, found: Guarantee) -> NDArray[np.float64]:
        """Return the error of each state, (n,)."""
        return found.bound


class Probable(Guaranteed):
    """Three standard deviations of the error that independent roundings would cause."""

    proof = None  # type: ignore[assignment]

    def over(self, steps: int) -> None:
        """Return None: the probable error is that of a steady state."""

    def _errors(self, found: Guarantee) -> NDArray[np.float64]:
        return 3 * probable_error(found)
