r"""Gains that never repeat, enclosed for ever.

Rounding can change the last digits of a computed covariance for ever. Then no finite emulation lists all gains, but
they follow from a set that the computed covariance never leaves: all :math:`P`, symmetric or not, with
:math:`|P - P^*| \le B` entry by entry, where the symmetric :math:`P^*` is near the limit of the exact covariance.

Let :math:`\mathcal E` be the exact step of the covariance, A and S the closed loop and the innovation covariance of the
step from :math:`P^*`, :math:`G = \Phi^TH^TS^{-1}H\Phi`, and F the closed loop of the step from P. For
:math:`E = P - P^*`

.. math:: \mathcal E(P) - \mathcal E(P^*) = F E A^T = A E A^T - F E G E A^T ,

which needs no symmetry; see :func:`gpbnb.report.kalman.derivation.contraction`. So the computed covariance obeys
:math:`E_k = AE_{k-1}A^T + w_k`, where w collects :math:`FEGEA^T`, the roundings of a step and the small
:math:`\mathcal E(P^*) - P^*`. If :math:`|w| \le W` holds for every P in the set, the covariance never leaves the set if

.. math:: \sum_{l<L} |A^l|\,W\,|A^l|^T + |A^L|\,B\,|A^L|^T + \max_l |A^l|\,|E_0|\,|A^l|^T \le B ,

by induction. Products of closed loops are float64, with their own rounding errors as further terms. Ball arithmetic
with a bound for every operation gives the roundings of a step. To keep the balls small, it restarts twice, from the
computed predicted covariance V and from the computed gain, because later operations undo a part of earlier errors: the
error of V enters as :math:`C\,\delta V\,D` with :math:`C = I - KH` and :math:`D = I - H^TS^{-1}HV`, which is
:math:`C^T` only for a symmetric V, and that of the gain as :math:`\delta K\,HV` or, in Joseph's form,
:math:`\delta K\,S\,\delta K^T + \delta K(HV - SS^{-T}HV^T)`. In a cycle of several models, each phase has its own
:math:`P^*` and B. Neither V nor B need be symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_mat, ctx
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import Algebra
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, gain, predicted, updated
from gpbnb.filters.model import LinearModel
from gpbnb.filters.poles import eigenvalues
from gpbnb.filters.run import Run

FORMS = (Form.INNOVATION, Form.JOSEPH)
"""Forms that compute the estimate only with the gain, and whose gain can be enclosed."""

_UP = 1 + 2.0**-50
_SUMS = 1 + 1e-10
"""Factor that exceeds the effect of float64 roundings on sums and products of matrices with entries of one sign."""
_BITS = 160
_TRIALS = 60  # sets
_SLOWEST, _SMALL = 0.9999, 1e-5
"""Closed loops with a larger spectral radius are not tried. Powers are computed until they are about this small."""


# -- numbers with a bound for their roundings -------------------------------------------------------------------------


class Enclosed:
    """A ball that contains an exact value, and a bound on the error of the computed value.

    Parameters
    ----------
    exactly : arb ball.
    error : float, not negative.
    unit : unit roundoff of an operation, or twice that for chopping.
    """

    __slots__ = ("error", "exactly", "unit")

    def __init__(self, exactly: Any, unit: float, error: float = 0.0) -> None:
        self.exactly, self.unit, self.error = exactly, unit, error

    @property
    def size(self) -> float:
        """Largest magnitude of the exact value."""
        return float(self.exactly.abs_upper()) * _UP

    def _is(self, value: int) -> bool:
        return self.error == 0.0 and bool(self.exactly == value)

    def _rounded(self, exactly: Any, error: float) -> Enclosed:
        size = float(exactly.abs_upper()) * _UP
        return Enclosed(exactly, self.unit, (error + self.unit * (size + error)) * _UP)

    def __add__(self, other: Enclosed) -> Enclosed:
        if self._is(0):
            return other
        if other._is(0):
            return self
        return self._rounded(self.exactly + other.exactly, self.error + other.error)

    def __neg__(self) -> Enclosed:
        return Enclosed(-self.exactly, self.unit, self.error)

    def __sub__(self, other: Enclosed) -> Enclosed:
        if self._is(1) and other._is(1):
            return Enclosed(arb(0), self.unit)
        return self + (-other)

    def __mul__(self, other: Enclosed) -> Enclosed:
        if self._is(0) or other._is(0):
            return Enclosed(arb(0), self.unit)
        if self._is(1):
            return other
        if other._is(1):
            return self
        a, b = self.error, other.error
        error = (self.size * b + other.size * a + a * b) * _UP if a or b else 0.0
        return self._rounded(self.exactly * other.exactly, error)

    def __truediv__(self, other: Enclosed) -> Enclosed:
        least = float(other.exactly.abs_lower()) / _UP - other.error * _UP
        if not least > 0:
            raise ZeroDivisionError("a divisor may be zero")
        if self._is(0):
            return self
        ratio = self.exactly / other.exactly
        error = (self.error + float(ratio.abs_upper()) * other.error) * _UP / least * _UP * _UP
        return self._rounded(ratio, error)


def enclosed_numbers(values: NDArray[Any], unit: float, spread: NDArray[np.float64] | None = None) -> NDArray[Any]:
    """Return numbers as :class:`Enclosed` balls with radius zero or with the radii in `spread`."""
    out = np.empty(values.shape, dtype=object)
    for at in np.ndindex(values.shape):
        radius = 0.0 if spread is None else float(spread[at])
        out[at] = Enclosed(_ball(values[at]) + arb(0, radius), unit)
    return out


def _restarted(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Treat computed values as exact in wider balls; return these balls and the bounds of the errors so far."""
    out, errors = np.empty(values.shape, dtype=object), np.empty(values.shape)
    for at in np.ndindex(values.shape):
        each: Any = values[at]
        out[at], errors[at] = Enclosed(each.exactly + arb(0, each.error), each.unit), each.error
    return out, errors


def _ball(value: Any) -> Any:
    if isinstance(value, float):
        return arb(float(value))
    return arb(int(value.numerator)) / arb(int(value.denominator))


# -- the set that the covariance never leaves -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Limits on the gains of each phase of a model's cycle, from some step on.

    Parameters
    ----------
    start : a multiple of the cycle; the gains of later steps are within the limits.
    gain : (cycle, n, m), limits for the difference between the gain of a later step and that of the last step up to
        `start` with the same phase.
    covariance : (cycle, n, n), limits for the distance of the computed covariance before a step from the centers.
    center : (cycle, n, n), the centers.
    """

    start: int
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]
    center: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Phase:
    """One phase of the cycle: the model, the center before the step, and upper limits that follow from them."""

    given: tuple[NDArray[Any], ...]
    center: NDArray[np.float64]
    loop: Any
    K: Any
    HS: NDArray[np.float64]
    G: NDArray[np.float64]
    after: Any


def enclose(stored: LinearModel, run: Run, fmt: FloatFormat | FixedFormat, form: Form) -> Enclosure | None:
    """Find a step from which the computed covariance stays in a set for ever, and enclose its gains.

    Parameters
    ----------
    stored : the model, rounded to the format.
    run : a run of the filter with every step as a checkpoint.

    Returns
    -------
    enclosure : None if the form or the format is not covered (a limited range is not), or if no such set was found.
    """
    if not isinstance(fmt, FloatFormat) or fmt.limits is not None:
        # relative errors exceed the unit roundoff where numbers underflow
        return None
    start = _settled(stored, run.steps, float(fmt.unit_roundoff)) if form in FORMS else None
    if start is None:
        return None
    before, ctx.prec = ctx.prec, _BITS
    try:
        return _enclose(stored, run, float(fmt.unit_roundoff) * _UP, form, start)
    except ZeroDivisionError:  # the set contains a covariance whose innovation has no variance
        return None
    finally:
        ctx.prec = before


def _enclose(stored: LinearModel, run: Run, unit: float, form: Form, start: int) -> Enclosure | None:
    cycle = stored.cycle
    phases = _phases(stored, start)
    powers = _powers(phases)
    if powers is None:
        return None
    moved = [_abs(phase.after - matrix_of(phases[(j + 1) % cycle].center)) for j, phase in enumerate(phases)]
    P = _to_matrix(run.exactly(run.C[start - 1]))
    first = _abs(P - matrix_of(phases[0].center))
    # E_0 is the error before phase 0; before phase j it has been multiplied by every power of that phase.
    begun = [_largest([M @ first @ M.T for M in each.products]) for each in powers]
    B = [2 * each for each in begun]
    given = [[enclosed_numbers(each, unit) for each in phase.given] for phase in phases]
    for _ in range(_TRIALS):
        found = [_disturbed(form, phase, each, b, unit) for phase, each, b in zip(phases, given, B, strict=True)]
        W = [each.covariance + moved[j] for j, each in enumerate(found)]
        new = []
        for j in range(cycle):
            products, residuals = powers[j]
            total = begun[j] + products[-1] @ B[(j - len(residuals)) % cycle] @ products[-1].T
            for lag, (M, after, off) in enumerate(zip(products, products[1:], residuals, strict=False)):
                at = (j - 1 - lag) % cycle
                total += M @ W[at] @ M.T + _carried(off, B[at], after)
            new.append(total * _SUMS)
        if not all(np.isfinite(each).all() for each in new):
            return None
        if all((a <= b).all() for a, b in zip(new, B, strict=True)):
            break
        B = [np.maximum(1.1 * a, b) for a, b in zip(new, B, strict=True)]
        if any((b.diagonal() >= phase.center.diagonal()).any() for b, phase in zip(B, phases, strict=True)):
            return None
    else:
        return None
    known = [_to_matrix(each) for each in run.exactly(run.G[start - cycle : start])]
    limits = [found[j].gain + _abs(phases[j].K - known[j]) * _SUMS for j in range(cycle)]
    return Enclosure(start, np.array(limits), np.array(B), np.array([phase.center for phase in phases]))


def _carried(off: NDArray[np.float64], B: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bound the effect of errors of M within `off` on M E M', for |M| = `after` and |E| <= B; B needs no symmetry."""
    whole = after + off
    return np.asarray(off @ B @ whole.T + whole @ B @ off.T)


class _Disturbed(NamedTuple):
    """Error that a step adds to the covariance, and distance of its gain from that of the center."""

    covariance: NDArray[np.float64]
    gain: NDArray[np.float64]


def _disturbed(form: Form, phase: _Phase, given: list[NDArray[Any]], B: NDArray[np.float64], unit: float) -> _Disturbed:
    """Bound w and the gain of a step from any covariance within B of the center."""
    Phi, H, Q, R = given
    algebra, n = Algebra(lambda size: enclosed_numbers(np.eye(size), unit)), len(B)
    V, error_V = _restarted(predicted(algebra, Phi, enclosed_numbers(phase.center, unit, B), Q))
    computed = gain(algebra, H, R, V).K
    K, error_K = _restarted(computed)
    result = updated(algebra, form, StepModel(Phi, H, Q, R), V, K)
    rounded = np.array([[each.error for each in row] for row in result])
    h, v = _of(H), _of(V)
    s = h * v * h.transpose() + _of(R)
    identity = arb_mat([[int(i == j) for j in range(n)] for i in range(n)])
    C, D = _abs(identity - _of(computed) * h), _abs(identity - h.transpose() * s.inv() * h * v)
    if form is Form.JOSEPH:
        askew = h * v - s * s.transpose().inv() * h * v.transpose()  # zero if V is symmetric
        of_gain = error_K @ _abs(s) @ error_K.T + error_K @ _abs(askew)
    else:
        of_gain = error_K @ _abs(h * v)
    phi = _abs(_of(Phi))
    second = C @ phi @ B @ phase.G @ B @ _abs(phase.loop).T
    moved = phi @ B @ phi.T + error_V
    return _Disturbed((rounded + of_gain + C @ error_V @ D + second) * _SUMS, (C @ moved @ phase.HS + error_K) * _SUMS)


def _settled(stored: LinearModel, steps: int, unit: float) -> int | None:
    """Find a step, a multiple of the cycle, after which the exact covariance changes far less than by rounding."""
    cycle = stored.cycle
    start = -(-64 // cycle) * cycle
    while start <= steps:
        run = Run(stored, None, Form.INNOVATION, (start - cycle, start) if start > cycle else (start,))
        run.take(np.zeros((start, stored.m)))
        if len(run.C) > 1:
            P, last = (run.C[i][..., 0] for i in (1, 0))
            size = np.sqrt(np.abs(P.diagonal()))
            if (np.abs(P - last) <= 1e-3 * unit * np.outer(size, size)).all():
                return start
        start *= 2
    return None


def _phases(stored: LinearModel, start: int) -> list[_Phase]:
    """Return the centers of the set before each phase, from the exact filter one cycle after the start."""
    n, cycle = stored.n, stored.cycle
    run = Run(stored, None, Form.INNOVATION, range(start + cycle, start + 2 * cycle))
    run.take(np.zeros((start + 2 * cycle, stored.m)))
    identity = arb_mat([[int(i == j) for j in range(n)] for i in range(n)])
    found = []
    for j in range(cycle):
        P = run.C[j][..., 0]
        center = (P + P.T) / 2
        given = tuple(each[j % len(each)] for each in (stored.Phi, stored.H, stored.Q, stored.R))
        Phi, H, Q, R = (_to_matrix(each) for each in given)
        V = Phi * matrix_of(center) * Phi.transpose() + Q
        HS = H.transpose() * (H * V * H.transpose() + R).inv()
        K, C = V * HS, identity - V * HS * H
        G = _abs(Phi.transpose() * HS * H * Phi)
        found.append(_Phase(given, center, C * Phi, K, _abs(HS), G, C * V))
    return found


class _Powers(NamedTuple):
    """Products M of the closed loops of the last 0, 1, ... steps before a phase, in float64, magnitudes only.

    `residuals` holds their own roundings: M of a lag times the loop before it, minus M of the next lag.
    """

    products: list[NDArray[np.float64]]
    residuals: list[NDArray[np.float64]]


def _powers(phases: list[_Phase]) -> list[_Powers] | None:
    """Return products of closed loops until they are small; None if they do not become small."""
    cycle, n = len(phases), len(phases[0].center)
    whole = np.eye(n)
    for phase in phases:
        whole = _middle(phase.loop) @ whole
    radius = float(np.abs(eigenvalues(whole)).max()) ** (1 / cycle)
    if not radius < _SLOWEST:
        return None
    lags = int(np.ceil(np.log(_SMALL) / np.log(max(radius, 1e-3)))) + 8
    found = []
    for j in range(cycle):
        M = np.eye(n)
        each = _Powers([M], [])
        for lag in range(lags):
            exactly = matrix_of(M) * phases[(j - 1 - lag) % cycle].loop
            M = _middle(exactly)
            each.products.append(np.abs(M))
            each.residuals.append(_abs(exactly - matrix_of(M)))
        found.append(each)
    return found


def _middle(X: Any) -> NDArray[np.float64]:
    return np.array([[float(each.mid()) for each in row] for row in X.tolist()])


def _largest(matrices: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the largest value of each entry."""
    return np.asarray(np.max(matrices, axis=0) * _SUMS)


def _of(values: NDArray[Any]) -> Any:
    return arb_mat([[each.exactly for each in row] for row in values])


def _to_matrix(values: NDArray[Any]) -> Any:
    return arb_mat([[_ball(a) for a in row] for row in values])


def matrix_of(values: NDArray[np.float64]) -> Any:
    """Return a matrix of balls with radius 0."""
    return arb_mat([[arb(float(a)) for a in row] for row in values])


def _abs(X: Any) -> NDArray[np.float64]:
    """Return upper limits of the magnitudes of the entries of a matrix of balls."""
    return np.array([[float(each.abs_upper()) * _UP for each in row] for row in X.tolist()])
