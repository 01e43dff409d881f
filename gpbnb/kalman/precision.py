"""How many digits does a filter of one's own need?"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb._kernels.carriers import LARGEST_PRECISION
from gpbnb.formats import FloatFormat, Rounding
from gpbnb.kalman.experiment import Followed, Form, Kept, Simulation, emulate, log_spaced, reference
from gpbnb.kalman.model import LinearModel

Basis = Literal["emulation", "bound"]


@dataclass(frozen=True)
class Requirement:
    """The smallest precision that meets a goal, and what the answer rests on.

    Parameters
    ----------
    fmt : None if no format with compiled loops meets the goal.
    basis : "emulation", what happened with these measurements; or "bound", what could at most have happened.
    steps : of the filter.
    tried : precision, and largest error over goal of all states and steps looked at; infinite where the run stopped, a
        variance was lost, or nothing can be said.
    """

    fmt: FloatFormat | None
    basis: Basis
    steps: int
    tried: tuple[tuple[int, float], ...]

    def __str__(self) -> str:
        if self.fmt is None:
            return f"no precision up to {self.tried[-1][0]} digits meets the goal ({self.basis}, {self.steps} steps)"
        ratio = dict(self.tried)[self.fmt.precision]
        return (
            f"{self.fmt.precision} digits of base {self.fmt.base}, {self.fmt.rounding.value}: "
            f"{ratio:.2g} of the goal ({self.basis}, {self.steps} steps)"
        )


def required_precision(
    model: LinearModel,
    steps: int,
    goal: float | Sequence[float],
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    form: Form = Form.USUAL,
    basis: Basis = "emulation",
    z: Any = None,
    seed: int = 0,
    progress: bool = False,
) -> Requirement:
    """Find the smallest precision with which a filter stays within a goal.

    Found by bisection, which takes for granted that a precision that misses the goal is not below one that counts. One
    counts if the next meets the goal as well, so that no lucky one does. Whatever is taken for granted, the answer and
    the next one were run and meet the goal, and unless the answer is 2 digits, the one before it was run and does not
    count.

    Parameters
    ----------
    goal : largest error of each state due to rounding, in its unit; one number, or (n,), infinite for a state that does
        not matter.
    base : 2, 10 or 16.
    basis : "emulation" compares each precision with double-double and the model as given, so that the errors of storing
        the model are among those of the arithmetic; the answer is for these measurements. "bound" takes the
        contraction bound of :mod:`gpbnb.kalman.theory`, which holds for the arithmetic of this run without doubt, and
        asks for more digits.
    z : (steps, m), measurements; by default simulated by the model, from its first estimate.
    seed : of the simulation.
    progress : show a bar, a tick a precision.

    Raises
    ------
    ValueError : a goal that is not positive; another basis; a base without compiled loops; not as many measurements as
        steps.
    """
    goals = np.broadcast_to(np.asarray(goal, dtype=np.float64), (model.n,))
    if not (goals > 0).all() or not np.isfinite(goals).any():
        raise ValueError(f"got goal {goal}; needed an error above 0 for each of the {model.n} states, one finite")
    if basis not in ("emulation", "bound"):
        raise ValueError(f'got basis {basis!r}; needed "emulation" or "bound"')
    if base not in LARGEST_PRECISION:
        raise ValueError(f"got base {base}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}")
    if steps < 1:
        raise ValueError(f"got {steps} steps; needed at least 1")
    if z is None:
        z = Simulation(model, tuple(model.x0.astype(np.float64)), seed, resolution=2.0**-30).measurements(steps)
    measured, marks = np.asarray(z), log_spaced(steps, 16)
    if measured.shape != (steps, model.m):
        raise ValueError(
            f"got {len(measured)} measurements of shape {measured.shape[1:]}; needed one for each of the {steps} "
            f"steps, of shape ({model.m},)"
        )
    true = reference(model, measured, marks) if basis == "emulation" else None
    most, tried = LARGEST_PRECISION[base], dict[int, float]()
    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:

        def meets(precision: int) -> bool:
            if precision not in tried:
                fmt = FloatFormat(base, precision, rounding)
                tried[precision] = _over_goal(model, measured, fmt, form, marks, true, goals)
                bar.update()
            return tried[precision] <= 1

        answer = 2 + bisect_left(range(2, most), True, key=meets)
        while answer < most and not (meets(answer) and meets(answer + 1)):
            answer += 1
        found = FloatFormat(base, answer, rounding) if meets(answer) else None
    return Requirement(found, basis, steps, tuple(sorted(tried.items())))


def survey(
    model: LinearModel,
    z: Any,
    goal: float | Sequence[float],
    precisions: Sequence[int],
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    form: Form = Form.USUAL,
    basis: Basis = "emulation",
) -> tuple[tuple[int, float], ...]:
    """Run a filter in each of some precisions; arguments as of :func:`required_precision`.

    Returns
    -------
    tried : precision, and largest error or bound over goal, as in :class:`Requirement`.
    """
    measured, goals = np.asarray(z), np.broadcast_to(np.asarray(goal, dtype=np.float64), (model.n,))
    marks = log_spaced(len(measured), 16)
    true = reference(model, measured, marks) if basis == "emulation" else None
    formats = [FloatFormat(base, precision, rounding) for precision in precisions]
    return tuple((fmt.precision, _over_goal(model, measured, fmt, form, marks, true, goals)) for fmt in formats)


def _over_goal(
    model: LinearModel,
    z: NDArray[Any],
    fmt: FloatFormat,
    form: Form,
    marks: Sequence[int],
    true: Kept | None,
    goals: NDArray[np.float64],
) -> float:
    """Largest error over goal against `true`, or without it, largest bound over goal; infinite if a run fails."""
    asked = np.isfinite(goals)
    try:
        if true is None:
            followed = Followed(model, fmt, form, marks)
            followed.take(fmt.array(z))
            lost, error = followed.stopped is not None, followed.bounds[0]
        else:
            history = emulate(model, z, fmt, form, marks, true)
            lost, error = history.indefinite is not None or history.stopped is not None, history.state
    except ValueError:  # a covariance is not definite in so few digits
        return math.inf
    return math.inf if lost else float((np.abs(error[:, asked]) / goals[asked]).max())
