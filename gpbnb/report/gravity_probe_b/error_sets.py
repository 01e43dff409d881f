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

Everything is float64. Each sum of terms of one sign is enlarged by more than its own rounding errors. The filter rounds
to nearest in bits, without limits on the range.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels import doubledouble, tags
from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.filters.kernels.linear import effects, extents, functionals
from gpbnb.filters.program import MULTIPLY

_U = 2.0**-53
_UP = 1 + 2.0**-40
"""Factor that exceeds the effect of roundings on a sum of up to 2**12 terms of one sign."""
_TINY = 1e-250
"""Components below this are dropped; 1e-240 is added to the slack of a step that drops any."""
_LARGEST = 2.0**850
"""Beyond this size, and below its reciprocal, errors of rounding are not told apart."""

ROUNDING, LOOP, GAIN = range(3)
"""Parts of a bound: roundings of the step, of the stored closed loop, and error of the gain."""


@inner
def _largest_error(precision: int, size: float) -> float:
    r"""Return the largest error of rounding a number of at most this size, :math:`2^{e-t-1}` for a size of 2**e."""
    if size == 0.0:
        return 0.0
    if not size <= _LARGEST:
        return np.inf
    fraction, exponent = math.frexp(max(size, 1 / _LARGEST))
    return math.ldexp(1.0, exponent - precision - (2 if fraction == 0.5 else 1))


@inner
def _is_power(high: float, low: float) -> bool:
    """Whether a coefficient in double-double is zero or a power of two, so that a product by it is exact."""
    return low == 0.0 and (high == 0.0 or abs(math.frexp(high)[0]) == 0.5)


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


def columns(found: Disturbances) -> NDArray[np.float64]:
    """Return the largest effect of each column on each state, (steps, n, g), zero for zero times infinity."""
    return np.abs(found.G) * np.where(found.G == 0, 0.0, found.limits[:, np.newaxis, :])


class FilterSteps(NamedTuple):
    """Coefficients of some steps, and the exact filter of these steps."""

    #: (steps, c, 2), double-double.
    coefficients: NDArray[np.float64]
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
    #: (values,), largest rounding error so far, and whether it is always zero.
    off: NDArray[np.float64]
    none: NDArray[np.bool_]
    #: (values, 2), see :func:`gpbnb.filters.kernels.linear.extents`.
    reach: NDArray[np.int64]


@compiled
def disturbances(program: Any, given: Any, precision: int, limits: Any, b: Any) -> Any:
    r"""Compute disturbances of each step, :math:`e_k = \hat F e_{k-1} + q_k + \Delta F x_{k-1} + (\hat K - K)\nu_k`.

    Parameters
    ----------
    program : :class:`gpbnb.filters.program.Operations`.
    given : FilterSteps.
    precision : bits of the filter.
    limits : limits on state and innovation of the filter without rounding.
    b : (n,), bound of the error before and after each step.
    """
    steps, n, m = given.coefficients.shape[0], given.Phi.shape[1], given.HPhi.shape[1]
    first, o_count, g_count = n + m, program.operations.shape[0], program.roots.shape[0]
    F, spread, slack = np.zeros((steps, n, n)), np.zeros((steps, n, n)), np.zeros((steps, n))
    G, lim = np.zeros((steps, n, g_count + n + m)), np.zeros((steps, g_count + n + m))
    count = first + o_count
    rows, sizes = np.empty((count, first, 2)), np.empty((count, first))
    values = _Values(rows, sizes, np.zeros(count), np.zeros(count, np.bool_), extents(program.operations, first))
    effect, effect_sizes = np.empty((count, n)), np.empty((count, n))
    for k in range(steps):
        functionals(program.operations, given.coefficients[k], first, rows, sizes)
        plain = np.ascontiguousarray(given.coefficients[k, :, 0])
        effects(program.operations, program.outputs, plain, first, effect, effect_sizes)
        _results(program, given, k, precision, limits, b, values, lim[k])
        for g in range(g_count):
            v = first + program.roots[g]
            h = lim[k, g] * _UP
            lim[k, g] = h
            for i in range(n):
                G[k, i, g] = effect[v, i]
                slack[k, i] += (6 * o_count + 2 * n + 16) * _U * effect_sizes[v, i] * h
        into = Disturbances(F[k], spread[k], G[k], lim[k], slack[k])
        _differences(program.outputs, given, k, limits, values, into)
        for j in range(n):
            lim[k, g_count + j] = limits.state[j]
        for r in range(m):
            lim[k, g_count + n + r] = limits.innovation[r]
        for i in range(n):
            slack[k, i] *= _UP
    return Disturbances(F, spread, G, lim, slack)


@inner
def _size(v: int, HPhi: Any, limits: Any, b: Any, values: Any) -> float:
    """Return the largest size of a value's function, by state and innovation; `carried` is due to earlier errors."""
    m, n = HPhi.shape[0], HPhi.shape[1]
    rows, sizes = values.rows, values.sizes
    known, carried = 0.0, 0.0
    begin, end = values.reach[v, 0], values.reach[v, 1]
    if end <= n:  # without measurements, innovations add nothing
        for j in range(begin, end):
            size = abs(rows[v, j, 0]) + 2.0**-90 * sizes[v, j]
            known += size * limits.state[j]
            carried += size * b[j]
        return known + carried
    for j in range(n):
        r, tiny = rows[v, j, 0], (m + 8) * _U * sizes[v, j]
        by_innovation = r
        for i in range(m):
            by_innovation += rows[v, n + i, 0] * HPhi[i, j, 0]
            tiny += (m + 8) * _U * abs(rows[v, n + i, 0] * HPhi[i, j, 0])
        known += (abs(by_innovation) + tiny) * limits.state[j]
        carried += (abs(r) + 2.0**-90 * sizes[v, j]) * b[j]
    for i in range(m):
        known += (abs(rows[v, n + i, 0]) + 2.0**-90 * sizes[v, n + i]) * limits.innovation[i]
    return known + carried


@inner
def _results(program: Any, given: Any, k: int, precision: int, limits: Any, b: Any, values: Any, lim: Any) -> None:
    """Note rounding errors of a step's operations, and add the errors of each group to its limit."""
    n, m = given.Phi.shape[1], given.HPhi.shape[1]
    off, none, coefficients = values.off, values.none, given.coefficients[k]
    result_of = np.full(len(off), -1)
    for i in range(n):
        result_of[program.outputs[i]] = i
    for o in range(program.operations.shape[0]):
        v = n + m + o
        code, a, c = program.operations[o, 0], program.operations[o, 1], program.operations[o, 2]
        if code == MULTIPLY:
            factor = coefficients[a, 0]
            before = abs(factor) * off[c]
            none[v] = none[c] or factor == 0.0
            is_exact = none[v] or _is_power(factor, coefficients[a, 1])
        else:
            before = off[a] + off[c]
            none[v] = none[a] and none[c]
            is_exact = none[a] or none[c]
        size = (_size(v, given.HPhi[k], limits, b, values) + before) * _UP
        if result_of[v] >= 0:
            size = min(size, (limits.state[result_of[v]] + b[result_of[v]]) * _UP)
        h = _largest_error(precision, size)
        if is_exact and h < np.inf:
            h = 0.0
        off[v] = (before + h) * _UP
        lim[program.groups[o]] += h


@inner
def _differences(outputs: Any, given: Any, k: int, limits: Any, values: Any, into: Any) -> None:
    """Note the closed loop of step k + 1, and its difference and that of the gain from those of the exact filter."""
    n, m = given.dK.shape[1], given.dK.shape[2]
    g_count = into.G.shape[1] - n - m
    rows, sizes, X, V = values.rows, values.sizes, limits.state, limits.innovation
    for i in range(n):
        v = outputs[i]
        for j in range(n):
            into.F[i, j] = rows[v, j, 0]
            into.spread[i, j] = (n + 4) * _U * abs(into.F[i, j]) + 2.0**-89 * sizes[v, j]
            size = sizes[v, j] + abs(given.Phi[k, i, j, 0])
            s = doubledouble.operate(
                tags.SUBTRACT, (rows[v, j, 0], rows[v, j, 1]), (given.Phi[k, i, j, 0], given.Phi[k, i, j, 1])
            )
            for r in range(m):
                gain, row = (rows[v, n + r, 0], rows[v, n + r, 1]), (given.HPhi[k, r, j, 0], given.HPhi[k, r, j, 1])
                s = doubledouble.operate(tags.ADD, s, doubledouble.operate(tags.MULTIPLY, gain, row))
                size += 2 * sizes[v, n + r] * abs(given.HPhi[k, r, j, 0])
            into.G[i, g_count + j] = s[0]
            into.slack[i] += ((n + 4) * _U * abs(s[0]) + 2.0**-86 * size) * X[j]
        for r in range(m):
            s = doubledouble.operate(
                tags.SUBTRACT,
                (rows[v, n + r, 0], rows[v, n + r, 1]),
                (given.exact[k, i, r, 0], given.exact[k, i, r, 1]),
            )
            into.G[i, g_count + n + r] = s[0]
            size = sizes[v, n + r] + abs(given.exact[k, i, r, 0])
            into.slack[i] += ((n + 4) * _U * abs(s[0]) + 2.0**-86 * size + given.dK[k, i, r]) * V[r]


class Reach(NamedTuple):
    """The set that contains the error after one step, the sum of all segments and ellipsoids."""

    #: (window, columns, n); each segment is a row times a number from -1 to 1.
    segments: NDArray[np.float64]
    #: (columns,), the part of the bound to which a segment belongs.
    kind: NDArray[np.int64]
    #: (3, n, n), one for each part.
    ellipsoids: NDArray[np.float64]


def units_of_trace(scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return units of the states for :func:`_take_in`, whose squares float64 can divide by; any are valid."""
    return np.clip(np.where((scale > 0) & np.isfinite(scale), scale, 1.0), 1e-120, 1e120)


def nothing(window: int, part: NDArray[np.int64], n: int) -> Reach:
    """Return the set before the first step, which contains only zero; `part` is the part of each column."""
    kind = np.concatenate([part, np.full(n, ROUNDING, dtype=np.int64)])
    return Reach(np.zeros((window, len(kind), n)), kind, np.zeros((3, n, n)))


@compiled
def forward(
    F: Any, spread: Any, G: Any, limits: Any, slack: Any, reach: Any, done: int, steps: int, before: Any, size: Any
) -> Any:
    """Bound the error after each of some steps, (steps, n), and its parts, (steps, n, 3).

    Parameters
    ----------
    F, spread, G, limits, slack : fields of :class:`Disturbances`, one row for each step.
    reach : the set after the previous steps; it becomes the set after the last step.
    done : number of previous steps.
    before : (n,), bound of the error before the first of these steps.
    size : (n,), positive, scales of the states, which are the units of the trace of an ellipsoid.
    """
    n, g_count = F.shape[1], G.shape[2]
    segments, kind, ellipsoids = reach
    window, columns = segments.shape[0], segments.shape[1]
    bounds, parts, moved = np.zeros((steps, n)), np.zeros((steps, n, 3)), np.empty(n)
    last, reached = before.copy(), np.empty((3, n))
    for k in range(steps):
        number = done + k
        loop, slot, dropped = F[k], number % window, 0.0
        turned = np.ascontiguousarray(loop.T)  # so that the entries of a product are computed side by side
        if number >= window:
            for p in range(3):
                _take_in(segments[slot], kind, p, ellipsoids[p], size)
                _move_ellipsoid(loop, turned, ellipsoids[p])
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
            last[i] = bounds[k, i] = total * (1 + (window * columns + 64) * 4 * _U)
    return bounds, parts


@inner
def _take_in(segments: Any, kind: Any, part: int, M: Any, size: Any) -> None:
    """Add the segments (columns, n) of one part of the bound to its ellipsoid."""
    n, count, trace = size.shape[0], segments.shape[0], 0.0
    for i in range(n):
        trace += M[i, i] / (size[i] * size[i])
    own = math.sqrt(trace)
    total, lengths = own, np.zeros(count)
    for c in range(count):
        if kind[c] == part:
            for i in range(n):
                lengths[c] += (segments[c, i] / size[i]) ** 2
            lengths[c] = math.sqrt(lengths[c])
            total += lengths[c]
    if total == own:
        return
    total *= _UP
    if own > 0.0:
        M *= total / own
    for c in range(count):
        if lengths[c] > 0.0:
            for i in range(n):
                for j in range(n):
                    M[i, j] += segments[c, i] * segments[c, j] * (total / lengths[c])
    for i in range(n):
        M[i, i] *= 1 + n * (count + 16) * 4 * _U


@inner
def _move_ellipsoid(loop: Any, turned: Any, M: Any) -> None:
    """Replace M by an upper bound of F M F^T; `turned` is F^T."""
    n = M.shape[0]
    half, reached, row = np.zeros((n, n)), np.zeros(n), np.empty(n)
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
