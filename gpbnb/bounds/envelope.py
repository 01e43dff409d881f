r"""Bound sums over all earlier steps by a certificate that a finite computation can check.

Let :math:`e_k = F_k e_{k-1} + w_k`. For any row vectors :math:`c_0, \dots, c_L` with :math:`1 \le L \le k`, which may
depend on k, and :math:`r_l = c_l F_{k-l} - c_{l+1}`, telescoping gives *exactly*

.. math:: c_0 e_k = \sum_{l<L} c_l w_{k-l} + \sum_{l<L} r_l e_{k-l-1} + c_L e_{k-L}.

So the rows need not be exact. A float64 value of :math:`c_{l+1} = c_l F_{k-l}` is sufficient, since its rounding errors
are the small residuals :math:`r_l`. The infinite sum needs no estimate of its tail, because the tail is the last term.
If the error was within b at all earlier steps, then

.. math:: |c_0 e_k| \le \sum_{l<L} |c_l w_{k-l}| + \Big(\sum_{l<L} |r_l| + |c_L|\Big) b,

and if the right side is at most b for each state and each step of the period, then the error stays within b for ever,
by induction.

Disturbances are given as columns: :math:`w_k = \sum_g G_{k,g}\rho_g + s`, :math:`|\rho_g| \le h_{k,g}`, :math:`|s| \le
\text{slack}_k`, and :math:`|c w| \le \sum_g |c\,G_g| h_g + |c|\,\text{slack}`, which is smaller than :math:`|c||w|`
if a disturbance affects several states at once.

The limit of a rounding error follows from the largest size of a result *before* it is rounded: that of its linear
function of the exact filter, plus what earlier errors and roundings of the step add. The last rounding of a state has
another limit, the largest error h of a result of size X + b, if that is smaller. It uses the claim for the same step,
but not in a circle: without this rounding, the certificate gives :math:`|s - x| \le b - h` for the sum s before it, so
:math:`|s| \le X + b`, and the error of rounding such a number is at most h. The roundings of a step are taken in the
order of its operations.

Everything is float64. Each sum of terms of one sign is enlarged by more than its own rounding errors.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.doubledouble import two_sum
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.program import MULTIPLY, effects, extents, functionals

_U = 2.0**-53
_UP = 1 + 2.0**-40
"""Factor that exceeds the effect of roundings on a sum of up to 2**12 terms of one sign."""

ROUNDING, LOOP, GAIN, START = range(4)
"""Parts of a bound (roundings of the step, of the stored closed loop, error of the gain, and earlier errors)."""


class Units(NamedTuple):
    r"""The largest rounding error of a result of at most a given size, :math:`\tfrac12 b^{e-t}` or :math:`b^{e-t}`.

    The size is below :math:`b^e`. The table covers sizes from 2**-900 to 2**900, or the range of the format. Below the
    least number, the error stays that of the least number; beyond the largest, the table has no error.
    """

    #: powers of the base, rounded down.
    powers: NDArray[np.float64]
    #: error of a result up to this power, rounded up.
    errors: NDArray[np.float64]
    #: double-double powers of the base, by which a product is exact; with a limited range, only one.
    exact: NDArray[np.float64]
    #: whether sums are exact, as in fixed point.
    sums_exact: bool


@lru_cache(maxsize=64)
def units(fmt: FloatFormat | FixedFormat) -> Units:
    """Tables of :class:`Units` for a format."""
    limits, most = fmt.limits, int(850 / np.log2(fmt.base))
    sizes = [Fraction(fmt.base) ** k for k in range(-most, most + 1)]
    exact = [(float(power), float(power - Fraction(float(power)))) for power in sizes]
    share = 2 if fmt.rounding in (Rounding.NEAREST, Rounding.EVEN) else 1
    errors = [power / fmt.base**fmt.precision / share for power in sizes]
    if limits is not None and limits.fixed:
        sizes, errors, exact = (
            [limits.largest],
            [Fraction(1, 2) ** (fmt.precision - 1 - limits.emin) / share],
            [(1.0, 0.0)],
        )
    elif limits is not None:
        normal = Fraction(fmt.base) ** limits.emin
        least = normal / fmt.base ** (fmt.precision - 1) / share if limits.subnormal else normal
        errors = [max(each, least) for each in errors]
        last = next((i for i, power in enumerate(sizes) if power >= limits.largest), None)
        if last is not None:
            sizes, errors = [*sizes[:last], limits.largest], errors[: last + 1]
        exact = [(1.0, 0.0)]
    powers, above = [], []
    for power, error in zip(sizes, errors, strict=True):
        near = float(power)
        powers.append(near if Fraction(near) <= power else np.nextafter(near, 0))
        near_error = float(error)
        above.append(near_error if Fraction(near_error) >= error else np.nextafter(near_error, np.inf))
    return Units(np.array(powers), np.array(above), np.array(exact), limits is not None and limits.fixed)


@compiled
def largest_error(units: Any, size: float) -> float:
    """Return the largest error of rounding a number of at most this size."""
    if size == 0.0:
        return 0.0
    at = np.searchsorted(units.powers, size)  # the first power not below
    return np.inf if at >= len(units.powers) else units.errors[at]


@inner
def _is_power(units: Any, high: float, low: float) -> bool:
    if high == 0.0:
        return True
    sign = 1.0 if high > 0 else -1.0
    at = np.searchsorted(units.exact[:, 0], sign * high)
    if at >= len(units.exact):
        return False
    return bool(units.exact[at, 0] == sign * high and units.exact[at, 1] == sign * low)


class FilterLimits(NamedTuple):
    """Limits on the filter without rounding, in float64; none is negative, some may be infinite.

    The state and the innovation, or the measurement, must be finite.
    """

    #: (n,), largest size of each state.
    state: NDArray[np.float64]
    #: (m,), largest size of each innovation.
    innovation: NDArray[np.float64]
    #: (m,), largest size of each measurement.
    measurement: NDArray[np.float64]


class Disturbances(NamedTuple):
    """Closed loops and disturbances of some steps in float64, with bounds of the errors of float64."""

    #: (steps, n, n), closed loop of the program.
    F: NDArray[np.float64]
    #: (steps, n, n), the product of a row vector c and F in float64 differs by at most ``abs(c) @ spread``.
    spread: NDArray[np.float64]
    #: (steps, n, g), columns.
    G: NDArray[np.float64]
    #: (steps, g), their limits.
    limits: NDArray[np.float64]
    #: (steps, n), limit of a further disturbance of each state.
    slack: NDArray[np.float64]
    #: (steps, n, m), gain of the program, and (steps, n, n) and (steps, n, m), its difference from the exact filter.
    K: NDArray[np.float64]
    loop: NDArray[np.float64]
    gain: NDArray[np.float64]


def columns(found: Disturbances) -> NDArray[np.float64]:
    """Return the largest effect of each column on each state, (steps, n, g), zero for zero times infinity."""
    return np.abs(found.G) * np.where(found.G == 0, 0.0, found.limits[:, np.newaxis, :])


class Steps(NamedTuple):
    """Coefficients of some steps, and the exact filter of these steps."""

    #: (steps, c, 2), double-double.
    coefficients: NDArray[np.float64]
    #: (steps, c), largest distance of the true coefficients from these.
    offsets: NDArray[np.float64]
    #: (steps, n, n, 2) and (steps, m, n, 2), double-double.
    Phi: NDArray[np.float64]
    HPhi: NDArray[np.float64]
    #: (steps, n, m, 2) and (steps, n, m), the exact filter's gain, double-double, and a bound of its error.
    exact: NDArray[np.float64]
    dK: NDArray[np.float64]


class _Values(NamedTuple):
    """What is known of each value of a step: the states, the measurements, then the results of the operations."""

    #: (values, n + m, 2) and (values, n + m), the linear function and the function with all signs made positive.
    rows: NDArray[np.float64]
    sizes: NDArray[np.float64]
    #: (values,), largest rounding error so far, whether it is always zero, largest drift and largest size.
    off: NDArray[np.float64]
    none: NDArray[np.bool_]
    drift: NDArray[np.float64]
    largest: NDArray[np.float64]
    #: (values, 2), see :func:`gpbnb.filters.program.extents`.
    reach: NDArray[np.int64]


@compiled
def disturbances(program: Any, given: Any, units: Any, limits: Any, b: Any, caps: Any) -> Any:
    r"""Compute disturbances of each step, :math:`e_k = \hat F e_{k-1} + q_k + \Delta F x_{k-1} + (\hat K - K)\nu_k`.

    If the coefficients of a step are known only within limits, each value differs by at most its drift from the value
    that the given coefficients would give for the same operands and rounding errors. The drift of the results is a
    further disturbance.

    Parameters
    ----------
    program : :class:`gpbnb.filters.program.Operations`.
    given : Steps.
    units : units of the format.
    limits : limits on the filter without rounding.
    b : (n,), bound of the error before and after each step.
    caps : (o,), bound of each operation's linear function of the exact filter; infinite if not known.
    """
    steps, n, m = given.coefficients.shape[0], given.Phi.shape[1], given.HPhi.shape[1]
    first, o_count, g_count = n + m, program.operations.shape[0], program.roots.shape[0]
    F, spread = np.zeros((steps, n, n)), np.zeros((steps, n, n))
    G, lim = np.zeros((steps, n, g_count + n + m)), np.zeros((steps, g_count + n + m))
    slack, K = np.zeros((steps, n)), np.zeros((steps, n, m))
    loop, gain = np.zeros((steps, n, n)), np.zeros((steps, n, m))
    count = first + o_count
    rows, sizes = np.empty((count, first, 2)), np.empty((count, first))
    none, reach = np.empty(count, np.bool_), extents(program.operations, first)
    values = _Values(rows, sizes, np.empty(count), none, np.empty(count), np.empty(count), reach)
    effect, effect_sizes = np.empty((count, n)), np.empty((count, n))
    plain = np.empty(given.coefficients.shape[1])
    for k in range(steps):
        functionals(program.operations, given.coefficients[k], first, rows, sizes)
        for a in range(len(plain)):
            plain[a] = given.coefficients[k, a, 0]
        effects(program.operations, program.outputs, plain, first, effect, effect_sizes)
        _operands(given.HPhi[k], limits, b, values)
        _results(program, given, k, units, limits, b, caps, values, lim[k])
        for g in range(g_count):
            v = first + program.roots[g]
            h = lim[k, g] * _UP
            lim[k, g] = h
            for i in range(n):
                G[k, i, g] = effect[v, i]
                slack[k, i] += (6 * o_count + 2 * n + 16) * _U * effect_sizes[v, i] * h
        into = Disturbances(F[k], spread[k], G[k], lim[k], slack[k], K[k], loop[k], gain[k])
        _differences(program.outputs, given, k, limits, values, into)
        for j in range(n):
            lim[k, g_count + j] = limits.state[j]
        for r in range(m):
            lim[k, g_count + n + r] = limits.innovation[r]
        for i in range(n):
            slack[k, i] *= _UP
    return Disturbances(F, spread, G, lim, slack, K, loop, gain)


@inner
def _operands(HPhi: Any, limits: Any, b: Any, values: Any) -> None:
    """Note the largest states and measurements of a step, which have no rounding errors of their own."""
    m, n = HPhi.shape[0], HPhi.shape[1]
    for v in range(n + m):
        values.off[v], values.none[v], values.drift[v] = 0.0, False, 0.0
    largest = values.largest
    for j in range(n):
        largest[j] = (limits.state[j] + b[j]) * _UP
    for i in range(m):
        largest[n + i] = limits.innovation[i]
        for j in range(n):
            if HPhi[i, j, 0] != 0.0:
                largest[n + i] += abs(HPhi[i, j, 0]) * limits.state[j]
        largest[n + i] = min(limits.measurement[i], largest[n + i] * _UP)


@inner
def _size(v: int, HPhi: Any, limits: Any, b: Any, cap: float, values: Any) -> float:
    """Return the largest size of a value's function, by state and measurement, or by state and innovation."""
    m, n = HPhi.shape[0], HPhi.shape[1]
    rows, sizes = values.rows, values.sizes
    seen, known, carried = 0.0, 0.0, 0.0
    begin, end = values.reach[v, 0], values.reach[v, 1]
    if end <= n:  # without measurements, innovations add nothing
        for j in range(begin, end):
            r, tiny = rows[v, j, 0], (m + 8) * _U * sizes[v, j]
            size = abs(r) + 2.0**-90 * sizes[v, j]
            if r != 0.0:
                seen += size * limits.state[j]
            if r != 0.0 or tiny != 0.0:
                known += (abs(r) + tiny) * limits.state[j]
            carried += size * b[j]
        return min(min(seen, known), cap) + carried
    for j in range(n):
        r, tiny = rows[v, j, 0], (m + 8) * _U * sizes[v, j]
        by_innovation = r
        for i in range(m):
            by_innovation += rows[v, n + i, 0] * HPhi[i, j, 0]
            tiny += (m + 8) * _U * abs(rows[v, n + i, 0] * HPhi[i, j, 0])
        if r != 0.0:
            seen += (abs(r) + 2.0**-90 * sizes[v, j]) * limits.state[j]
        if by_innovation != 0.0 or tiny != 0.0:
            known += (abs(by_innovation) + tiny) * limits.state[j]
        carried += (abs(r) + 2.0**-90 * sizes[v, j]) * b[j]
    for i in range(m):
        size = abs(rows[v, n + i, 0]) + 2.0**-90 * sizes[v, n + i]
        if size != 0.0:
            seen += size * limits.measurement[i]
            known += size * limits.innovation[i]
    return min(min(seen, known), cap) + carried


@inner
def _results(
    program: Any, given: Any, k: int, units: Any, limits: Any, b: Any, caps: Any, values: Any, lim: Any
) -> None:
    """Note sizes, drifts and rounding errors of a step's operations, and add the errors of each group to its limit."""
    n, m = given.Phi.shape[1], given.HPhi.shape[1]
    off, none, drift, largest = values.off, values.none, values.drift, values.largest
    coefficients, offsets = given.coefficients[k], given.offsets[k]
    result_of = np.full(len(off), -1)
    for i in range(n):
        result_of[program.outputs[i]] = i
    for o in range(program.operations.shape[0]):
        v = n + m + o
        code, a, c = program.operations[o, 0], program.operations[o, 1], program.operations[o, 2]
        size = _size(v, given.HPhi[k], limits, b, caps[o], values)
        if code == MULTIPLY:
            factor = abs(coefficients[a, 0])
            before = factor * off[c]
            drift[v] = factor * drift[c]
            if offsets[a] != 0.0:
                drift[v] += offsets[a] * largest[c]
            none[v] = none[c] or (factor == 0.0 and offsets[a] == 0.0)
            is_exact = none[v] or (offsets[a] == 0.0 and _is_power(units, coefficients[a, 0], coefficients[a, 1]))
        else:
            before = off[a] + off[c]
            drift[v] = drift[a] + drift[c]
            none[v] = none[a] and none[c]
            is_exact = none[a] or none[c] or units.sums_exact
        drift[v] *= _UP
        size = (size + before + drift[v]) * _UP
        if result_of[v] >= 0:
            size = min(size, (limits.state[result_of[v]] + b[result_of[v]]) * _UP)
        h = largest_error(units, size)
        if is_exact and h < np.inf:
            h = 0.0
        off[v] = (before + h) * _UP
        largest[v] = (size + h) * _UP
        lim[program.groups[o]] += h


@inner
def _differences(outputs: Any, given: Any, k: int, limits: Any, values: Any, into: Any) -> None:
    """Note closed loop and gain of step k + 1, and their differences from those of the exact filter."""
    n, m = into.K.shape
    g_count = into.G.shape[1] - n - m
    rows, sizes, X, V = values.rows, values.sizes, limits.state, limits.innovation
    for i in range(n):
        v = outputs[i]
        into.slack[i] += values.drift[v]
        for j in range(n):
            into.F[i, j] = rows[v, j, 0]
            into.spread[i, j] = (n + 4) * _U * abs(into.F[i, j]) + 2.0**-89 * sizes[v, j]
            s = rows[v, j, 0], rows[v, j, 1]
            size = sizes[v, j] + abs(given.Phi[k, i, j, 0])
            s = _minus(s, (given.Phi[k, i, j, 0], given.Phi[k, i, j, 1]))
            for r in range(m):
                s = _plus_product(s, rows[v, n + r], given.HPhi[k, r, j])
                size += 2 * sizes[v, n + r] * abs(given.HPhi[k, r, j, 0])
            into.loop[i, j] = s[0]
            into.G[i, g_count + j] = s[0]
            if size != 0.0 and X[j] < np.inf:
                into.slack[i] += ((n + 4) * _U * abs(s[0]) + 2.0**-86 * size) * X[j]
        for r in range(m):
            into.K[i, r] = rows[v, n + r, 0]
            s = _minus((rows[v, n + r, 0], rows[v, n + r, 1]), (given.exact[k, i, r, 0], given.exact[k, i, r, 1]))
            into.gain[i, r] = s[0]
            into.G[i, g_count + n + r] = s[0]
            size = sizes[v, n + r] + abs(given.exact[k, i, r, 0])
            if size != 0.0 and V[r] < np.inf:
                into.slack[i] += ((n + 4) * _U * abs(s[0]) + 2.0**-86 * size + given.dK[k, i, r]) * V[r]


@inner
def _minus(a: Any, b: Any) -> Any:
    s, e = two_sum(a[0], -b[0])
    e += a[1] - b[1]
    high = s + e
    return high, e - (high - s)


@inner
def _plus_product(s: Any, a: Any, b: Any) -> Any:
    p = a[0] * b[0]
    high, low = _two_product(a[0], b[0], p)
    low += a[0] * b[1] + a[1] * b[0]
    t, e = two_sum(s[0], high)
    e += s[1] + low
    total = t + e
    return total, e - (total - t)


@inner
def _two_product(a: float, b: float, p: float) -> Any:
    c = 134217729.0 * a
    a1 = c - (c - a)
    a2 = a - a1
    d = 134217729.0 * b
    b1 = d - (d - b)
    b2 = b - b1
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


class Columns(NamedTuple):
    """Closed loops and columns of some steps; the first five fields are those of :class:`Disturbances`."""

    F: NDArray[np.float64]
    spread: NDArray[np.float64]
    G: NDArray[np.float64]
    limits: NDArray[np.float64]
    slack: NDArray[np.float64]
    #: (g,), the part of the bound to which each column belongs.
    part: NDArray[np.int64]


class End(NamedTuple):
    """When the rows of a certificate end."""

    #: after this number of steps at the latest.
    most: int
    #: (n,), and once ``abs(c) @ scale`` of a row c is below `small`.
    scale: NDArray[np.float64]
    small: float


class Sizes(NamedTuple):
    """Sizes of the exact filter."""

    #: (n,), largest size of each state so far.
    state: NDArray[np.float64]
    #: (m,), limit of each measurement.
    measurement: NDArray[np.float64]
    #: (n,), size of the first estimate.
    first: NDArray[np.float64]


class Certificate(NamedTuple):
    """Results of :func:`certify` for each start."""

    #: (t, 4), sums of each part of the disturbances, without earlier errors.
    sums: NDArray[np.float64]
    #: (t, n), sums of the residuals; they multiply the bound of errors at any earlier step.
    residual: NDArray[np.float64]
    #: (t, n), the last rows; they multiply the bound of the error where the rows end.
    tail: NDArray[np.float64]
    #: (t, n), the rows that reached the first estimate, zero if none did.
    start: NDArray[np.float64]
    #: number of steps that the rows went back.
    lags: int


@inner
def effect(given: Any, at: int, c: Any, each: Any) -> None:
    """Set `each`, (4,), to the effect of the disturbances of a step on the product c e, part by part."""
    n, g_count = given.F.shape[1], given.G.shape[2]
    for p in range(4):
        each[p] = 0.0
    for j in range(n):
        each[ROUNDING] += abs(c[j]) * given.slack[at, j]
    sums = np.zeros(g_count)
    for j in range(n):  # sums of all columns side by side
        for g in range(g_count):
            sums[g] += c[j] * given.G[at, j, g]
    for g in range(g_count):
        if given.limits[at, g] != 0.0 and sums[g] != 0.0:
            each[given.part[g]] += abs(sums[g]) * given.limits[at, g]


@inner
def _entries(given: Any) -> Any:
    """Return where the rows of the closed loops have entries in any step, (n, n), and how many, (n,)."""
    n = given.F.shape[1]
    into, counts = np.zeros((n, n), np.int64), np.zeros(n, np.int64)
    for j in range(n):
        for r in range(n):
            for k in range(given.F.shape[0]):
                if given.F[k, j, r] != 0.0 or given.spread[k, j, r] != 0.0:
                    into[j, counts[j]] = r
                    counts[j] += 1
                    break
    return into, counts


@compiled
def certify(given: Any, starts: Any, k: int, first: int, steady: bool, end: Any) -> Any:
    """Sum the effects of all earlier disturbances on some linear functions of the error after step k.

    Parameters
    ----------
    given : Columns; the rows from `first` on repeat for ever.
    starts : (t, n), the functions.
    k : the step; with `steady`, it counts from `first`, and the past is infinite.
    end : End, when to stop.
    """
    n, t, g_count = given.F.shape[1], starts.shape[0], given.G.shape[2]
    rows = given.F.shape[0]
    period = rows - first
    sums, residual, tail, lags = np.zeros((t, 4)), np.zeros((t, n)), np.zeros((t, n)), 0
    begun = np.zeros((t, n))
    following, rate, each = np.empty(n), np.empty(n), np.empty(4)
    into, counts = _entries(given)
    for i in range(t):
        c = starts[i].copy()
        for lag in range(end.most):
            if not steady and k - lag <= 0:
                break
            at = k - lag - 1
            if steady:
                at = first + at % period
            elif at >= rows:
                at = first + (at - first) % period
            size = 0.0
            for j in range(n):
                size += abs(c[j]) * end.scale[j]
            if size < end.small and lag >= n:  # a state that only repeats an earlier one has no disturbance of its own
                break
            effect(given, at, c, each)  # a sum of its own: no term takes part in more than n + g + lags additions
            for p in range(4):
                sums[i, p] += each[p]
            for j in range(n):
                following[j] = rate[j] = 0.0
            for j in range(n):
                if c[j] != 0.0 and counts[j] == n:
                    for r in range(n):
                        following[r] += c[j] * given.F[at, j, r]
                        rate[r] += abs(c[j]) * given.spread[at, j, r]
                elif c[j] != 0.0:
                    for e in range(counts[j]):
                        r = into[j, e]
                        following[r] += c[j] * given.F[at, j, r]
                        rate[r] += abs(c[j]) * given.spread[at, j, r]
            for r in range(n):
                c[r] = following[r]
                residual[i, r] += rate[r]
            lags = max(lags, lag + 1)
            if not steady and k - lag - 1 <= 0:
                for r in range(n):
                    begun[i, r], c[r] = abs(c[r]), 0.0
        for r in range(n):
            residual[i, r] *= 1 + (lags + n + g_count + 64) * 4 * _U
            tail[i, r] = abs(c[r])
        for p in range(4):
            sums[i, p] *= 1 + (lags + n + g_count + 64) * 4 * _U
    return Certificate(sums, residual, tail, begun, lags)


@compiled
def peaks(given: Any, HPhi: Any, known: Any, first: int, early: int, steady: bool, end: Any) -> Any:
    """Return worst-case peaks of state and innovation of the exact filter, driven by the columns.

    Parameters
    ----------
    given : Columns.
    HPhi : (steps, m, n), float64.
    known : Sizes; those of the states are for the small terms and the tail.
    early : number of first steps to examine.
    steady : whether to examine each step of the period as well.
    end : End, as for :func:`certify`.
    """
    n, m, rows = given.F.shape[1], HPhi.shape[1], given.F.shape[0]
    X, Z, x0 = known
    peak_x, peak_v = x0.copy(), np.zeros(m)
    for r in range(m):
        s = Z[r]
        for j in range(n):
            s += abs(HPhi[0, r, j]) * x0[j]
        peak_v[r] = s * _UP
    starts = np.zeros((n + m, n))
    for i in range(n):
        starts[i, i] = 1.0
    for k in range(1, early + (rows - first if steady else 0) + 1):
        settled = k > early
        at = k - early if settled else k
        following = at if not settled else first + at
        if following >= rows:
            following = first + (following - first) % (rows - first) if steady else rows - 1
        starts[n:] = HPhi[following]
        found = certify(given, starts, at, first, settled, end)
        for i in range(n + m):
            total = found.sums[i].sum()
            for j in range(n):
                total += (found.residual[i, j] + found.tail[i, j]) * X[j] + found.start[i, j] * x0[j]
            if i < n:
                peak_x[i] = max(peak_x[i], total * _UP)
            else:
                for j in range(n):
                    total += 2.0**-50 * abs(starts[i, j]) * X[j]
                peak_v[i - n] = max(peak_v[i - n], (Z[i - n] + total) * _UP)
    return peak_x, peak_v
