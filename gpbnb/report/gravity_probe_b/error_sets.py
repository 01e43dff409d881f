r"""Sets that contain the error after each step of a filter that never settles, propagated forward in time.

The error obeys :math:`e_k = F_k e_{k-1} + w_k`, where :math:`w_k = \sum_g G_{k,g}\rho_g + s`,
:math:`|\rho_g| \le h_{k,g}`, :math:`|s| \le \text{slack}_k`. It lies in the Minkowski sum of

* **segments**: the columns of the disturbances of the latest steps, each times its limit, propagated by the
  closed loops of the steps since. They are exact, up to rounding in float64;
* **ellipsoids** :math:`\{x: |a x| \le \sqrt{a M a^T}\ \text{for all}\ a\}`, one for each part of the
  bound. They contain the segments of earlier steps.

An ellipsoid absorbs segments :math:`g_j` by the Cauchy-Schwarz inequality. For any positive :math:`t, t_j` of sum s,

.. math:: \Big(\sqrt{aMa^T} + \sum_j|a g_j|\Big)^2 \le a\,s\Big(\frac Mt + \sum_j\frac{g_jg_j^T}{t_j}\Big)a^T.

With :math:`t^2 = \operatorname{tr} M` and :math:`t_j = |g_j|` the trace is smallest. Nothing is lost if all segments
are parallel. Old errors nearly are: their fast modes have decayed, and only the slowest is left.

Everything is float64. Each sum of terms of one sign is enlarged by more than its own rounding errors.
"""

from __future__ import annotations

import math
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
from gpbnb.filters.kernels.linear import effects, extents, functionals
from gpbnb.filters.program import MULTIPLY

_U = 2.0**-53
_UP = 1 + 2.0**-40
"""Factor that exceeds the effect of roundings on a sum of up to 2**12 terms of one sign."""
_TINY = 1e-250
"""Components below this are dropped; 1e-240 is added to the slack of a step that drops any."""

ROUNDING, LOOP, GAIN, START = range(4)
"""Parts of a bound (roundings of the step, of the stored closed loop, error of the gain, and earlier errors)."""


class RoundingUnits(NamedTuple):
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
def units(fmt: FloatFormat | FixedFormat) -> RoundingUnits:
    """Tables of :class:`RoundingUnits` for a format."""
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
    return RoundingUnits(np.array(powers), np.array(above), np.array(exact), limits is not None and limits.fixed)


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


class FilterSteps(NamedTuple):
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
    #: (values, 2), see :func:`gpbnb.filters.kernels.linear.extents`.
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
    given : FilterSteps.
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


class Reach(NamedTuple):
    """The set that contains the error after one step, the sum of all segments and ellipsoids."""

    #: (window, columns, n); each segment is a row times a number from -1 to 1.
    segments: NDArray[np.float64]
    #: (columns,), the part of the bound to which a segment belongs.
    kind: NDArray[np.int64]
    #: (3, n, n), one for each part.
    ellipsoids: NDArray[np.float64]


def units_of_trace(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return units of the states for :func:`take_in`, whose squares float64 can divide by; any are valid."""
    return np.clip(np.where((scale > 0) & np.isfinite(scale), scale, 1.0), 1e-120, 1e120)


def nothing(window: int, part: NDArray[np.int64], n: int) -> Reach:
    """Return the set before the first step, which contains only zero; `part` is the part of each column."""
    kind = np.concatenate([part, np.full(n, ROUNDING, dtype=np.int64)])
    return Reach(np.zeros((window, len(kind), n)), kind, np.zeros((3, n, n)))


@compiled
def forward(
    F: Any, spread: Any, G: Any, limits: Any, slack: Any, reach: Any, done: int, steps: int, before: Any, size: Any
) -> Any:
    """Bound the error after each of some steps, (steps, n), and its parts, (steps, n, 4).

    Parameters
    ----------
    F, spread, G, limits, slack : fields of :class:`gpbnb.bounds.envelope.Disturbances`, one row for each
        step.
    reach : the set after the previous steps; it becomes the set after the last step.
    done : number of previous steps.
    before : (n,), bound of the error before the first of these steps.
    size : (n,), positive, scales of the states, which are the units of the trace of an ellipsoid.
    """
    n, g_count = F.shape[1], G.shape[2]
    segments, kind, ellipsoids = reach
    window, columns = segments.shape[0], segments.shape[1]
    bounds, parts, moved = np.zeros((steps, n)), np.zeros((steps, n, 4)), np.empty(n)
    last, reached = before.copy(), np.empty((3, n))
    for k in range(steps):
        number = done + k
        loop, slot, dropped = F[k], number % window, 0.0
        turned = np.ascontiguousarray(loop.T)  # so that the entries of a product are computed side by side
        if number >= window:
            take_in(segments[slot : slot + 1], kind, ellipsoids, size)
            for p in range(3):
                _move_ellipsoid(loop, ellipsoids[p])
        for w in range(min(number, window)):
            if w != slot:
                for c in range(columns):
                    moved[:] = 0.0
                    for j in range(n):
                        s = segments[w, c, j]
                        for i in range(n):
                            moved[i] += turned[j, i] * s
                    for i in range(n):
                        s = moved[i]
                        if s != 0.0 and abs(s) <= _TINY:
                            s, dropped = 0.0, 1e-240
                        segments[w, c, i] = s
        for i in range(n):
            own = slack[k, i] + dropped
            for j in range(n):
                own += 2 * spread[k, i, j] * last[j]
            for g in range(g_count):
                limit = limits[k, g]
                segments[slot, g, i] = G[k, i, g] * limit if limit != 0.0 and G[k, i, g] != 0.0 else 0.0
                own += 2 * _U * abs(segments[slot, g, i])
            for j in range(n):
                segments[slot, g_count + j, i] = 0.0
            segments[slot, g_count + i, i] = own * _UP
        reached[:] = 0.0
        for w in range(min(number + 1, window)):
            for c in range(columns):
                for i in range(n):
                    reached[kind[c], i] += abs(segments[w, c, i])
        for i in range(n):
            total = 0.0
            for p in range(3):
                parts[k, i, p] = reached[p, i] + math.sqrt(ellipsoids[p, i, i])
                total += parts[k, i, p]
            bounds[k, i] = total * (1 + (window * columns + 64) * 4 * _U)
        for i in range(n):
            last[i] = bounds[k, i]
    return bounds, parts


@compiled
def take_in(segments: Any, kind: Any, ellipsoids: Any, size: Any) -> None:
    """Add segments (w, columns, n) to the ellipsoids, each to that of its part of the bound."""
    n = size.shape[0]
    for p in range(ellipsoids.shape[0]):
        M = ellipsoids[p]
        trace = 0.0
        for i in range(n):
            trace += M[i, i] / (size[i] * size[i])
        own = math.sqrt(trace)
        total = own
        for w in range(segments.shape[0]):
            for c in range(segments.shape[1]):
                if kind[c] == p:
                    total += _length(segments[w, c], size)
        if total == own:
            continue
        total *= _UP
        if own > 0.0:
            _scale(M, total / own)
        for w in range(segments.shape[0]):
            for c in range(segments.shape[1]):
                length = _length(segments[w, c], size) if kind[c] == p else 0.0
                if length > 0.0:
                    for i in range(n):
                        for j in range(n):
                            M[i, j] += segments[w, c, i] * segments[w, c, j] * (total / length)
        for i in range(n):
            M[i, i] *= 1 + n * (segments.shape[0] * segments.shape[1] + 16) * 4 * _U


@inner
def _scale(M: Any, factor: float) -> None:
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            M[i, j] *= factor


@inner
def _length(segment: Any, size: Any) -> float:
    s = 0.0
    for i in range(size.shape[0]):
        s += (segment[i] / size[i]) ** 2
    return math.sqrt(s)


@inner
def _move_ellipsoid(loop: Any, M: Any) -> None:
    """Replace M by an upper bound of F M F^T."""
    n = M.shape[0]
    half, reached, turned, row = np.zeros((n, n)), np.zeros(n), np.ascontiguousarray(loop.T), np.empty(n)
    for i in range(n):
        for r in range(n):
            reached[i] += abs(loop[i, r]) * math.sqrt(M[r, r])
            for j in range(n):
                half[i, j] += loop[i, r] * M[r, j]
    for i in range(n):
        row[:] = 0.0
        for r in range(n):
            for j in range(i + 1):
                row[j] += half[i, r] * turned[r, j]
        for j in range(i + 1):
            s = row[j]
            if i == j:
                s = max(s, 0.0) + n * (n + 4) * 8 * _U * reached[i] * reached[i]
            M[i, j] = s
            M[j, i] = s
