"""How many digits does a filter of one's own need?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gpbnb._kernels.carriers import LARGEST_PRECISION
from gpbnb.formats import FloatFormat, Rounding
from gpbnb.kalman.experiment import Form, Simulation, bounded, emulate, log_spaced, reference
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
) -> Requirement:
    """Find the smallest precision with which a filter stays within a goal.

    Precisions are tried upwards. One counts if the next meets the goal as well, so that no lucky one does.

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

    Raises
    ------
    ValueError : a goal that is not positive; another basis; a base without compiled loops; not as many measurements as
        steps.
    """
    goals = np.broadcast_to(np.asarray(goal, dtype=np.float64), (model.n,))
    if not (goals > 0).all() or not np.isfinite(goals).any():
        raise ValueError(f"got goal {goal}; needed an error above 0 for each of the {model.n} states, one finite")
    asked = np.isfinite(goals)
    if basis not in ("emulation", "bound"):
        raise ValueError(f'got basis {basis!r}; needed "emulation" or "bound"')
    if base not in LARGEST_PRECISION:
        raise ValueError(f"got base {base}; needed one with compiled loops: {', '.join(map(str, LARGEST_PRECISION))}")
    if steps < 1:
        raise ValueError(f"got {steps} steps; needed at least 1")
    if z is None:
        z = Simulation(model, tuple(model.x0.astype(np.float64)), seed, resolution=2.0**-30).measurements(steps)
    if len(z) != steps:
        raise ValueError(f"got {len(z)} measurements; needed one for each of the {steps} steps")
    marks = log_spaced(steps, 16)
    true = reference(model, np.asarray(z), marks) if basis == "emulation" else None
    tried: list[tuple[int, float]] = []
    for precision in range(2, LARGEST_PRECISION[base] + 1):
        fmt = FloatFormat(base, precision, rounding)
        try:
            if true is not None:
                history = emulate(model, z, fmt, form, marks, true)
                error: NDArray[np.float64] = history.state
                lost = history.indefinite is not None or history.stopped is not None
            else:
                error, lost = bounded(model, z, fmt, form, marks).state, False
        except ValueError:  # a covariance is not definite in so few digits
            error, lost = np.empty((0, model.n)), True
        ratio = math.inf if lost or not len(error) else float((np.abs(error[:, asked]) / goals[asked]).max())
        tried.append((precision, ratio))
        if ratio <= 1 and len(tried) > 1 and tried[-2][1] <= 1:
            return Requirement(FloatFormat(base, precision - 1, rounding), basis, steps, tuple(tried))
    best = tried[-1][1] <= 1
    return Requirement(FloatFormat(base, tried[-1][0], rounding) if best else None, basis, steps, tuple(tried))
