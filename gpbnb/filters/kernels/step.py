"""Compiled filter steps in each form, and runs of many steps.

Each function works in every arithmetic of :mod:`gpbnb.arithmetic.kernels.scalar` and releases the interpreter's lock.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.matrices import (
    copy,
    difference,
    factor_ud,
    inverse,
    is_zero,
    matrix_sum,
    product,
    product_by_sparse,
    transpose,
)
from gpbnb.arithmetic.kernels.scalar import (
    add,
    compare,
    divide,
    load,
    multiply,
    negative,
    one,
    put,
    store,
    subtract,
    zero,
)
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.compensated import compensated_update
from gpbnb.filters.kernels.products import add_transposed, product_by_columns, product_with_units

_HUNG, _HUNG_SECOND_GAIN, _JOSEPH = (int(each) for each in (Form.HUNG, Form.HUNG_SECOND_GAIN, Form.JOSEPH))

#: Entries of a run's status: number of steps done, index of the next checkpoint, first step with a variance or pivot
#: that is not positive, and step at which a division by zero ended the run.
DONE, NEXT_CHECKPOINT, INDEFINITE, STOPPED = range(4)

#: Quantities that a step computes, in this order; an overflow error names one of them.
QUANTITIES = (
    "the predicted covariance",
    "the innovation covariance",
    "its inverse",
    "the gain",
    "the covariance",
    "the estimate",
    "the update of factors and estimate",
)
_PREDICTED, _OF_INNOVATION, _INVERSE, _GAIN, _COVARIANCE, _ESTIMATE, _FACTORS = range(len(QUANTITIES))


@inner
def _predict_ud(fmt: Any, Phi: Any, UQ: Any, U: Any, W: Any, D: Any, C: Any, T: Any) -> Any:
    """Thornton's modified weighted Gram-Schmidt: overwrite U with the factors of Phi U D U' Phi' + UQ DQ UQ'."""
    n = U.shape[0]
    definite = True
    for i in range(n):
        for j in range(n):
            put(fmt, T, (i, j), load(fmt, U, (i, j)) if i < j else one(fmt) if i == j else zero(fmt))
            put(fmt, W, (i, n + j), load(fmt, UQ, (i, j)) if i < j else one(fmt) if i == j else zero(fmt))
        put(fmt, D, (i, 0), load(fmt, U, (i, i)))
        put(fmt, D, (n + i, 0), load(fmt, UQ, (i, i)))
    product(fmt, Phi, T, W[:, :n])
    for j in range(n - 1, -1, -1):
        d = zero(fmt)
        for k in range(2 * n):
            w = load(fmt, W, (j, k))
            if is_zero(fmt, w):
                put(fmt, C, (k, 0), zero(fmt))
            else:
                c = multiply(fmt, load(fmt, D, (k, 0)), w)
                put(fmt, C, (k, 0), c)
                d = add(fmt, d, multiply(fmt, w, c))
        store(fmt, U, (j, j), d)
        sign = compare(fmt, d, zero(fmt))
        definite = definite and sign > 0
        for i in range(j):
            put(fmt, U, (j, i), zero(fmt))
            s = zero(fmt)
            if sign != 0:
                for k in range(2 * n):
                    c = load(fmt, C, (k, 0))
                    if not is_zero(fmt, c):
                        s = add(fmt, s, multiply(fmt, load(fmt, W, (i, k)), c))
                s = divide(fmt, s, d)
            store(fmt, U, (i, j), s)
            if not is_zero(fmt, s):
                for k in range(2 * n):
                    w = load(fmt, W, (j, k))
                    if not is_zero(fmt, w):
                        w = multiply(fmt, s, w)
                        store(fmt, W, (i, k), subtract(fmt, load(fmt, W, (i, k)), w))
    return definite


@inner
def _observe_ud(fmt: Any, i: int, h: Any, z: Any, r: Any, x: Any, U: Any, K: Any, F: Any, G: Any) -> Any:
    """Bierman's update by one measurement z of h' x with variance r; its gain becomes column i of K.

    Returns 1 if all variances are positive, -1 if one is not, and 0 if a division by zero ended the update.
    """
    n = x.shape[0]
    answer = 1
    y = z
    for j in range(n):
        c = load(fmt, h, j)
        if not is_zero(fmt, c):
            y = subtract(fmt, y, multiply(fmt, c, load(fmt, x, (j, 0))))
    for j in range(n):
        s = zero(fmt)
        for k in range(j):
            c = load(fmt, h, k)
            if not is_zero(fmt, c):
                s = add(fmt, s, multiply(fmt, load(fmt, U, (k, j)), c))
        s = add(fmt, s, load(fmt, h, j))
        put(fmt, F, (j, 0), s)
        store(fmt, G, (j, 0), multiply(fmt, load(fmt, U, (j, j)), s))
    a = r
    for j in range(n):
        f, g = load(fmt, F, (j, 0)), load(fmt, G, (j, 0))
        before = a
        if not is_zero(fmt, g):
            a = add(fmt, before, multiply(fmt, f, g))
            sign = compare(fmt, a, zero(fmt))
            if sign == 0:
                return 0
            if sign < 0:
                answer = -1
            store(fmt, U, (j, j), divide(fmt, multiply(fmt, load(fmt, U, (j, j)), before), a))
            factor = negative(fmt, divide(fmt, f, before))
            for k in range(j):
                u, c = load(fmt, U, (k, j)), load(fmt, K, (k, i))
                if not is_zero(fmt, c):
                    store(fmt, U, (k, j), add(fmt, u, multiply(fmt, factor, c)))
                store(fmt, K, (k, i), add(fmt, c, multiply(fmt, g, u)))
        if compare(fmt, load(fmt, U, (j, j)), zero(fmt)) < 0:
            answer = -1
        put(fmt, K, (j, i), g)
    for j in range(n):
        g = divide(fmt, load(fmt, K, (j, i)), a)
        store(fmt, K, (j, i), g)
        store(fmt, x, (j, 0), add(fmt, load(fmt, x, (j, 0)), multiply(fmt, g, y)))
    return answer


@inner
def decorrelate(fmt: Any, UR: Any, a: Any, c: Any) -> None:
    """c = the inverse of U times a, by back substitution, where R = U D U'."""
    for j in range(a.shape[1]):
        for i in range(a.shape[0] - 1, -1, -1):
            s = load(fmt, a, (i, j))
            for k in range(i + 1, a.shape[0]):
                u = load(fmt, UR, (i, k))
                if not is_zero(fmt, u):
                    s = subtract(fmt, s, multiply(fmt, u, load(fmt, c, (k, j))))
            store(fmt, c, (i, j), s)


@compiled
def invert_each(fmt: Any, R: Any, RI: Any) -> Any:
    """RI = the inverse of each R; returns whether all pivots are positive."""
    S = np.empty_like(R[0])
    definite = True
    for k in range(R.shape[0]):
        copy(fmt, R[k], S)
        definite = inverse(fmt, S, RI[k]) > 0 and definite
    return definite


@compiled
def factor_each(fmt: Any, a: Any, U: Any) -> Any:
    """U = the factors of each a; returns whether all are definite."""
    T = np.empty_like(a[0])
    definite = True
    for k in range(a.shape[0]):
        copy(fmt, a[k], T)
        definite = factor_ud(fmt, T, U[k]) and definite
    return definite


@inner
def _subtract_gain(fmt: Any, identity: Any, K: Any, hT: Any, KT: Any, T: Any, F: Any, W: Any) -> None:
    """W = I - K H; KT becomes K', and T and F are overwritten."""
    transpose(fmt, K, KT)
    product_with_units(fmt, hT, KT, T)
    transpose(fmt, T, F)
    difference(fmt, identity, F, W)


@inner(inline="always")
def _filter_step(fmt: Any, form: int, model: Any, k: int, z: Any, x: Any, P: Any, work: Any) -> Any:
    """Take step k + 1 with the measurement z, and overwrite x and P; the gain stays in the workspace.

    Returns 1 if all variances and pivots are positive, -1 if one is not, and 0 if a pivot is zero; x is then invalid.
    """
    Phi, PhiT, H, HT, Q, R, RI, identity, increment, carried, place = model
    V, T, W, F, WT, K, PHt, B, KT, HD, S, SI, pivots, y, g, u, v = work
    phi, h, r = Phi[k % Phi.shape[0]], H[k % H.shape[0]], R[k % R.shape[0]]
    phiT, hT = PhiT[k % Phi.shape[0]], HT[k % H.shape[0]]
    # Products whose right factor is sparse are formed transposed, with the same digits.
    place[0] = _PREDICTED
    product_with_units(fmt, phi, P, T)
    transpose(fmt, T, F)
    product_with_units(fmt, phi, F, W)
    add_transposed(fmt, Q[k % Q.shape[0]], W)
    transpose(fmt, W, V)
    place[0] = _OF_INNOVATION
    product_with_units(fmt, h, W, HD)
    transpose(fmt, HD, PHt)
    product(fmt, h, PHt, S)
    matrix_sum(fmt, S, r, S)
    place[0] = _INVERSE
    copy(fmt, S, pivots)
    answer = inverse(fmt, pivots, SI)
    if answer != 0:
        place[0] = _GAIN
        transpose(fmt, SI, pivots)
        product_with_units(fmt, pivots, HD, KT)
        transpose(fmt, KT, K)
        place[0] = _COVARIANCE
        _subtract_gain(fmt, identity, K, hT, KT, T, F, W)
        if form == _JOSEPH:
            transpose(fmt, W, WT)
            product(fmt, W, V, T)
            product(fmt, T, WT, F)
            product_by_sparse(fmt, K, r, B)
            product(fmt, B, KT, T)
            matrix_sum(fmt, F, T, P)
        else:
            product_by_columns(fmt, W, V, P)
        if form == _HUNG_SECOND_GAIN:
            place[0] = _GAIN
            product_by_sparse(fmt, P, hT, B)
            product(fmt, B, RI[k % R.shape[0]], K)
            _subtract_gain(fmt, identity, K, hT, KT, T, F, W)
        place[0] = _ESTIMATE
        if increment.shape[0] > 0:
            compensated_update(fmt, increment[k % Phi.shape[0]], h, K, z, x, carried, v, u, y, g)
        else:
            if form in (_HUNG, _HUNG_SECOND_GAIN):
                transpose(fmt, W, WT)
                product_with_units(fmt, phiT, WT, T)
                transpose(fmt, T, F)
                product(fmt, F, x, u)
                product(fmt, K, z, v)
            else:
                product_with_units(fmt, phi, x, u)
                product(fmt, h, u, y)
                difference(fmt, z, y, g)
                product(fmt, K, g, v)
            matrix_sum(fmt, u, v, x)
        for i in range(x.shape[0]):
            if compare(fmt, load(fmt, P, (i, i)), zero(fmt)) <= 0:
                answer = -1
    return answer


@inner
def _record_step(fmt: Any, k: int, answer: int, x: Any, K: Any, P: Any, kept: Any, notes: Any) -> Any:
    """Record the result of step k + 1 if it is a checkpoint step; return whether the run continues."""
    checkpoint_steps, X, G, C = kept
    if answer == 0:
        notes[STOPPED] = k + 1
        return False
    if answer < 0 and notes[INDEFINITE] == 0:
        notes[INDEFINITE] = k + 1
    notes[DONE] = k + 1
    at = notes[NEXT_CHECKPOINT]
    if at < checkpoint_steps.shape[0] and checkpoint_steps[at] == k + 1:
        copy(fmt, x, X[at])
        copy(fmt, K, G[at])
        copy(fmt, P, C[at])
        notes[NEXT_CHECKPOINT] += 1
    return True


@compiled
def advance(
    fmt: Any, form: int, model: Any, z: Any, first: int, x: Any, P: Any, repeated: Any, kept: Any, notes: Any
) -> None:
    """Take one step per row of z, in any form except UD.

    Parameters
    ----------
    first : number of steps taken before.
    x, P : state and covariance, before the first step and after the last.
    repeated : to start every step from a given state (steps, n, 1) and covariance (steps, n, n), both of them, and an
        array (steps, m, m) for the innovation covariances; otherwise empty arrays.
    kept : checkpoint steps, and arrays for the state, gain and covariance at each of them.
    notes : status of the run.
    """
    if z.shape[0] == 0:
        return
    x0, P0, innovation = repeated
    K, KT, S, y = np.empty_like(model[3][0]), np.empty_like(model[2][0]), np.empty_like(model[5][0]), z[:1].copy()
    square = np.empty_like(P), np.empty_like(P), np.empty_like(P), np.empty_like(P), np.empty_like(P)
    tall = K, np.empty_like(K), np.empty_like(K), KT, np.empty_like(KT)
    small = S, np.empty_like(S), np.empty_like(S)
    work = (*square, *tall, *small, y[0], np.empty_like(y[0]), np.empty_like(x), np.empty_like(x))
    for step in range(z.shape[0]):
        if x0.shape[0] > 0:
            copy(fmt, x0[step], x)
            copy(fmt, P0[step], P)
        answer = _filter_step(fmt, form, model, first + step, z[step], x, P, work)
        if x0.shape[0] > 0:
            copy(fmt, S, innovation[step])
        if not _record_step(fmt, first + step, answer, x, K, P, kept, notes):
            return


@compiled
def advance_ud(fmt: Any, model: Any, z: Any, first: int, x: Any, U: Any, kept: Any, notes: Any) -> None:
    """Take one step per row of z in the UD form, like :func:`advance`; U holds the factors of the covariance."""
    if z.shape[0] == 0:
        return
    Phi, H, HT, UQ, UR, place = model
    K, HD, y, u, v = np.empty_like(HT[0]), np.empty_like(H[0]), z[:1].copy(), np.empty_like(x), np.empty_like(x)
    T, W, D, C = np.empty_like(U), np.concatenate((U, U), axis=1), np.concatenate((x, x)), np.concatenate((x, x))
    for step in range(z.shape[0]):
        k = first + step
        place[0] = _PREDICTED
        phi = Phi[k % Phi.shape[0]]
        answer = 1 if _predict_ud(fmt, phi, UQ[k % UQ.shape[0]], U, W, D, C, T) else -1
        place[0] = _FACTORS
        product(fmt, phi, x, u)
        copy(fmt, u, x)
        ur = UR[k % UR.shape[0]]
        decorrelate(fmt, ur, H[k % H.shape[0]], HD)
        decorrelate(fmt, ur, z[step], y[0])
        for i in range(HD.shape[0]):
            if answer != 0:
                found = _observe_ud(fmt, i, HD[i], load(fmt, y[0], (i, 0)), load(fmt, ur, (i, i)), x, U, K, u, v)
                answer = min(answer, found) if found != 0 else 0
        if not _record_step(fmt, k, answer, x, K, U, kept, notes):
            return
