"""Compiled: a run with its contraction bound, each step repeated in double-double."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from gpbnb.arithmetic.kernels import doubledouble
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.matrices import (
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
from gpbnb.kalman.kernels.step import NEXT_CHECKPOINT, decorrelate, filter_step, record_step, workspace

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


@njit(nogil=True)
def _widen(fmt: Any, form: int, a: Any, c: Any, U: Any, UD: Any) -> None:
    """c = the symmetric part, in double-double, of a covariance, or what its factors in a stand for."""
    exactly, n = DoubleDouble(), a.shape[0]
    half = (0.5, 0.0)
    if form == _UD:
        for i in range(n):
            for j in range(n):
                d = widened(fmt, load(fmt, a, (j, j)))
                u = widened(fmt, load(fmt, a, (i, j))) if i < j else one(exactly) if i == j else zero(exactly)
                put(exactly, U, (j, i), u)
                put(exactly, UD, (i, j), multiply(exactly, u, d))
        product(exactly, UD, U, c)
        return
    for i in range(n):
        for j in range(i + 1):
            x = add(exactly, widened(fmt, load(fmt, a, (i, j))), widened(fmt, load(fmt, a, (j, i))))
            x = multiply(exactly, x, half)
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
def _whole_gain(fmt: Any, form: int, K: Any, H: Any, UR: Any, c: Any, HD: Any, U: Any) -> None:
    """c = the gain of a step, in double-double; of UD, from those of one measurement after the other."""
    n, m = K.shape[0], K.shape[1]
    exactly = DoubleDouble()
    for i in range(n):
        for j in range(m):
            put(exactly, c, (i, j), widened(fmt, load(fmt, K, (i, j))))
    if form != _UD:
        return
    for i in range(m):
        for j in range(m):
            put(exactly, U, (i, j), widened(fmt, load(fmt, UR, (i, j))))
    decorrelate(exactly, U, H, HD)
    for i in range(m):
        for j in range(i):
            s = zero(exactly)
            for k in range(n):
                s = add(exactly, s, multiply(exactly, load(exactly, HD, (i, k)), load(exactly, c, (k, j))))
            for k in range(n):
                x = multiply(exactly, widened(fmt, load(fmt, K, (k, i))), s)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))
    for j in range(1, m):
        for i in range(j):
            u = load(exactly, U, (i, j))
            for k in range(n):
                x = multiply(exactly, load(exactly, c, (k, i)), u)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))


@compiled
def advance_bounded(
    fmt: Any,
    form: int,
    model: Any,
    exact_model: Any,
    plain: Any,
    z: Any,
    exact_z: Any,
    first: int,
    x: Any,
    P: Any,
    bound: Any,
    checkpoint_steps: Any,
    outputs: Any,
    bounds: Any,
    notes: Any,
) -> Any:
    """Go on as :func:`advance` does, and take the contraction bound along; returns it.

    Each step is repeated in double-double from where the run stood: its residuals enter the bound.
    """
    exactly, unit = DoubleDouble(), 2.0**-100
    (X, G, C), (states, gains, covariances) = outputs, bounds
    n, m = x.shape[0], z.shape[1]
    work = workspace(x, P, model[3][0], model[2][0], model[5][0], z[0])
    xe, Pe, xn = np.empty((n, 1, 2)), np.empty((n, n, 2)), np.empty((n, n, 2))
    exact_work = workspace(xe, Pe, exact_model[3][0], exact_model[2][0], exact_model[5][0], exact_z[0])
    U, UD, y, hx = np.empty((n, n, 2)), np.empty((n, n, 2)), np.empty((m, 1, 2)), np.empty((n, 1, 2))
    K, S, innovation, used = np.empty((n, m)), np.empty((m, m)), np.empty(m), np.empty((n, m, 2))
    q, T, size = np.empty(n), np.empty((n, n)), np.empty((n, n))
    HD, UR = np.empty((m, n, 2)), np.empty((m, m, 2))
    Phi, H, Q, R = plain
    for step in range(z.shape[0]):
        k = first + step
        for i in range(n):
            put(exactly, xe, (i, 0), widened(fmt, load(fmt, x, (i, 0))))
        _widen(fmt, form, P, Pe, U, UD)
        before = xe[:, 0, 0].copy()
        for i in range(n):
            for j in range(n):
                size[i, j] = math.sqrt(abs(Pe[i, i, 0] * Pe[j, j, 0])) * (1 + 2.0**-50) if form == _UD else Pe[i, j, 0]
        product(exactly, exact_model[0][k % Phi.shape[0]], xe, hx)
        product(exactly, exact_model[2][k % H.shape[0]], hx, y)
        difference(exactly, exact_z[step], y, y)
        found = filter_step(exactly, _INNOVATION, exact_model, k, exact_z[step], xe, Pe, exact_work)
        _symmetrize(Pe)
        answer = filter_step(fmt, form, model, k, z[step], x, P, work)
        at = notes[NEXT_CHECKPOINT]
        is_checkpoint = at < checkpoint_steps.shape[0] and checkpoint_steps[at] == k + 1
        if not record_step(fmt, k, answer, x, work[1][0], P, checkpoint_steps, X, G, C, notes):
            return bound
        _widen(fmt, form, P, xn, U, UD)
        for i in range(n):
            q[i] = subtract(exactly, widened(fmt, load(fmt, x, (i, 0))), load(exactly, xe, (i, 0)))[0]
            for j in range(n):
                T[i, j] = subtract(exactly, load(exactly, xn, (i, j)), load(exactly, Pe, (i, j)))[0]
            for j in range(m):
                K[i, j] = exact_work[1][0][i, j, 0]
        for i in range(m):
            innovation[i] = y[i, 0, 0]
            for j in range(m):
                S[i, j] = exact_work[3][0][i, j, 0]
        phi, h = Phi[k % Phi.shape[0]], H[k % H.shape[0]]
        qk, rk = Q[k % Q.shape[0]], R[k % R.shape[0]]
        dq, dT, dK, dinnovation = evaluation_errors(phi, h, qk, rk, before, size, exact_z[step, :, 0, 0], K, S, unit)
        bound = contraction_step(bound, phi, h, qk, rk, K, S, innovation, q, T, dq, dT, dK, dinnovation)
        if found == 0:
            bound = contraction_start(np.full((n, n), np.inf), np.zeros(n), np.zeros((n, n)))
        if is_checkpoint:
            hk, ur = exact_model[2][k % H.shape[0]], model[8][k % R.shape[0]]
            _whole_gain(fmt, form, work[1][0], hk, ur, used, HD, UR)
            states[at] = state_error_bound(bound)
            covariances[at] = covariance_error_bound(bound)
            gains[at] = gain_error_bound(bound, K, used[:, :, 0], dK)
    return bound
