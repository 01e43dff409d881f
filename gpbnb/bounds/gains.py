"""Find a filter's coefficients for all steps: emulate the covariance until it repeats, and enclose the exact gain.

As long as the rounding is deterministic, a computed covariance and the phase of the model's cycle determine the next
covariance. The measurements have no influence on it. Once the computed covariance equals, digit for digit, the one a
whole number of model cycles earlier, everything repeats from then on. With unlimited exponents, nothing forces a
covariance to occur again; the emulation shows whether one does.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_mat
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.matrices import difference, is_zero, product_by_sparse
from gpbnb.arithmetic.kernels.scalar import load, multiply, store, subtract
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.enclosure import Enclosure, enclose
from gpbnb.bounds.gain_limits import FORMS, StepNumbers, limits_of_gains
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import compiled_form
from gpbnb.filters.opening import widened_array
from gpbnb.filters.program import Program, innovation_program, loop_program, sequential_program
from gpbnb.filters.run import Run, widened
from gpbnb.filters.system import LinearFilter

MOST, WORK = 20_000, 1e8
"""Largest number of steps to emulate unless more are asked for, and of steps times the cube of the number of states."""

ENTRY_BY_ENTRY = 16
"""Largest number of states whose covariances are enclosed entry by entry where the norm of `gain_limits` applies."""


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
    exact, dK : (steps, n, m, 2) and (steps, n, m), the exact filter's gain and a bound of its error.
    x0 : (n,), the first estimate as stored.
    first : row at which the period begins.
    settled : whether the rows from there on repeat for ever.
    repeat, period : first step whose computed covariance occurs again, `period` steps later.
    why : why the gain has not settled, if it has not.
    enclosed : the first step from which a gain that never repeats stays within known limits.
    limits : (steps, c), largest distance of the true coefficients from these; None if they are known exactly.
    origin, form : the filter as given, and the form of a Kalman filter.
    """

    program: Program
    fmt: FloatFormat | FixedFormat
    coefficients: NDArray[np.float64]
    packed: NDArray[Any]
    Phi: NDArray[np.float64]
    HPhi: NDArray[np.float64]
    exact: NDArray[np.float64]
    dK: NDArray[np.float64]
    x0: NDArray[Any]
    first: int
    settled: bool
    repeat: int | None
    period: int | None
    why: str = ""
    enclosed: int | None = None
    limits: NDArray[np.float64] | None = None
    origin: LinearModel | LinearFilter | None = None
    form: Form | None = None

    @property
    def steps(self) -> int:
        return len(self.coefficients)

    @property
    def offsets(self) -> NDArray[np.float64]:
        """Largest distance of the true coefficients of each step from those given, (steps, c)."""
        return np.zeros(self.coefficients.shape[:2]) if self.limits is None else self.limits


@compiled
def _stored_loops(fmt: Any, K: Any, H: Any, Phi: Any, identity: Any, F: Any) -> None:
    """Compute closed loops (I - KH)Φ of some steps with every operation rounded, in the order of the filter."""
    T, W = np.empty_like(identity), np.empty_like(identity)
    for k in range(K.shape[0]):
        product_by_sparse(fmt, K[k], H[k % H.shape[0]], T)
        difference(fmt, identity, T, W)
        product_by_sparse(fmt, W, Phi[k % Phi.shape[0]], F[k])


@compiled
def _decorrelated(fmt: Any, U: Any, H: Any, D: Any) -> None:
    """Compute D, the inverse of the unit upper triangle U times H, by back substitution for each step."""
    for k in range(D.shape[0]):
        u, h = U[k % U.shape[0]], H[k % H.shape[0]]
        for j in range(D.shape[2]):
            for i in range(D.shape[1] - 1, -1, -1):
                s = load(fmt, h, (i, j))
                for r in range(i + 1, D.shape[1]):
                    c = load(fmt, u, (i, r))
                    if not is_zero(fmt, c):
                        s = subtract(fmt, s, multiply(fmt, c, load(fmt, D[k], (r, j))))
                store(fmt, D[k], (i, j), s)


def check_deterministic(fmt: FloatFormat | FixedFormat) -> None:
    """Reject stochastic rounding of a filter that computes its gain.

    Raises
    ------
    ValueError : the format rounds at random.
    """
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

    Raises
    ------
    ValueError : the format or the form has no compiled loops, or a covariance is not definite in it; stochastic
        rounding.
    """
    form = compiled_form(form)
    check_deterministic(fmt)
    stored, nothing = model.rounded(fmt), np.array([Fraction(0)] * model.n, dtype=object)
    x0, stored = stored.x0, replace(stored, x0=nothing, steps=None)
    tried = int(np.clip(WORK / model.n**3, 256, MOST)) if most is None else most
    most = MOST if most is None else most
    run, repeat, period = _emulated(replace(model, x0=nothing, steps=None), fmt, form, tried)
    bad = run.stopped or run.indefinite
    if run.stopped:
        why = f"the computed covariance became singular, or left the range of the backend, at step {run.stopped}"
    elif run.indefinite:
        why = f"the computed covariance lost definiteness at step {run.indefinite}"
    elif repeat is None:
        why = f"the computed gain did not settle within {run.steps} steps"
    else:
        why = ""
    end = max(bad - bool(run.stopped), 0) if bad else run.steps if repeat is None or period is None else repeat + period
    if end == 0:
        raise ValueError(f"got {model.name} in {format_text(fmt)}; needed a first step that can be computed: {why}")
    enclosure = _enclosed(stored, run, fmt, form) if repeat is None and not bad else None
    if enclosure is not None:
        repeat, period, why = enclosure.start - stored.cycle, stored.cycle, ""
    if repeat is None or period is None or why:
        repeat = period = None
        K, dK, settled, first = _exact_gains(stored, end if horizon is None else min(end, horizon), None, most, fmt)
    else:
        try:
            K, dK, settled, first = _exact_gains(stored, repeat, period, most, fmt)
            why = "" if settled else f"the exact gain did not settle within {len(K)} steps"
        except ArithmeticError as error:
            why = str(error)
            K, dK, settled, first = _exact_gains(stored, end if horizon is None else horizon, None, most, fmt)
    steps = len(K)
    if not steps:
        raise ValueError(f"got {model.name} in {format_text(fmt)}; needed a first step that can be computed exactly")
    rows = _rows(steps, repeat, period)
    program, packed = packed_coefficients(run, rows)
    phases = np.arange(steps)
    Phi = double_doubles(stored.Phi)[phases % len(stored.Phi)]
    cycle = np.lcm(len(stored.H), len(stored.Phi))
    products = np.array([stored.H[k % len(stored.H)] @ stored.Phi[k % len(stored.Phi)] for k in range(cycle)])
    HPhi = double_doubles(products)[phases % cycle]
    coefficients = widened_array(packed)
    enclosed = wide = None
    if enclosure is not None:
        enclosed, repeat, period = enclosure.start, None, None
        wide = np.zeros(coefficients.shape[:2])
        late = phases[enclosed:]
        count = model.n * model.m  # the gain has the last coefficients
        wide[enclosed:, -count:] = enclosure.gain[(late - enclosed) % stored.cycle].reshape(len(late), count)
    return Schedule(
        program, fmt, coefficients, packed, Phi, HPhi, K, dK, x0, first, settled, repeat, period, why, enclosed, wide,
        model, form,
    )  # fmt: skip


def _enclosed(stored: LinearModel, run: Run, fmt: FloatFormat | FixedFormat, form: Form) -> Enclosure | None:
    """Enclose gains that do not repeat: by a norm if there are many states and it applies, else entry by entry."""
    by_norm = stored.n > ENTRY_BY_ENTRY and form in FORMS and stored.cycle == 1
    if not by_norm or not isinstance(fmt, FloatFormat) or fmt.limits is not None:
        return enclose(stored, run, fmt, form)
    P, K = (widened(each[: run.steps]).sum(axis=-1) for each in (run.C, run.G))
    if form is Form.UD:
        P = np.array([U @ U.T for U in map(_root, P)])
    return limits_of_gains(form, step_numbers(run), P, K, float(fmt.unit_roundoff) * (1 + 2.0**-50))


def step_numbers(run: Run) -> StepNumbers:
    """Return the first step's matrices of a run, as its form uses them."""
    n, m, each = run.model.n, run.model.m, run.matrices
    given = each.Phi, each.H, each.Q, each.R
    Phi, H, Q, R = (widened(each[:1]).sum(axis=-1)[0] for each in given)
    if run.form is not Form.UD:
        return StepNumbers(Phi, Q, np.zeros((n, n)), [(H, R)])
    row = widened_array(packed_coefficients(run, np.zeros(1, dtype=np.int64))[1]).sum(axis=-1)[0]
    D = row[n * n + m * m : n * n + m * m + m * n].reshape(m, 1, n)
    variances = widened(run.UR[:1]).sum(axis=-1)[0].diagonal()
    root = _root(widened(run.UQ[:1]).sum(axis=-1)[0])
    return StepNumbers(Phi, root @ root.T, root, [(D[i], variances[i].reshape(1, 1)) for i in range(m)])


def _root(U: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root of a covariance from its factors, whose diagonal holds variances."""
    return np.asarray((np.triu(U, 1) + np.eye(len(U))) * np.sqrt(np.maximum(U.diagonal(), 0.0)))


def _rows(steps: int, repeat: int | None, period: int | None) -> NDArray[np.int64]:
    """Return, for each step, the emulated step with the same coefficients."""
    k = np.arange(steps)
    if repeat is None or period is None:
        return k
    return np.where(k < repeat + period, k, repeat + (k - repeat) % period)


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
        for k in range(1, done + 1):
            key = (k % model.cycle, (run.C[k - 1] + 0).tobytes())
            if key in seen:
                return run, seen[key], k - seen[key]
            seen[key] = k
        if done < steps or steps >= most:
            return run, None, None
        steps = min(most, 4 * steps)


def packed_coefficients(run: Run, rows: NDArray[np.int64], before: int = 0) -> tuple[Program, NDArray[Any]]:
    """Return the program of a run and its coefficients, row by row.

    Parameters
    ----------
    rows : indices of the run's checkpoints; the first checkpoint is for step `before` + 1.
    """
    n, m, last = run.model.n, run.model.m, int(rows.max()) + 1
    Phi, H, identity = run.matrices.Phi, run.matrices.H, run.matrices.identity
    K = np.ascontiguousarray(run.G[:last])
    tail = K.shape[3:]

    def flat(matrices: NDArray[Any]) -> NDArray[Any]:
        """Return the entries of the matrix of each step, with one row for each step."""
        return matrices[rows].reshape(len(rows), -1, *tail)

    def of_cycle(matrices: NDArray[Any]) -> NDArray[Any]:
        return matrices[(before + rows) % len(matrices)].reshape(len(rows), -1, *tail)

    if run.form in (Form.HUNG, Form.HUNG_SECOND_GAIN):
        F = np.empty((last, n, n, *tail), K.dtype)
        _stored_loops(run.tag, K, np.roll(H, -before, axis=0), np.roll(Phi, -before, axis=0), identity, F)
        return loop_program(n, m), np.concatenate([flat(F), flat(K)], axis=1)
    if run.form is Form.UD:
        cycle = int(np.lcm(len(H), len(run.UR)))
        D = np.empty((cycle, m, n, *tail), K.dtype)
        _decorrelated(run.tag, run.UR, H, D)
        U = np.array(run.UR)
        for i in range(m):  # the diagonal stores variances in place of ones
            U[:, i, : i + 1] = 0
        parts = [of_cycle(each) for each in (Phi, U, D)]
        return sequential_program(n, m), np.concatenate([*parts, flat(K)], axis=1)
    parts = [of_cycle(each) for each in (Phi, H)]
    return innovation_program(n, m), np.concatenate([*parts, flat(K)], axis=1)


# -- the exact gain ---------------------------------------------------------------------------------------------------


def _exact_gains(
    stored: LinearModel, repeat: int, period: int | None, most: int, fmt: FloatFormat | FixedFormat
) -> tuple[NDArray[np.float64], NDArray[np.float64], bool, int]:
    """Return the exact gain in double-double, a bound of its error, whether it holds for ever, and from which row.

    Without a period, these cover the first `repeat` steps. With a period, they go on until the exact gain is periodic,
    too. Distances are measured in the norm of the contraction bound. If the exact covariance is within some distance of
    the computed one at the beginning of a period, and within the same distance at its end, it stays so for ever.
    """
    n, m = stored.n, stored.m
    if period is None:
        run = _bounded_run(stored, repeat, to_the_end=False)
        done = run.steps
        return run.G[:done].reshape(done, n, m, 2), run.bounds.gain[:done], False, done
    unit = float(fmt.unit if isinstance(fmt, FixedFormat) else fmt.unit_roundoff)
    steps = repeat + 2 * period
    while True:
        run = _bounded_run(stored, steps)
        first = steps - period
        K = run.G.reshape(steps, n, m, 2)
        change = np.abs(K[first:, :, :, 0] - K[first - period : first, :, :, 0])
        size = np.abs(K[first:, :, :, 0]).max(axis=(0, 1), keepdims=True)
        if (change <= 1e-5 * unit * size).all() or steps >= most:
            break
        steps = min(max(most, repeat + 2 * period), repeat + period * (2 + 2 * ((steps - repeat) // period)))
    for _ in range(6):
        # Find the invariant distance roughly by trial, then reduce it as far as one more period allows.
        for larger in (4.0, 1e3, 1e6, 1e9):
            closed = _closes(stored, run, first, period, larger, most)
            if closed is not None:
                smaller = _closes(stored, run, first, period, closed.needed, most) if closed.needed < larger else None
                extended = closed if smaller is None else smaller
                return extended.run.G.reshape(-1, n, m, 2), extended.dK, True, first + period
        if steps + period > most:
            break
        steps = min(most, 2 * steps - repeat)
        steps = repeat + (steps - repeat) // period * period
        run = _bounded_run(stored, steps)
        first = steps - period
    return run.G.reshape(run.steps, n, m, 2), run.bounds.gain, False, run.steps


def _bounded_run(stored: LinearModel, steps: int, to_the_end: bool = True) -> Run:
    run = Run(stored, None, Form.INNOVATION, range(1, steps + 1), bounded=True)
    run.take(np.zeros((steps, stored.m)))
    if run.stopped and to_the_end:
        raise ArithmeticError(f"the exact filter leaves the range of float64 at step {run.stopped}")
    return run


class _Closed(NamedTuple):
    """A run of one more period, the bound of its gain's error, and the smallest sufficient factor."""

    run: Run
    dK: NDArray[np.float64]
    needed: float


def _closes(stored: LinearModel, run: Run, first: int, period: int, larger: float, most: int) -> _Closed | None:
    """Follow one more period from a trial invariant distance, `larger` times the change in the last period."""
    steps = run.steps + period
    longer = Run(stored, None, Form.INNOVATION, range(1, steps + 1), bounded=True)
    longer.take(np.zeros((run.steps, stored.m)))
    begin, P_begin = longer.bound, _symmetric(longer)
    weights = arb_mat([[arb(float(a)) for a in row] for row in begin.L])
    inverse = weights.inv()
    last = _symmetric_of(run, run.steps - 1 - period) if run.steps > period else P_begin
    wrap = _distance(inverse, P_begin - last)
    trial = max(max(larger, 1.0) * begin.zeta, larger * wrap, 1e-28)  # the exact covariance begins within begin.zeta
    longer.bound = begin._replace(zeta=trial)
    longer.take(np.zeros((period, stored.m)))
    end = longer.bound
    if not np.isfinite(end.zeta):
        return None
    turned = inverse * arb_mat([[arb(float(a)) for a in row] for row in end.L])
    kappa = _frobenius_to_identity(turned)
    moved = _distance(inverse, _symmetric(longer) - P_begin)
    carried = (1 + kappa) ** 2 * arb(float(end.zeta))
    if not carried + arb(moved) <= arb(float(trial)):
        return None
    shrinks = 1 - float(carried.mid()) / trial  # a distance shrinks by this share in a period
    return _Closed(longer, longer.bounds.gain, 1.1 * max(moved, wrap) / shrinks / max(begin.zeta, wrap))


def _symmetric(run: Run) -> NDArray[Any]:
    P = run.exactly(run.P)
    return np.asarray((P + P.T) / 2)


def _symmetric_of(run: Run, row: int) -> NDArray[Any]:
    P = run.exactly(run.C[row])
    return np.asarray((P + P.T) / 2)


def _distance(inverse: Any, change: NDArray[Any]) -> float:
    """Return an upper bound of the norm of a change of the covariance in units of the weights, float64."""
    D = arb_mat([[arb(a.numerator) / arb(a.denominator) for a in row] for row in change])
    X = inverse * D * inverse.transpose()
    return _upper(_norm(X.entries()))


def _frobenius_to_identity(X: Any) -> Any:
    n = X.nrows()
    return _norm(X[i, j] - int(i == j) for i in range(n) for j in range(n))


def _norm(balls: Iterable[Any]) -> Any:
    """Return an upper bound of the root of the sum of squares; a ball around zero has no square root."""
    return sum((arb(x.abs_upper()) ** 2 for x in balls), arb(0)).sqrt()


def _upper(x: Any) -> float:
    return float(x.upper()) * (1 + 2.0**-50)
