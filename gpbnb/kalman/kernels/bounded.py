"""Compiled: the contraction bound of steps that a run has taken, each repeated in double-double.

The long functions do not depend on the format of the run: what it computed comes as double-double numbers. So they
are compiled once, not once for each arithmetic.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from gpbnb.arithmetic.kernels import doubledouble
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.matrices import (
    copy,
    difference,
    product,
)
from gpbnb.arithmetic.kernels.scalar import (
    add,
    load,
    multiply,
    one,
    put,
    subtract,
    zero,
)
from gpbnb.arithmetic.kernels.tags import Decimal, DoubleDouble, ShortDecimal
from gpbnb.kalman.forms import Form
from gpbnb.kalman.kernels.contraction import (
    contraction_start,
    contraction_step,
    covariance_error_bound,
    evaluation_errors,
    gain_error_bound,
    state_error_bound,
)
from gpbnb.kalman.kernels.step import decorrelate, filter_step, workspace

_INNOVATION, _UD = int(Form.INNOVATION), int(Form.UD)
_POWERS = np.array([10.0**k for k in range(23)])  # exact


def widened(fmt: Any, a: Any) -> Any:
    """A number of a format as a double-double: exact in base 2 and 16; within four roundings in base 10."""
    raise TypeError("got a call of widened from Python; needed one from a function compiled by numba")


@overload(widened, strict=False, jit_options={"forceinline": True})
def _overloaded_widened(fmt: Any, a: Any) -> Any:
    tag = getattr(fmt, "instance_class", None)

    def of_float(fmt: Any, a: Any) -> Any:
        return a, 0.0

    def of_pair(fmt: Any, a: Any) -> Any:
        high = np.float64(a[0])
        x, e = (high, np.float64(a[0] - np.int64(high))), a[1]
        while e > 0:
            x = doubledouble.multiply(DoubleDouble(), x, (_POWERS[min(e, 22)], 0.0))
            e -= min(e, 22)
        while e < 0:
            x = doubledouble.divide(DoubleDouble(), x, (_POWERS[min(-e, 22)], 0.0))
            e += min(-e, 22)
        return x

    if tag is DoubleDouble:
        return lambda fmt, a: a
    return of_pair if tag in (Decimal, ShortDecimal) else of_float


@compiled
def widen(fmt: Any, packed: Any, wide: Any) -> None:
    """Convert numbers of a format, (k, n, m) as it packs them, to double-double, (k, n, m, 2)."""
    for k in range(wide.shape[0]):
        for i in range(wide.shape[1]):
            for j in range(wide.shape[2]):
                wide[k, i, j, 0], wide[k, i, j, 1] = widened(fmt, load(fmt, packed, (k, i, j)))


@njit(nogil=True)
def _covariance(form: int, a: Any, c: Any, U: Any, UD: Any) -> None:
    """c = the symmetric part of a covariance, or what its factors in a stand for."""
    exactly, n = DoubleDouble(), a.shape[0]
    half = (0.5, 0.0)
    if form == _UD:
        for i in range(n):
            for j in range(n):
                d = load(exactly, a, (j, j))
                u = load(exactly, a, (i, j)) if i < j else one(exactly) if i == j else zero(exactly)
                put(exactly, U, (j, i), u)
                put(exactly, UD, (i, j), multiply(exactly, u, d))
        product(exactly, UD, U, c)
        return
    for i in range(n):
        for j in range(i + 1):
            x = multiply(exactly, add(exactly, load(exactly, a, (i, j)), load(exactly, a, (j, i))), half)
            put(exactly, c, (i, j), x)
            put(exactly, c, (j, i), x)


@njit(nogil=True)
def _symmetrize(a: Any) -> None:
    exactly = DoubleDouble()
    for i in range(a.shape[0]):
        for j in range(i):
            x = multiply(exactly, add(exactly, load(exactly, a, (i, j)), load(exactly, a, (j, i))), (0.5, 0.0))
            put(exactly, a, (i, j), x)
            put(exactly, a, (j, i), x)


@njit(nogil=True)
def _whole_gain(form: int, K: Any, H: Any, UR: Any, c: Any, HD: Any) -> None:
    """c = the gain of a step; of UD, from those of one measurement after the other."""
    n, m = K.shape[0], K.shape[1]
    exactly = DoubleDouble()
    copy(exactly, K, c)
    if form != _UD:
        return
    decorrelate(exactly, UR, H, HD)
    for i in range(m):
        for j in range(i):
            s = zero(exactly)
            for k in range(n):
                s = add(exactly, s, multiply(exactly, load(exactly, HD, (i, k)), load(exactly, c, (k, j))))
            for k in range(n):
                x = multiply(exactly, load(exactly, K, (k, i)), s)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))
    for j in range(1, m):
        for i in range(j):
            u = load(exactly, UR, (i, j))
            for k in range(n):
                x = multiply(exactly, load(exactly, c, (k, i)), u)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))


@compiled
def advance_bound(
    form: int,
    exact_model: Any,
    plain: Any,
    exact_z: Any,
    first: int,
    x: Any,
    P: Any,
    gains: Any,
    UR: Any,
    bound: Any,
    checkpoint_steps: Any,
    at: int,
    bounds: Any,
) -> Any:
    """Take the contraction bound over steps that a run has taken; returns it, and saves it at checkpoint steps.

    Each step is repeated in double-double from where the run stood: its residuals enter the bound.

    Parameters
    ----------
    form : the form of the run.
    exact_model, plain : the stored model in double-double, as ``Run.matrices``, and Phi, H, Q, R in float64.
    exact_z : (steps, m, 1, 2), the measurements.
    first : how many steps were taken before these.
    x, P : (steps + 1, n, 1, 2) and (steps + 1, n, n, 2), states and covariances, or factors, before and after each.
    gains : (steps, n, m, 2), as the run computed them.
    UR : (k, m, m, 2), the factors of R as the run computed them.
    bound : Contraction, before the first of these steps.
    checkpoint_steps, at : all steps to be saved, and which of them is next.
    bounds : of state (c, n), gain (c, n, m) and covariance (c, n, n), written at the checkpoint steps.
    """
    exactly, unit = DoubleDouble(), 2.0**-100
    states, gain_bounds, covariances = bounds
    n, m = x.shape[1], exact_z.shape[1]
    xe, Pe, Pn = np.empty((n, 1, 2)), np.empty((n, n, 2)), np.empty((n, n, 2))
    work = workspace(xe, Pe, exact_model[3][0], exact_model[2][0], exact_model[5][0], exact_z[0])
    U, UD, y, hx = np.empty((n, n, 2)), np.empty((n, n, 2)), np.empty((m, 1, 2)), np.empty((n, 1, 2))
    K, S, used = np.empty((n, m)), np.empty((m, m)), np.empty((n, m, 2))
    innovation, high_z, high_gain = np.empty(m), np.empty(m), np.empty((n, m))
    q, T, size = np.empty(n), np.empty((n, n)), np.empty((n, n))
    HD = np.empty((m, n, 2))
    Phi, H, Q, R = plain
    for step in range(exact_z.shape[0]):
        k = first + step
        copy(exactly, x[step], xe)
        _covariance(form, P[step], Pe, U, UD)
        before = xe[:, 0, 0].copy()
        for i in range(n):
            for j in range(n):
                size[i, j] = math.sqrt(abs(Pe[i, i, 0] * Pe[j, j, 0])) * (1 + 2.0**-50) if form == _UD else Pe[i, j, 0]
        product(exactly, exact_model[0][k % Phi.shape[0]], xe, hx)
        product(exactly, exact_model[2][k % H.shape[0]], hx, y)
        difference(exactly, exact_z[step], y, y)
        found = filter_step(exactly, _INNOVATION, exact_model, k, exact_z[step], xe, Pe, work)
        _symmetrize(Pe)
        _covariance(form, P[step + 1], Pn, U, UD)
        for i in range(n):
            q[i] = subtract(exactly, load(exactly, x[step + 1], (i, 0)), load(exactly, xe, (i, 0)))[0]
            for j in range(n):
                T[i, j] = subtract(exactly, load(exactly, Pn, (i, j)), load(exactly, Pe, (i, j)))[0]
            for j in range(m):
                K[i, j] = work[1][0][i, j, 0]
        for i in range(m):
            innovation[i], high_z[i] = y[i, 0, 0], exact_z[step, i, 0, 0]
            for j in range(m):
                S[i, j] = work[3][0][i, j, 0]
        phi, h = Phi[k % Phi.shape[0]], H[k % H.shape[0]]
        qk, rk = Q[k % Q.shape[0]], R[k % R.shape[0]]
        dq, dT, dK, dinnovation = evaluation_errors(phi, h, qk, rk, before, size, high_z, K, S, unit)
        bound = contraction_step(bound, phi, h, qk, rk, K, S, innovation, q, T, dq, dT, dK, dinnovation)
        if found == 0:
            bound = contraction_start(np.full((n, n), np.inf), np.zeros(n), np.zeros((n, n)))
        if at < checkpoint_steps.shape[0] and checkpoint_steps[at] == k + 1:
            _whole_gain(form, gains[step], exact_model[2][k % H.shape[0]], UR[k % R.shape[0]], used, HD)
            state, covariance = state_error_bound(bound), covariance_error_bound(bound)
            for i in range(n):
                for j in range(m):
                    high_gain[i, j] = used[i, j, 0]
            gain = gain_error_bound(bound, K, high_gain, dK)
            for i in range(n):  # numba compiles an assignment of whole arrays for seconds
                states[at, i] = state[i]
                for j in range(n):
                    covariances[at, i, j] = covariance[i, j]
                for j in range(m):
                    gain_bounds[at, i, j] = gain[i, j]
            at += 1
    return bound
