r"""Guess how far rounding moves the states of a filter; :mod:`gpbnb.bounds.check` proves the guess, or rejects it.

Let the program of a step compute :math:`\hat F_k x + \hat K_k z` up to its roundings, and the exact filter
:math:`x_k = (I - K_kH_k)\Phi_k x_{k-1} + K_k z_k`, with innovation :math:`\nu_k = z_k - H_k\Phi_kx_{k-1}`. Then
:math:`e_k = \hat x_k - x_k` obeys

.. math:: e_k = \hat F_k e_{k-1} + \Delta F_k x_{k-1} + (\hat K_k - K_k)\nu_k + \Gamma_k\rho_k, \qquad
    \Delta F_k = \hat F_k - (I - \hat K_kH_k)\Phi_k ,

where ρ holds the rounding errors of the operations, and the columns of Γ their effects on the result. A guess adds the
largest effects of all columns over all earlier steps. Sizes of numbers, and so roundings, depend on the bound itself,
which is raised until it bounds the sizes that it assumed. All of this is plain float64: a wrong guess is rejected.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import eigenvalues
from gpbnb.bounds.gains import Schedule, periodic
from gpbnb.bounds.units import largest_errors, units
from gpbnb.filters.program import ADD, MULTIPLY, Program

Array = NDArray[np.float64]

ROUNDING, LOOP, GAIN = range(3)
"""Parts of a bound: roundings of the estimate, roundings of the closed loop, errors of the gain."""

EXCESS = 1 + 2.0**-20
"""Factor by which a guess is larger than the sums, so that the checker may round outwards."""

_BLOCK, _LAGS, _WORK = 64, 1_024, 1_200_000
"""Powers of a loop that are computed at a time; most lags that are summed one by one, and times squared states."""
_LOSS = 16.0
"""Largest factor by which sums over twice as many lags may grow, once these are many."""
_LEFT = 2.0**-12
"""Share of a response that may be left after the lags that are summed one by one."""
_DENSE, _RATIO = 256, 1.02
"""Steps whose bounds are guessed one by one, and the ratio of the later ones."""
_ROUNDS, _LARGE = 60, 5_000_000
_NOISE = 2.0**-48
"""More than the errors of float64 in the size of a number."""


class FilterLimits(NamedTuple):
    """Limits on the filter without rounding, in float64; none is negative, some may be infinite.

    The state and the innovation, or the measurement, must be finite.
    """

    #: (n,), largest size of each state.
    state: Array
    #: (m,), largest size of each innovation.
    innovation: Array
    #: (m,), largest size of each measurement.
    measurement: Array


class Guess(NamedTuple):
    """What the checker is asked to prove."""

    bound: Array  # (n,), of the error of each state; infinite if there is none
    state: Array  # (n,), limits of the exact filter, given or derived
    innovation: Array  # (m,), likewise
    parts: Array  # (n, 3), of each bound, where it is largest
    lags: int = 1  # how many earlier steps are summed one by one, for fixed coefficients


def no_bound(fmt: FloatFormat | FixedFormat) -> str:
    """Say why a bound that should exist was not found."""
    if fmt.limits is None:
        return "no bound was found: in this precision, an error causes rounding errors as large as itself"
    return f"no bound was found within the range of {arithmetic(fmt)}: a number may exceed the largest"


class LinearValues(NamedTuple):
    """The values of some steps as linear functions of states and measurements."""

    factors: Array  # (operations, steps), size of the coefficient of each product
    rows: Any  # (values, steps, n + m), each value as a function of states and measurements, in long double
    effects: Array  # (values, steps, n), of an error of each value on the states after the step
    exact: NDArray[np.bool_]  # (values, steps), whether the operation of a value never rounds


class Steps(NamedTuple):
    """Some steps of a program as linear functions, in float64."""

    factors: Array  # (operations, steps), size of the coefficient of each product
    rows: Array  # (values, steps, n + m), each value as a function of states and measurements
    effects: Array  # (values, steps, n), of an error of each value on the states after the step
    exact: NDArray[np.bool_]  # (values, steps), whether the operation of a value never rounds
    F: Array  # (steps, n, n), what the program computes
    K: Array  # (steps, n, m), likewise
    loop: Array  # F minus that of the exact filter
    gain: Array  # K minus that of the exact filter
    HPhi: Array  # (steps, m, n), what a measurement is expected to be


def linear_values(program: Program, coefficients: Array, powers: Array) -> LinearValues:
    """Return the values of steps with coefficients (steps, c, 2); a product by one of some powers is exact."""
    first, c = program.n + program.m, coefficients.astype(np.longdouble).sum(axis=-1).T
    count, steps = first + len(program.operations), c.shape[1]
    rows = np.zeros((count, steps, first), np.longdouble)
    rows[np.arange(first), :, np.arange(first)] = 1
    factors, exact = np.zeros((count - first, steps)), np.ones((count, steps), dtype=bool)
    zero = np.zeros((count, steps), dtype=bool)
    for v, (code, a, b) in enumerate(program.operations.tolist(), first):
        if code == MULTIPLY:
            rows[v], size = c[a][:, None] * rows[b], np.abs(c[a])
            near = powers[np.minimum(np.searchsorted(powers, size.astype(np.float64)), len(powers) - 1)]
            zero[v] = zero[b] | (size == 0)
            factors[v - first], exact[v] = size, zero[v] | (near == size)
        else:
            rows[v] = rows[a] + rows[b] if code == ADD else rows[a] - rows[b]
            zero[v], exact[v] = zero[a] & zero[b], zero[a] | zero[b]
    return LinearValues(factors, rows, error_effects(program, c.astype(np.float64)), exact)


def linear_steps(given: Schedule, at: NDArray[np.int64]) -> Steps:
    """Return some rows of a schedule as linear functions."""
    program, n, wide = given.program, given.program.n, np.longdouble
    factors, rows, effects, exact = linear_values(program, given.coefficients[at], units(given.fmt).exact)
    whole = rows[program.outputs].transpose(1, 0, 2)
    Phi, HPhi, K = (each[at].astype(wide).sum(axis=-1) for each in (given.Phi, given.HPhi, given.exact))
    loop, gain = whole[:, :, :n] - Phi + whole[:, :, n:] @ HPhi, whole[:, :, n:] - K
    floats = (each.astype(np.float64) for each in (whole[:, :, :n], whole[:, :, n:], loop, gain, HPhi))
    return Steps(factors, rows.astype(np.float64), effects, exact, *floats)


def error_effects(program: Program, coefficients: Array) -> Array:
    """Return by how much an error of 1 in each value changes the states after a step, (values, steps, n).

    Coefficients are those of each step, (c, steps).
    """
    first, found = program.n + program.m, np.zeros((len(program.places), coefficients.shape[1], program.n))
    for i, o in enumerate(program.outputs.tolist()):
        found[o, :, i] += 1
    for v, (code, a, b) in reversed(list(enumerate(program.operations.tolist(), first))):
        if code == MULTIPLY:
            found[b] += coefficients[a][:, None] * found[v]
        else:
            found[a] += found[v]
            found[b] += found[v] if code == ADD else -found[v]
    return found


def sizes_within(a: Array, x: Array) -> Array:
    """Return the largest sizes of rows times numbers within limits, some of which may be infinite."""
    return np.where(a == 0, 0.0, np.abs(a) * np.where(a == 0, 0.0, x)).sum(axis=-1)


def value_sizes(steps: Steps, within: FilterLimits) -> Array:
    """Return the largest size of each value of the exact filter, (values, steps)."""
    n = steps.F.shape[1]
    of_state, of_input = steps.rows[..., :n], steps.rows[..., n:]
    known = sizes_within(of_state + np.einsum("vkm,kmn->vkn", of_input, steps.HPhi), within.state)
    seen = sizes_within(of_state, within.state) + sizes_within(of_input, within.measurement)
    return np.minimum(known + sizes_within(of_input, within.innovation), seen)


Largest = Callable[[int, Array], Array]
"""Function that returns the largest rounding error of an operation, from the largest sizes of its result, (steps,)."""


def float_errors(program: Program, fmt: FloatFormat | FixedFormat, steps: Steps | LinearValues) -> Largest:
    """Return the largest errors of rounding each result into one format."""
    first, table = program.n + program.m, units(fmt)

    def largest(o: int, sizes: Array) -> Array:
        error, exact = largest_errors(fmt, sizes), steps.exact[first + o]
        if program.operations[o, 0] != MULTIPLY:
            exact = exact | (sizes <= table.aligned)
        return np.where(exact & np.isfinite(error), 0.0, error)

    return largest


def rounding_errors(
    program: Program, steps: Steps | LinearValues, sizes: Array, ends: Array, b: Array, largest: Largest
) -> Array:
    """Return the largest rounding error of each operation, (operations, steps).

    Sizes, (values, steps), are those without the errors b of the states; `ends`, (n,), those of states after the step
    with their errors.
    """
    n, first = program.n, program.n + program.m
    moved = np.abs(steps.rows[..., :n]) @ b
    sizes = sizes + moved
    before, h = np.zeros(sizes.shape), np.zeros(sizes.shape)
    for v, (code, a, c) in enumerate(program.operations.tolist(), first):
        before[v] = steps.factors[v - first] * before[c] if code == MULTIPLY else before[a] + before[c]
        size = sizes[v] + before[v]
        for i in np.flatnonzero(program.outputs == v):
            size = np.minimum(size, ends[i])
        noise = np.where(before[v] + moved[v] > 0, _NOISE, -_NOISE)  # limits are often powers of the base
        h[v] = largest(v - first, size * (1 + noise))
        before[v] += h[v]
    return h[first:]


def columns(program: Program, steps: Steps, h: Array) -> Array:
    """Return the effects of the largest roundings of a step, (steps, n, groups), equal ones added."""
    first = program.n + program.m
    grouped = np.zeros((len(program.roots), h.shape[1]))
    np.add.at(grouped, program.groups, h)
    G = steps.effects[first + program.roots].transpose(1, 2, 0)
    return np.asarray(G * np.where(G == 0, 0.0, grouped.T[:, None, :]))


# -- constant loops ---------------------------------------------------------------------------------------------------


@np.errstate(over="ignore", invalid="ignore")
def lags_of(F: Array, G: Array, steps: int | None) -> int:
    """Return how many lags are summed one by one, a power of two: all that count, unless they take too long."""
    most = max(_LAGS, _WORK // len(F) ** 2) if radius_of(F) < 1 else _LAGS
    lags, P, T = 1, F, np.abs(G).sum(axis=1)
    most = most if steps is None else min(most, steps)
    while lags < most and not (np.abs(P) @ T <= _LEFT * T).all():
        P, T, lags = P @ P, T + np.abs(P) @ T, 2 * lags
    return lags


def radius_of(F: Array) -> float:
    """Return the spectral radius of a loop; proofs do not use it."""
    return float(np.abs(eigenvalues(F)).max(initial=0.0))


def gains(F: Array, G: Array, rows: Array, steps: int | None, lags: int) -> Array:
    """Return the sums of the sizes of r F^l G over l, (n + rows, columns), for unit rows and others.

    Sums over more than some lags follow from squares of powers of the loop, as in :mod:`gpbnb.bounds.check`.
    """
    start, count = np.vstack([np.eye(len(F)), rows]), lags if steps is None else min(lags, steps)
    sums, C = np.zeros((len(start), G.shape[1])), start
    for lag in range(0, count, _BLOCK):
        some = [C]
        for _ in range(min(_BLOCK, count - lag)):
            some.append(some[-1] @ F)
        C, block = some[-1], np.array(some[:-1])
        sums += np.abs(block @ G).sum(axis=0)
    if steps is not None and steps <= lags:
        return sums
    P, T = C[: len(F)], sums[: len(F)]
    blocks = None if steps is None else steps // lags
    most = gains(F, G, rows[:0], steps % lags, lags) if steps is not None else np.zeros_like(T)
    with np.errstate(over="ignore", invalid="ignore"):
        while blocks != 0:
            if blocks is None and np.abs(P).sum(axis=1).max() < 1e-30:
                most = T
                break
            if blocks is not None:
                most = T + np.abs(P) @ most if blocks & 1 else most
                blocks >>= 1
            once = np.abs(P) @ T
            if not np.isfinite(once).all():
                return np.full(sums.shape, np.inf)
            if blocks is None and (once.sum(axis=1) > _LOSS * T.sum(axis=1)).any():
                raise ValueError(
                    f"the system decays too slowly for a bound: its response is not negligible after {lags} steps; "
                    "shorten its memory, or split it into sections"
                )
            P, T = P @ P, T + once
    return sums + np.abs(C) @ most


def positive(sizes: Array) -> Array:
    """Return tiny numbers for zeros, so that the checker may round outwards."""
    return np.asarray(np.maximum(sizes, 2.0**-40 * float(sizes[sizes > 0].min(initial=1.0))))


def raised(bounded: Any, n: int) -> Array:
    """Return the least positive bound that bounds itself, found from zero; infinite if there is none."""
    b = np.zeros(n)
    for _ in range(_ROUNDS):
        new = bounded(b * EXCESS)
        if not np.isfinite(new).all():
            break
        if (new <= b).all():
            if (b > 0).all():
                return b * EXCESS
            new = positive(b)
        b = np.maximum(b, new) * (1 + 2.0**-30)
    return np.full(n, np.inf)


# -- loops that change ------------------------------------------------------------------------------------------------


class Course(NamedTuple):
    """Which steps a guess looks at."""

    at: NDArray[np.int64]  # rows of the schedule whose steps are taken as different
    first: int  # the rows from this one on repeat
    ends: NDArray[np.int64]  # numbers of steps after which the errors are guessed
    lags: int  # the largest number of earlier steps that count

    def rows(self, k: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the place in `at` of some steps, counted from 0."""
        return np.minimum(periodic(k, self.first, len(self.at) - self.first), len(self.at) - 1)


def course(given: Schedule, steps: int | None, radius: float) -> Course:
    """Choose the steps of a guess; a gain that has nearly settled counts as settled."""
    if steps is not None:
        return Course(given.rows(np.arange(steps)), steps, np.arange(1, steps + 1), steps)
    period, first = given.steps - given.first, given.first
    c, k = given.coefficients[..., 0], np.arange(first)
    late = first + (k - first) % period
    size = np.abs(c[first:]).max(axis=0)
    begun = first
    if first * (given.program.n + given.program.m) * len(given.program.operations) > _LARGE:
        near = (np.abs(c[:first] - c[late]) <= 1e-5 * (1 - radius) * size).all(axis=1)
        begun = int(np.flatnonzero(~near).max(initial=-1)) + 1
        begun = first - (first - begun) // period * period
    at = np.concatenate([np.arange(begun), np.arange(first, first + period)])
    lags = math.ceil(math.log(1e-9) / math.log(min(max(radius, 1e-3), 1 - 1e-12))) + 2 * period
    some = np.arange(1, begun + lags + 1)
    if len(some) > _DENSE:
        grown = _DENSE * _RATIO ** np.arange(math.ceil(math.log(len(some) / _DENSE) / math.log(_RATIO)))
        some = np.unique(np.concatenate([some[:_DENSE], grown.astype(np.int64)]))
    return Course(at, begun, np.concatenate([some, begun + (lags // period + 1) * period + np.arange(period)]), lags)


def summed(chosen: Course, F: Array, G: Array, part: NDArray[np.int64], starts: Array | None = None) -> Array:
    """Sum the effects of the columns of all earlier steps after each end, part by part, (ends, rows, parts).

    They are those on functions of the state, (ends, rows, n), by default on each state.
    """
    n, parts = F.shape[1], np.eye(int(part.max(initial=0)) + 1)[part]
    C = np.broadcast_to(np.eye(n), (len(chosen.ends), n, n)) if starts is None else starts
    sums, ends, left = np.zeros((*C.shape[:2], parts.shape[1])), chosen.ends, np.arange(len(chosen.ends))
    for lag in range(chosen.lags):
        if (over := ends <= lag).any():
            C, ends, left = C[~over], ends[~over], left[~over]
        if not len(ends):
            break
        at = chosen.rows(ends - 1 - lag)
        added = np.abs(C @ G[at]) @ parts
        sums[left] += added
        C = C @ F[at]
        if lag % 16 == 15 and (added.sum(axis=2) <= 1e-12 * sums[left].sum(axis=2)).all():
            break
    return sums


@np.errstate(over="ignore", invalid="ignore")
def filter_guess(given: Schedule, within: FilterLimits, steps: int | None) -> Guess:
    """Guess the bound of a filter whose gain repeats, or over some steps; ValueError says why there is none."""
    program, n, m = given.program, given.program.n, given.program.m
    chosen = course(given, steps, 0.0 if steps is not None else loop_radius(given))
    each = linear_steps(given, chosen.at)
    known = derived_limits(given, chosen, each, within)
    if not all(np.isfinite(limit).all() for limit in known[:2]):
        raise ValueError(no_bound(given.fmt))
    exact = each.loop * known.state, each.gain * known.innovation
    part = np.array([ROUNDING] * len(program.roots) + [LOOP] * n + [GAIN] * m)
    sizes, found, before = value_sizes(each, known), np.zeros((0, n, 3)), np.zeros(0)
    largest = float_errors(program, given.fmt, each)

    def bounded(b: Array) -> Array:
        nonlocal found, before
        h = rounding_errors(program, each, sizes, known.state + b, b, largest)
        if not np.isfinite(h).all():
            return np.full(n, np.inf)
        if not np.array_equal(h, before):
            G, before = np.concatenate([columns(program, each, h), *exact], axis=2), h
            found = summed(chosen, each.F, G, part)
        return np.asarray(found.sum(axis=2).max(axis=0, initial=0.0))

    b = raised(bounded, n)
    if not np.isfinite(b).all():
        raise ValueError(no_bound(given.fmt))
    worst = found[found.sum(axis=2).argmax(axis=0), np.arange(n)]
    return Guess(b, known.state, known.innovation, worst)


def loop_radius(given: Schedule) -> float:
    """Return the growth of an error per step, averaged over a period."""
    F = linear_steps(given, np.arange(given.first, given.steps)).F
    return float(radius_of(product_of(F)) ** (1 / len(F)))


def product_of(F: Array) -> Array:
    """Return the product of the loops of consecutive steps."""
    return np.asarray(reduce(lambda whole, each: each @ whole, F, np.eye(F.shape[1])))


def derived_limits(given: Schedule, chosen: Course, each: Steps, within: FilterLimits) -> FilterLimits:
    """Return limits on state and innovation, derived from those of the measurements where they are not given."""
    if np.isfinite(within.state).all() and np.isfinite(within.innovation).all():
        return within
    n, m, Z = given.program.n, given.program.m, within.measurement
    x0 = given.x0.astype(np.float64)
    X, V = np.zeros(n), np.zeros(m)
    ends = np.concatenate([[0], chosen.ends])
    whole = chosen._replace(ends=ends)
    following = each.HPhi[chosen.rows(ends)]
    starts = np.concatenate([np.broadcast_to(np.eye(n), (len(ends), n, n)), following], axis=1)
    begun = np.abs(_begun(whole, each.F, starts, x0))
    G = np.concatenate([each.K * Z, each.loop, each.gain], axis=2)
    sums = summed(whole, each.F, G, np.arange(m + n + m), starts)
    for _ in range(_ROUNDS):
        peaks = (sums @ np.concatenate([np.ones(m), X, V]) + begun).max(axis=0)
        x, v = np.minimum(peaks[:n], within.state), np.minimum(Z + peaks[n:], within.innovation)
        if not (np.isfinite(x).all() and np.isfinite(v).all()):
            break
        if (x <= X).all() and (v <= V).all():
            X, V = positive(X * EXCESS), positive(V * EXCESS)
            return FilterLimits(np.minimum(within.state, X), np.minimum(within.innovation, V), Z)
        X, V = np.maximum(X, x) * (1 + 2.0**-30), np.maximum(V, v) * (1 + 2.0**-30)
    return FilterLimits(np.full(n, np.inf), np.full(m, np.inf), Z)


def _begun(chosen: Course, F: Array, starts: Array, x0: Array) -> Array:
    """Return what is left of the first estimate after each end, (ends, rows)."""
    if not x0.any():
        return np.zeros(starts.shape[:2])
    states, x, most = np.zeros((len(chosen.ends), len(x0))), x0, int(chosen.ends.max())
    places = {int(end): i for i, end in enumerate(chosen.ends)}
    for k in range(most + 1):
        if k in places:
            states[places[k]] = x
        x = F[chosen.rows(np.array([k]))[0]] @ x
        if np.abs(x).max() < 1e-30 * np.abs(x0).max():
            break
    return np.einsum("ern,en->er", starts, states)
