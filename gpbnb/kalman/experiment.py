"""What does happen: a Kalman filter with each of its operations rounded, beside the same in double-double.

The filter is written once, for every arithmetic of :mod:`gpbnb.arithmetic.kernels.scalar`, and releases the
interpreter's lock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from fractions import Fraction
from functools import cached_property
from typing import Any, cast

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import doubledouble
from gpbnb.arithmetic.kernels.backends import Compiled, double_doubles
from gpbnb.arithmetic.kernels.matrices import (
    copy,
    difference,
    factor_ud,
    inverse,
    is_zero,
    product,
    product_by_sparse,
    total,
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
from gpbnb.arithmetic.kernels.tags import Decimal, DoubleDouble, ShortDecimal, Tag
from gpbnb.kalman.model import LinearModel, factor
from gpbnb.kalman.theory import (
    contraction_start,
    contraction_step,
    covariance_error_bound,
    evaluation_errors,
    gain_error_bound,
    state_error_bound,
)


class Form(IntEnum):
    r"""How one step is computed; all are the same in exact arithmetic. P_p is the predicted covariance (100).

    ========  ===========================================================================================
    form      gain, covariance, estimate
    ========  ===========================================================================================
    REPORT    the first form of (99); :math:`(I - KH)P_p`; (111) with (109) and (110)
    SECOND    the same, but the estimate takes :math:`P H^T R^{-1}`, the second form of (99), with the new P
    USUAL     the first form of (99); :math:`(I - KH)P_p`; (98), by the innovation
    JOSEPH    as USUAL, but :math:`(I - KH)P_p(I - KH)^T + KRK^T`
    UD        Thornton's and Bierman's recursions of the factors of :math:`P = UDU^T`
    ========  ===========================================================================================

    References
    ----------
    hung1984, ch. II, eqs. (98)-(101), (109)-(111); Bierman 1977, ch. V, VI.
    """

    REPORT = 0
    SECOND = 1
    USUAL = 2
    JOSEPH = 3
    UD = 4

    def __str__(self) -> str:
        return _NAMES[self]


_NAMES = {
    Form.REPORT: "report",
    Form.SECOND: "report, second gain",
    Form.USUAL: "innovation",
    Form.JOSEPH: "Joseph",
    Form.UD: "UD",
}
_REPORT, _SECOND, _USUAL, _JOSEPH, _UD = (int(each) for each in Form)

# Places in the notes that a compiled run leaves: steps done, the next mark, the first step at which a variance or pivot
# was not positive, and the step at which a division by zero ended the run.
_DONE, _MARK, _INDEFINITE, _STOPPED = range(4)


# -- compiled -----------------------------------------------------------------------------------------


@njit(nogil=True)
def _predict_ud(fmt: Any, Phi: Any, UQ: Any, U: Any, W: Any, D: Any, C: Any, T: Any) -> Any:
    """Thornton's modified weighted Gram-Schmidt: the factors of Phi U D U' Phi' + UQ DQ UQ', in place of U."""
    n = U.shape[0]
    fine = True
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
        fine = fine and sign > 0
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
    return fine


@njit(nogil=True)
def _observe_ud(fmt: Any, i: int, h: Any, z: Any, r: Any, x: Any, U: Any, K: Any, F: Any, G: Any) -> Any:
    """Bierman's update by one measurement z of h' x with variance r; its gain becomes column i of K.

    Returns 1 if all variances are positive, -1 if one is not, 0 if a division by zero ended it.
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


@njit(nogil=True)
def _decorrelated(fmt: Any, UR: Any, a: Any, c: Any) -> None:
    """c = the inverse of U times a, by back substitution, U being that of R = U D U'."""
    for j in range(a.shape[1]):
        for i in range(a.shape[0] - 1, -1, -1):
            s = load(fmt, a, (i, j))
            for k in range(i + 1, a.shape[0]):
                u = load(fmt, UR, (i, k))
                if not is_zero(fmt, u):
                    s = subtract(fmt, s, multiply(fmt, u, load(fmt, c, (k, j))))
            store(fmt, c, (i, j), s)


@njit(cache=True, nogil=True)
def prepare(fmt: Any, form: int, Q: Any, R: Any, P: Any, RI: Any, UQ: Any, UR: Any) -> Any:
    """What a form needs beside the model, computed in its arithmetic: the inverses of R, the factors of Q, R and P."""
    T, S = np.empty_like(P), np.empty_like(R[0])
    fine = True
    if form == _SECOND:
        for k in range(R.shape[0]):
            copy(fmt, R[k], S)
            fine = inverse(fmt, S, RI[k]) > 0 and fine
    if form == _UD:
        for k in range(Q.shape[0]):
            copy(fmt, Q[k], T)
            fine = factor_ud(fmt, T, UQ[k]) and fine
        for k in range(R.shape[0]):
            copy(fmt, R[k], S)
            fine = factor_ud(fmt, S, UR[k]) and fine
        copy(fmt, P, T)
        fine = factor_ud(fmt, T, P) and fine
    return fine


@njit(nogil=True)
def _workspace(x: Any, P: Any, K: Any, KT: Any, R: Any, y: Any) -> Any:
    """Matrices for what a step computes on its way."""
    square = np.empty_like(P), np.empty_like(P), np.empty_like(P), np.empty_like(P), np.empty_like(P)
    tall = np.empty_like(K), np.empty_like(K), np.empty_like(K)
    small = np.empty_like(R), np.empty_like(R), np.empty_like(R)
    stacked = np.concatenate((P, P), axis=1), np.concatenate((x, x)), np.concatenate((x, x))
    columns = np.empty_like(y), np.empty_like(y), np.empty_like(x), np.empty_like(x)
    return square, tall, (np.empty_like(KT), np.empty_like(KT)), small, columns, stacked


@njit(nogil=True)
def _step(fmt: Any, form: int, model: Any, k: int, z: Any, x: Any, P: Any, work: Any) -> Any:
    """Take step k + 1, from x and P to x and P, with the measurement z; the gain is left in the workspace.

    Returns 1 if all variances and pivots are positive, -1 if one is not, 0 if one is zero: x is then void.
    """
    Phi, PhiT, H, HT, Q, R, RI, UQ, UR, identity = model
    (V, T, W, F, WT), (K, PHt, B), (KT, HD), (S, SI, pivots), (y, g, u, v), stacked = work
    phi, h, r = Phi[k % Phi.shape[0]], H[k % H.shape[0]], R[k % R.shape[0]]
    phiT, hT = PhiT[k % Phi.shape[0]], HT[k % H.shape[0]]
    answer = 1
    if form == _UD:
        if not _predict_ud(fmt, phi, UQ[k % Q.shape[0]], P, stacked[0], stacked[1], stacked[2], T):
            answer = -1
        product(fmt, phi, x, u)
        copy(fmt, u, x)
        ur = UR[k % R.shape[0]]
        _decorrelated(fmt, ur, h, HD)
        _decorrelated(fmt, ur, z, y)
        for i in range(z.shape[0]):
            found = _observe_ud(fmt, i, HD[i], load(fmt, y, (i, 0)), load(fmt, ur, (i, i)), x, P, K, u, v)
            if found == 0:
                return 0
            answer = min(answer, found)
        return answer
    product(fmt, phi, P, T)
    product_by_sparse(fmt, T, phiT, V)
    total(fmt, V, Q[k % Q.shape[0]], V)
    product_by_sparse(fmt, V, hT, PHt)
    product(fmt, h, PHt, S)
    total(fmt, S, r, S)
    copy(fmt, S, pivots)
    answer = inverse(fmt, pivots, SI)
    if answer == 0:
        return 0
    product(fmt, PHt, SI, K)
    product_by_sparse(fmt, K, h, T)
    difference(fmt, identity, T, W)
    if form == _JOSEPH:
        transpose(fmt, W, WT)
        product(fmt, W, V, T)
        product(fmt, T, WT, F)
        transpose(fmt, K, KT)
        product_by_sparse(fmt, K, r, B)
        product(fmt, B, KT, T)
        total(fmt, F, T, P)
    else:
        product(fmt, W, V, P)
    if form == _SECOND:
        product_by_sparse(fmt, P, hT, B)
        product(fmt, B, RI[k % R.shape[0]], K)
        product_by_sparse(fmt, K, h, T)
        difference(fmt, identity, T, W)
    if form in (_REPORT, _SECOND):
        product_by_sparse(fmt, W, phi, F)
        product(fmt, F, x, u)
        product(fmt, K, z, v)
    else:
        product(fmt, phi, x, u)
        product(fmt, h, u, y)
        difference(fmt, z, y, g)
        product(fmt, K, g, v)
    total(fmt, u, v, x)
    for i in range(x.shape[0]):
        if compare(fmt, load(fmt, P, (i, i)), zero(fmt)) <= 0:
            answer = -1
    return answer


@njit(nogil=True)
def _note(fmt: Any, k: int, answer: int, x: Any, K: Any, P: Any, marks: Any, X: Any, G: Any, C: Any, notes: Any) -> Any:
    """Keep what step k + 1 gave, if it is marked; returns whether the run goes on."""
    if answer == 0:
        notes[_STOPPED] = k + 1
        return False
    if answer < 0 and notes[_INDEFINITE] == 0:
        notes[_INDEFINITE] = k + 1
    notes[_DONE] = k + 1
    at = notes[_MARK]
    if at < marks.shape[0] and marks[at] == k + 1:
        copy(fmt, x, X[at])
        copy(fmt, K, G[at])
        copy(fmt, P, C[at])
        notes[_MARK] += 1
    return True


@njit(cache=True, nogil=True)
def advance(
    fmt: Any, form: int, model: Any, z: Any, first: int, x: Any, P: Any, marks: Any, X: Any, G: Any, C: Any, notes: Any
) -> None:
    """Go on from the step `first` by as many as z has; at the marked steps, keep x, the gain and P in X, G and C."""
    if z.shape[0] == 0:
        return
    work = _workspace(x, P, model[3][0], model[2][0], model[5][0], z[0])
    for step in range(z.shape[0]):
        answer = _step(fmt, form, model, first + step, z[step], x, P, work)
        if not _note(fmt, first + step, answer, x, work[1][0], P, marks, X, G, C, notes):
            return


@njit(cache=True, nogil=True)
def _measured(Phi: Any, H: Any, process: Any, noise: Any, first: int, w: Any, v: Any, x: Any, z: Any) -> None:
    """Move the truth x by Phi and roots of Q times w, and measure it by H and roots of R times v."""
    n, m = x.shape[0], z.shape[1]
    u = np.empty(n)
    for step in range(z.shape[0]):
        k = first + step
        phi, h = Phi[k % Phi.shape[0]], H[k % H.shape[0]]
        q, r = process[k % process.shape[0]], noise[k % noise.shape[0]]
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += phi[i, j] * x[j]
            for j in range(i + 1):
                s += q[i, j] * w[step, j]
            u[i] = s
        for i in range(n):
            x[i] = u[i]
        for i in range(m):
            s = 0.0
            for j in range(n):
                s += h[i, j] * x[j]
            for j in range(i + 1):
                s += r[i, j] * v[step, j]
            z[step, i] = s


# -- measurements -------------------------------------------------------------------------------------

#: Steps whose noise one seeded generator draws, so that a run may begin again at any block.
BLOCK = 4096


@dataclass(frozen=True, eq=False)
class Simulation:
    """Measurements of a simulated truth, block by block, the same on every run.

    Parameters
    ----------
    model : says how the truth moves and is measured.
    start : (n,), the truth at step 0.
    seed : of the noise; block b is drawn by ``default_rng([seed, b])``.
    resolution : measurements are rounded to its multiples, as by an analogue-to-digital converter.
    """

    model: LinearModel
    start: tuple[float, ...]
    seed: int
    resolution: float

    def __post_init__(self) -> None:
        if len(self.start) != self.model.n:
            raise ValueError(f"got a start of {len(self.start)} numbers; needed {self.model.n}, one a state")
        if not 0 < self.resolution < math.inf:
            raise ValueError(f"got resolution {self.resolution}; needed a number above 0")

    @cached_property
    def _given(self) -> tuple[NDArray[np.float64], ...]:
        given = self.model.to_float()
        roots = (np.array([_root(each) for each in covariances]) for covariances in (self.model.Q, self.model.R))
        return given["Phi"], given["H"], *roots

    def block(
        self, number: int, truth: NDArray[np.float64], steps: int = BLOCK
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Measurements of at most 4096 steps after `number` blocks, given the truth there.

        Returns
        -------
        z : (steps, m), multiples of the resolution.
        truth : (n,), after these steps.
        """
        rng = np.random.default_rng([self.seed, number])
        w = rng.standard_normal((BLOCK, self.model.n))
        v = rng.standard_normal((BLOCK, self.model.m))
        x, z = np.array(truth, dtype=np.float64), np.empty((min(steps, BLOCK), self.model.m))
        _measured(*self._given, number * BLOCK, w, v, x, z)
        return np.rint(z / self.resolution) * self.resolution, x

    def measurements(self, steps: int) -> NDArray[np.float64]:
        """The first measurements, (steps, m)."""
        truth, blocks = np.array(self.start, dtype=np.float64), [np.empty((0, self.model.m))]
        for number in range(-(-steps // BLOCK)):
            z, truth = self.block(number, truth, steps - number * BLOCK)
            blocks.append(z)
        return np.concatenate(blocks)


def _root(covariance: NDArray[Any]) -> NDArray[np.float64]:
    """A square root, by plain float64 operations that are the same everywhere."""
    lower, d = factor(covariance)
    return lower.astype(np.float64) * np.sqrt(d.astype(np.float64))


# -- runs ---------------------------------------------------------------------------------------------


class Run:
    """A filter on its way: what it has been told, where it is, and what it kept at the marked steps.

    Parameters
    ----------
    model : n states, m measurements.
    fmt : the format in which all of it is stored and computed; None for double-double.
    form : how a step is computed.
    marks : steps, 1 or more, after which estimate, gain and covariance are kept, in rising order.

    Raises
    ------
    ValueError : a format without compiled loops; marks that do not rise.
    OverflowError : the model has entries beyond the range of the format's backend.
    """

    def __init__(self, model: LinearModel, fmt: FloatFormat | None, form: Form, marks: Sequence[int]) -> None:
        self.model, self.fmt, self.form = model, fmt, Form(form)
        self.marks = np.array(marks, dtype=np.int64).reshape(-1)
        if np.any(np.diff(self.marks, prepend=0) <= 0):
            raise ValueError(f"got marks {list(marks)[:5]} …; needed steps of 1 or more, each above the one before")
        if fmt is not None and not isinstance(fmt.backend, Compiled):
            raise ValueError(
                f"got {fmt}; needed a format with compiled loops: base 2 up to 53 digits, 10 up to 18 or 16 up to 13"
            )
        Phi, H, Q, R = (self._packed(each) for each in (model.Phi, model.H, model.Q, model.R))
        PhiT, HT = (np.ascontiguousarray(np.swapaxes(each, 1, 2)) for each in (Phi, H))
        n, m, count = model.n, model.m, len(self.marks)
        identity = self._packed(np.array([[Fraction(int(i == j)) for j in range(n)] for i in range(n)], dtype=object))
        self.x, self.P = self._packed(model.x0.reshape(n, 1)), self._packed(model.P0)
        RI, self.UQ, self.UR = np.zeros_like(R), np.zeros_like(Q), np.zeros_like(R)
        self.X, self.G, self.C = (
            np.zeros((count, *shape, *self.x.shape[2:]), self.x.dtype) for shape in ((n, 1), (n, m), (n, n))
        )
        self.notes = np.zeros(4, dtype=np.int64)
        try:
            fine = prepare(self.tag, int(form), Q, R, self.P, RI, self.UQ, self.UR)
        except ZeroDivisionError:
            fine = False
        if not fine:
            raise ValueError(
                f"got {model.name} in {fmt}; needed covariances that stay definite when their factors are computed in "
                "this format; use more digits, or add a little to the diagonals of Q and P0"
            )
        self._parts = (Phi, PhiT, H, HT, Q, R, RI, self.UQ, self.UR, identity)

    @property
    def tag(self) -> Tag:
        return DoubleDouble() if self.fmt is None else cast(Compiled, self.fmt.backend).tag

    @property
    def steps(self) -> int:
        """How many steps are done."""
        return int(self.notes[_DONE])

    @property
    def indefinite(self) -> int | None:
        """The first step at which a variance or a pivot of the innovation covariance was not positive."""
        return int(self.notes[_INDEFINITE]) or None

    @property
    def stopped(self) -> int | None:
        """The step that a division by zero, or a number beyond the range of the backend, ended."""
        return int(self.notes[_STOPPED]) or None

    def take(self, z: Any) -> None:
        """Go on by as many steps as there are measurements, (steps, m); a run that has stopped stays where it is."""
        if np.ndim(z) != 2 or np.shape(z)[1] != self.model.m:
            raise ValueError(f"got measurements of shape {np.shape(z)}; needed (steps, {self.model.m})")
        if self.stopped:
            return
        packed = self._packed(z)
        packed = packed.reshape(len(packed), self.model.m, 1, *packed.shape[2:])
        kept = (self.marks, self.X, self.G, self.C, self.notes)
        try:
            advance(self.tag, int(self.form), self._parts, packed, self.steps, self.x, self.P, *kept)
        except (OverflowError, ZeroDivisionError):
            self.notes[_STOPPED] = self.steps + 1

    def _packed(self, values: Any) -> NDArray[Any]:
        """Numbers, each rounded into the format, as the compiled loops take them."""
        if self.fmt is None:
            entries = np.asarray(values)
            if entries.dtype == np.float64:
                if not np.isfinite(entries).all():
                    raise ValueError("got measurements with NaN or infinity; needed finite numbers")
                return np.stack([entries, np.zeros_like(entries)], axis=-1)
            return double_doubles(entries)
        array = self.fmt.array(values)
        if not isinstance(array.backend, Compiled):
            raise OverflowError(
                f"got numbers beyond the range of the compiled loops of {self.fmt}; scale the states, or use base 10"
            )
        return array.backend.pack(array.components)

    def exactly(self, packed: NDArray[Any]) -> NDArray[Any]:
        """Exact Fractions of what the compiled loops gave."""
        if self.fmt is None:
            high, low = (part.astype(object) for part in (packed[..., 0], packed[..., 1]))
            return np.asarray(np.frompyfunc(lambda h, s: Fraction(h) + Fraction(s), 2, 1)(high, low), dtype=object)
        backend = cast(Compiled, self.fmt.backend)
        return np.asarray(
            FloatArray.from_components(backend, backend.unpack(packed), self.fmt).to_fractions(), dtype=object
        )

    def kept(self) -> Kept:
        """Estimate, gain and covariance at the marked steps that were reached."""
        count = int(self.notes[_MARK])
        x, K, P = (self.exactly(each[:count]) for each in (self.X, self.G, self.C))
        if self.form is Form.UD:
            K, P = self._from_factors(K, P)
        return Kept(tuple(int(mark) for mark in self.marks[:count]), x[..., 0], K, P)

    def _from_factors(self, K: NDArray[Any], U: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Gains and covariances that the factors, and the gains of one measurement after the other, stand for."""
        gains, covariances = np.empty_like(K), np.empty_like(U)
        H, UR, n = self.exactly(self._parts[2]), self.exactly(self.UR), self.model.n
        unit = np.array([[Fraction(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)
        for at, step in enumerate(self.marks[: len(K)] - 1):
            h, ur = H[step % len(H)], UR[step % len(UR)]
            upper = np.triu(ur, 1) + np.array([[Fraction(int(i == j)) for j in range(len(ur))] for i in range(len(ur))])
            inverse_upper = _unit_upper_inverse(upper)
            rows = inverse_upper @ h
            whole = K[at].copy()
            for i in range(self.model.m):
                for j in range(i):
                    whole[:, j] -= K[at][:, i] * (rows[i] @ whole[:, j])
            gains[at] = whole @ inverse_upper
            d = U[at].diagonal()
            triangle = np.triu(U[at], 1) + unit
            covariances[at] = (triangle * d) @ triangle.T
        return gains, covariances


def _unit_upper_inverse(upper: NDArray[Any]) -> NDArray[Any]:
    m = len(upper)
    result = np.array([[Fraction(int(i == j)) for j in range(m)] for i in range(m)], dtype=object)
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            result[i] = result[i] - upper[i, k] * result[k]
    return result


@dataclass(frozen=True, eq=False)
class Kept:
    """Exact values after some steps, object arrays of Fractions: x (c, n), K (c, n, m), P (c, n, n)."""

    steps: tuple[int, ...]
    x: NDArray[Any]
    K: NDArray[Any]
    P: NDArray[Any]


@dataclass(frozen=True, eq=False)
class History:
    """Errors of a rounded run, against the reference, after some steps.

    Parameters
    ----------
    steps : (c,), those that were reached.
    state : (c, n), estimate minus reference, in the units of the states.
    gain, covariance : (c, n, m) and (c, n, n), likewise.
    reference : of the same steps.
    indefinite : the first step at which a variance or a pivot of the innovation covariance was not positive, if any.
    stopped : the step that a division by zero, or a number beyond the backend's range, ended, if any.
    """

    model: LinearModel
    fmt: FloatFormat
    form: Form
    steps: NDArray[np.int64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]
    reference: Kept
    indefinite: int | None
    stopped: int | None

    @property
    def state_norm(self) -> NDArray[np.float64]:
        """Largest entry of the error of the estimate, (c,); the norm (21)."""
        return np.abs(self.state).max(axis=1)

    @property
    def gain_norm(self) -> NDArray[np.float64]:
        """Largest column sum of the error of the gain over that of the gain, (c,); the norm (22)."""
        return relative(self.gain, self.reference.K)

    @property
    def covariance_norm(self) -> NDArray[np.float64]:
        """Largest column sum of the error of the covariance over that of the covariance, (c,); the norm (22)."""
        return relative(self.covariance, self.reference.P)

    @property
    def least_eigenvalue(self) -> NDArray[np.float64]:
        """Least eigenvalue of the computed covariance, symmetric part, scaled to ones on the true diagonal, (c,)."""
        true = self.reference.P[: len(self.steps)].astype(np.float64)
        computed = true + self.covariance
        scale = np.sqrt(np.diagonal(true, axis1=1, axis2=2))
        scaled = computed / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
        return np.asarray(np.linalg.eigvalsh((scaled + np.swapaxes(scaled, 1, 2)) / 2)[:, 0], dtype=np.float64)


def relative(error: NDArray[np.float64], true: NDArray[Any]) -> NDArray[np.float64]:
    """Norms (22), largest column sums, of errors over those of what is true, (c,)."""
    size = np.abs(true[: len(error)].astype(np.float64)).sum(axis=1).max(axis=1)
    return np.asarray(np.abs(error).sum(axis=1).max(axis=1) / size)


def log_spaced(steps: int, a_decade: int = 4) -> tuple[int, ...]:
    """Steps from 1 to the last, at equal ratios.

    Raises
    ------
    ValueError : no steps, or none a decade.
    """
    if steps < 1 or a_decade < 1:
        raise ValueError(f"got {steps} steps, {a_decade} a decade; needed both at least 1")
    grid = np.rint(10 ** (np.arange(0, int(math.log10(steps) * a_decade) + 1) / a_decade))
    return tuple(sorted({int(k) for k in grid if k <= steps} | {steps}))


def reference(model: LinearModel, z: Any, marks: Sequence[int], form: Form = Form.USUAL) -> Kept:
    """Run the filter in double-double, whose operations have relative errors below 2**-102.

    Parameters
    ----------
    z : (steps, m), measurements; float64 or Fractions.
    marks : steps whose results are kept.

    Raises
    ------
    ArithmeticError : a division by zero or a number beyond 2**1000, even so: the model is degenerate.
    """
    run = Run(model, None, form, marks)
    run.take(z)
    if run.stopped:
        raise ArithmeticError(f"{model.name}: the reference stopped at step {run.stopped}; scale or mend the model")
    return run.kept()


def compare_runs(run: Run, true: Kept) -> History:
    """What a run kept, minus the reference at the same steps."""
    kept = run.kept()
    c = len(kept.steps)
    if kept.steps != true.steps[:c]:
        raise ValueError(f"got marks {kept.steps} and, of the reference, {true.steps}; needed the same")
    x, K, P = (
        (each - other[:c]).astype(np.float64) for each, other in ((kept.x, true.x), (kept.K, true.K), (kept.P, true.P))
    )
    fmt, steps = cast(FloatFormat, run.fmt), np.array(kept.steps, dtype=np.int64)
    return History(run.model, fmt, run.form, steps, x, K, P, true, run.indefinite, run.stopped)


def emulate(
    model: LinearModel,
    z: Any,
    fmt: FloatFormat,
    form: Form = Form.REPORT,
    marks: Sequence[int] | None = None,
    true: Kept | None = None,
) -> History:
    """Run the filter with model, measurements and every operation rounded, and compare it with the reference.

    Parameters
    ----------
    model : n states, m measurements.
    z : (steps, m), measurements.
    fmt : any format of base 2 up to 53 digits, 10 up to 18, or 16 up to 13.
    marks : steps at which to compare; by default four a decade.
    true : a reference to compare with. By default it gets model and measurements as the format stores them, so that
        errors are those of the arithmetic alone; a reference of the model as given adds those of storing it.
    """
    measured: Any = z if hasattr(z, "to_fractions") else fmt.array(z)
    chosen = log_spaced(len(measured)) if marks is None else tuple(marks)
    run = Run(model, fmt, form, chosen)
    run.take(measured)
    if true is None:
        true = reference(model.rounded(fmt), measured.to_fractions(), chosen)
    return compare_runs(run, true)


# -- a run beside its contraction bound ---------------------------------------------------------------

_POWERS = np.array([10.0**k for k in range(23)])  # exact


def _widened(fmt: Any, a: Any) -> Any:
    """A number of a format as a double-double: exact in base 2 and 16; within four roundings in base 10."""
    raise TypeError("got a call of _widened from Python; needed one from a function compiled by numba")


@overload(_widened, strict=False, jit_options={"forceinline": True})
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
                d = _widened(fmt, load(fmt, a, (j, j)))
                u = _widened(fmt, load(fmt, a, (i, j))) if i < j else one(exactly) if i == j else zero(exactly)
                put(exactly, U, (j, i), u)
                put(exactly, UD, (i, j), multiply(exactly, u, d))
        product(exactly, UD, U, c)
        return
    for i in range(n):
        for j in range(i + 1):
            x = add(exactly, _widened(fmt, load(fmt, a, (i, j))), _widened(fmt, load(fmt, a, (j, i))))
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
            put(exactly, c, (i, j), _widened(fmt, load(fmt, K, (i, j))))
    if form != _UD:
        return
    for i in range(m):
        for j in range(m):
            put(exactly, U, (i, j), _widened(fmt, load(fmt, UR, (i, j))))
    _decorrelated(exactly, U, H, HD)
    for i in range(m):
        for j in range(i):
            s = zero(exactly)
            for k in range(n):
                s = add(exactly, s, multiply(exactly, load(exactly, HD, (i, k)), load(exactly, c, (k, j))))
            for k in range(n):
                x = multiply(exactly, _widened(fmt, load(fmt, K, (k, i))), s)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))
    for j in range(1, m):
        for i in range(j):
            u = load(exactly, U, (i, j))
            for k in range(n):
                x = multiply(exactly, load(exactly, c, (k, i)), u)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))


@njit(cache=True, nogil=True)
def follow(
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
    marks: Any,
    kept: Any,
    bounds: Any,
    notes: Any,
) -> Any:
    """Go on as :func:`advance` does, and take the contraction bound along; returns it.

    Each step is repeated in double-double from where the run stood: its residuals enter the bound.
    """
    exactly, unit = DoubleDouble(), 2.0**-100
    (X, G, C), (states, gains, covariances) = kept, bounds
    n, m = x.shape[0], z.shape[1]
    work = _workspace(x, P, model[3][0], model[2][0], model[5][0], z[0])
    xe, Pe, xn = np.empty((n, 1, 2)), np.empty((n, n, 2)), np.empty((n, n, 2))
    exact_work = _workspace(xe, Pe, exact_model[3][0], exact_model[2][0], exact_model[5][0], exact_z[0])
    U, UD, y, hx = np.empty((n, n, 2)), np.empty((n, n, 2)), np.empty((m, 1, 2)), np.empty((n, 1, 2))
    K, S, innovation, used = np.empty((n, m)), np.empty((m, m)), np.empty(m), np.empty((n, m, 2))
    q, T, size = np.empty(n), np.empty((n, n)), np.empty((n, n))
    HD, UR = np.empty((m, n, 2)), np.empty((m, m, 2))
    Phi, H, Q, R = plain
    for step in range(z.shape[0]):
        k = first + step
        for i in range(n):
            put(exactly, xe, (i, 0), _widened(fmt, load(fmt, x, (i, 0))))
        _widen(fmt, form, P, Pe, U, UD)
        before = xe[:, 0, 0].copy()
        for i in range(n):
            for j in range(n):
                size[i, j] = math.sqrt(abs(Pe[i, i, 0] * Pe[j, j, 0])) * (1 + 2.0**-50) if form == _UD else Pe[i, j, 0]
        product(exactly, exact_model[0][k % Phi.shape[0]], xe, hx)
        product(exactly, exact_model[2][k % H.shape[0]], hx, y)
        difference(exactly, exact_z[step], y, y)
        found = _step(exactly, _USUAL, exact_model, k, exact_z[step], xe, Pe, exact_work)
        _symmetrize(Pe)
        answer = _step(fmt, form, model, k, z[step], x, P, work)
        at, marked = notes[_MARK], notes[_MARK] < marks.shape[0] and marks[notes[_MARK]] == k + 1
        if not _note(fmt, k, answer, x, work[1][0], P, marks, X, G, C, notes):
            return bound
        _widen(fmt, form, P, xn, U, UD)
        for i in range(n):
            q[i] = subtract(exactly, _widened(fmt, load(fmt, x, (i, 0))), load(exactly, xe, (i, 0)))[0]
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
        if marked:
            hk, ur = exact_model[2][k % H.shape[0]], model[8][k % R.shape[0]]
            _whole_gain(fmt, form, work[1][0], hk, ur, used, HD, UR)
            states[at] = state_error_bound(bound)
            covariances[at] = covariance_error_bound(bound)
            gains[at] = gain_error_bound(bound, K, used[:, :, 0], dK)
    return bound


@dataclass(frozen=True, eq=False)
class Bounded:
    """A history, and the contraction bound of each entry of its errors, infinite where there is none.

    Parameters
    ----------
    state, gain, covariance : (c, n), (c, n, m) and (c, n, n), in the units of the errors; of the covariance's
        symmetric part.
    """

    history: History
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def ratios(self) -> NDArray[np.float64]:
        """Largest error over bound of state, gain and covariance, after each step, (c, 3); above 1 if violated."""
        error = self.history.covariance
        symmetric = (error + np.swapaxes(error, 1, 2)) / 2
        pairs = ((self.history.state, self.state), (self.history.gain, self.gain), (symmetric, self.covariance))
        with np.errstate(divide="ignore", invalid="ignore"):
            each = [np.where(e == 0, 0.0, np.abs(e) / b).reshape(len(e), -1).max(axis=1) for e, b in pairs]
        return np.stack(each, axis=1)


class Followed(Run):
    """A run that takes the contraction bound of :mod:`gpbnb.kalman.theory` along; see :class:`Run`.

    Of the reference itself, in double-double, the bound says how far it may be from what is exact.
    """

    def __init__(self, model: LinearModel, fmt: FloatFormat | None, form: Form, marks: Sequence[int]) -> None:
        super().__init__(model, fmt, form, marks)
        self.stored = model if fmt is None else model.rounded(fmt)
        given = self.stored.to_float()
        self._plain = given["Phi"], given["H"], given["Q"], given["R"]
        self._exact = Run(self.stored, None, Form.USUAL, ())._parts
        n, m, count = model.n, model.m, len(self.marks)
        self.bounds = np.full((count, n), np.inf), np.full((count, n, m), np.inf), np.full((count, n, n), np.inf)
        zero_n, size = np.zeros(n), np.zeros((n, n))
        if self.form is Form.UD:  # the first factors may be off
            size = np.abs((self._covariance() - self.stored.P0).astype(np.float64)) * (1 + 2.0**-50)
        self.bound = contraction_start(given["P0"], zero_n, size)

    def _covariance(self) -> NDArray[Any]:
        U = self.exactly(self.P)
        triangle = np.triu(U, 1) + np.array(
            [[Fraction(int(i == j)) for j in range(len(U))] for i in range(len(U))], dtype=object
        )
        return np.asarray((triangle * U.diagonal()) @ triangle.T)

    def take(self, z: Any) -> None:
        """Go on by as many steps as there are measurements, (steps, m)."""
        if np.ndim(z) != 2 or np.shape(z)[1] != self.model.m:
            raise ValueError(f"got measurements of shape {np.shape(z)}; needed (steps, {self.model.m})")
        if self.stopped or not len(z):
            return
        packed = self._packed(z)
        values = double_doubles(self.exactly(packed))
        packed = packed.reshape(len(packed), self.model.m, 1, *packed.shape[2:])
        kept = (self.marks, (self.X, self.G, self.C), self.bounds, self.notes)
        told = (self.tag, int(self.form), self._parts, self._exact, self._plain)
        try:
            self.bound = follow(*told, packed, values[:, :, np.newaxis], self.steps, self.x, self.P, self.bound, *kept)
        except (OverflowError, ZeroDivisionError):
            self.notes[_STOPPED] = self.steps + 1


def bounded(
    model: LinearModel, z: Any, fmt: FloatFormat, form: Form = Form.REPORT, marks: Sequence[int] | None = None
) -> Bounded:
    """Run the filter rounded, in double-double, and with its contraction bound; arguments as of :func:`emulate`."""
    measured: Any = z if hasattr(z, "to_fractions") else fmt.array(z)
    chosen = log_spaced(len(measured)) if marks is None else tuple(marks)
    run = Followed(model, fmt, form, chosen)
    run.take(measured)
    history = compare_runs(run, reference(run.stored, measured.to_fractions(), chosen))
    c = len(history.steps)
    state, gain, covariance = run.bounds
    return Bounded(history, state[:c], gain[:c], covariance[:c])


# -- Gravity Probe B ----------------------------------------------------------------------------------

#: The truth at the start of a simulated year, with the drift rates that relativity predicts, 6606 and 39 mas/yr.
TRUTH = (30.0, -20.0, 6606.0, 39.0, 0.0, 0.0, 60.0, -80.0, 0.0, 4.0)


def gravity_probe_b_year(model: LinearModel) -> Simulation:
    """Measurements in whole milliarcseconds, for a :func:`gpbnb.kalman.model.gravity_probe_b`."""
    return Simulation(model, TRUTH, seed=1984, resolution=1.0)
