"""Find the number of digits that your own filter needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.search import CHECKED, Search, largest_compiled
from gpbnb.bounds.bounded_run import BoundedRun
from gpbnb.bounds.envelope import Limits
from gpbnb.bounds.gains import check_deterministic
from gpbnb.bounds.guarantee import check_limits, guarantee
from gpbnb.bounds.probable import probable_error
from gpbnb.filters.array_forms import AnyForm, ArrayForm
from gpbnb.filters.array_run import ArrayRun
from gpbnb.filters.forms import Form
from gpbnb.filters.inputs import simulated_measurements
from gpbnb.filters.missing import without_missing
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import form_named, rounding_named, whole_number
from gpbnb.filters.run import Run, reference_states
from gpbnb.wordlength.recursion import Recursion, required_recursion_precision, survey_recursion
from gpbnb.wordlength.requirement import Basis, Requirement, checked_tolerance, format_like, largest_ratio, listed
from gpbnb.wordlength.system import LinearSystem, required_system_precision, unobserved


def required_precision(
    model: LinearModel | LinearSystem | Recursion,
    steps: int,
    tolerance: float | Sequence[float],
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    form: AnyForm | str = Form.INNOVATION,
    basis: Basis = "emulation",
    z: Any = None,
    seed: int = 0,
    progress: bool = False,
    within: Limits | None = None,
    emin: int | None = None,
    emax: int | None = None,
    subnormal: bool = True,
    largest: int | None = None,
) -> Requirement:
    """Find the smallest precision with which a filter stays within a tolerance.

    The search is a bisection, and checks its own assumption: the answer, the next two precisions, and those of binary32
    and binary64 above it (:data:`gpbnb.arithmetic.search.CHECKED`) were run and meet the tolerance; the next lower one,
    if any, was run and does not qualify. If a higher precision misses the tolerance, every precision up to the largest
    is run, the answer lies above the highest that misses it, and the other forms are tried.

    Parameters
    ----------
    model : a Kalman filter; with repaired covariances, the answer lists the repairs. Or a linear system, whose inputs
        are `z`; see :func:`gpbnb.wordlength.system.required_system_precision`. Or a function of a format and `z`,
        written with arrays of the format; see :func:`gpbnb.wordlength.recursion.required_recursion_precision`.
    tolerance : largest error of each state due to rounding in any step, in its unit; one number, or (n,). Give states
        whose accuracy does not matter an infinite tolerance. For a linear system, of each output.
    base : 2, 10 or 16.
    rounding, form : values or their names, such as "nearest" and "UD"; see :class:`gpbnb.filters.forms.Form` and
        :class:`gpbnb.filters.array_forms.ArrayForm`.
    basis : "emulation" compares each precision with double-double and the model as given, so that the errors of storing
        the model are among those of the arithmetic; the answer is for these measurements. "bound" uses the
        contraction bound of :mod:`gpbnb.filters.contraction`, which is proved for the arithmetic of this run and
        requires more digits. "guarantee" bounds the error for every measurement sequence within limits, and forever
        (``guarantee``); "probable" takes three standard deviations of the error that independent
        roundings would cause. Neither depends on `z` or `steps`, and only neighbours of the answer are checked. Both
        assume sums from left to right without fused multiply-add, and refuse stochastic rounding of a Kalman filter.
    within : limits on the filter without rounding, for "guarantee" and "probable"; see
        :func:`gpbnb.bounds.guarantee.limits`.
    emin, emax, subnormal : range of the formats, as of a :class:`gpbnb.arithmetic.formats.FloatFormat`; by default
        unlimited. A format in which a number overflows does not meet the tolerance; the answer names the quantity and
        the step.
    z : (steps, m), measurements, NaN or masked if missing; by default simulated with the model, from its first
        estimate, and rounded to :func:`gpbnb.filters.simulation.fine_resolution`.
    seed : seed of the simulation.
    progress : show a progress bar that counts precisions.
    largest : highest precision to try. By default, and at most, it is the largest with compiled loops: 53 bits, 18
        decimal or 13 hexadecimal digits, fewer with some roundings. A function runs in any precision; by default
        those up to 200 bits, 60 decimal or 50 hexadecimal digits are tried.

    Raises
    ------
    ValueError : a tolerance that is not positive; another basis, form or rounding; a base without compiled loops, or
        for a model a largest precision without them; more or fewer measurements than steps; a model with known inputs,
        or an ``ArrayForm``, where a basis does not cover them; limits for another filter, or that the first estimate
        exceeds; stochastic rounding with a basis that holds for ever.
    TypeError : another kind of model, or of limits.
    OverflowError : an output of a linear system, or its reference, leaves the range of float64; the entries of a model
        are too large or too small for compiled loops.
    ArithmeticError : the filter is degenerate even without rounding; see :func:`gpbnb.filters.run.reference`.
    """
    form, rounding = form_named(form), rounding_named(rounding)
    like = format_like(base, rounding, emin, emax, subnormal)
    if within is not None and not isinstance(within, Limits):
        raise TypeError(f"got within={within!r}; needed the result of limits(...)")
    if not isinstance(model, LinearModel) and form is not Form.INNOVATION:
        raise ValueError(f"got the {form} form; needed none: only a LinearModel has forms")
    if callable(model):
        if within is not None:
            raise ValueError("got limits for a function; needed none: they are for models")
        steps = whole_number("steps", steps)
        return required_recursion_precision(model, steps, tolerance, z, like, basis, progress, largest)
    largest = _checked_largest(largest, like)
    if isinstance(model, LinearSystem):
        return required_system_precision(model, steps, tolerance, z, like, basis, within, progress, largest)
    tolerances = _checked(model, tolerance, base, basis)
    if like.limits is None:
        model.check_sizes()
    steps = whole_number("steps", steps)
    for_ever = basis in ("guarantee", "probable")
    if for_ever and within is None:
        raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
    if for_ever:
        model.refuse_inputs(f'basis "{basis}"')
        check_deterministic(like)
        check_limits(within, model.n, model.m, model.x0)
        if isinstance(form, ArrayForm):
            raise ValueError(f'got the {form} form and basis "{basis}"; needed one of {", ".join(map(str, Form))}')
        if model.steps is not None:
            raise ValueError(
                f'got a model of {model.steps} steps and basis "{basis}"; needed one that goes on for ever'
            )
    if z is None:
        z = simulated_measurements(model, steps, whole_number("seed", seed, 0))
    repairs = tuple(str(each) for each in model.repairs)
    given = model
    model, z = without_missing(model, z)
    if for_ever and model is not given:
        raise ValueError(f'got missing measurements and basis "{basis}"; needed none: it does not depend on a record')
    measured = _measured(model, z, steps)
    model.check_steps(steps)
    true = reference_states(model, measured) if basis == "emulation" else None

    def errors_of(chosen: AnyForm) -> Callable[[FloatFormat], tuple[float, str]]:
        if within is not None and for_ever and isinstance(chosen, Form):
            compiled = chosen
            return lambda fmt: _guaranteed(model, fmt, compiled, within, tolerances, basis)
        return lambda fmt: _error_over_tolerance(model, measured, fmt, chosen, true, tolerances)

    checks = () if for_ever else CHECKED[base]
    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:
        search = partial(Search, like=like, checks=checks, tick=bar.update, bounds=basis == "bound", largest=largest)
        found = search(errors_of(form))
        advice = f"no bound exists in {listed(found.undecided)} digits" if found.undecided else ""
        if not for_ever and (found.irregular or found.fmt is None):
            advice = _better_form(errors_of, form, search)
    if found.fmt is not None:
        repairs += tuple(map(str, _opened(model, found.fmt, form, (), False).repairs[len(model.repairs) :]))
    cause = "" if found.fmt is not None or model.cycle != 1 else unobserved(model.Phi[0], model.H[0])
    if cause and not for_ever:
        cause, advice = "", "; ".join([*filter(None, [advice]), f"{cause}, so that its errors never decay"])
    return Requirement(
        found.fmt, basis, steps, found.tried, found.why, form, found.irregular, advice, repairs, found.limit, cause
    )


def _better_form(
    errors_of: Callable[[AnyForm], Callable[[FloatFormat], tuple[float, str]]],
    form: AnyForm,
    search: Callable[[Callable[[FloatFormat], tuple[float, str]]], Search],
) -> str:
    """Name the form that meets the tolerance with the fewest digits, as advice; empty if there is none."""
    others = [each for each in (Form.UD, Form.JOSEPH, Form.INNOVATION) if each is not form]
    answers = [(other, search(errors_of(other)).fmt) for other in others]
    met = [(fmt.precision, str(other)) for other, fmt in answers if fmt is not None]
    return f"the form {min(met)[1]} needs {min(met)[0]} digits" if met else ""


def survey(
    model: LinearModel | Recursion,
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
    """Run a filter in each of some precisions; for the arguments, see :func:`required_precision`.

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
    if not isinstance(model, LinearModel) and callable(model):
        if form is not Form.INNOVATION:
            raise ValueError(f"got the {form} form; needed none: only a LinearModel has forms")
        return survey_recursion(model, z, tolerance, formats, basis)
    if beyond := [fmt.precision for fmt in formats if not isinstance(fmt.backend, Compiled)]:
        raise ValueError(f"got {beyond} digits of base {base}; needed at most {largest_compiled(like)}")
    found = survey_formats(model, z, tolerance, formats, form, basis)
    return tuple((fmt.precision, ratio) for fmt, (ratio, _) in zip(formats, found, strict=True))


def survey_formats(
    model: LinearModel,
    z: Any,
    tolerance: Any,
    formats: Sequence[FloatFormat],
    form: AnyForm = Form.INNOVATION,
    basis: Basis = "emulation",
) -> list[tuple[float, str]]:
    """Run a filter in each format; return largest error or bound / tolerance, and why it is infinite."""
    tolerances = _checked(model, tolerance, formats[0].base, basis)
    if any(fmt.limits is None for fmt in formats):
        model.check_sizes()
    model, z = without_missing(model, z)
    measured = _measured(model, z)
    if basis not in ("emulation", "bound"):
        raise ValueError(f'got basis "{basis}"; needed "emulation" or "bound"; the other bases do not depend on a run')
    true = reference_states(model, measured) if basis == "emulation" else None
    return [_error_over_tolerance(model, measured, fmt, form, true, tolerances) for fmt in formats]


def largest_errors(
    model: LinearModel, z: Any, fmt: FloatFormat, form: AnyForm | str = Form.INNOVATION
) -> NDArray[np.float64]:
    """Return the largest error of each state in any step, (n,), of a run that :func:`survey` found finite."""
    run = _opened(model, fmt, form_named(form), (), False)
    return np.abs((run.states(fmt.array(z)) - reference_states(model, z)).sum(axis=2)).max(axis=0)


def _checked_largest(largest: int | None, like: FloatFormat) -> int | None:
    """Check the highest precision to try for a model; None stands for the largest with compiled loops."""
    if largest is None:
        return None
    largest, most = whole_number("largest", largest, 2), largest_compiled(like)
    if largest > most:
        raise ValueError(
            f"got largest={largest} for a model; needed at most {most}, the most digits with compiled loops in base "
            f"{like.base}, rounded {like.rounding.value}; a filter written as a function of a format runs in more"
        )
    return largest


def _checked(model: LinearModel, tolerance: Any, base: int, basis: str) -> NDArray[np.float64]:
    """Check the question, and return the tolerance of each state."""
    if not isinstance(model, LinearModel):
        raise TypeError(f"got a model {type(model).__name__}; needed a LinearModel or a LinearSystem")
    return checked_tolerance(tolerance, model.n, "states", base, basis)


def _measured(model: LinearModel, z: Any, steps: int | None = None) -> NDArray[Any]:
    """Return measurements (steps, m) that are all numbers."""
    measured = np.asarray(z)
    if measured.ndim != 2 or measured.shape[1] != model.m or not len(measured) or steps not in (None, len(measured)):
        count = f"{steps} steps" if steps else "steps, at least one"
        column = "; write z.reshape(-1, 1)" if measured.ndim == model.m == 1 else ""
        length = f"{len(measured)} measurements of shape {measured.shape[1:]}" if measured.ndim else "a single number"
        raise ValueError(f"got {length}; needed one measurement for each of the {count}, of shape ({model.m},){column}")
    if measured.dtype.kind == "f" and not np.isfinite(measured).all():
        k, i = np.argwhere(~np.isfinite(measured))[0]
        raise ValueError(
            f"got {measured[k, i]} for measurement {i} of step {k + 1}; needed finite numbers, or NaN where "
            "one is missing"
        )
    return measured


def _error_over_tolerance(
    model: LinearModel,
    z: NDArray[Any],
    fmt: FloatFormat,
    form: AnyForm,
    true: NDArray[np.float64] | None,
    tolerances: NDArray[np.float64],
) -> tuple[float, str]:
    """Return the largest error, or without `true` the largest bound, over tolerance; or infinity and the reason."""
    asked = np.isfinite(tolerances)
    try:
        measured = fmt.array(z)
        run = _opened(model, fmt, form, range(1, len(z) + 1) if true is None else (), true is None)
    except ValueError as error:  # with so few digits, a covariance is not definite
        return math.inf, str(error)
    except OverflowError as error:
        return math.inf, f"overflow in the model or the measurements: {error}"
    if true is None:
        run.take(measured)
    else:
        states = run.states(measured)
    if run.stopped is not None:
        return math.inf, f"the run is refused: {run.reason}"
    if true is None and isinstance(run, (BoundedRun, ArrayRun)):
        errors = run.bounds[0]
    elif true is not None:
        errors = (states - true).sum(axis=2)
        if run.indefinite is not None:
            lost = f"a computed variance was not positive at step {run.indefinite}"
            return math.inf, f"{lost}; if the model leaves a state without any, give it a little in P0"
    ratio = largest_ratio(np.abs(errors[:, asked]), tolerances[asked])
    return ratio, "the bound says nothing" if math.isinf(ratio) else ""


def _opened(
    model: LinearModel, fmt: FloatFormat, form: AnyForm, checkpoint_steps: Sequence[int], bounded: bool
) -> Run | BoundedRun | ArrayRun:
    """Return a run in compiled loops if the form has them and the model has no inputs, else in array operations."""
    if model.has_inputs or isinstance(form, ArrayForm):
        return ArrayRun(model, fmt, form, checkpoint_steps, bounded)
    return (BoundedRun if bounded else Run)(model, fmt, form, checkpoint_steps)


def _guaranteed(
    model: LinearModel,
    fmt: FloatFormat,
    form: Form,
    within: Limits,
    tolerances: NDArray[np.float64],
    basis: Basis,
) -> tuple[float, str]:
    """Return the guaranteed error, or three times the probable error, over tolerance; or infinity and the reason."""
    asked = np.isfinite(tolerances)
    try:
        found = guarantee(model, fmt, within, form, horizon=1)
    except ValueError as error:
        return math.inf, str(error)
    if not found.for_ever:
        return math.inf, found.why
    errors = found.bound if basis == "guarantee" else 3 * probable_error(found)
    return largest_ratio(errors[asked], tolerances[asked]), ""
