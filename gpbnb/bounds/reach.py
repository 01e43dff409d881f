r"""Sets that contain the error after each of the first steps, propagated forward in time.

The certificate of :mod:`gpbnb.bounds.envelope` goes back from one step through all steps before it. For a
filter that needs 30,000 steps to settle, this would take a billion of them. Here one forward pass serves every
step. The error after a step lies in the Minkowski sum of

* **segments**: the columns of the disturbances of the latest steps, each times its limit, propagated by the
  closed loops of the steps since. They are exact, up to rounding in float64;
* **ellipsoids** :math:`\{x: |a x| \le \sqrt{a M a^T}\ \text{for all}\ a\}`, one for each part of the
  bound. They contain the segments of earlier steps.

An ellipsoid absorbs segments :math:`g_j` by the Cauchy-Schwarz inequality. For any positive :math:`t, t_j` of sum s,

.. math:: \Big(\sqrt{aMa^T} + \sum_j|a g_j|\Big)^2 \le a\,s\Big(\frac Mt + \sum_j\frac{g_jg_j^T}{t_j}\Big)a^T.

With :math:`t^2 = \operatorname{tr} M` and :math:`t_j = |g_j|` the trace is smallest. Nothing is lost if all segments
are parallel. Old errors nearly are: their fast modes have decayed, and only the slowest is left. A bound for each state
at a time, carried from one checkpoint to the next, would lose a factor of 1000 with the altimeter of
:mod:`gpbnb.wordlength.examples`.

Rounding errors of float64 are disturbances of their own. Those of the segments join the slack of the next step. Those
of an ellipsoid, at most :math:`\varepsilon q_iq_j` in each entry, are covered by adding
:math:`n\varepsilon q_i^2` to its diagonal.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.bounds.envelope import ROUNDING, START, effect

_U = 2.0**-53
_UP = 1 + 2.0**-40
_TINY = 1e-250
"""Components below this are dropped; 1e-240 is added to the slack of a step that drops any."""


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


@compiled
def support(reach: Any, a: Any, out: Any) -> None:
    """Add the largest values of a x over the set, part by part, to `out`, (4,)."""
    n = a.shape[0]
    for w in range(reach.segments.shape[0]):
        for c in range(reach.segments.shape[1]):
            s, size = 0.0, 0.0
            for i in range(n):
                s += a[i] * reach.segments[w, c, i]
                size += abs(a[i] * reach.segments[w, c, i])
            out[reach.kind[c]] += abs(s) + (n + 4) * _U * size
    for p in range(3):
        out[p] += width(reach.ellipsoids[p], a)


@compiled
def width(M: Any, a: Any) -> float:
    """Return the largest value of a x over an ellipsoid, rounded up."""
    n = a.shape[0]
    s, reached = 0.0, 0.0
    for i in range(n):
        reached += abs(a[i]) * math.sqrt(M[i, i])
        for j in range(n):
            s += a[i] * M[i, j] * a[j]
    return math.sqrt(max(s, 0.0) + (n + 4) * 8 * _U * reached * reached) * _UP + 2.0**-48 * reached


@compiled
def onward(given: Any, first: int, lags: int, reach: Any, size: Any, b: Any) -> Any:
    """Bound the error after each of some steps from `first` on, when the coefficients are periodic.

    All steps of a phase share the rows of their certificate. They differ only in where these rows meet the set after
    step `first`. The bound of a row over that set serves the rows after it as long as the difference, bounded over one
    ellipsoid around the whole set, stays below a thousandth of the largest bound.

    Parameters
    ----------
    given : :class:`gpbnb.bounds.envelope.Columns`; the rows from `first` on repeat.
    lags : number of steps.
    reach : the set after step `first`.
    b : (n,), bound of earlier errors, by which the
        rounding errors of the rows are multiplied.

    Returns
    -------
    bounds, parts : (lags, n) and (lags, n, 4).
    """
    n, g_count, rows = given.F.shape[1], given.G.shape[2], given.F.shape[0]
    period = rows - first
    bounds, parts = np.zeros((lags, n)), np.zeros((lags, n, 4))
    whole = np.zeros((1, n, n))
    everything = np.zeros(reach.kind.shape[0], np.int64)
    take_in(reach.segments, everything, whole, size)
    for p in range(3):
        _join(whole[0], reach.ellipsoids[p], size)
    sums, value, each = np.zeros(4), np.zeros(4), np.zeros(4)
    c, c_next, anchor, difference = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for phase in range(1, min(period, lags) + 1):
        for i in range(n):
            for j in range(n):
                c[j] = 1.0 if i == j else 0.0
            for p in range(4):
                sums[p] = 0.0
            residual, largest, asked = 0.0, 0.0, False
            for lag in range(1, lags + 1):
                at = first + (phase - lag) % period
                effect(given, at, c, each)  # sums of their own: no term takes part in more additions than allowed
                for j in range(n):
                    c_next[j] = 0.0
                for j in range(n):
                    if c[j] != 0.0:
                        for r in range(n):
                            c_next[r] += c[j] * given.F[at, j, r]
                            each[START] += abs(c[j]) * given.spread[at, j, r] * b[r]
                residual += each[START]
                for p in range(3):
                    sums[p] += each[p]
                for j in range(n):
                    c[j] = c_next[j]
                if (lag - phase) % period == 0:
                    for j in range(n):
                        difference[j] = c[j] - anchor[j]
                    between = width(whole[0], difference) if asked else np.inf
                    if not between <= 1e-3 * largest:
                        for j in range(n):
                            anchor[j] = c[j]
                        for p in range(4):
                            value[p] = 0.0
                        support(reach, c, value)
                        between, asked = 0.0, True
                    total = residual + between
                    parts[lag - 1, i, START] = residual + between
                    for p in range(3):
                        parts[lag - 1, i, p] = sums[p] + value[p]
                        total += parts[lag - 1, i, p]
                    count = lags + n * n + g_count + reach.segments.size
                    bounds[lag - 1, i] = total * (1 + (count + 64) * 4 * _U)
                    largest = max(largest, total)
    return bounds, parts


@inner
def _join(M: Any, other: Any, size: Any) -> None:
    """Add an ellipsoid to another."""
    n = M.shape[0]
    mine, its = 0.0, 0.0
    for i in range(n):
        mine += M[i, i] / (size[i] * size[i])
        its += other[i, i] / (size[i] * size[i])
    mine, its = math.sqrt(mine), math.sqrt(its)
    if its == 0.0:
        return
    total = (mine + its) * _UP
    if mine > 0.0:
        _scale(M, total / mine)
    for i in range(n):
        for j in range(n):
            M[i, j] += other[i, j] * (total / its)
        M[i, i] *= 1 + n * 32 * _U
