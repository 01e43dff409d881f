"""Test the sharpness of a guarantee with admissible measurements whose rounding errors all have the same effect.

At each step, the search chooses among some admissible measurements. It takes the one whose rounding errors most
increase the error of one state at one later step. A plan keeps the state large, and the search determines the last
digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels import doubledouble, tags
from gpbnb.arithmetic.kernels.backends import Compiled, double_doubles
from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.scalar import add, less, load, multiply, put, round_, store, subtract
from gpbnb.arithmetic.kernels.tags import PAIRS, DoubleDouble
from gpbnb.bounds.gains import Schedule
from gpbnb.bounds.guarantee import FilterGuarantee, closed_loops
from gpbnb.bounds.guess import FilterLimits, linear_steps
from gpbnb.bounds.units import largest_errors, units
from gpbnb.filters.opening import as_packed
from gpbnb.filters.program import ADD, AT_LEAST, MULTIPLY, SUBTRACT, Program

_POWERS = np.array([10.0**k for k in range(23)])  # exact


@dataclass(frozen=True, eq=False)
class Attack:
    """Runs of a filter with chosen measurements, and the largest errors.

    Parameters
    ----------
    errors : (n,), the largest error of each state in any run, at any step.
    ratio : largest of these over their bounds; a guarantee is violated above 1.
    ratios : (n,), the ratio of each state.
    runs, steps : number of runs, and steps of each.
    z : (steps, m), measurements of the run with the largest ratio, numbers of the format, in float64.
    state, step : where the largest ratio occurs: index of the state, and number of steps done.
    admissible : whether the exact filter stayed within its limits in all runs.
    """

    errors: NDArray[np.float64]
    ratio: float
    ratios: NDArray[np.float64]
    runs: int
    steps: int
    z: NDArray[np.float64]
    state: int
    step: int
    admissible: bool


def number(fmt: Any, x: Any) -> Any:
    """Round a float64 into a format; in base 10, use its first decimals."""
    raise TypeError("got a call of number from Python; needed one from a function compiled by numba")


@overload(number, strict=False, jit_options={"forceinline": True, "no_cfunc_wrapper": True})
def _overloaded_number(fmt: Any, x: Any) -> Any:
    if getattr(fmt, "instance_class", None) in PAIRS:
        return lambda fmt, x: round_(fmt, _scaled(x))
    return lambda fmt, x: round_(fmt, x)


def widened(fmt: Any, a: Any) -> Any:
    """Convert a number to double-double: exactly in bases 2 and 16, within four roundings in base 10."""
    raise TypeError("got a call of widened from Python; needed one from a function compiled by numba")


@overload(widened, strict=False, jit_options={"forceinline": True, "no_cfunc_wrapper": True})
def _overloaded_widened(fmt: Any, a: Any) -> Any:
    def of_float(fmt: Any, a: Any) -> Any:
        return a, 0.0

    def of_pair(fmt: Any, a: Any) -> Any:
        high = np.float64(a[0])
        x, e = (high, np.float64(a[0] - np.int64(high))), a[1]
        while e > 0:
            x = doubledouble.operate(tags.MULTIPLY, x, (_POWERS[min(e, 22)], 0.0))
            e -= min(e, 22)
        while e < 0:
            x = doubledouble.operate(tags.DIVIDE, x, (_POWERS[min(-e, 22)], 0.0))
            e += min(-e, 22)
        return x

    return of_pair if getattr(fmt, "instance_class", None) in PAIRS else of_float


@inner
def _scaled(x: float) -> Any:
    e = 0
    while x != 0.0 and abs(x) < 1e15:
        x *= 10.0
        e -= 1
    while abs(x) > 1e17:
        x /= 10.0
        e += 1
    return np.int64(x), np.int64(e)


@inner
def _times(a: Any, x: Any, c: Any) -> None:
    """Compute c = a x for a matrix and a column in double-double."""
    exactly = DoubleDouble()
    for i in range(a.shape[0]):
        s = (0.0, 0.0)
        for j in range(a.shape[1]):
            p = doubledouble.operate(tags.MULTIPLY, load(exactly, a, (i, j)), load(exactly, x, j))
            s = doubledouble.operate(tags.ADD, s, p)
        put(exactly, c, i, s)


@inner
def _worth(fmt: Any, row: Any, x: Any, x_exact: Any) -> float:
    """Return the weighted error of an estimate."""
    exactly, total = DoubleDouble(), 0.0
    for i in range(x_exact.shape[0]):
        e = doubledouble.operate(tags.SUBTRACT, widened(fmt, load(fmt, x, i)), load(exactly, x_exact, i))
        total += row[i] * e[0]
    return total


@inner
def _share(size: float, limit: float) -> float:
    """Return a size as a share of its limit, which may be zero."""
    if size == 0.0:
        return 0.0
    return size / limit if limit > 0.0 else 1e10


class _Attacked(NamedTuple):
    """The filter that is attacked: the operations of a step, and coefficients whose rows from `first` on repeat."""

    operations: NDArray[np.int64]
    outputs: NDArray[np.int64]
    #: packed, (steps, c).
    coefficients: NDArray[Any]
    #: the exact filter, double-double.
    Phi: NDArray[np.float64]
    HPhi: NDArray[np.float64]
    K: NDArray[np.float64]
    first: int
    #: limits of the exact filter.
    limits: FilterLimits


class Plan(NamedTuple):
    """How measurements are chosen, step by step."""

    #: (steps, n), weight of an error after each step.
    rows: NDArray[np.float64]
    #: (steps, candidates, m), measurements; with `by_range`, innovations, to which steering is added.
    pool: NDArray[np.float64]
    #: (m, n + 1), with `by_range`: steer (x_predicted, share) is added to innovations, within their limit.
    steer: NDArray[np.float64]
    by_range: bool
    #: number of steps in which the share rises from 0 to 1.
    ramp: float
    #: whether each candidate is judged by the error one step later, after a measurement from the middle of the range.
    ahead: bool


class _Measured(NamedTuple):
    """A measurement: packed, and minus what the exact filter expects, in double-double."""

    z: NDArray[Any]
    nu: NDArray[np.float64]


@inner
def _row(given: Any, k: int) -> int:
    """Return the row of the coefficients of step k + 1."""
    count = given.Phi.shape[0]
    return k if k < count else given.first + (k - given.first) % (count - given.first)


@inner
def _measure(fmt: Any, given: Any, plan: Any, values: Any, pull: Any, seen: Any, into: Any) -> float:
    """Turn a candidate into a measurement; return the largest share of a limit."""
    exactly, limits, excess = DoubleDouble(), given.limits, 0.0
    for r in range(values.shape[0]):
        value = values[r]
        if plan.by_range:
            most = limits.innovation[r]
            value = seen[r, 0] + min(max(pull[r] + value, -most), most) * (1 - 1e-6)
        c = number(fmt, value)
        put(fmt, into.z, r, c)
        c_exact = widened(fmt, c)
        put(exactly, into.nu, r, doubledouble.operate(tags.SUBTRACT, c_exact, load(exactly, seen, r)))
        excess = max(excess, _share(abs(into.nu[r, 0]), limits.innovation[r]))
        excess = max(excess, _share(abs(c_exact[0]), limits.measurement[r]))
    return excess


@inner
def _corrected(K: Any, nu: Any, predicted: Any, c: Any) -> None:
    """Compute c = predicted + K nu in double-double; c is not the predicted estimate itself."""
    exactly = DoubleDouble()
    _times(K, nu, c)
    for i in range(c.shape[0]):
        put(exactly, c, i, doubledouble.operate(tags.ADD, load(exactly, predicted, i), load(exactly, c, i)))


@inner
def _execute(fmt: Any, operations: Any, outputs: Any, coefficients: Any, x: Any, z: Any, values: Any) -> None:
    """Take one step in the arithmetic that the tag selects, and overwrite x and the workspace `values`."""
    n, m = x.shape[0], z.shape[0]
    for i in range(n):
        put(fmt, values, i, load(fmt, x, i))
    for i in range(m):
        put(fmt, values, n + i, load(fmt, z, i))
    for o in range(operations.shape[0]):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        right = load(fmt, values, b)
        if code == MULTIPLY:
            put(fmt, values, n + m + o, multiply(fmt, load(fmt, coefficients, a), right))
        elif code == ADD:
            put(fmt, values, n + m + o, add(fmt, load(fmt, values, a), right))
        elif code == SUBTRACT:
            put(fmt, values, n + m + o, subtract(fmt, load(fmt, values, a), right))
        else:
            limit = load(fmt, coefficients, a)
            beyond = less(fmt, right, limit) if code == AT_LEAST else less(fmt, limit, right)
            put(fmt, values, n + m + o, limit if beyond else right)
    for i in range(n):
        store(fmt, x, i, load(fmt, values, outputs[i]))


@inner
def _error_ahead(fmt: Any, given: Any, plan: Any, k: int, x: Any, x_exact: Any, values: Any) -> float:
    """Return the weighted error one step after step k + 1, with a measurement from the middle of the range."""
    exactly, m, then = DoubleDouble(), given.HPhi.shape[1], _row(given, k + 1)
    beyond, moved, nu = np.empty_like(x_exact), np.empty_like(x_exact), np.empty((m, 2))
    z, later = np.empty((m, *x.shape[1:]), x.dtype), x.copy()
    _times(given.Phi[then], x_exact, beyond)
    _times(given.HPhi[then], x_exact, nu)
    for r in range(m):
        c = number(fmt, nu[r, 0] if plan.by_range else plan.pool[k + 1, 0, r])
        put(fmt, z, r, c)
        put(exactly, nu, r, doubledouble.operate(tags.SUBTRACT, widened(fmt, c), load(exactly, nu, r)))
    _corrected(given.K[then], nu, beyond, moved)
    _execute(fmt, given.operations, given.outputs, given.coefficients[then], later, z, values)
    return _worth(fmt, plan.rows[k + 1], later, moved)


@compiled
def greedy(fmt: Any, given: Any, plan: Any, x: Any, x_exact: Any, chosen: Any, errors: Any) -> Any:
    """Choose a measurement at each step from a pool; keeps the errors in `errors` (steps, n).

    Most products of a step depend only on the estimate. So each candidate may be judged by the error one step later.

    Parameters
    ----------
    given : _Attacked.
    plan : Plan.
    x, x_exact : the first estimate, packed and double-double.
    chosen : (steps, m[, 2]), the chosen measurements, packed.

    Returns
    -------
    violations : steps at which no candidate kept the exact filter within its limits.
    """
    n, m, steps = given.Phi.shape[1], given.HPhi.shape[1], plan.rows.shape[0]
    exactly, trial, best = DoubleDouble(), np.empty_like(x), np.empty_like(x)
    values = np.empty((n + m + given.operations.shape[0], *x.shape[1:]), x.dtype)
    tried, taken = _Measured(np.empty((m, *x.shape[1:]), x.dtype), np.empty((m, 2))), np.empty_like(chosen[0])
    predicted, following, best_exact = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2))
    seen, pull, violations = np.empty((m, 2)), np.zeros(m), 0
    for k in range(steps):
        at = _row(given, k)
        _times(given.Phi[at], x_exact, predicted)
        _times(given.HPhi[at], x_exact, seen)
        if plan.by_range:
            for r in range(m):
                pull[r] = plan.steer[r, n] * min(1.0, k / plan.ramp)
                for j in range(n):
                    pull[r] += plan.steer[r, j] * predicted[j, 0]
        largest, found = -np.inf, -1
        for q in range(plan.pool.shape[1]):
            excess = _measure(fmt, given, plan, plan.pool[k, q], pull, seen, tried)
            _corrected(given.K[at], tried.nu, predicted, following)
            for i in range(n):
                excess = max(excess, _share(abs(following[i, 0]), given.limits.state[i]))
            trial[:] = x
            _execute(fmt, given.operations, given.outputs, given.coefficients[at], trial, tried.z, values)
            if excess > 1.0:
                score = -1e300 * min(excess, 1e7)
            elif k + 1 == steps or not plan.ahead:
                score = _worth(fmt, plan.rows[k], trial, following)
            else:
                score = _error_ahead(fmt, given, plan, k, trial, following, values)
            if score > largest or found < 0:
                largest, found = score, q
                best[:] = trial
                best_exact[:] = following
                taken[:] = tried.z
        if largest <= -1e299:
            violations += 1
        x[:] = best
        x_exact[:] = best_exact
        chosen[k] = taken
        for i in range(n):
            e = doubledouble.operate(tags.SUBTRACT, widened(fmt, load(fmt, x, i)), load(exactly, x_exact, i))
            errors[k, i] = e[0]
    return violations


def responses(given: Schedule, F: NDArray[np.float64], state: int, steps: int) -> NDArray[np.float64]:
    """Return how much an error after each step adds to the error of one state after the last step, (steps, n)."""
    rows = np.zeros((steps, given.program.n))
    c = np.eye(given.program.n)[state]
    for k in range(steps - 1, -1, -1):
        rows[k] = c
        at = k if k < given.steps else given.first + (k - given.first) % (given.steps - given.first)
        c = c @ F[at]
    return rows


def attack(
    found: FilterGuarantee,
    steps: int = 1_000,
    candidates: int = 200,
    seed: int = 0,
    states: Any = None,
    center: Any = None,
    plans: int = 6,
    ramp: float | None = None,
) -> Attack:
    """Attack a guarantee with measurements chosen step by step, within its limits.

    Parameters
    ----------
    steps : length of each run; the attack maximizes the error after the last step.
    candidates : number of measurements to choose from at each step.
    states : the states whose errors to maximize; all by default.
    center : (n,), for limits on state and innovation: the state near which the exact filter stays; by default near
        the limits.
    plans : courses of the measurements to try for each state.
    """
    given, rng = found.schedule, np.random.default_rng(seed)
    n, m = given.program.n, given.program.m
    by_range = not np.isfinite(found.limits.measurement).all()
    errors, best, best_z, allowed, runs = np.zeros(n), 0.0, np.zeros((steps, m)), True, 0
    at: tuple[Any, ...] = ()
    F = closed_loops(given)
    for state in range(n) if states is None else states:
        rows = responses(given, F, state, steps)
        for plan in range(plans):
            pool = _pool(found, F, state, steps, candidates, plan, by_range, rng)
            steer = _steering(found, center) if by_range else np.zeros((m, n + 1))
            rise = steps / 2 if ramp is None else ramp
            outcome = run_against(found, rows, pool, steer, by_range, rise, ahead=True)
            runs += 1
            allowed = allowed and not outcome[0]
            if outcome[0]:
                continue
            errors = np.maximum(errors, np.abs(outcome[2]).max(axis=0))
            reached = shares_of(np.abs(outcome[2]), found.bound)
            if reached.max() > best or not at:
                best, best_z, at = float(reached.max()), outcome[1], np.unravel_index(reached.argmax(), reached.shape)
    ratios, (step, state) = shares_of(errors, found.bound), at or (0, 0)
    return Attack(errors, float(ratios.max()), ratios, runs, steps, best_z, int(state), int(step) + 1, allowed)


def shares_of(errors: NDArray[np.float64], bound: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ratio of each error to its bound: 0 for no error, infinity for an error with a bound of zero."""
    beyond = np.where(errors == 0, 0.0, np.inf)
    return np.asarray(np.divide(errors, bound, out=beyond, where=(errors != 0) & (bound != 0)))


def ceiling(found: FilterGuarantee, z: NDArray[np.float64], state: int) -> float:
    """Return the error that a state would have after a run if all roundings of this run had the same effect.

    Each rounding error is as large as a result of that size allows. The errors of gain and closed loop are those of the
    run. The guarantee, on the other hand, allows for the largest sizes at every step. So the ceiling tells whether
    an attack fails because it does not control all roundings, or because no run keeps all numbers as large as the
    limits allow.

    Parameters
    ----------
    z : (steps, m), measurements of the run, such as those of an :class:`Attack`.
    state : index of the state.
    """
    given, program = found.schedule, found.schedule.program
    first, steps = program.n + program.m, len(z)
    parts, table = linear_steps(given, np.arange(given.steps)), units(given.fmt)
    rows, known = responses(given, parts.F, state, steps), 0.0
    values, x = np.empty(first + len(program.operations)), given.x0.astype(np.float64)
    powers, total = {0.0, *table.exact.tolist()}, 0.0
    for k in range(steps):
        at = k if k < given.steps else given.first + (k - given.first) % (given.steps - given.first)
        coefficients = np.ascontiguousarray(given.coefficients[at, :, 0])
        values[:first] = *x, *z[k]
        errors = np.zeros(len(program.operations))
        for o, (code, a, b) in enumerate(program.operations):
            if code == MULTIPLY:
                values[first + o] = coefficients[a] * values[b]
                exact = abs(coefficients[a]) in powers
            else:
                values[first + o] = values[a] - values[b] if code == SUBTRACT else values[a] + values[b]
                exact = values[a] == 0 or values[b] == 0 or abs(values[first + o]) <= table.aligned
            if not exact and values[first + o]:
                errors[o] = largest_errors(given.fmt, np.abs(values[first + o]))
        total += float(np.abs(_effects(program, coefficients)[first:] @ rows[k]) @ errors)
        innovation = z[k] - given.HPhi[at, :, :, 0] @ x
        known += float(rows[k] @ (parts.loop[at] @ x + parts.gain[at] @ innovation))
        x = values[program.outputs]
    return total + abs(known)


def _effects(program: Program, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the effect of an error in each value on the states after the step, (n + m + o, n)."""
    first = program.n + program.m
    effects = np.zeros((first + len(program.operations), program.n))
    np.add.at(effects, (program.outputs, np.arange(program.n)), 1.0)
    for v, (code, a, b) in reversed(list(enumerate(program.operations.tolist(), first))):
        if code == MULTIPLY:
            effects[b] += coefficients[a] * effects[v]
        else:
            effects[a] += effects[v]
            effects[b] += effects[v] if code == ADD else -effects[v]
    return effects


def random_errors(found: FilterGuarantee, steps: int, center: Any = None) -> NDArray[np.float64]:
    """Return errors after each step, (steps, n), of one run with random measurements within the limits.

    Parameters
    ----------
    center : see :func:`attack`.
    """
    given, rng = found.schedule, np.random.default_rng([0, 1])
    n, m = given.program.n, given.program.m
    by_range = not np.isfinite(found.limits.measurement).all()
    share = 0.3 * found.limits.innovation if by_range else found.limits.measurement * (1 - 1e-6)
    pool = share * rng.uniform(-1, 1, (steps, 1, m))
    steer = _steering(found, center) if by_range else np.zeros((m, n + 1))
    outside, _, errors = run_against(found, np.zeros((steps, n)), pool, steer, by_range, steps / 4)
    if outside:
        raise ArithmeticError(f"got random measurements that leave the limits at {outside} steps; needed wider limits")
    return errors


def run_against(
    found: FilterGuarantee,
    rows: NDArray[np.float64],
    pool: NDArray[np.float64],
    steer: NDArray[np.float64],
    by_range: bool,
    ramp: float = 1.0,
    ahead: bool = False,
) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """Run :func:`greedy` once; return the steps outside the limits, measurements in float64, and errors (steps, n)."""
    given, program = found.schedule, found.schedule.program
    backend = cast(Compiled, given.fmt.backend)
    steps = len(rows)
    x = as_packed(given.fmt, given.x0)
    chosen, errors = np.zeros((steps, program.m, *x.shape[1:]), x.dtype), np.zeros((steps, program.n))
    numbers = given.packed, given.Phi, given.HPhi, given.exact, given.first
    attacked = _Attacked(program.operations, program.outputs, *numbers, found.limits)
    plan = Plan(rows, pool, steer, by_range, float(ramp), ahead)
    outside = greedy(backend.tag, attacked, plan, x, double_doubles(given.x0), chosen, errors)
    z = chosen if x.dtype == np.float64 else chosen[..., 0] * 10.0 ** chosen[..., 1]
    return outside, z, errors


def _pool(
    found: FilterGuarantee,
    F: NDArray[np.float64],
    state: int,
    steps: int,
    candidates: int,
    plan: int,
    by_range: bool,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return candidates at each step: near the largest measurements of one sign, of a response, or anywhere."""
    m = found.schedule.program.m
    if by_range:
        share = (1.0, 0.3, 0.05)[plan % 3]
        return share * found.limits.innovation * rng.uniform(-1, 1, (steps, candidates, m))
    Z = found.limits.measurement
    width = (0.05, 0.5, 1.0, 2.0)[plan % 4]
    signs = rng.choice((-1.0, 1.0), m) if plan < 4 else 1.0
    course = np.ones((steps, m)) * signs
    if plan >= 4:  # the input that attains the peak gain of a state
        given = found.schedule
        back = responses(given, F, (state + plan) % given.program.n, steps)
        at = np.array(
            [
                k if k < given.steps else given.first + (k - given.first) % (given.steps - given.first)
                for k in range(steps)
            ]
        )
        course = np.sign(np.einsum("ki,kim->km", back, given.exact[at][..., 0]))
    low = np.clip(course - width, -1, 1)[:, None, :]
    high = np.clip(course + width, -1, 1)[:, None, :]
    return Z * (1 - 1e-9) * (low + (high - low) * rng.uniform(0, 1, (steps, candidates, m)))


def _steering(found: FilterGuarantee, center: Any) -> NDArray[np.float64]:
    """Return a regulator whose innovations bring the exact filter to a given state, from transition and gain."""
    given, n, m = found.schedule, found.schedule.program.n, found.schedule.program.m
    Phi, K = given.Phi[-1, :, :, 0], given.exact[-1, :, :, 0]
    X = found.limits.state
    limits = np.where(np.isfinite(X) & (X > 0), X, 1.0)
    place = np.zeros(n) if center is None else np.asarray(center, dtype=np.float64)
    # x = p + K nu; a regulator chooses nu to minimize |x - place| / limits over a few steps.
    P = np.diag(limits**-2.0)
    weight = np.diag(np.maximum(found.limits.innovation, 1e-150) ** -2.0) * 1e-2
    for _ in range(2000):
        gain = np.linalg.solve(weight + K.T @ P @ K, K.T @ P)
        following = Phi.T @ (P - P @ K @ gain) @ Phi + np.diag(limits**-2.0)
        if np.allclose(following, P, rtol=1e-12):
            break
        P = following
    return np.hstack([-gain, (gain @ place).reshape(m, 1)])
