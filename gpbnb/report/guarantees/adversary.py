"""Test the sharpness of a guarantee with admissible measurements whose rounding errors all have the same effect.

At each step, the search chooses among some admissible measurements. It takes the one whose rounding errors most
increase the error of one state at one later step. A plan keeps the state large, and the search determines the last
digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import product_in_order
from gpbnb.arithmetic.interpreting import Numbers, Segment
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.machine import rounded, tables
from gpbnb.bounds.gains import Schedule
from gpbnb.bounds.guarantee import FilterGuarantee, closed_loops
from gpbnb.bounds.guess import linear_steps
from gpbnb.bounds.units import largest_errors, units
from gpbnb.filters.opening import as_packed
from gpbnb.filters.pairs import double_doubles_near
from gpbnb.filters.program import MULTIPLY, SUBTRACT, Program, flat, matrices_of, recorded

_BEYOND = "got a result beyond the range of float64; needed 2**-960 <= |x| < 2**1023; scale the numbers, or use base 10"


@dataclass(frozen=True, eq=False)
class Attack:
    """Runs of a filter with chosen measurements, and the largest errors.

    Parameters
    ----------
    errors : (n,), the largest error of each state in any run, at any step.
    ratios : (n,), these over their bounds; a guarantee is violated above 1.
    z : (steps, m), measurements of the run with the largest ratio, numbers of the format, in float64.
    state, step : where the largest ratio occurs: index of the state, and number of steps done.
    admissible : whether the exact filter stayed within its limits in all runs.
    """

    errors: NDArray[np.float64]
    ratios: NDArray[np.float64]
    z: NDArray[np.float64]
    state: int
    step: int
    admissible: bool

    @property
    def ratio(self) -> float:
        """The largest error over its bound."""
        return float(self.ratios.max())


class _Lanes:
    """A program on the machine, with a candidate of a run in each lane; the format None is double-double."""

    def __init__(self, fmt: Any, program: Program, lanes: int) -> None:
        self._program, self._numbers = program, Numbers([fmt], program.tape.sizes, lanes)
        self._code = Numbers.ready([Segment(program.rows, program.formats, None)])

    def take(self, coefficients: Any, states: Any, inputs: Any = ()) -> NDArray[Any]:
        """Return the results, (results, lanes, ...), from numbers (count, ...) or (count, lanes, ...)."""
        program = self._program
        given = (program.coefficients, coefficients), (program.states, states), (program.inputs, inputs)
        for places, numbers in given:
            if len(numbers):
                self._numbers.hold(flat(places), numbers)
        if not self._numbers.run(self._code):
            raise OverflowError(_BEYOND)
        return self._numbers.at(flat(program.after))


def _expected(n: int, m: int) -> Program:
    """The exact filter before a measurement: the predicted estimate (n,), and what it expects (m,)."""

    def step(c: Any, x: Any, z: Any) -> list[Any]:
        Phi, HPhi = matrices_of(c, (n, n), (m, n))
        return [*_product(Phi, x), *_product(HPhi, x)]

    return recorded(step, n, 0, n * (n + m))


def _compared(n: int, m: int) -> Program:
    """The exact filter after a measurement: innovation (m,), estimate (n,), and the error of another one (n,)."""

    def step(K: Any, x: Any, z: Any) -> list[Any]:
        predicted, seen, computed = x[:n], x[n : n + m], x[n + m :]
        innovation = z - seen
        after = predicted + _product(K.reshape(n, m), innovation)
        return [*innovation, *after, *(computed - after)]

    return recorded(step, 2 * n + m, m, n * m)


def _product(a: Any, x: Any) -> Any:
    return product_in_order(a, x[:, None])[:, 0]


class _Filters:
    """A filter and its exact counterpart, each with a candidate of a run in each lane."""

    def __init__(self, found: FilterGuarantee, steps: int, lanes: int) -> None:
        given = self._given = found.schedule
        n, m = given.program.n, given.program.m
        self._limits = np.concatenate([found.limits.measurement, found.limits.innovation, found.limits.state])
        self._rounded = _Lanes(given.fmt, given.program, lanes)
        self._expected, self._compared = _Lanes(None, _expected(n, m), lanes), _Lanes(None, _compared(n, m), lanes)
        self._machine, self._at = tables([given.fmt]), given.rows(np.arange(steps))
        self._matrices = np.concatenate([each.reshape(len(each), -1, 2) for each in (given.Phi, given.HPhi)], axis=1)
        self._gains = given.exact.reshape(len(given.exact), n * m, 2)

    def stored(self, values: NDArray[np.float64]) -> NDArray[Any]:
        """Round float64, (m, lanes), into the format; in base 10, their first decimals."""
        packed = values if self._given.fmt.base != 10 else _first_decimals(values)
        found = rounded(*self._machine, packed.reshape(-1, *packed.shape[2:]))
        if found is None:
            raise OverflowError(_BEYOND)
        return found.reshape(packed.shape)

    def expected(self, k: int, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the predicted estimate of the exact filter, and what it expects, in double-double."""
        found = self._expected.take(self._matrices[self._at[k]], x)
        return found[: len(x)], found[len(x) :]

    def step(
        self, k: int, x: NDArray[Any], z: NDArray[Any], predicted: Any, seen: Any
    ) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the packed estimate after a step, the exact one, the error, and the largest share of a limit."""
        n, m, at = len(predicted), len(seen), self._at[k]
        after = self._rounded.take(self._given.packed[at], x, z)
        computed, measured = np.split(double_doubles_near(np.concatenate([after, z])), [n])
        found = self._compared.take(self._gains[at], np.concatenate([predicted, seen, computed]), measured)
        exactly, error = np.split(found[m:], [n])
        sizes = np.abs(np.concatenate([measured[..., 0], found[: m + n, ..., 0]]))
        return after, exactly, error[..., 0], _shares(sizes, self._limits[:, np.newaxis], 1e10).max(axis=0)


def _shares(sizes: NDArray[np.float64], limits: NDArray[np.float64], beyond: float) -> NDArray[np.float64]:
    """Return sizes as shares of their limits: 0 for no size, and `beyond` for a size with a limit of zero."""
    found = np.where(sizes == 0, 0.0, beyond)
    return np.asarray(np.divide(sizes, limits, out=found, where=(sizes != 0) & (limits > 0)))


def shares_of(errors: NDArray[np.float64], bound: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ratio of each error to its bound: 0 for no error, infinity for an error with a bound of zero."""
    return _shares(errors, bound, np.inf)


def _first_decimals(x: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return significands of 15 to 17 digits, and their exponents."""
    x, e = x.copy(), np.zeros(x.shape, np.int64)
    while (small := (x != 0) & (np.abs(x) < 1e15)).any():
        x[small] *= 10.0
        e[small] -= 1
    while (large := np.abs(x) > 1e17).any():
        x[large] /= 10.0
        e[large] += 1
    return np.stack([x.astype(np.int64), e], axis=-1)


def responses(given: Schedule, F: NDArray[np.float64], state: int, steps: int) -> NDArray[np.float64]:
    """Return how much an error after each step adds to the error of one state after the last step, (steps, n)."""
    rows = np.zeros((steps, given.program.n))
    c = np.eye(given.program.n)[state]
    for k, at in reversed(list(enumerate(given.rows(np.arange(steps))))):
        rows[k] = c
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
    ramp : steps in which the exact filter is brought there.
    """
    given, rng, steer = found.schedule, np.random.default_rng(seed), _steering(found, center)
    n, F, allowed = given.program.n, closed_loops(given), True
    errors, best, best_z, at = np.zeros(n), -1.0, np.zeros((steps, given.program.m)), (1, 0)
    for state in range(n) if states is None else states:
        rows = np.broadcast_to(responses(given, F, state, steps), (plans, steps, n))
        pools = [_pool(found, F, state, steps, candidates, plan, rng) for plan in range(plans)]
        rise = steps / 2 if ramp is None else ramp
        outside, z, off = run_against(found, rows, np.array(pools), steer, rise, ahead=True)
        allowed = allowed and not outside.any()
        for plan in np.flatnonzero(outside == 0):
            errors = np.maximum(errors, np.abs(off[plan]).max(axis=0))
            reached = shares_of(np.abs(off[plan]), found.bound)
            if reached.max() > best:
                k, i = np.unravel_index(reached.argmax(), reached.shape)
                best, best_z, at = float(reached.max()), z[plan], (int(k) + 1, int(i))
    return Attack(errors, shares_of(errors, found.bound), best_z, at[1], at[0], allowed)


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
    for k, at in enumerate(given.rows(np.arange(steps))):
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
        total += float(np.abs(parts.effects[first:, at] @ rows[k]) @ errors)
        innovation = z[k] - given.HPhi[at, :, :, 0] @ x
        known += float(rows[k] @ (parts.loop[at] @ x + parts.gain[at] @ innovation))
        x = values[program.outputs]
    return total + abs(known)


def random_errors(found: FilterGuarantee, steps: int, center: Any = None) -> NDArray[np.float64]:
    """Return errors after each step, (steps, n), of one run with random measurements within the limits.

    Parameters
    ----------
    center : see :func:`attack`.
    """
    rng, steer, program = np.random.default_rng([0, 1]), _steering(found, center), found.schedule.program
    share = found.limits.measurement * (1 - 1e-6) if steer is None else 0.3 * found.limits.innovation
    pool = share * rng.uniform(-1, 1, (1, steps, 1, program.m))
    outside, _, errors = run_against(found, np.zeros((1, steps, program.n)), pool, steer, steps / 4)
    if outside[0]:
        raise ArithmeticError(
            f"got random measurements that leave the limits at {outside[0]} steps; needed wider limits"
        )
    return errors[0]


def run_against(
    found: FilterGuarantee,
    rows: NDArray[np.float64],
    pool: NDArray[np.float64],
    steer: NDArray[np.float64] | None = None,
    ramp: float = 1.0,
    ahead: bool = False,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Choose a measurement at each step from a pool, in some runs at once.

    A measurement enters only a few products of its own step. Each candidate may therefore be judged by the error one
    step later.

    Parameters
    ----------
    rows : (runs, steps, n), weight of an error after each step.
    pool : (runs, steps, candidates, m), measurements; or innovations, if there is steering.
    steer : (m, n + 1); steer (x_predicted, share) is added to innovations, within their limit.
    ramp : number of steps in which the share rises from 0 to 1.
    ahead : whether each candidate is judged by the error one step later, after a measurement from the middle of the
        range.

    Returns
    -------
    outside : (runs,), number of steps at which no candidate kept the exact filter within its limits.
    z : (runs, steps, m), the measurements in float64.
    errors : (runs, steps, n).
    """
    given, (runs, steps, candidates, _) = found.schedule, pool.shape
    filters, most = _Filters(found, steps, runs * candidates), found.limits.innovation[:, np.newaxis]

    def in_lanes(numbers: NDArray[Any]) -> NDArray[Any]:
        """Return numbers of each run, (count, runs, ...), for each of its candidates, (count, lanes, ...)."""
        return np.repeat(numbers, candidates, axis=1)

    def measurements(k: int, predicted: NDArray[Any], seen: NDArray[Any]) -> NDArray[Any]:
        """Return the candidates of a step, (m, lanes, ...), packed."""
        values = pool[:, k].reshape(runs * candidates, -1).T
        if steer is not None:
            pull = steer[:, -1:] * min(1.0, k / ramp)
            for column, each in zip(steer.T[:-1, :, np.newaxis], predicted, strict=True):
                pull = pull + column * each[:, 0]
            values = seen[..., 0] + np.minimum(np.maximum(pull + values, -most), most) * (1 - 1e-6)
        return filters.stored(values)

    x, x_exact = (each[:, np.newaxis] for each in (as_packed(given.fmt, given.x0), double_doubles(given.x0)))
    x, x_exact = np.repeat(x, runs, axis=1), np.repeat(x_exact, runs, axis=1)
    chosen, errors, outside = [], np.zeros((runs, steps, given.program.n)), np.zeros(runs, np.int64)
    for k in range(steps):
        x, x_exact = in_lanes(x), in_lanes(x_exact)
        predicted, seen = filters.expected(k, x_exact)
        z = measurements(k, predicted, seen)
        after, exactly, error, excess = filters.step(k, x, z, predicted, seen)
        judged, weights = error, rows[:, k]
        if ahead and k + 1 < steps:
            predicted, seen = filters.expected(k + 1, exactly)
            middle = in_lanes(pool[:, k + 1, 0].T) if steer is None else seen[..., 0]
            judged, weights = filters.step(k + 1, after, filters.stored(middle), predicted, seen)[2], rows[:, k + 1]
        worth = np.zeros(len(excess))
        for weight, each in zip(in_lanes(weights.T), judged, strict=True):
            worth = worth + weight * each
        scores = np.where(excess > 1, -1e300 * np.minimum(excess, 1e7), worth)
        best = np.arange(runs) * candidates + scores.reshape(runs, candidates).argmax(axis=1)
        outside += scores[best] <= -1e299
        x, x_exact, errors[:, k] = after[:, best], exactly[:, best], error[:, best].T
        chosen.append(z[:, best])
    numbers = np.moveaxis(np.array(chosen), 2, 0)
    return outside, numbers if numbers.dtype == np.float64 else numbers[..., 0] * 10.0 ** numbers[..., 1], errors


def _pool(
    found: FilterGuarantee,
    F: NDArray[np.float64],
    state: int,
    steps: int,
    candidates: int,
    plan: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Return candidates at each step: near the largest measurements of one sign, of a response, or anywhere."""
    given, m, Z = found.schedule, found.schedule.program.m, found.limits.measurement
    if not np.isfinite(Z).all():
        share = (1.0, 0.3, 0.05)[plan % 3]
        return share * found.limits.innovation * rng.uniform(-1, 1, (steps, candidates, m))
    width = (0.05, 0.5, 1.0, 2.0)[plan % 4]
    signs = rng.choice((-1.0, 1.0), m) if plan < 4 else 1.0
    course = np.ones((steps, m)) * signs
    if plan >= 4:  # the input that attains the peak gain of a state
        back = responses(given, F, (state + plan) % given.program.n, steps)
        course = np.sign(np.einsum("ki,kim->km", back, given.exact[given.rows(np.arange(steps)), ..., 0]))
    low = np.clip(course - width, -1, 1)[:, None, :]
    high = np.clip(course + width, -1, 1)[:, None, :]
    return Z * (1 - 1e-9) * (low + (high - low) * rng.uniform(0, 1, (steps, candidates, m)))


def _steering(found: FilterGuarantee, center: Any) -> NDArray[np.float64] | None:
    """Return a regulator whose innovations bring the exact filter to a given state; None if measurements have limits.

    In x = p + K nu, it chooses nu to minimize |x - place| / limits over a few steps.
    """
    if np.isfinite(found.limits.measurement).all():
        return None
    given, n, m = found.schedule, found.schedule.program.n, found.schedule.program.m
    Phi, K = given.Phi[-1, :, :, 0], given.exact[-1, :, :, 0]
    X = found.limits.state
    limits = np.where(np.isfinite(X) & (X > 0), X, 1.0)
    place = np.zeros(n) if center is None else np.asarray(center, dtype=np.float64)
    P = np.diag(limits**-2.0)
    weight = np.diag(np.maximum(found.limits.innovation, 1e-150) ** -2.0) * 1e-2
    for _ in range(2000):
        gain = np.linalg.solve(weight + K.T @ P @ K, K.T @ P)
        following = Phi.T @ (P - P @ K @ gain) @ Phi + np.diag(limits**-2.0)
        if np.allclose(following, P, rtol=1e-12):
            break
        P = following
    return np.hstack([-gain, (gain @ place).reshape(m, 1)])
