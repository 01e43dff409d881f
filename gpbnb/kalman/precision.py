"""The number of digits that your own filter needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.arithmetic.kernels.backends import LARGEST_PRECISION
from gpbnb.arithmetic.search import smallest_precision
from gpbnb.kalman.bounded_run import BoundedRun
from gpbnb.kalman.emulation import compare_runs
from gpbnb.kalman.filter_run import Checkpoints, Run, log_spaced, reference
from gpbnb.kalman.forms import Form
from gpbnb.kalman.guarantee.bound import guarantee
from gpbnb.kalman.guarantee.envelope import Limits
from gpbnb.kalman.guarantee.probable import probable_error
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.simulation import Simulation

Basis = Literal["emulation", "bound", "guarantee", "probable"]


@dataclass(frozen=True)
class Requirement:
    """The smallest precision that meets a tolerance, and what the answer rests on.

    Parameters
    ----------
    fmt : None if no format with compiled loops meets the tolerance.
    basis : "emulation", what happened with these measurements; or "bound", what could at most have happened.
    steps : of the filter.
    tried : precision, and largest error over tolerance of all states and checkpoints; infinite where the run stopped, a
        variance was lost, or no bound exists.
    why : of the largest precision tried that has no number for an error, why not; empty if all have one. Shown where it
        kept the answer from being a smaller one.
    """

    fmt: FloatFormat | None
    basis: Basis
    steps: int
    tried: tuple[tuple[int, float], ...]
    why: str = ""

    def __str__(self) -> str:
        if self.fmt is None:
            most, why = self.tried[-1][0], f"; {self.why}" if self.why else ""
            return f"no precision up to {most} digits meets the tolerance ({self.basis}, {self.steps} steps){why}"
        tried = dict(self.tried)
        why = f"; {self.why}" if self.why and math.isinf(tried.get(self.fmt.precision - 1, 0.0)) else ""
        return (
            f"{self.fmt.precision} digits of base {self.fmt.base}, {self.fmt.rounding.value}: "
            f"{tried[self.fmt.precision]:.2g} of the tolerance ({self.basis}, {self.steps} steps){why}"
        )


def required_precision(
    model: LinearModel,
    steps: int,
    tolerance: float | Sequence[float],
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    form: Form = Form.INNOVATION,
    basis: Basis = "emulation",
    z: Any = None,
    seed: int = 0,
    progress: bool = False,
    within: Limits | None = None,
) -> Requirement:
    """Find the smallest precision with which a filter stays within a tolerance.

    A precision qualifies only if the next higher one also meets the tolerance. The search is a bisection, which assumes
    that no precision above a qualifying one misses the tolerance. Whether or not that assumption holds, the answer and
    the next higher precision were run and meet the tolerance; the next lower one, if any, was run and does not qualify.

    Parameters
    ----------
    tolerance : largest error of each state due to rounding, in its unit; one number, or (n,). Give states whose
        accuracy does not matter an infinite tolerance.
    base : 2, 10 or 16.
    basis : "emulation" compares each precision with double-double and the model as given, so that the errors of storing
        the model are among those of the arithmetic; the answer is for these measurements. "bound" takes the
        contraction bound of :mod:`gpbnb.kalman.contraction`, which certainly holds for the arithmetic of this run and
        asks for more digits. "guarantee" bounds the error for every measurement sequence within limits, and for ever
        (``guarantee``); "probable" takes three standard deviations of the error that independent
        roundings would cause. Neither depends on `z` or `steps`.
    within : limits on the filter without rounding, for "guarantee" and "probable"; see
        :func:`gpbnb.kalman.guarantee.bound.limits`.
    z : (steps, m), measurements; by default simulated by the model, from its first estimate.
    seed : of the simulation.
    progress : show a bar, a tick a precision.

    Raises
    ------
    ValueError : a tolerance that is not positive; another basis; a base without compiled loops; more or fewer
        measurements than steps.
    """
    tolerances = _checked(model, tolerance, base, form, basis)
    if not isinstance(steps, (int, np.integer)) or steps < 1:
        raise ValueError(f"got {steps!r} steps; needed a whole number, at least 1")
    for_ever = basis in ("guarantee", "probable")
    if for_ever and within is None:
        raise ValueError(f'got basis "{basis}" without limits; needed within=limits(...) on state and innovation')
    if z is None:
        z = Simulation(model, tuple(model.x0.astype(np.float64)), seed, resolution=2.0**-30).measurements(steps)
    measured, checkpoint_steps = _measured(model, z, steps), log_spaced(steps, 16)
    true = reference(model, measured, checkpoint_steps) if basis == "emulation" else None
    tried, why = dict[int, float](), dict[int, str]()
    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:

        def meets(fmt: FloatFormat) -> bool:
            if within is not None and for_ever:
                ratio, reason = _guaranteed(model, fmt, form, within, tolerances, basis)
            else:
                ratio, reason = _error_over_tolerance(model, measured, fmt, form, checkpoint_steps, true, tolerances)
            tried[fmt.precision], why[fmt.precision] = ratio, reason
            bar.update()
            return ratio <= 1

        found = smallest_precision(meets, base, rounding, least=2, largest=LARGEST_PRECISION[base])
    reasons = [f"in {digits} digits {reason}" for digits, reason in sorted(why.items()) if reason]
    return Requirement(found, basis, int(steps), tuple(sorted(tried.items())), reasons[-1] if reasons else "")


def survey(
    model: LinearModel,
    z: Any,
    tolerance: float | Sequence[float],
    precisions: Sequence[int],
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    form: Form = Form.INNOVATION,
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
    tolerances, measured = _checked(model, tolerance, base, form, basis), _measured(model, z)
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


def _checked(model: LinearModel, tolerance: Any, base: int, form: Form, basis: str) -> NDArray[np.float64]:
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
    if not isinstance(form, Form):
        raise ValueError(f"got form {form!r}; needed one of {', '.join(f'Form.{each.name}' for each in Form)}")
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
