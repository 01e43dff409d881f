"""Find a filter's coefficients for all steps: emulate the covariance until it repeats, and run the exact filter along.

As long as the rounding is deterministic, a computed covariance and the phase of the model's cycle determine the next
covariance. The measurements have no influence on it. Once the computed covariance equals, digit for digit, the one a
whole number of model cycles earlier, everything repeats from then on. With unlimited exponents, nothing forces a
covariance to occur again; the emulation shows whether one does.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form, form_with_program
from gpbnb.filters.model import LinearModel
from gpbnb.filters.opening import as_packed
from gpbnb.filters.pairs import nearest_double_doubles
from gpbnb.filters.program import Program, matrices
from gpbnb.filters.run import Run
from gpbnb.filters.structures import LinearFilter

MOST, WORK = 20_000, 1e8
"""Largest number of steps to emulate unless more are asked for, and of steps times the cube of the number of states."""


@dataclass(frozen=True, eq=False)
class Schedule:
    """Coefficients of each step of a linear filter, and the corresponding exact filter.

    Row k of each array is for step k + 1. If `settled`, the rows from `first` on repeat for ever.

    Parameters
    ----------
    program : operations of a step.
    fmt : their format.
    coefficients : (steps, c, 2), double-double.
    packed : the coefficients as the compiled loops of the format expect them.
    Phi, HPhi : (steps, n, n, 2) and (steps, m, n, 2), the model as stored, double-double.
    exact : (steps, n, m, 2), the exact filter's gain.
    x0 : (n,), the first estimate as stored.
    first : row at which the period begins.
    settled : whether the rows from there on repeat for ever.
    repeat, period : first step whose computed covariance occurs again, `period` steps later.
    why : why the gain has not settled, if it has not.
    covariances : (steps, n, n, 2), those of the exact filter after each step; none for fixed coefficients.
    origin, form : the filter as given, and the form of a Kalman filter.
    """

    program: Program
    fmt: FloatFormat | FixedFormat
    coefficients: NDArray[np.float64]
    packed: NDArray[Any]
    Phi: NDArray[np.float64]
    HPhi: NDArray[np.float64]
    exact: NDArray[np.float64]
    x0: NDArray[Any]
    first: int
    settled: bool
    repeat: int | None
    period: int | None
    why: str = ""
    covariances: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0, 0, 2)))
    origin: LinearModel | LinearFilter | None = None
    form: Form | None = None

    @property
    def steps(self) -> int:
        return len(self.coefficients)

    def rows(self, k: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the row of each step, counted from 0."""
        return periodic(k, self.first, self.steps - self.first)


def periodic(k: NDArray[np.int64], first: int, period: int) -> NDArray[np.int64]:
    """Return each number, or that below `first` + `period` which it repeats."""
    return np.where(k < first + period, k, first + (k - first) % max(period, 1))


def filter_schedule(made: LinearFilter, fmt: FloatFormat | FixedFormat) -> Schedule:
    """Return a filter with fixed coefficients in a format, for :func:`gpbnb.bounds.guarantee.from_schedule`.

    Its coefficients are stored once, see :meth:`~gpbnb.filters.structures.LinearFilter.stored`, so they are fixed even
    if the format rounds at random. The error of an operation is then less than a unit in the last place.
    """
    if not made.program.is_linear:
        raise ValueError(f"got {made.name}, which limits its values; needed a linear filter for a schedule")
    program, stored = made.program, made.stored(fmt)
    packed, n, m = as_packed(fmt, stored.reshape(1, -1)), program.n, program.m
    A, B = (double_doubles(each)[None] for each in matrices(program, stored))
    nothing = np.array([Fraction(0)] * n, dtype=object)
    return Schedule(
        program, fmt, nearest_double_doubles(packed), packed, A, np.zeros((1, m, n, 2)), B, nothing, first=0,
        settled=True, repeat=None, period=None, origin=made,
    )  # fmt: skip


def check_deterministic(fmt: FloatFormat | FixedFormat) -> None:
    """Reject stochastic rounding of a filter that computes its gain."""
    if fmt.rounding is Rounding.STOCHASTIC:
        raise ValueError(
            "got stochastic rounding for a Kalman filter; needed another rounding: its computed gain depends on the "
            "random numbers, and a covariance that occurs again does not repeat. A LinearSystem, whose coefficients "
            "are fixed, may round at random"
        )


def schedule(
    model: LinearModel,
    fmt: FloatFormat | FixedFormat,
    form: Form | str,
    most: int | None = None,
    horizon: int | None = None,
) -> Schedule:
    """Find the coefficients of a Kalman filter until its computed covariance repeats and the exact gain has settled.

    Parameters
    ----------
    model, fmt, form : as for a run of the filter. The exact filter uses model and measurements as the format stores
        them.
    most : largest number of steps to try, 20,000 by default, and fewer for more than 17 states, whose covariances
        seldom repeat. A model with `steps` is continued with the cycles of its matrices.
    horizon : number of steps to return if the gain does not settle; by default all that were tried.
    """
    model.refuse_inputs("a guarantee")
    form = form_with_program(form)
    check_deterministic(fmt)
    stored, nothing = model.rounded(fmt), np.array([Fraction(0)] * model.n, dtype=object)
    x0, stored = stored.x0, replace(stored, x0=nothing, steps=None)
    tried = int(np.clip(WORK / model.n**3, 256, MOST)) if most is None else most
    most = MOST if most is None else most
    run, repeat, period = _emulated(replace(model, x0=nothing, steps=None), fmt, form, tried)
    if run.indefinite:
        end, why = run.indefinite, f"the computed covariance lost definiteness at step {run.indefinite}"
    elif run.stopped:
        end = run.stopped - 1
        why = f"the computed covariance became singular, or left the range of the backend, at step {run.stopped}"
    elif repeat is None or period is None:
        end, why = run.steps, f"the computed gain did not settle within {run.steps} steps"
    else:
        end, why = repeat + period, ""
    if end == 0:
        raise ValueError(f"got {model.name} in {format_text(fmt)}; needed a first step that can be computed: {why}")
    if repeat is None or why:
        repeat = period = None
        true = _exact_run(stored, None, None, most, fmt, end if horizon is None else min(end, horizon))
    else:
        true = _exact_run(stored, repeat, period, most, fmt, end if horizon is None else horizon)
        why = "" if true.settled else f"the exact gain did not settle within {true.run.steps} steps"
    steps = true.run.steps
    if not steps:
        raise ValueError(f"got {model.name} in {format_text(fmt)}; needed a first step that can be computed exactly")
    rows = np.arange(steps) if repeat is None or period is None else periodic(np.arange(steps), repeat, period)
    packed = run.coefficients()[rows]
    phases = np.arange(steps)
    Phi = double_doubles(stored.Phi)[phases % len(stored.Phi)]
    cycle = np.lcm(len(stored.H), len(stored.Phi))
    products = np.array([stored.H[k % len(stored.H)] @ stored.Phi[k % len(stored.Phi)] for k in range(cycle)])
    HPhi = double_doubles(products)[phases % cycle]
    exact = true.run.G[:steps].reshape(steps, model.n, model.m, 2)
    return Schedule(
        run.linear_program(), fmt, nearest_double_doubles(packed), packed, Phi, HPhi, exact, x0, true.first,
        true.settled, repeat, period, why, true.run.C[:steps], model, form,
    )  # fmt: skip


def _emulated(
    model: LinearModel, fmt: FloatFormat | FixedFormat, form: Form, most: int
) -> tuple[Run, int | None, int | None]:
    """Return a run that keeps every gain, and the number of steps after which the computed covariance first repeats."""
    steps = min(most, max(128, 2 * model.cycle))
    while True:
        run = Run(model, fmt, form, range(1, steps + 1))  # type: ignore[arg-type]
        start = np.array(run.P)
        run.take(np.zeros((steps, model.m)))
        done = run.steps
        seen: dict[tuple[int, bytes], int] = {(0, start.tobytes()): 0}
        covariances = run.C
        for k in range(1, done + 1):
            key = (k % model.cycle, (covariances[k - 1] + 0).tobytes())
            if key in seen:
                return run, seen[key], k - seen[key]
            seen[key] = k
        if done < steps or steps >= most:
            return run, None, None
        steps = min(most, 4 * steps)


# -- the exact gain ---------------------------------------------------------------------------------------------------


class _Exact(NamedTuple):
    """A run of the exact filter in double-double, whether its gain has settled, and the step before its last period."""

    run: Run
    settled: bool
    first: int


def _exact_run(
    stored: LinearModel, repeat: int | None, period: int | None, most: int, fmt: FloatFormat | FixedFormat, steps: int
) -> _Exact:
    """Run the exact filter over some steps or, with a period, until its gain is periodic, too."""
    if repeat is None or period is None:
        run = _run(stored, steps)
        return _Exact(run, False, run.steps)
    unit = float(fmt.unit if isinstance(fmt, FixedFormat) else fmt.unit_roundoff)
    steps = repeat + 2 * period
    while True:
        run, first = _run(stored, steps), steps - period
        if run.steps < steps:
            return _Exact(run, False, run.steps)
        K = run.G[first - period : steps, ..., 0].reshape(2, period, -1)
        if (np.abs(K[1] - K[0]) <= 1e-4 * unit * np.abs(K[1]).max(axis=0)).all():
            return _Exact(run, True, first)
        if steps >= most:
            return _Exact(run, False, run.steps)
        steps = min(max(most, repeat + 2 * period), repeat + period * (2 + 2 * ((steps - repeat) // period)))


def _run(stored: LinearModel, steps: int) -> Run:
    run = Run(stored, None, Form.INNOVATION, range(1, steps + 1))
    run.take(np.zeros((steps, stored.m)))
    return run
