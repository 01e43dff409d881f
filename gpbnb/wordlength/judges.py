"""How well a format does for a model: errors of a run, or bounds of them, over their tolerances."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import eigenvalues
from gpbnb.arithmetic.search import Outcome
from gpbnb.bounds.guarantee import guarantee, sized_limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.probable import probable_error, probable_output_errors
from gpbnb.bounds.system import OutputBounds
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel, stored_measurements
from gpbnb.filters.named import named
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.nonlinear_run import check_form, nonlinear_checkpoints, opened, simulated, true_states
from gpbnb.filters.run import reference
from gpbnb.filters.system import LinearSystem, is_stable, system_inputs
from gpbnb.wordlength.asked import Asked, is_filter, tolerances_of
from gpbnb.wordlength.functions import referenced

Found = NDArray[np.float64] | Outcome
"""The largest error or bound of each state or output, (n,); or why there is none."""

Answer = TypeVar("Answer")


@dataclass(frozen=True, eq=False)
class Judge:
    """What says how well a format does, for a model, data and tolerances that were checked.

    Parameters
    ----------
    errors : function that returns what is found in a format; a guess if it is proved otherwise.
    tolerances : (n,).
    proved : function that returns what is proved, if this is not what is found.
    steps : steps for which a bound holds; None if it holds for ever.
    over : function that returns a judge over some steps, where nothing bounds the errors for ever.
    warnings : function that returns why the errors may say little about other runs.
    beyond : what an infinite ratio means; by default that float64 does not hold it.
    untraced : why a user's function cannot be traced; empty if it can be.
    model, form : a Kalman filter for the measurements that are present, and its form; `of_form` judges another.
    """

    errors: Callable[[Any], Found]
    tolerances: NDArray[np.float64]
    proved: Callable[[Any], Found] | None = None
    steps: int | None = None
    over: Callable[[int], Judge] | None = None
    warnings: Callable[[], tuple[str, ...]] = tuple
    beyond: str = ""
    untraced: str = ""
    model: AnyModel | None = None
    form: Form = Form.INNOVATION
    of_form: Callable[[Form], Judge] | None = None

    def error(self, fmt: Any) -> Outcome:
        """Return the largest error or bound as a multiple of the tolerance; or infinity, with the reason."""
        return self.outcome(self.errors(fmt))

    def proof(self, fmt: Any) -> Outcome:
        """Return what is proved of a format."""
        return self.outcome((self.proved or self.errors)(fmt))

    def outcome(self, found: Found) -> Outcome:
        """Return errors over their tolerances."""
        if isinstance(found, Outcome):
            return found
        asked = np.isfinite(self.tolerances)
        with np.errstate(over="ignore"):
            ratio = float((found[asked] / self.tolerances[asked]).max())
        if ratio < math.inf:
            return Outcome(ratio)
        what = "an error over its tolerance" if np.isfinite(found).all() else "an output or a bound"
        return Outcome(math.inf, self.beyond or f"{what} is beyond the range of float64")


def judge_for(asked: Asked, base: int = 2, most: int = 0) -> Judge:
    """Check a question, and return what answers it; `base` and `most` digits are for a function's reference."""
    if isinstance(asked.model, LinearSystem):
        return _of_system(asked)
    if is_filter(asked.model):
        return (_of_record if asked.basis in ("emulation", "bound") else _for_ever)(asked)
    given = referenced(asked, base, most)
    return Judge(given.errors, given.tolerances, untraced=given.untraced)


def for_ever_or_over(
    asked: Asked, judge: Judge, ask: Callable[[Judge], Answer], has_bound: Callable[[Answer], bool]
) -> tuple[Answer, Judge]:
    """Ask a judge for a bound for ever or, if it has none, over the steps of the data; return that judge, too."""
    found = ask(judge)
    if not has_bound(found) and judge.over is not None:
        later = judge.over(asked.steps)
        if has_bound(ended := ask(later)):
            return ended, later
    return found, judge


def reasoned(errors: Callable[[Any], Found]) -> Callable[[Any], Found]:
    """Return a function that says why a format has no errors, in place of raising it."""

    def found(fmt: Any) -> Found:
        try:
            return errors(fmt)
        except ValueError as fault:
            return Outcome(math.inf, str(fault))
        except OverflowError as fault:
            return Outcome(math.inf, str(fault), True)

    return found


# -- Kalman filters ---------------------------------------------------------------------------------------------------


def measured(asked: Asked) -> tuple[AnyModel, NDArray[Any]]:
    """Return a model for the measurements that are present, and the measurements (steps, m), perhaps simulated."""
    model, z = asked.model, _simulated(asked) if asked.z is None else asked.z
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
        if asked.z is None:
            raise ValueError(
                f"the simulated measurements grow beyond float64 by step {k + 1}: {model.name} is not stable; give "
                "measurements, or fewer steps"
            )
        raise ValueError(
            f"got {found[k, i]} for {which} of step {k + 1}; needed finite numbers, or NaN where one is missing"
        )
    sound.check_steps(len(found))
    return sound, found


def _simulated(asked: Asked) -> NDArray[Any]:
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return simulated(asked.model, asked.steps, asked.seed)
    except OverflowError:
        raise ValueError(
            f"the simulated measurements of {asked.model.name} grow beyond float64: it is not stable; give "
            "measurements, or fewer steps"
        ) from None


def _of_record(asked: Asked) -> Judge:
    """Judge the errors of one run with a measurement record, or its bounds."""
    tolerances, bounded = tolerances_of(asked.tolerance, asked.model.n, "states"), asked.basis == "bound"
    sound, z = measured(asked)
    if not bounded and isinstance(sound, NonlinearModel):
        check_form(sound, asked.form)
    true = None if bounded else true_states(sound, z)
    lacking = cache(lambda: _without_variance(sound, z))

    def of_form(form: Form) -> Judge:
        errors = partial(_recorded, sound, z, form, true, lacking)
        return Judge(errors, tolerances, beyond="the bound says nothing", model=sound, form=form, of_form=of_form)

    return of_form(asked.form)


def _recorded(
    model: AnyModel,
    z: NDArray[Any],
    form: Form,
    true: NDArray[np.float64] | None,
    lacking: Callable[[], str],
    fmt: Any,
) -> Found:
    """Return the errors of a run, relative to the estimates (steps, n, 2) without rounding; without these, bounds."""
    try:
        stored = stored_measurements(z, fmt)
        run: Any = opened(model, fmt, form, range(1, len(z) + 1) if true is None else (), true is None)
    except ValueError as error:  # with so few digits, a covariance is not definite
        return Outcome(math.inf, str(error))
    except OverflowError as error:
        return Outcome(math.inf, f"overflow: {error}", True)
    if true is None:
        run.take(stored)
        errors = np.asarray(run.bounds[0])
    else:
        states = run.states(stored)
        off = states - true[: len(states)]
        errors = off[..., 0] + off[..., 1]
    if run.stopped is not None:
        return Outcome(math.inf, f"the run is refused: {run.reason}", run.reason.startswith("overflow"))
    if run.indefinite is not None and true is not None:
        lost = f"a computed variance was not positive at step {run.indefinite}"
        return Outcome(math.inf, lost + (lacking() if run.indefinite == 1 else ""))
    return np.asarray(np.abs(errors).max(axis=0))


def _without_variance(model: Any, z: NDArray[Any]) -> str:
    """Return in words which state has no variance after the first step without rounding; empty if none lacks it."""
    linear = isinstance(model, LinearModel)
    found = reference(model, z[:1], [1]) if linear else nonlinear_checkpoints(model, z[:1], [1])
    lacking = [named("state", i, model.state_names) for i in range(model.n) if not found.P[0, i, i] > 0]
    cure = "whatever the precision; give it a little in P0 or Q"
    return f"; the model gives {' and '.join(lacking)} no variance, {cure}" if lacking else ""


def _for_ever(asked: Asked) -> Judge:
    """Judge the guarantee for all measurements within limits, or three deviations of the probable error."""
    model, basis, form = asked.model, asked.basis, asked.form
    tolerances = tolerances_of(asked.tolerance, model.n, "states")
    if asked.within is None:
        raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
    sized = sized_limits(asked.within, model.n, model.m, model.x0)
    if form not in WITH_PROGRAM:
        raise ValueError(f'got the {form} form and basis "{basis}"; needed one of {", ".join(map(str, WITH_PROGRAM))}')
    if model.steps is not None:
        raise ValueError(f'got a model of {model.steps} steps and basis "{basis}"; needed one that goes on for ever')
    outside: tuple[str, ...] = ()
    if asked.z is not None:
        sound, z = measured(asked)
        if sound is not model:
            raise ValueError(
                f'got missing measurements and basis "{basis}"; needed none: it does not depend on a record'
            )
        outside = _outside(_seen(asked.model, z, sized))

    def over(steps: int | None) -> Judge:
        guess, proof = (partial(_bounded, asked, sized, steps, each) for each in (False, True))
        if basis == "probable":
            return Judge(guess, tolerances, warnings=lambda: outside)
        return Judge(guess, tolerances, proof, steps, over if steps is None else None, lambda: outside)

    return over(None)


def _bounded(asked: Asked, within: FilterLimits, steps: int | None, proved: bool, fmt: Any) -> Found:
    """Return the bound of each state for ever or over some steps, or three deviations of its probable error."""
    try:
        found = guarantee(asked.model, fmt, within, asked.form, steps, steps or 1, proved)
    except ValueError as error:
        return Outcome(math.inf, str(error))
    except OverflowError as error:
        if isinstance(fmt, FloatFormat) and fmt.limits is None:
            raise
        return Outcome(math.inf, f"overflow: {error}", True)
    if not found.for_ever and found.steps != steps:
        return Outcome(math.inf, found.why, "exceed the largest" in found.why)
    return 3 * probable_error(found) if asked.basis == "probable" else found.bound


def _seen(model: LinearModel, z: NDArray[Any], within: FilterLimits) -> dict[str, tuple[Any, Any, Any]]:
    """Return what has limits in a run of the filter without rounding, its limits and names."""
    x = true_states(model, z)[..., 0]
    before = np.concatenate([model.x0.astype(np.float64)[None], x[:-1]])
    at = np.arange(len(z))
    Phi, H = (each.astype(np.float64)[at % len(each)] for each in (model.Phi, model.H))
    numbers = z.astype(np.float64)
    expected = np.einsum("kij,kjl,kl->ki", H, Phi, before)
    seen, names = {"state": x, "innovation": numbers - expected, "measurement": numbers}, model.measurement_names
    named_by = {"state": model.state_names, "innovation": names, "measurement": names}
    return {name: (values, getattr(within, name), named_by[name]) for name, values in seen.items()}


def _outside(seen: dict[str, tuple[Any, Any, Any]]) -> tuple[str, ...]:
    """Say which limits a run leaves, in one sentence at most."""
    for name, (values, most, names) in seen.items():
        over = np.abs(values) > most * (1 + 2.0**-30)
        if over.any():
            k, i = np.argwhere(over)[0].tolist()
            which = named(name, i, names)
            return (
                f"the given run leaves the limits at step {k + 1}: {which} is {values[k, i]:.4g}, above {most[i]:.4g}",
            )
    return ()


# -- linear systems ---------------------------------------------------------------------------------------------------


def _of_system(asked: Asked) -> Judge:
    system, basis, within = asked.model, asked.basis, asked.within
    tolerances, u = tolerances_of(asked.tolerance, system.p, "outputs"), None
    if asked.z is not None:
        u = system_inputs(system, asked.z)
    elif within is None:
        how = "" if basis == "emulation" else '; or basis "guarantee" and within=limits(measurement=...)'
        raise ValueError(
            f"got a number of steps for {system.name}, a linear system; needed inputs of shape (steps, {system.m}), "
            f"whose size decides how large errors are{how}"
        )
    if basis == "emulation":
        true = system.outputs(u)

        def errors(fmt: Any) -> NDArray[np.float64]:
            found = system.outputs(u, fmt)
            return np.asarray(np.abs((found[..., 0] - true[..., 0]) + (found[..., 1] - true[..., 1])).max(axis=0))

        return Judge(reasoned(errors), tolerances, warnings=lambda: weak_evidence(system, true, tolerances))
    outside: tuple[str, ...] = ()
    if within is None:
        if basis == "probable":
            raise ValueError(f'got basis "{basis}" without limits; needed within=limits(measurement=...)')
        most = all_above(np.abs(np.asarray(u)).max(axis=0))
    else:
        most = largest_inputs(system, within)
        if u is not None:
            outside = _outside({"input": (u.astype(np.float64), most, system.input_names)})
    if any(system.x0):
        raise ValueError(f'got a first state {system.x0.tolist()} and basis "{basis}"; needed x0 = 0 for a bound')
    linear = system.as_filter().program.is_linear

    def over(steps: int | None) -> Judge:
        if basis == "probable":
            probable = partial(probable_output_errors, system, most)
            return Judge(reasoned(probable), tolerances, warnings=lambda: outside)
        known, later = OutputBounds(system, most, steps), over if steps is None and not linear else None
        guess, proof = (reasoned(partial(known.errors, proved=each)) for each in (False, True))
        return Judge(guess, tolerances, proof, steps, later, lambda: outside)

    return over(asked.steps if linear and not is_stable(system.A) else None)


def largest_inputs(system: LinearSystem, within: FilterLimits) -> NDArray[np.float64]:
    """Return the limits on the inputs of a system, (m,), and refuse limits on its states or innovations."""
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
    """Say if a run, with outputs `true` (steps, p, 2), is shorter than the system's memory, or if zero would do."""
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
