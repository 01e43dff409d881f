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

The functions are compiled, take and return float64, and include their own roundings in the bound.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.compiling import compiled

_U = 2.0**-53


class Contraction(NamedTuple):
    r"""The bound after a step: :math:`\|e_k\|_k \le \eta`, :math:`\|L_k^{-1}E_kL_k^{-T}\|_F \le \zeta`.

    It is infinite if the error of the covariance is too large to bound the error of the gain.
    """

    #: (n, n), the weights, lower triangular.
    L: NDArray[np.float64]
    #: bounds the error of the state, in standard deviations.
    eta: float
    #: bounds the relative error of the covariance.
    zeta: float
    #: bounds the norm of :math:`A_k`, at most about 1.
    alpha: float
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


@compiled
def contraction_start(P: Any, de: Any, dE: Any) -> Any:
    """Start the bound at the initial state and covariance.

    Parameters
    ----------
    P : (n, n), initial covariance, which defines the weights.
    de, dE : (n,) and (n, n), componentwise bounds on the errors of the initial state and covariance; zero if exact.

    Returns
    -------
    bound : Contraction.
    """
    L = _weights((P + P.T) / 2)
    Y, delta = _inverse(L)
    eta = _norm(_times(np.abs(Y), de.reshape(-1, 1))) / (1 - delta)
    zeta = _norm(_times(_times(np.abs(Y), dE), np.abs(Y).T)) / (1 - delta) ** 2
    up = 1 + _many(len(P), 0)
    if not (delta < 1 and eta < np.inf and zeta < np.inf):
        eta, zeta = np.inf, np.inf
    return Contraction(L, eta * up, zeta * up, 1.0, np.zeros(1))


@compiled
def contraction_step(before: Any, model: Any, repeated: Any, off: Any) -> Any:
    r"""Propagate the bound through one step.

    .. math:: \zeta_k = \|T_k\|_k + \frac{\alpha^2\zeta}{1-g\zeta}, \qquad
        \eta_k = \|q_k\|_k + \frac{\alpha\,(\eta + \|y_k\|\zeta)}{1-g\zeta}, \qquad g\zeta < 1,

    with :math:`\alpha = \|L_k^{-1}A_kL_{k-1}\|_2`, :math:`g = \|L_{k-1}^TG_kL_{k-1}\|`,
    :math:`\|y_k\| = \|L_{k-1}^Ty_k\|`. The weights :math:`L_kL_k^T` follow Joseph's form with the gain K.

    Parameters
    ----------
    before : Contraction, the bound after the previous step.
    model : StepModel of this step, nearest float64.
    repeated : Repeated, the exact step from the program's values, and its residuals.
    off : EvaluationErrors of the repeated step, from :func:`evaluation_errors`.

    Returns
    -------
    bound : Contraction.
    """
    Phi, H, Q, R = model
    K, S, innovation, q, T = repeated
    dq, dT, dK, dinnovation = off
    n, m = K.shape
    L, zeta = before.L, before.zeta
    many = _many(n, m)
    HPhi = _times(H, Phi)
    A = Phi - _times(K, HPhi)
    aK, aH, aPhi, aL = np.abs(K), np.abs(H), np.abs(Phi), np.abs(L)
    AL = _times(A, L)
    C = np.eye(n) - _times(K, H)
    W = _times(AL, AL.T) + _times(_times(C, Q), C.T) + _times(_times(K, R), K.T)
    new = _weights((W + W.T) / 2)
    Y, delta = _inverse(new)
    aY = np.abs(Y)
    # Bounds the errors of A, AL and YAL: their roundings, and the error of K.
    spread = _times(aPhi + _times(aK, _times(aH, aPhi)), aL) * many + _times(dK, _times(aH, _times(aPhi, aL)))
    alpha = (_norm2(_times(Y, AL)) + _norm(_times(aY, spread))) / (1 - delta)

    inverse, dinverse = _inverse_general(S)
    HL, aHL = _times(HPhi, L), _times(aH, _times(aPhi, aL))
    N, dN = _times(HL.T, inverse), _times(aHL.T, dinverse + many * np.abs(inverse))  # L'N, N = Phi' H' S^-1
    g = _norm(_times(N, HL)) + _norm(_times(dN, aHL)) + many * _norm(_times(np.abs(N), aHL))
    nu, dnu = innovation.reshape(-1, 1), dinnovation.reshape(-1, 1) + many * np.abs(innovation).reshape(-1, 1)
    y = _norm(_times(N, nu)) + _norm(_times(dN, np.abs(nu) + dnu)) + _norm(_times(np.abs(N), dnu))

    q1, dq1 = q.reshape(-1, 1), (dq + many * np.abs(q)).reshape(-1, 1)
    size_q = (_norm(_times(Y, q1)) + _norm(_times(aY, dq1))) / (1 - delta)
    size_T = (_norm(_times(_times(Y, T), Y.T)) + _norm(_times(_times(aY, dT + many * np.abs(T)), aY.T))) / (
        1 - delta
    ) ** 2
    up = 1 + many  # roundings of these few norms and sums
    known = 1 - g * zeta * up
    columns = np.zeros(m)
    if not (delta < 1 and known > 0 and alpha < np.inf and size_T < np.inf and size_q < np.inf and y < np.inf):
        return Contraction(new, np.inf, np.inf, alpha, columns + np.inf)
    for j in range(m):
        columns[j] = (_norm(N[:, j : j + 1]) + _norm(dN[:, j : j + 1])) * alpha * zeta / known * up
    eta = (size_q + alpha * (before.eta + y * zeta) / known) * up
    return Contraction(new, eta, (size_T + alpha * alpha * zeta / known) * up, alpha, columns)


@compiled
def evaluation_errors(model: Any, x: Any, P: Any, z: Any, K: Any, S: Any, unit: float) -> Any:
    r"""Bound the errors of the evaluation of one step, componentwise.

    The step is :math:`x = \Phi x + K(z - H(\Phi x))`, :math:`P_p = \Phi P\Phi^T + Q`, :math:`S = HP_pH^T + R`,
    :math:`K = P_pH^TS^{-1}`, and P by :math:`(I-KH)P_p` or Joseph's form, made symmetric by averaging its two halves.
    The bound holds for Cholesky and for elimination without row exchanges, whether or not the inverse of S is formed,
    and for sums in any order.

    Parameters
    ----------
    model : StepModel. x (n,), P (n, n) : state and covariance before the step. z (m,) : measurement.
    K (n, m), S (m, m) : gain and innovation covariance of this step.
    unit : unit roundoff of one operation of the evaluation, 2**-102 for :mod:`gpbnb.arithmetic.kernels.doubledouble`.

    Returns
    -------
    off : EvaluationErrors.
    """
    Phi, H, Q, R = model
    n, m = K.shape
    many = (16 * (n + m) + 64) * unit * (1 + _many(n, m))
    aPhi, aH, aK = np.abs(Phi), np.abs(H), np.abs(K)
    predicted = _times(_times(aPhi, np.maximum(np.abs(P), np.abs(P.T))), aPhi.T) + np.abs(Q)
    PH = _times(predicted, aH.T)
    sizes = _times(aH, PH) + np.abs(R)
    pivots = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            pivots[i, j] = math.sqrt(sizes[i, i] * sizes[j, j])
    inverse, dinverse = _inverse_general(S)
    aS = np.abs(inverse) + dinverse
    dK = many * _times(PH + m * _times(_times(PH, aS), pivots), aS)
    left = np.eye(n) + _times(aK, aH)
    dT = many * (_times(_times(left, predicted), left.T) + _times(_times(aK, np.abs(R)), aK.T))
    dT += 2 * _times(_times(dK, PH.T), left.T) + 2 * _times(left, _times(PH, dK.T))
    ahead = _times(aPhi, np.abs(x).reshape(-1, 1))
    seen = np.abs(z).reshape(-1, 1) + _times(aH, ahead)
    dq = many * (ahead + _times(aK, seen)) + _times(dK, seen)
    return EvaluationErrors(dq[:, 0], dT, dK, many * seen[:, 0])


@compiled
def state_error_bound(bound: Any) -> Any:
    r"""Bound each entry of the error of the state, :math:`|e_i| \le \eta\,\sqrt{(LL^T)_{ii}}`; (n,)."""
    rows = np.sqrt((bound.L * bound.L).sum(axis=1)) * (1 + _many(len(bound.L), 0))
    return rows * bound.eta


@compiled
def covariance_error_bound(bound: Any) -> Any:
    r"""Bound each entry of the error of the covariance, :math:`\zeta\sqrt{(LL^T)_{ii}(LL^T)_{jj}}`; (n, n)."""
    rows = np.sqrt((bound.L * bound.L).sum(axis=1)) * (1 + _many(len(bound.L), 0))
    return bound.zeta * np.outer(rows, rows)


@compiled
def gain_error_bound(bound: Any, K: Any, used: Any, dK: Any) -> Any:
    r"""Bound each entry of the error of the gain that the program used in the step that led to `bound`; (n, m).

    .. math:: \hat K_k - K_k = (\hat K_k - K^\circ_k) + F_k E_{k-1} \Phi^T H^T S^{\circ-1}

    Parameters
    ----------
    bound : Contraction after the step.
    K, dK : as in :func:`contraction_step`.
    used : (n, m), the program's gain.
    """
    up = 1 + _many(K.shape[0], K.shape[1])
    rows = np.sqrt((bound.L * bound.L).sum(axis=1))
    return (np.abs(used - K) + dK + _U * (np.abs(used) + np.abs(K)) + np.outer(rows, bound.gain)) * up


def companion_bound(difference: Any, bound: Any) -> NDArray[np.float64]:
    r"""Bound the errors of a run by its distance from a companion run, such as one with more digits, and its bound.

    .. math:: |\hat x - x| \le |\hat x - \hat x_c| + |\hat x_c - x|

    Parameters
    ----------
    difference : the run minus its companion, entry by entry, subtracted before conversion to float64.
    bound : bound of each entry of the companion's errors, as from :func:`state_error_bound`.
    """
    return (np.abs(difference) + np.asarray(bound)) * (1 + 4 * _U)


@compiled
def _many(n: int, m: int) -> float:
    """Bound on the error of one step's float64 computations, relative to the sums of magnitudes."""
    return (16 * (n + m) + 64) * _U


@compiled
def _times(A: Any, B: Any) -> Any:
    rows, inner, columns = A.shape[0], A.shape[1], B.shape[1]
    product = np.zeros((rows, columns))
    for i in range(rows):
        for k in range(inner):
            a = A[i, k]
            if a != 0.0:
                for j in range(columns):
                    product[i, j] += a * B[k, j]
    return product


@compiled
def _norm(A: Any) -> float:
    total = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            total += A[i, j] * A[i, j]
    return math.sqrt(total)


@compiled
def _norm2(X: Any) -> float:
    """Upper bound on the largest singular value: bisection finds a mu for which elimination shows mu - X'X positive.

    If elimination succeeds, all eigenvalues of a matrix with trace t are above -2 (n + 2) u t (Rump 2006).
    """
    n = X.shape[1]
    B = _times(X.T, X)
    trace = 0.0
    for i in range(n):
        trace += B[i, i]
    if not trace < np.inf:
        return np.inf
    low, high = trace / n * 0.999, trace
    while high - low > max(1e-3 * abs(1 - high), 1e-11) * low + 1e-300:  # only its distance from 1 matters
        middle = low + (high - low) / 2
        if not low < middle < high:
            break
        if _is_positive(middle, B):
            high = middle
        else:
            low = middle
    return math.sqrt(high * (1 + 4 * n * (n + 2) * _U) + 4 * (n + 2) * _U * trace) * (1 + 4 * _U)


@compiled
def _is_positive(mu: float, B: Any) -> bool:
    n = len(B)
    M = -B
    for i in range(n):
        M[i, i] += mu
    for k in range(n):
        if not M[k, k] > 0:
            return False
        for i in range(k + 1, n):
            factor = M[i, k] / M[k, k]
            for j in range(k + 1, n):
                M[i, j] -= factor * M[k, j]
    return True


@compiled
def _weights(W: Any) -> Any:
    """A nonsingular lower factor of about W; any such factor is valid, so lost pivots are replaced by small ones."""
    n = len(W)
    L = np.zeros((n, n))
    for j in range(n):
        pivot = W[j, j]
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        least = 1e-13 * abs(W[j, j])
        if not pivot > least:
            pivot = least if least > 0 else 1.0
        L[j, j] = math.sqrt(pivot)
        for i in range(j + 1, n):
            entry = W[i, j]
            for k in range(j):
                entry -= L[i, k] * L[j, k]
            L[i, j] = entry / L[j, j]
    return L


@compiled
def _inverse(L: Any) -> Any:
    """Approximate inverse Y of a lower triangular L, and a bound on the Frobenius norm of YL - I."""
    n = len(L)
    Y = np.zeros((n, n))
    for j in range(n):
        Y[j, j] = 1 / L[j, j]
        for i in range(j + 1, n):
            entry = 0.0
            for k in range(j, i):
                entry -= L[i, k] * Y[k, j]
            Y[i, j] = entry / L[i, i]
    return Y, _norm(_times(Y, L) - np.eye(n)) + _many(n, 0) * _norm(_times(np.abs(Y), np.abs(L)))


@compiled
def _inverse_general(S: Any) -> Any:
    """Inverse of S by elimination with pivoting, and a componentwise bound on its error, infinite if S is singular."""
    m = len(S)
    M, Y = S.copy(), np.eye(m)
    for k in range(m):
        p = k
        for i in range(k + 1, m):
            if abs(M[i, k]) > abs(M[p, k]):
                p = i
        if not abs(M[p, k]) > 0:
            return np.eye(m), np.full((m, m), np.inf)
        for j in range(m):
            M[k, j], M[p, j] = M[p, j], M[k, j]
            Y[k, j], Y[p, j] = Y[p, j], Y[k, j]
        pivot = M[k, k]
        for j in range(m):
            M[k, j] /= pivot
            Y[k, j] /= pivot
        for i in range(m):
            factor = M[i, k]
            if i != k and factor != 0.0:
                for j in range(m):
                    M[i, j] -= factor * M[k, j]
                    Y[i, j] -= factor * Y[k, j]
    # S^-1 - Y = -E (I + E)^-1 Y with E = YS - I. With e the largest row sum of |E|, each entry is at most e / (1 - e)
    # times the sum of its column of |Y|.
    aY = np.abs(Y)
    E = np.abs(_times(Y, S) - np.eye(m)) + _many(m, m) * _times(aY, np.abs(S))
    largest = 0.0
    for i in range(m):
        largest = max(largest, E[i].sum())
    if not largest < 0.5:
        return Y, np.full((m, m), np.inf)
    return Y, 2 * _times(np.full((m, m), largest), aY)
