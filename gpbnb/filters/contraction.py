r"""A rounding error bound that holds for one run of a filter: the contraction bound.

The contraction bound needs no pattern and no first-order approximation. Let :math:`(\hat x_k, \hat P_k)` be the results
of any program, by any form of the filter (for an asymmetric covariance, its symmetric part), and :math:`\mathcal E` one
exact step (98)-(101). Only two residuals of a step enter,

.. math:: q_k = \hat x_k - \mathcal E_x(\hat x_{k-1}, \hat P_{k-1}, z_k), \qquad
    T_k = \hat P_k - \mathcal E_P(\hat P_{k-1}),

for the errors :math:`e_k = \hat x_k - x_k` and :math:`E_k = \hat P_k - P_k` obey *exactly*

.. math:: E_k = A_k E_{k-1} F_k^T + T_k, \quad e_k = F_k (e_{k-1} + E_{k-1} y_k) + q_k, \quad
    F_k = A_k (I - E_{k-1} G_k)^{-1},

    A_k = (I - K^\circ_k H_k)\Phi_{k-1}, \quad y_k = \Phi^T H^T S^{\circ-1}\hat\nu_k, \quad
    G_k = \Phi^T H^T S^{\circ-1} H \Phi,

where :math:`K^\circ, S^\circ` are the gain and the innovation covariance of (99) for :math:`\hat P_{k-1}`, and
:math:`\hat\nu_k = z_k - H\Phi\hat x_{k-1}`; :math:`F_k` is (109), the closed loop of the exact filter. The
derivation ``contraction`` of the report on Kalman filters proves it. In the norm
:math:`\|v\|_k = \|L_k^{-1}v\|_2`, with :math:`L_kL_k^T` close to the filter's own covariance, the closed loop does not
expand, so errors are added but not amplified. The norm has no units; an entry of the error is at most
:math:`\|v\|_k` of these standard deviations.

The functions take and return float64, and include their own roundings in the bound. Each sum of products is added up
from left to right. All that does not depend on the step before is computed for many steps at once, along a first axis.
"""

from __future__ import annotations

import operator
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.lanes import recorded, repeatable
from gpbnb.arithmetic.named import BINARY64
from gpbnb.filters.steps import StepModel

Array = NDArray[np.float64]

_U = 2.0**-53


class Contraction(NamedTuple):
    r"""The bound after a step: :math:`\|e_k\|_k \le \eta`, :math:`\|L_k^{-1}E_kL_k^{-T}\|_F \le \zeta`.

    It is infinite if the error of the covariance is too large to bound the error of the gain.
    """

    #: (n, n), the weights, lower triangular.
    L: NDArray[np.float64]
    #: bounds the error of the state, in standard deviations.
    eta: Any
    #: bounds the relative error of the covariance.
    zeta: Any
    #: bounds the norm of :math:`A_k`, and is at most about 1. The bounds eta, zeta and alpha are floats for one step,
    #: and arrays (steps,) for several.
    alpha: Any
    #: (m,), bounds the effect of the covariance error on each column of the gain.
    gain: NDArray[np.float64]


class Repeated(NamedTuple):
    """One exact step from a run's values, evaluated in double-double and rounded to float64, and what the run differs.

    The innovation covariance S° and the gain K° belong to the run's covariance before the step.
    """

    #: (n, m) and (m, m).
    K: NDArray[np.float64]
    S: NDArray[np.float64]
    #: (m,), of the run's estimate.
    innovation: NDArray[np.float64]
    #: (n,) and (n, n), the residuals, which are state and covariance of the run minus those of the exact step.
    q: NDArray[np.float64]
    T: NDArray[np.float64]


class EvaluationErrors(NamedTuple):
    """Bounds of the errors of the evaluation of one step, entry by entry."""

    q: NDArray[np.float64]
    T: NDArray[np.float64]
    gain: NDArray[np.float64]
    innovation: NDArray[np.float64]


@np.errstate(all="ignore")
def contraction_start(P: Array, de: Array, dE: Array) -> Contraction:
    """Start the bound at the initial state and covariance P (n, n), which defines the weights.

    Componentwise bounds of their errors are de (n,) and dE (n, n), zero if they are exact.
    """
    (found,), _ = recorded(_weights, P.shape).begin(BINARY64, ((P + P.T) / 2)[np.newaxis])
    L = found[0] if len(found) else np.full(P.shape, np.nan)
    Y, delta = _inverse(L)
    aY, up = np.abs(Y), 1 + _many(len(P), 0)
    eta = float(_norm(_times(aY, de[:, np.newaxis])) / (1 - delta))
    zeta = float(_norm(_times(_times(aY, dE), aY.T)) / (1 - delta) ** 2)
    if not (delta < 1 and eta < np.inf and zeta < np.inf):
        eta, zeta = np.inf, np.inf
    return Contraction(L, eta * up, zeta * up, 1.0, np.zeros(1))


def at_step(bounds: Contraction, k: int) -> Contraction:
    """Return the bound after step k, counted from 0, of the bounds after some steps."""
    return Contraction(bounds.L[k], float(bounds.eta[k]), float(bounds.zeta[k]), float(bounds.alpha[k]), bounds.gain[k])


@np.errstate(all="ignore")
def contraction_steps(before: Contraction, model: StepModel, repeated: Repeated, off: EvaluationErrors) -> Contraction:
    r"""Propagate the bound through some steps, and return the bounds after each; see :func:`at_step`.

    .. math:: \zeta_k = \|T_k\|_k + \frac{\alpha^2\zeta}{1-g\zeta}, \qquad
        \eta_k = \|q_k\|_k + \frac{\alpha\,(\eta + \|y_k\|\zeta)}{1-g\zeta}, \qquad g\zeta < 1,

    with :math:`\alpha = \|L_k^{-1}A_kL_{k-1}\|_2`, :math:`g = \|L_{k-1}^TG_kL_{k-1}\|`,
    :math:`\|y_k\| = \|L_{k-1}^Ty_k\|`. The weights :math:`L_kL_k^T` follow Joseph's form with the gain K.

    Models, repeated steps and errors of their evaluation have a first axis for the steps, as the bounds have.
    """
    K, q, T = repeated.K, repeated.q, repeated.T
    many = _many(*K.shape[-2:])
    up = 1 + many  # roundings of a few norms and sums
    A, weights = _closed_loops(model, K, before.L)
    L, new = weights[:-1], weights[1:]
    Y, delta = _inverse(new)
    known = delta < 1
    aY, within = np.abs(Y), 1 - delta
    alpha = _closed_norm(model, repeated, off, (A, L, Y)) / within
    N, dN, g, y = _through_gain(model, repeated, off, L)
    columns = np.sqrt(_sums(N * N, axis=-2)) + np.sqrt(_sums(dN * dN, axis=-2))
    dq = (off.q + many * np.abs(q))[..., np.newaxis]
    size_q = (_norm(_times(Y, q[..., np.newaxis])) + _norm(_times(aY, dq))) / within
    dT = off.T + many * np.abs(T)
    size_T = _norm(_times(_times(Y, T), _turned(Y))) + _norm(_times(_times(aY, dT), _turned(aY)))
    size_T /= within**2
    known &= (alpha < np.inf) & (size_T < np.inf) & (size_q < np.inf) & (y < np.inf)
    etas, zetas, rests = [before.eta], [before.zeta], []
    sizes = (each.tolist() for each in (known, alpha, g, y, size_q, size_T))
    for is_known, a, gain, by_covariance, state, covariance in zip(*sizes, strict=True):
        eta, zeta = etas[-1], zetas[-1]
        rest = 1 - gain * zeta * up
        if is_known and rest > 0:
            eta = (state + a * (eta + by_covariance * zeta) / rest) * up
            zeta = (covariance + a * a * zeta / rest) * up
        else:
            rest, eta, zeta = 0.0, np.inf, np.inf
        etas.append(eta)
        zetas.append(zeta)
        rests.append(rest)
    rest = np.array(rests)[:, np.newaxis]
    by_gain = columns * alpha[:, np.newaxis] * np.array(zetas[:-1])[:, np.newaxis] / rest * up
    return Contraction(new, np.array(etas[1:]), np.array(zetas[1:]), alpha, np.where(rest > 0, by_gain, np.inf))


def _closed_loops(model: StepModel, K: Array, L: Array) -> tuple[Array, Array]:
    """Return the closed loop of each step, and weights before the first and after each step, by Joseph's form."""
    C = np.eye(len(L)) - _times(K, model.H)
    A = model.Phi - _times(K, _times(model.H, model.Phi))
    by_noise, by_measurement = _times(_times(C, model.Q), _turned(C)), _times(_times(K, model.R), _turned(K))
    return A, _propagated_weights(L, A, by_noise, by_measurement)


def _closed_norm(
    model: StepModel, repeated: Repeated, off: EvaluationErrors, loops: tuple[Array, Array, Array]
) -> Array:
    """Bound the norms of YAL, where A has rounding errors and the error of K."""
    A, L, Y = loops
    many = _many(*repeated.K.shape[-2:])
    aPhi, aH, aL = np.abs(model.Phi), np.abs(model.H), np.abs(L)
    spread = _times(aPhi + _times(np.abs(repeated.K), _times(aH, aPhi)), aL) * many
    spread += _times(off.gain, _times(aH, _times(aPhi, aL)))
    return _norm2(_times(Y, _times(A, L))) + _norm(_times(np.abs(Y), spread))


def _through_gain(model: StepModel, repeated: Repeated, off: EvaluationErrors, L: Array) -> tuple[Array, ...]:
    """Return L'N with N = Phi' H' S^-1 and a bound of its error, and bounds of the norms of L'GL and L'y."""
    many = _many(*repeated.K.shape[-2:])
    HL = _times(_times(model.H, model.Phi), L)
    aHL = _times(np.abs(model.H), _times(np.abs(model.Phi), np.abs(L)))
    inverse, dinverse = _inverse_general(repeated.S)
    N, dN = _times(_turned(HL), inverse), _times(_turned(aHL), dinverse + many * np.abs(inverse))
    aN = np.abs(N)
    g = _norm(_times(N, HL)) + _norm(_times(dN, aHL)) + many * _norm(_times(aN, aHL))
    nu = repeated.innovation[..., np.newaxis]
    dnu = off.innovation[..., np.newaxis] + many * np.abs(nu)
    y = _norm(_times(N, nu)) + _norm(_times(dN, np.abs(nu) + dnu)) + _norm(_times(aN, dnu))
    return N, dN, g, y


@np.errstate(all="ignore")
def evaluation_errors(
    model: StepModel, x: Array, P: Array, z: Array, K: Array, S: Array, unit: float
) -> EvaluationErrors:
    r"""Bound the errors of the evaluation of one step, or of each of some steps, componentwise.

    The step is :math:`x = \Phi x + K(z - H(\Phi x))`, :math:`P_p = \Phi P\Phi^T + Q`, :math:`S = HP_pH^T + R`,
    :math:`K = P_pH^TS^{-1}`, and P by :math:`(I-KH)P_p` or Joseph's form, made symmetric by averaging its two halves.
    The bound holds for Cholesky and for elimination without row exchanges, whether or not the inverse of S is formed,
    and for sums in any order.

    Parameters
    ----------
    model : the step's. x (n,), P (n, n) : state and covariance before the step. z (m,) : measurement.
    K (n, m), S (m, m) : gain and innovation covariance of this step.
    unit : unit roundoff of one operation of the evaluation, 2**-102 for :mod:`gpbnb.arithmetic.kernels.doubledouble`.
    """
    n, m = K.shape[-2:]
    many = (16 * (n + m) + 64) * unit * (1 + _many(n, m))
    aPhi, aH, aQ, aR = map(np.abs, model)
    aK = np.abs(K)
    predicted = _times(_times(aPhi, np.maximum(np.abs(P), np.abs(_turned(P)))), _turned(aPhi)) + aQ
    PH = _times(predicted, _turned(aH))
    sizes = _times(aH, PH) + aR
    diagonal = np.diagonal(sizes, axis1=-2, axis2=-1)
    pivots = np.sqrt(diagonal[..., :, np.newaxis] * diagonal[..., np.newaxis, :])
    inverse, dinverse = _inverse_general(S)
    aS = np.abs(inverse) + dinverse
    dK = many * _times(PH + m * _times(_times(PH, aS), pivots), aS)
    left = np.eye(n) + _times(aK, aH)
    dT = many * (_times(_times(left, predicted), _turned(left)) + _times(_times(aK, aR), _turned(aK)))
    dT += 2 * _times(_times(dK, _turned(PH)), _turned(left)) + 2 * _times(left, _times(PH, _turned(dK)))
    ahead = _times(aPhi, np.abs(x)[..., np.newaxis])
    seen = np.abs(z)[..., np.newaxis] + _times(aH, ahead)
    dq = many * (ahead + _times(aK, seen)) + _times(dK, seen)
    return EvaluationErrors(dq[..., 0], dT, dK, many * seen[..., 0])


def state_error_bound(bound: Contraction) -> Array:
    r"""Bound each entry of the error of the state, :math:`|e_i| \le \eta\,\sqrt{(LL^T)_{ii}}`; (n,).

    Like the next two functions, it also takes the bounds after several steps, from :func:`contraction_steps`.
    """
    rows = _standard_deviations(bound)
    return rows * np.asarray(bound.eta)[..., np.newaxis]


def covariance_error_bound(bound: Contraction) -> Array:
    r"""Bound each entry of the error of the covariance, :math:`\zeta\sqrt{(LL^T)_{ii}(LL^T)_{jj}}`; (n, n)."""
    rows = _standard_deviations(bound)
    return np.asarray(bound.zeta)[..., np.newaxis, np.newaxis] * _outer(rows, rows)


@np.errstate(all="ignore")
def gain_error_bound(bound: Contraction, K: Array, used: Array, dK: Array) -> Array:
    r"""Bound each entry of the error of the gain that the program used in the step that led to `bound`; (n, m).

    .. math:: \hat K_k - K_k = (\hat K_k - K^\circ_k) + F_k E_{k-1} \Phi^T H^T S^{\circ-1}

    The gain that was used is (n, m); K and dK are those of the repeated step.
    """
    up = 1 + _many(*K.shape[-2:])
    off = np.abs(used - K) + dK + _U * (np.abs(used) + np.abs(K)) + _outer(_rows(bound.L), bound.gain)
    return off * up


def companion_bound(difference: Any, bound: Any) -> NDArray[np.float64]:
    r"""Bound the errors of a run by its distance from a companion run, such as one with more digits, and its bound.

    .. math:: |\hat x - x| \le |\hat x - \hat x_c| + |\hat x_c - x|

    Parameters
    ----------
    difference : the run minus its companion, entry by entry, subtracted before conversion to float64.
    bound : bound of each entry of the companion's errors, as from :func:`state_error_bound`.
    """
    return (np.abs(difference) + np.asarray(bound)) * (1 + 4 * _U)


def _many(n: int, m: int) -> float:
    """Bound on the error of one step's float64 computations, relative to the sums of magnitudes."""
    return (16 * (n + m) + 64) * _U


def _standard_deviations(bound: Contraction) -> Array:
    return _rows(bound.L) * (1 + _many(bound.L.shape[-1], 0))


def _outer(a: Array, b: Array) -> Array:
    return a[..., :, np.newaxis] * b[..., np.newaxis, :]


def _turned(A: Array) -> Array:
    return np.swapaxes(A, -2, -1)


def _sums(A: Array, axis: int = -1) -> Any:
    """Sums from left to right."""
    return np.cumsum(A, axis=axis).take(-1, axis=axis)


def _norm(A: Array) -> Array:
    return np.sqrt(_sums(np.square(A).reshape(*A.shape[:-2], -1)))


def _rows(L: Array) -> Array:
    return np.sqrt(_sums(L * L))


def _times(A: Array, B: Array) -> Array:
    """Products of matrices, or of each pair of matrices; zeros of A are skipped, so that none meets an infinity."""
    left, right = _steps_last(A), _steps_last(B)
    product = np.zeros((len(left), *right.shape[1:]))
    finite = np.isfinite(right).all()
    for k in range(len(right)):
        a = left[:, k, np.newaxis]
        terms = a * right[k]
        product += terms if finite else np.where(a == 0, 0.0, terms)
    return np.moveaxis(product, (0, 1), (-2, -1))


def _steps_last(A: Array) -> Array:
    """Return matrices (steps, n, m) as (n, m, steps), so that NumPy computes all steps in one inner loop."""
    return np.ascontiguousarray(np.moveaxis(A, (-2, -1), (0, 1)))


def _norm2(X: Array) -> Array:
    """Upper bounds on the largest singular values, from B = X'X.

    Bisection finds a mu for which elimination shows mu - B positive. If elimination succeeds, all eigenvalues of a
    matrix with trace t are above -2 (n + 2) u t (Rump 2006).
    """
    n = X.shape[-1]
    B = _times(_turned(X), X).reshape(-1, n, n)
    trace = _sums(np.diagonal(B, axis1=1, axis2=2))
    low, high, at = trace / n * 0.999, trace.copy(), np.flatnonzero(trace < np.inf)
    while len(at):
        below, above = low[at], high[at]
        middle = below + (above - below) / 2
        close = np.maximum(1e-3 * np.abs(1 - above), 1e-11)  # only its distance from 1 matters
        wide = (above - below > close * below + 1e-300) & (below < middle) & (middle < above)
        at, middle = at[wide], middle[wide]
        positive = _are_positive(middle, B[at])
        high[at[positive]], low[at[~positive]] = middle[positive], middle[~positive]
    above = high * (1 + 4 * n * (n + 2) * _U) + 4 * (n + 2) * _U * trace
    return np.where(trace < np.inf, np.sqrt(above) * (1 + 4 * _U), np.inf).reshape(X.shape[:-2])


def _are_positive(mu: Array, B: Array) -> NDArray[np.bool_]:
    """Tell for each matrix whether elimination finds only positive pivots of mu - B."""
    n, positive = B.shape[-1], np.ones(len(mu), np.bool_)
    M = np.eye(n)[..., np.newaxis] * mu - _steps_last(B)
    for k in range(n):
        positive &= M[k, k] > 0
        M[k + 1 :, k + 1 :] -= (M[k + 1 :, k] / M[k, k])[:, np.newaxis] * M[k, k + 1 :]
    return positive


def _propagated_weights(L: Array, A: Array, *added: Array) -> Array:
    """Return the weights before the first step and after each, (steps + 1, n, n). An overflow leaves them as they are.

    The machine repeats :func:`_weights_after` in binary64. Its roundings affect no bound: any weights are valid.
    """
    own, lower, n = np.stack([A, *added], axis=1), np.tril_indices(len(L)), len(L)
    usable = np.isfinite(own).all(axis=(1, 2, 3)) & np.isfinite(L).all()
    most = len(own) if usable.all() else int(np.argmin(usable))
    step = repeatable(_weights_after, (lower[0].shape, *((n, n),) * own.shape[1]))
    loop = step.loop(BINARY64)
    loop.states = L[lower]
    given = int(step.given[1][0, 0]), own.reshape(len(own), -1)[:most]
    loop.keep(loop.after)
    kept, _, _ = loop.take(0, most, [given])
    weights = np.zeros((1 + len(own), n, n))
    weights[0] = L
    weights[1 : 1 + len(kept), lower[0], lower[1]] = kept
    weights[1 + len(kept) :] = weights[len(kept)]
    return weights


def _weights_after(lower: Any, A: Any, *added: Any) -> Any:
    """Return the lower half of a factor of ALL'A' and the covariances that are added, the mean of their two halves."""
    i, j = np.tril_indices(len(A))
    AL = A @ (A * 0).at[i, j].set(lower)
    product = reduce(operator.add, (AL[i] * AL[j]).T)
    halves = (reduce(lambda total, each: total + each[at], added, product) for at in ((i, j), (j, i)))
    return _weights((A * 0).at[i, j].set(sum(halves) * 0.5))[i, j]


def _weights(W: Any) -> Any:
    """Return a nonsingular lower factor of a matrix close to W. Only the lower half of W is read.

    Any such factor is valid, so lost pivots are replaced by small ones.
    """
    L = W * 0
    for j in range(len(W)):
        column, least = W[j:, j], abs(W[j, j]) * 1e-13
        for k in range(j):
            column = column - L[j:, k] * L[j, k]
        root = np.sqrt(np.where(column[0] > least, column[0], np.where(least > 0, least, 1)))
        L = L.at[j, j].set(root).at[j + 1 :, j].set(column[1:] / root)
    return L


@np.errstate(all="ignore")
def _inverse(L: Array) -> tuple[Array, Array]:
    """Approximate inverse Y of a lower triangular L, and a bound on the Frobenius norm of YL - I."""
    n = L.shape[-1]
    Y = np.zeros(L.shape)
    for i in range(n):
        for k in range(i):
            Y[..., i, :i] -= L[..., i, k, np.newaxis] * Y[..., k, :i]
        Y[..., i, i] = 1.0
        Y[..., i, : i + 1] /= L[..., i, i, np.newaxis]
    return Y, _norm(_times(Y, L) - np.eye(n)) + _many(n, 0) * _norm(_times(np.abs(Y), np.abs(L)))


@np.errstate(all="ignore")
def _inverse_general(S: Array) -> tuple[Array, Array]:
    """Inverse of S by elimination with pivoting, and a componentwise bound on its error, infinite if S is singular."""
    m = S.shape[-1]
    M = np.array(S).reshape(-1, m, m)
    Y, every, singular = np.tile(np.eye(m), (len(M), 1, 1)), np.arange(len(M)), np.zeros(len(M), dtype=bool)
    for k in range(m):
        p = k + np.abs(M[:, k:, k]).argmax(axis=1)
        for rows in (M, Y):
            rows[every, k], rows[every, p] = rows[every, p], rows[every, k]
        pivot = M[:, k, k].copy()
        singular |= ~(np.abs(pivot) > 0)
        for rows in (M, Y):
            rows[:, k] /= pivot[:, np.newaxis]
        for i in range(m):
            if i != k:
                factor = M[:, i, k, np.newaxis].copy()
                M[:, i] -= factor * M[:, k]
                Y[:, i] -= factor * Y[:, k]
    Y[singular] = np.eye(m)
    # S^-1 - Y = -E (I + E)^-1 Y with E = YS - I. With e the largest row sum of |E|, each entry is at most e / (1 - e)
    # times the sum of its column of |Y|.
    Y = Y.reshape(S.shape)
    aY = np.abs(Y)
    E = np.abs(_times(Y, S) - np.eye(m)) + _many(m, m) * _times(aY, np.abs(S))
    largest = _sums(E).max(axis=-1)
    error = 2 * _times(np.broadcast_to(largest[..., np.newaxis, np.newaxis], S.shape), aY)
    error[singular.reshape(S.shape[:-2]) | ~(largest < 0.5)] = np.inf
    return Y, error
