"""Compiled filter steps in each form, and runs of many steps.

Each function works in every arithmetic of :mod:`gpbnb.arithmetic.kernels.scalar` and releases the interpreter's lock.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.compiling import borrowing, compiled, inner
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
    repeats,
    store,
    subtract,
    zero,
)
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.blocks import (
    number_taken,
    of_covariance,
    of_gain,
    of_innovation,
    of_state,
    taken,
    taken_arrays,
)
from gpbnb.filters.kernels.compensated import compensated_update
from gpbnb.filters.kernels.products import add_transposed, product_by_columns, product_with_units

LARGEST_KEPT = 2**18
"""Largest number of entries of the covariances that a step keeps of a cycle that they have reached."""

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


class StepArrays(NamedTuple):
    """What a step of a filter uses, each with its own cycle of members, as the compiled loops expect it."""

    #: (p, n, n) and its transposed members.
    Phi: NDArray[Any]
    PhiT: NDArray[Any]
    #: (p, m, n) and its transposed members.
    H: NDArray[Any]
    HT: NDArray[Any]
    #: (p, n, n) and (p, m, m).
    Q: NDArray[Any]
    R: NDArray[Any]
    #: (p, m, m), inverses of R, for Hung's form with the second gain.
    RI: NDArray[Any]
    #: (n, n).
    identity: NDArray[Any]
    #: (p, n, n), Phi - I, for compensated summation of the estimate; otherwise (0, n, n).
    increment: NDArray[Any]
    #: (n, 1), rounding error of the estimate, from the previous step and for the next.
    carried: NDArray[Any]
    #: (1,), which of :data:`QUANTITIES` is being computed.
    place: NDArray[np.int64]


class FactorArrays(NamedTuple):
    """What a step of the UD form uses."""

    Phi: NDArray[Any]
    #: (p, m, n) and its transposed members.
    H: NDArray[Any]
    HT: NDArray[Any]
    #: factors of Q and R, with D on the diagonal.
    UQ: NDArray[Any]
    UR: NDArray[Any]
    #: (1,), which of :data:`QUANTITIES` is being computed.
    place: NDArray[np.int64]


class Workspace(NamedTuple):
    """Arrays that a step overwrites; those of one line have the same shape."""

    V: NDArray[Any]
    T: NDArray[Any]
    W: NDArray[Any]
    F: NDArray[Any]
    WT: NDArray[Any]
    #: the gain, (n, m), and others.
    K: NDArray[Any]
    PHt: NDArray[Any]
    B: NDArray[Any]
    #: (m, n).
    KT: NDArray[Any]
    HD: NDArray[Any]
    #: (m, m), the innovation covariance and others.
    S: NDArray[Any]
    SI: NDArray[Any]
    pivots: NDArray[Any]
    #: as a measurement.
    y: NDArray[Any]
    g: NDArray[Any]
    #: as an estimate.
    u: NDArray[Any]
    v: NDArray[Any]


_PREDICTED, _OF_INNOVATION, _INVERSE, _GAIN, _COVARIANCE, _ESTIMATE, _FACTORS = range(len(QUANTITIES))


@borrowing
def _predict_ud(fmt: Any, Phi: Any, UQ: Any, U: Any, W: Any, D: Any, C: Any, T: Any) -> Any:
    """Thornton's modified weighted Gram-Schmidt: overwrite U with the factors of Phi U D U' Phi' + UQ DQ UQ'.

    Returns whether no entry of D is negative, and the variance of each state positive.
    """
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
        definite = definite and sign >= 0
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
    for i in range(n):
        varies = False
        for j in range(i, n):
            adds = i == j or not is_zero(fmt, load(fmt, U, (i, j)))
            varies = varies or (adds and not is_zero(fmt, load(fmt, U, (j, j))))
        definite = definite and varies
    return definite


@borrowing
def _observe_ud(fmt: Any, i: int, h: Any, z: Any, r: Any, x: Any, U: Any, K: Any, F: Any, G: Any) -> Any:
    """Bierman's update by one measurement z of h' x with variance r; its gain becomes column i of K.

    Returns 1 if all variances are positive, -1 if one is not, and 0 if a division by zero ended the update.
    """
    state, gain, covariance, innovation = of_state(fmt), of_gain(fmt), of_covariance(fmt), of_innovation(fmt)
    n = x.shape[0]
    answer = 1
    y = z
    for j in range(n):
        c = number_taken(fmt, state, load(state, h, j))
        if not is_zero(state, c):
            y = subtract(state, y, multiply(state, c, load(state, x, (j, 0))))
    for j in range(n):
        s = zero(innovation)
        for k in range(j):
            c = load(innovation, h, k)
            if not is_zero(innovation, c):
                u = number_taken(fmt, innovation, load(innovation, U, (k, j)))
                s = add(innovation, s, multiply(innovation, u, c))
        s = add(innovation, s, load(innovation, h, j))
        put(innovation, F, (j, 0), s)
        d = number_taken(fmt, innovation, load(innovation, U, (j, j)))
        store(innovation, G, (j, 0), multiply(innovation, d, s))
    a, observed = r, False
    for j in range(n):
        f, g = load(innovation, F, (j, 0)), load(innovation, G, (j, 0))
        before = a
        if not is_zero(innovation, g):
            a = add(innovation, before, multiply(innovation, f, g))
            sign = compare(innovation, a, zero(innovation))
            if sign == 0:
                return 0
            if sign < 0:
                answer = -1
            whole, part = number_taken(fmt, covariance, a), number_taken(fmt, covariance, before)
            d = multiply(covariance, load(covariance, U, (j, j)), part)
            store(covariance, U, (j, j), divide(covariance, d, whole))
            factor = zero(covariance)
            if observed:
                factor = negative(covariance, divide(covariance, number_taken(fmt, covariance, f), part))
            observed = True
            for k in range(j):
                u, c = load(covariance, U, (k, j)), load(gain, K, (k, i))
                if not is_zero(gain, c):
                    moved = multiply(covariance, factor, number_taken(fmt, covariance, c))
                    store(covariance, U, (k, j), add(covariance, u, moved))
                moved = multiply(gain, number_taken(fmt, gain, g), number_taken(fmt, gain, u))
                store(gain, K, (k, i), add(gain, c, moved))
        if compare(covariance, load(covariance, U, (j, j)), zero(covariance)) < 0:
            answer = -1
        put(gain, K, (j, i), number_taken(fmt, gain, g))
    for j in range(n):
        g = divide(gain, load(gain, K, (j, i)), number_taken(fmt, gain, a))
        store(gain, K, (j, i), g)
        step = multiply(state, number_taken(fmt, state, g), y)
        store(state, x, (j, 0), add(state, load(state, x, (j, 0)), step))
    return answer


@borrowing
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


@borrowing
def _subtract_gain(fmt: Any, model: Any, K: Any, hT: Any, KT: Any, T: Any, F: Any, W: Any, own: Any) -> None:
    """W = I - K H in the covariance block; KT becomes K', and T and F are overwritten."""
    covariance = of_covariance(fmt)
    transpose(covariance, taken(fmt, covariance, K, own.tall), KT)
    product_with_units(covariance, taken(fmt, covariance, hT, own.HT), KT, T)
    transpose(covariance, T, F)
    difference(covariance, taken(fmt, covariance, model.identity, own.square), F, W)


@borrowing
def _update_estimate(fmt: Any, model: Any, k: int, z: Any, x: Any, K: Any, work: Any, own: Any) -> None:
    """Overwrite x with the estimate of step k + 1, whose gain is K, in the innovation form or Joseph's."""
    phi, h, state = model.Phi[k % model.Phi.shape[0]], model.H[k % model.H.shape[0]], of_state(fmt)
    if model.increment.shape[0] > 0:
        compensated_update(state, model.increment[k % model.Phi.shape[0]], h, K, z, x, model.carried, work)
    else:
        product_with_units(state, taken(fmt, state, phi, own.Phi), x, work.u)
        product(state, taken(fmt, state, h, own.H), work.u, work.y)
        difference(state, z, work.y, work.g)
        product(state, taken(fmt, state, K, own.tall), work.g, work.v)
        matrix_sum(state, work.u, work.v, x)


@borrowing
def _filter_step(fmt: Any, form: int, model: Any, k: int, z: Any, x: Any, P: Any, work: Any, own: Any) -> Any:
    """Take step k + 1 with the measurement z, and overwrite x and P; the gain stays in the workspace.

    Returns 1 if all variances and pivots are positive, -1 if one is not, and 0 if a pivot is zero; x is then invalid.
    """
    Phi, PhiT, H, HT, Q, R, RI, _identity, increment, _carried, place = model
    V, T, W, F, WT, K, PHt, B, KT, HD, S, SI, pivots, _y, _g, u, v = work
    state, gain, covariance, innovation = of_state(fmt), of_gain(fmt), of_covariance(fmt), of_innovation(fmt)
    phi, h, r = Phi[k % Phi.shape[0]], H[k % H.shape[0]], R[k % R.shape[0]]
    phiT, hT = PhiT[k % Phi.shape[0]], HT[k % H.shape[0]]
    # Products whose right factor is sparse are formed transposed, with the same digits.
    place[0] = _PREDICTED
    own_phi = taken(fmt, covariance, phi, own.Phi)
    product_with_units(covariance, own_phi, P, T)
    transpose(covariance, T, F)
    product_with_units(covariance, own_phi, F, W)
    add_transposed(covariance, taken(fmt, covariance, Q[k % Q.shape[0]], own.square), W)
    transpose(covariance, W, V)
    place[0] = _OF_INNOVATION
    own_h = taken(fmt, innovation, h, own.H)
    product_with_units(innovation, own_h, taken(fmt, innovation, W, own.square), HD)
    transpose(innovation, HD, PHt)
    product(innovation, own_h, PHt, S)
    matrix_sum(innovation, S, taken(fmt, innovation, r, own.small), S)
    place[0] = _INVERSE
    copy(innovation, S, pivots)
    answer = inverse(innovation, pivots, SI)
    if answer != 0:
        place[0] = _GAIN
        transpose(innovation, SI, pivots)
        product_with_units(gain, taken(fmt, gain, pivots, own.small), taken(fmt, gain, HD, own.wide), KT)
        transpose(gain, KT, K)
        place[0] = _COVARIANCE
        _subtract_gain(fmt, model, K, hT, KT, T, F, W, own)
        if form == _JOSEPH:
            transpose(covariance, W, WT)
            product(covariance, W, V, T)
            product(covariance, T, WT, F)
            product_by_sparse(covariance, taken(fmt, covariance, K, own.tall), taken(fmt, covariance, r, own.small), B)
            product(covariance, B, KT, T)
            matrix_sum(covariance, F, T, P)
        else:
            product_by_columns(covariance, W, V, P)
        if form == _HUNG_SECOND_GAIN:
            place[0] = _GAIN
            own_hT = taken(fmt, gain, hT, own.HT)
            product_by_sparse(gain, taken(fmt, gain, P, own.square), own_hT, B)
            product(gain, B, taken(fmt, gain, RI[k % R.shape[0]], own.small), K)
            _subtract_gain(fmt, model, K, hT, KT, T, F, W, own)
        place[0] = _ESTIMATE
        if increment.shape[0] == 0 and form in (_HUNG, _HUNG_SECOND_GAIN):
            transpose(covariance, W, WT)
            product_with_units(state, taken(fmt, state, phiT, own.Phi), taken(fmt, state, WT, own.square), T)
            transpose(state, T, F)
            product(state, F, x, u)
            product(state, taken(fmt, state, K, own.tall), z, v)
            matrix_sum(state, u, v, x)
        else:
            _update_estimate(fmt, model, k, z, x, K, work, own)
        for i in range(x.shape[0]):
            if compare(covariance, load(covariance, P, (i, i)), zero(covariance)) <= 0:
                answer = -1
    return answer


@borrowing
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


@inner
def _least_multiple(model: Any) -> Any:
    """Number of steps after which the matrices of a model repeat."""
    found = 1
    for length in (model.Phi.shape[0], model.H.shape[0], model.Q.shape[0], model.R.shape[0]):
        found *= length // np.gcd(found, length)
    return found


@borrowing
def _equal(fmt: Any, a: Any, b: Any) -> Any:
    """Whether two matrices have the same numbers."""
    for i in range(a.shape[0]):  # covariances that wander differ in their first entries
        for j in range(a.shape[1]):
            if load(fmt, a, (i, j)) != load(fmt, b, (i, j)):
                return False
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
    K, KT, S, y = np.empty_like(model.HT[0]), np.empty_like(model.H[0]), np.empty_like(model.R[0]), z[:1].copy()
    square = np.empty_like(P), np.empty_like(P), np.empty_like(P), np.empty_like(P), np.empty_like(P)
    tall = K, np.empty_like(K), np.empty_like(K), KT, np.empty_like(KT)
    small = S, np.empty_like(S), np.empty_like(S)
    work = Workspace(*square, *tall, *small, y[0], np.empty_like(y[0]), np.empty_like(x), np.empty_like(x))
    own, storing = taken_arrays(P, KT, K, S), of_state(fmt)
    # Once a covariance comes back, a whole number of the model's cycles later, so do all later ones and the gains, and
    # only the estimate is still computed. Each is compared with an earlier one, which is replaced ever more rarely.
    cycle = _least_multiple(model)
    seeks = x0.shape[0] == 0 and form not in (_HUNG, _HUNG_SECOND_GAIN) and repeats(fmt)
    since, lasts, before, returned = 0, cycle, P.copy(), -1
    gains, covariances = model.HT[:0].copy(), model.Phi[:0].copy()
    for step in range(z.shape[0]):
        if returned >= 0 and step >= returned + gains.shape[0]:
            at = (step - returned) % gains.shape[0]
            model.place[0] = _ESTIMATE
            _update_estimate(fmt, model, first + step, z[step], x, gains[at], work, own)
            _record_step(storing, first + step, 1, x, gains[at], covariances[at], kept, notes)
            continue
        if x0.shape[0] > 0:
            copy(storing, x0[step], x)
            copy(storing, P0[step], P)
        answer = _filter_step(fmt, form, model, first + step, z[step], x, P, work, own)
        if x0.shape[0] > 0:
            copy(storing, S, innovation[step])
        if not _record_step(storing, first + step, answer, x, K, P, kept, notes):
            return
        if returned >= 0:
            copy(storing, K, gains[step - returned])
            copy(storing, P, covariances[step - returned])
        elif seeks:
            since += 1
            if since % cycle == 0 and _equal(storing, P, before):
                returned, seeks = step + 1, since * P.size <= LARGEST_KEPT
                if seeks:
                    gains = np.empty((since, *K.shape), K.dtype)
                    covariances = np.empty((since, *P.shape), P.dtype)
                else:
                    returned = -1
            elif since == lasts:
                copy(storing, P, before)
                since, lasts = 0, lasts + cycle * (lasts // (8 * cycle) + 1)
    if returned >= 0 and z.shape[0] > returned + gains.shape[0]:
        copy(storing, covariances[(z.shape[0] - 1 - returned) % gains.shape[0]], P)


@borrowing
def _step_ud(fmt: Any, model: Any, k: int, z: Any, x: Any, U: Any, work: Any, own: Any) -> Any:
    """Take step k + 1 with the measurement z in the UD form, and overwrite x and U; the gain stays in the workspace.

    Returns 1 if all variances are positive, -1 if one is not, and 0 if a division by zero ended the step.
    """
    Phi, H, _HT, UQ, UR, place = model
    K, HD, y, u, v, T, W, D, C = work
    state, covariance, innovation = of_state(fmt), of_covariance(fmt), of_innovation(fmt)
    place[0] = _PREDICTED
    phi = Phi[k % Phi.shape[0]]
    own_phi, uq = taken(fmt, covariance, phi, own.Phi), taken(fmt, covariance, UQ[k % UQ.shape[0]], own.square)
    answer = 1 if _predict_ud(covariance, own_phi, uq, U, W, D, C, T) else -1
    place[0] = _FACTORS
    product(state, taken(fmt, state, phi, own.Phi), x, u)
    copy(state, u, x)
    ur = UR[k % UR.shape[0]]
    decorrelate(state, taken(fmt, state, ur, own.small), z, y)
    ur = taken(fmt, innovation, ur, own.small)
    decorrelate(innovation, ur, taken(fmt, innovation, H[k % H.shape[0]], own.H), HD)
    for i in range(HD.shape[0]):
        if answer != 0:
            measured, variance = load(state, y, (i, 0)), load(innovation, ur, (i, i))
            found = _observe_ud(fmt, i, HD[i], measured, variance, x, U, K, u, v)
            answer = min(answer, found) if found != 0 else 0
    return answer


@compiled
def advance_ud(fmt: Any, model: Any, z: Any, first: int, x: Any, U: Any, kept: Any, notes: Any) -> None:
    """Take one step per row of z in the UD form, like :func:`advance`; U holds the factors of the covariance."""
    if z.shape[0] == 0:
        return
    K, HD, y, u, v = (
        np.empty_like(model.HT[0]),
        np.empty_like(model.H[0]),
        z[:1].copy(),
        np.empty_like(x),
        np.empty_like(x),
    )
    T, W, D, C = np.empty_like(U), np.concatenate((U, U), axis=1), np.concatenate((x, x)), np.concatenate((x, x))
    own, work, storing = taken_arrays(U, HD, K, model.UR[0]), (K, HD, y[0], u, v, T, W, D, C), of_state(fmt)
    for step in range(z.shape[0]):
        answer = _step_ud(fmt, model, first + step, z[step], x, U, work, own)
        if not _record_step(storing, first + step, answer, x, K, U, kept, notes):
            return
