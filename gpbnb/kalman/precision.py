"""The number of digits that your own filter needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.arithmetic.kernels.backends import LARGEST_PRECISION
from gpbnb.arithmetic.search import CHECKED, Search
from gpbnb.kalman.bounded_run import BoundedRun
from gpbnb.kalman.emulation import compare_runs
from gpbnb.kalman.filter_run import Checkpoints, Run, log_spaced, reference
from gpbnb.kalman.forms import Form
from gpbnb.kalman.guarantee.bound import guarantee
from gpbnb.kalman.guarantee.envelope import Limits
from gpbnb.kalman.guarantee.probable import probable_error
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.named import form_named, rounding_named, whole_number
from gpbnb.kalman.simulation import Simulation, fine_resolution

Basis = Literal["emulation", "bound", "guarantee", "probable"]


@dataclass(frozen=True)
class Requirement:
    """The smallest precision that meets a tolerance, and what the answer rests on.

    Parameters
    ----------
    fmt : None if no format with compiled loops meets the tolerance, or if the largest precision tried misses it.
    basis : "emulation", what happened with these measurements; or "bound", what could at most have happened.
    steps : of the filter.
    tried : precision, and largest error over tolerance of all states and checkpoints; infinite where the run stopped, a
        variance was lost, or no bound exists.
    why : of the largest precision below the answer that has no number for an error, why not; empty if all have one.
        Shown where it kept the answer from being a smaller one.
    form : of the filter.
    irregular : precisions that meet the tolerance although a higher one was run and misses it; empty if all is regular.
    advice : if more digits fail where fewer do not, another form that meets the tolerance; precisions without a bound.
    repairs : changes of the model's covariances, each as text.
    """

    fmt: FloatFormat | None
    basis: Basis
    steps: int
    tried: tuple[tuple[int, float], ...]
    why: str = ""
    form: Form | None = None
    irregular: tuple[int, ...] = ()
    advice: str = ""
    repairs: tuple[str, ...] = ()

    @property
    def precision(self) -> int | None:
        """Digits of the answer, or None."""
        return None if self.fmt is None else self.fmt.precision

    def __str__(self) -> str:
        notes = [*self.repairs]
        if self.irregular:
            missed = [digits for digits, ratio in self.tried if not ratio <= 1 and digits > self.irregular[0]]
            notes.insert(0, f"{_listed(self.irregular)} digits meet it, but {_listed(missed)} do not")
        if self.advice:
            notes.append(self.advice)
        end = "".join(f"; {note}" for note in notes)
        if self.fmt is None:
            most, why = self.tried[-1][0], f"; {self.why}" if self.why else ""
            met = "meets the tolerance reliably" if self.irregular else "meets the tolerance"
            return f"no precision up to {most} digits {met} ({self.basis}, {self.steps} steps){why}{end}"
        tried = dict(self.tried)
        why = f"; {self.why}" if self.why and math.isinf(tried.get(self.fmt.precision - 1, 0.0)) else ""
        return (
            f"{self.fmt.precision} digits of base {self.fmt.base}, {self.fmt.rounding.value}: "
            f"{tried[self.fmt.precision]:.2g} of the tolerance ({self.basis}, {self.steps} steps){why}{end}"
        )


def _listed(numbers: Sequence[int]) -> str:
    """Whole numbers in rising order as text, runs of three and more as ranges: "2, 5–8"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    texts = [f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return ", ".join(texts)


def required_precision(
    model: LinearModel,
    steps: int,
    tolerance: float | Sequence[float],
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    form: Form | str = Form.INNOVATION,
    basis: Basis = "emulation",
    z: Any = None,
    seed: int = 0,
    progress: bool = False,
    within: Limits | None = None,
) -> Requirement:
    """Find the smallest precision with which a filter stays within a tolerance.

    The search is a bisection. It checks what it assumes: the answer, the next two precisions, and those of binary32 and
    binary64 above it (:data:`gpbnb.arithmetic.search.CHECKED`) were run and meet the tolerance; the next lower one, if
    any, was run and does not qualify. If a higher precision misses the tolerance, every precision up to the largest is
    run, the answer lies above the highest that misses it, and the other forms are tried.

    Parameters
    ----------
    model : with repaired covariances, the answer lists the repairs.
    tolerance : largest error of each state due to rounding, in its unit; one number, or (n,). Give states whose
        accuracy does not matter an infinite tolerance.
    base : 2, 10 or 16.
    rounding, form : or their names, such as "nearest" and "UD".
    basis : "emulation" compares each precision with double-double and the model as given, so that the errors of storing
        the model are among those of the arithmetic; the answer is for these measurements. "bound" takes the
        contraction bound of :mod:`gpbnb.kalman.contraction`, which certainly holds for the arithmetic of this run and
        asks for more digits. "guarantee" bounds the error for every measurement sequence within limits, and for ever
        (``guarantee``); "probable" takes three standard deviations of the error that independent
        roundings would cause. Neither depends on `z` or `steps`, and only neighbours of the answer are checked.
    within : limits on the filter without rounding, for "guarantee" and "probable"; see
        :func:`gpbnb.kalman.guarantee.bound.limits`.
    z : (steps, m), measurements; by default simulated by the model, from its first estimate, and rounded to
        :func:`gpbnb.kalman.simulation.fine_resolution`.
    seed : of the simulation.
    progress : show a bar, a tick a precision.

    Raises
    ------
    ValueError : a tolerance that is not positive; another basis, form or rounding; a base without compiled loops; more
        or fewer measurements than steps.
    """
    form, rounding = form_named(form), rounding_named(rounding)
    tolerances = _checked(model, tolerance, base, basis)
    steps = whole_number("steps", steps)
    for_ever = basis in ("guarantee", "probable")
    if for_ever and within is None:
        raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
    if z is None:
        z = Simulation(
            model, tuple(model.x0.astype(np.float64)), whole_number("seed", seed, 0), fine_resolution(model)
        ).measurements(steps)
    measured, checkpoint_steps = _measured(model, z, steps), log_spaced(steps, 16)
    true = reference(model, measured, checkpoint_steps) if basis == "emulation" else None

    def errors_of(chosen: Form) -> Callable[[FloatFormat], tuple[float, str]]:
        if within is not None and for_ever:
            return lambda fmt: _guaranteed(model, fmt, chosen, within, tolerances, basis)
        return lambda fmt: _error_over_tolerance(model, measured, fmt, chosen, checkpoint_steps, true, tolerances)

    checks = () if for_ever else CHECKED[base]
    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:
        found = Search(errors_of(form), base, rounding, checks, bar.update, bounds=basis == "bound")
        advice = f"no bound exists in {_listed(found.undecided)} digits" if found.undecided else ""
        if not for_ever and (found.irregular or found.fmt is None):
            advice = _better_form(errors_of, form, base, rounding, checks, bar.update, basis == "bound")
    repairs = tuple(str(each) for each in model.repairs)
    return Requirement(found.fmt, basis, steps, found.tried, found.why, form, found.irregular, advice, repairs)


def _better_form(
    errors_of: Callable[[Form], Callable[[FloatFormat], tuple[float, str]]],
    form: Form,
    base: int,
    rounding: Rounding,
    checks: Sequence[int],
    tick: Callable[[], Any],
    bounds: bool,
) -> str:
    """Advice: the form that meets the tolerance with the fewest digits; empty if none does."""
    others = [each for each in (Form.UD, Form.JOSEPH, Form.INNOVATION) if each is not form]
    answers = [(other, Search(errors_of(other), base, rounding, checks, tick, bounds).fmt) for other in others]
    met = [(fmt.precision, str(other)) for other, fmt in answers if fmt is not None]
    return f"the form {min(met)[1]} needs {min(met)[0]} digits" if met else ""


def survey(
    model: LinearModel,
    z: Any,
    tolerance: float | Sequence[float],
    precisions: Sequence[int],
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    form: Form | str = Form.INNOVATION,
    basis: Basis = "emulation",
) -> tuple[tuple[int, float], ...]:
    """Run a filter in each of some precisions; arguments as of :func:`required_precision`.

    Returns
    -------
    tried : precision, and largest error or bound over tolerance, as in :class:`Requirement`.

    Raises
    ------
    ValueError : as :func:`required_precision`; a precision without compiled loops.
    """
    form, rounding = form_named(form), rounding_named(rounding)
    tolerances, measured = _checked(model, tolerance, base, basis), _measured(model, z)
    if basis not in ("emulation", "bound"):
        raise ValueError(f'got basis "{basis}"; needed "emulation" or "bound": the others do not depend on a run')
    formats = [FloatFormat(base, precision, rounding) for precision in precisions]
    if beyond := [fmt.precision for fmt in formats if fmt.precision > LARGEST_PRECISION[base]]:
        raise ValueError(f"got {beyond} digits of base {base}; needed at most {LARGEST_PRECISION[base]}")
    checkpoint_steps = log_spaced(len(measured), 16)
    true = reference(model, measured, checkpoint_steps) if basis == "emulation" else None
    return tuple(
        (fmt.precision, _error_over_tolerance(model, measured, fmt, form, checkpoint_steps, true, tolerances)[0])
        for fmt in formats
    )


def _checked(model: LinearModel, tolerance: Any, base: int, basis: str) -> NDArray[np.float64]:
    """The tolerance of each state, if all that was asked makes sense."""
    needed = f"needed an error above 0 for each of the {model.n} states, one finite"
    try:
        tolerances = np.asarray(tolerance, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"got tolerance {tolerance!r}; {needed}") from None
    if tolerances.shape not in ((), (model.n,)):
        raise ValueError(
            f"got tolerance {tolerance} of shape {tolerances.shape}; {needed}: one number, or {model.n} in a row"
        )
    if not (tolerances > 0).all() or not np.isfinite(tolerances).any():
        raise ValueError(f"got tolerance {tolerance}; {needed}")
    if basis not in get_args(Basis):
        raise ValueError(f"got basis {basis!r}; needed one of {', '.join(map(repr, get_args(Basis)))}")
    if base not in LARGEST_PRECISION:
        raise ValueError(f"got base {base}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}")
    return np.broadcast_to(tolerances, (model.n,))


def _measured(model: LinearModel, z: Any, steps: int | None = None) -> NDArray[Any]:
    """Measurements, (steps, m), each of them a number."""
    measured = np.asarray(z)
    if measured.ndim != 2 or measured.shape[1] != model.m or not len(measured) or steps not in (None, len(measured)):
        count = f"{steps} steps" if steps else "steps, at least one"
        column = "; write z.reshape(-1, 1)" if measured.ndim == model.m == 1 else ""
        length = f"{len(measured)} measurements of shape {measured.shape[1:]}" if measured.ndim else repr(z)
        raise ValueError(f"got {length}; needed one for each of the {count}, of shape ({model.m},){column}")
    if measured.dtype.kind == "f" and not np.isfinite(measured).all():
        k, i = np.argwhere(~np.isfinite(measured))[0]
        raise ValueError(
            f"got {measured[k, i]} for measurement {i} of step {k + 1}; needed finite numbers; where a sensor is "
            "silent, give H a cycle with a row of zeros there, and any number as its measurement"
        )
    return measured


def _error_over_tolerance(
    model: LinearModel,
    z: NDArray[Any],
    fmt: FloatFormat,
    form: Form,
    checkpoint_steps: Sequence[int],
    true: Checkpoints | None,
    tolerances: NDArray[np.float64],
) -> tuple[float, str]:
    """Largest error, or without `true` largest bound, over tolerance; infinity and the reason if there is none."""
    asked, measured = np.isfinite(tolerances), fmt.array(z)
    try:
        run = (BoundedRun if true is None else Run)(model, fmt, form, checkpoint_steps)
    except ValueError as error:  # a covariance is not definite in so few digits
        return math.inf, str(error)
    run.take(measured)
    if run.stopped is not None:
        return math.inf, f"the run is refused: {run.reason}"
    if isinstance(run, BoundedRun):
        errors = run.bounds[0]
    elif true is not None:
        errors = compare_runs(run, true).state
        if run.indefinite is not None:
            lost = f"a computed variance was not positive at step {run.indefinite}"
            return math.inf, f"{lost}; if the model leaves a state without any, give it a little in P0"
    ratio = float((np.abs(errors[:, asked]) / tolerances[asked]).max())
    return ratio, "the bound says nothing" if math.isinf(ratio) else ""


def _guaranteed(
    model: LinearModel,
    fmt: FloatFormat,
    form: Form,
    within: Limits,
    tolerances: NDArray[np.float64],
    basis: Basis,
) -> tuple[float, str]:
    """Guaranteed error, or three times the probable one, over tolerance; infinity and the reason if there is none."""
    asked = np.isfinite(tolerances)
    try:
        found = guarantee(model, fmt, within, form, horizon=1)
    except ValueError as error:
        return math.inf, str(error)
    if not found.for_ever:
        return math.inf, found.why
    errors = found.bound if basis == "guarantee" else 3 * probable_error(found)
    return float((errors[asked] / tolerances[asked]).max()), ""
