r"""Sets that contain the error after each step of a filter that never settles, propagated forward in time.

The error obeys :math:`e_k = F_k e_{k-1} + w_k`, where :math:`w_k = \sum_g G_{k,g}\rho_g + s`, :math:`|\rho_g| \le 1`,
:math:`|s| \le \text{slack}_k`. It lies in the Minkowski sum of

* **segments**: the columns of the disturbances of the latest steps, propagated by the closed loops of the steps since.
  They are exact, up to rounding in float64;
* **ellipsoids** :math:`\{x: |a x| \le \sqrt{a M a^T}\ \text{for all}\ a\}`, one for each part of the
  bound. They contain the segments of earlier steps.

An ellipsoid absorbs segments :math:`g_j` by the Cauchy-Schwarz inequality. For any positive :math:`t, t_j` of sum s,

.. math:: \Big(\sqrt{aMa^T} + \sum_j|a g_j|\Big)^2 \le a\,s\Big(\frac Mt + \sum_j\frac{g_jg_j^T}{t_j}\Big)a^T.

With :math:`t^2 = \operatorname{tr} M` and :math:`t_j = |g_j|` the trace is smallest. Nothing is lost if all segments
are parallel. Old errors nearly are: their fast modes have decayed, and only the slowest is left.

Everything is float64. Each sum of terms of one sign is enlarged by more than its own rounding errors; where terms
cancel, the same sum with all signs made positive bounds them. The filter has the innovation form, so that its closed
loop is exactly :math:`(I - \hat K_kH_k)\Phi_k`, and it rounds to nearest in bits, without limits on the range.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.machine import CODES
from gpbnb.bounds.gains import Schedule
from gpbnb.bounds.guess import FilterLimits, Steps, columns, float_errors, linear_steps, rounding_errors, value_sizes

Array = NDArray[np.float64]

_U = 2.0**-53
_UP = 1 + 2.0**-40
"""Factor that exceeds the effect of roundings on a sum of up to 2**12 terms of one sign."""
_NOISE = 2.0**-42
"""More than the rounding errors of a sum of up to 2**10 terms, over the sum of their sizes."""
_UNDERFLOW = 1e-240
"""More than all products of a step lose that are too small for float64."""

ROUNDING, GAIN = range(2)
"""Parts of a bound: roundings of the step, and error of the gain."""


class Disturbances(NamedTuple):
    """Closed loops and disturbances of some steps in float64, with bounds of the errors of float64.

    Parameters
    ----------
    F : (steps, n, n), closed loop of the program.
    spread : (steps, n, n), the product of a row vector c and F in float64 differs by at most ``abs(c) @ spread``.
    G : (steps, n, g), columns, each times a number from -1 to 1.
    slack : (steps, n), limit of a further disturbance of each state.
    part : (g,), the part of the bound to which a column belongs.
    """

    F: Array
    spread: Array
    G: Array
    slack: Array
    part: NDArray[np.int64]


def functions(given: Schedule) -> tuple[Steps, Steps]:
    """Return steps as linear functions, and the same with all signs made positive."""
    rows, at = given.program.rows.copy(), np.arange(given.steps)
    rows[rows[:, 0] == CODES["subtract"], 0] = CODES["add"]
    positive = replace(given, program=replace(given.program, rows=rows), coefficients=np.abs(given.coefficients))
    return linear_steps(given, at), linear_steps(positive, at)


def disturbances(
    given: Schedule, known: tuple[Steps, Steps], doubt: Array, within: FilterLimits, b: Array
) -> Disturbances:
    r"""Compute disturbances of each step, :math:`e_k = \hat F e_{k-1} + q_k + (\hat K - K)\nu_k`.

    Parameters
    ----------
    given : some steps of the innovation form, with the exact gain.
    known : their :func:`functions`.
    doubt : (steps, n, m), bound of the error of this gain.
    within : limits on state and innovation of the filter without rounding.
    b : (n,), bound of the error before and after each step.
    """
    (X, V, _), program, (steps, signless) = within, given.program, known
    n, first, HPhi, Phi = program.n, program.n + program.m, np.abs(steps.HPhi), np.abs(given.Phi[..., 0])
    of_state, of_input = signless.rows[..., :n] @ (X + b), signless.rows[..., n:]
    cancelled = of_state + np.einsum("vkm,km->vk", of_input, HPhi @ X + V)
    sizes = value_sizes(steps, within) + _NOISE * cancelled
    h = rounding_errors(program, steps, sizes, (X + b) * _UP, b, float_errors(program, given.fmt, steps)) * _UP
    exact, rest = given.exact[..., 0], given.exact[..., 1]
    gain = (steps.K - exact) - rest
    slack = _NOISE * np.einsum("vki,vk->ki", signless.effects[first:], h)
    slack += (doubt + _NOISE * (np.abs(steps.K - exact) + np.abs(rest))) @ V
    roundings = columns(program, steps, h)
    part = np.array([ROUNDING] * roundings.shape[2] + [GAIN] * program.m)
    spread = (4 * first + 16) * _U * (Phi + np.abs(steps.K) @ HPhi)
    return Disturbances(steps.F, spread, np.concatenate([roundings, gain * V], axis=2), slack * _UP, part)


@dataclass
class Reach:
    """The set that contains the error after the latest step, the sum of all segments and ellipsoids.

    Parameters
    ----------
    part : (columns,), the part of the bound to which a segment belongs.
    size : (n,), units of the states in the trace of an ellipsoid; any are valid.
    window : number of steps whose segments are kept one by one.
    """

    part: NDArray[np.int64]
    size: Array
    window: int
    done: int = 0
    last: Array = field(init=False)
    segments: Array = field(init=False)
    ellipsoids: Array = field(init=False)

    def __post_init__(self) -> None:
        n = len(self.size)
        self.part = np.concatenate([self.part, np.full(n, ROUNDING)])
        self.last, self.ellipsoids = np.zeros(n), np.zeros((2, n, n))
        self.segments = np.zeros((self.window, len(self.part), n))

    @classmethod
    def nothing(cls, found: Disturbances, window: int) -> Reach:
        """Return the set before the first of some steps, which contains only zero."""
        scale = (np.abs(found.G).sum(axis=2) + found.slack).max(axis=0)
        return cls(found.part, np.clip(np.where(scale > 0, scale, 1.0), 1e-120, 1e120), window)

    def advance(self, F: Array, spread: Array, G: Array, slack: Array) -> Array:
        """Take a step, and return the parts of the bound of the error after it, (n, 2)."""
        slot, parts = self.done % self.window, (self.part == np.arange(2)[:, np.newaxis]).astype(float)
        if self.done >= self.window:
            for M, own in zip(self.ellipsoids, parts, strict=True):
                M[:] = _moved(F, _with(self.segments[slot][own > 0], M, self.size))
        own = (slack + 2 * spread @ self.last + 2 * _U * np.abs(G).sum(axis=1) + _UNDERFLOW) * _UP
        self.segments = self.segments @ F.T
        self.segments[slot] = np.concatenate([G.T, np.diag(own)])
        reached = parts @ np.abs(self.segments).sum(axis=0) + np.sqrt(np.einsum("pii->pi", self.ellipsoids))
        self.last = reached.sum(axis=0) * (1 + (self.window * len(self.part) + 64) * 4 * _U)
        self.done += 1
        return reached.T


def _with(segments: Array, M: Array, size: Array) -> Array:
    """Return an ellipsoid that contains the sum of another one and of segments, (count, n)."""
    lengths, own = np.sqrt(((segments / size) ** 2).sum(axis=1)), float(np.sqrt((np.diag(M) / size**2).sum()))
    total = (own + lengths.sum()) * _UP
    some = segments[lengths > 0] * np.sqrt(total / lengths[lengths > 0])[:, np.newaxis]
    M = (M * (total / own) if own > 0 else M) + some.T @ some
    return M + np.diag(np.diag(M)) * (M.shape[0] * (len(segments) + 16) * 4 * _U)


def _moved(F: Array, M: Array) -> Array:
    """Return an upper bound of F M F^T."""
    n, reached = len(F), np.abs(F) @ np.sqrt(np.diag(M))
    found = np.tril(F @ M @ F.T)
    return found + np.tril(found, -1).T + np.diag(n * (n + 4) * 8 * _U * reached**2)
