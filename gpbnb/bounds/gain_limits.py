r"""Limits of the gains of a filter with many states that never repeat, by a norm in which the covariance contracts.

The sets of :mod:`gpbnb.bounds.enclosure` bound each entry of the covariance by itself, and products of such bounds grow
with the number of states. Here errors of first order are followed through all earlier steps, and only their products
are bounded by a norm, :math:`\|E\|_L = \|L^{-1}EL^{-T}\|_F` with :math:`LL^T` near the limit of the covariance.

A step predicts, :math:`V = \Phi P\Phi^T + Q`, and then takes its measurements, all at once or one by one. For an update
with H and R from a center :math:`V^*`, with :math:`S = HV^*H^T + R`, :math:`N = H^TS^{-1}`, :math:`C = I - V^*NH`
and :math:`G = NH`, an error E before it, symmetric or not, becomes exactly

.. math:: C(I + EG)^{-1}EC^T = CEC^T - C(I + EG)^{-1}EGEC^T , \qquad
    \Delta K = C(I + EG)^{-1}EN = CEN - C(I + EG)^{-1}EGEN .

With weights at each center, neither C nor the prediction expands, and :math:`\|G\| \le 1`. So a norm of at most ξ
before an update adds at most :math:`\xi^2/(1 - \xi)`. All else is of first order: let :math:`T_i` bound the roundings
of each part i of a step entry by entry, and :math:`D_i` the product of the C after it. Then, with the closed loop A of
the step and its computed powers :math:`M_l \approx A^l`,

.. math:: E_k = \sum_{l<L}M_l\Big(\sum_i D_it_iD_i^T + q\Big)M_l^T + M_LE_{k-L}M_L^T , \qquad
    |t_i| \le T_i ,\ \|q\|_L \le \eta ,

apart from the roundings of the powers, which are bounded as well. If this sum stays within ξ for the :math:`T_i` and η
that belong to ξ, then the covariance stays within ξ of its center for ever, by induction, and the same sum bounds
:math:`CEN`. Signs cancel inside of :math:`CM_lD_i`, which is why these limits are much smaller than those from bounds
of the entries of E.

The functions that bound the roundings of a step by :math:`T_i` assume errors of at most u in each operation, relative
to its result. In the UD form, let Û and D̂ be computed factors and :math:`\hat L = \hat U\hat D^{1/2}`. Thornton's
recursion replaces rows of :math:`Z = [\Phi\hat L, L_Q]` by :math:`z_i - \hat u_{ij}z_j + \delta_{ij}`. So
:math:`Z = \hat UW + \Delta`, where W are its last rows, and :math:`WW^T - \hat D = F + F^T + \text{diagonal}`, where
:math:`\hat UF` holds only the errors of the products of two rows: no error grows on its way. That
:math:`\hat L` is near the factor of the center follows by continuity: the roundings grow from zero to their values, and
the bounds hold all along.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from flint import ctx
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import inverse_in_order
from gpbnb.bounds.enclosure import Enclosure, enclosed_numbers, matrix_of
from gpbnb.filters.forms import Form

Array = NDArray[np.float64]

_MORE = 1 + 1e-9
"""Factor that exceeds the effect of float64 roundings on sums of terms of one sign."""
_TINY = 1e-13
"""Exceeds the relative error of a sum of at most 400 products in float64."""
_FLOAT = 1e-11
"""Exceeds the relative errors of the centers of a step, compared with sums of magnitudes."""
_MARGIN = 1 + 1e-6
"""Exceeds the effect of float64 roundings on norms, and of weights that are not exact roots of their centers."""
_LARGEST = 0.2
"""Larger sets are not tried."""
_BITS = 256
"""Bits of the balls in which the centers of a step are computed."""
_MOST_STATES = 400
_SMALL, _LAGS, _TRIALS = 1e-7, 5_000, 40
"""Powers of the closed loop are computed until they are about this small, unless there are too many."""


class Sized(NamedTuple):
    """A computed matrix: its center, and a bound of its distance from it."""

    center: Array
    off: Array

    @property
    def size(self) -> Array:
        return np.abs(self.center) + self.off


def known(center: Array) -> Sized:
    """Return a matrix without errors."""
    return Sized(center, np.zeros_like(center))


def turned(x: Sized) -> Sized:
    """Return the transpose."""
    return Sized(x.center.T, x.off.T)


def product_error(x: Sized, y: Sized, unit: float) -> Array:
    """Bound the roundings of a product of computed matrices, summed from left to right, entry by entry."""
    partial, sums = np.zeros((len(x.center), y.center.shape[1])), np.zeros((len(x.center), y.center.shape[1]))
    for k in range(x.center.shape[1]):
        partial += np.outer(x.center[:, k], y.center[k])
        sums += np.abs(partial)
    whole = x.size @ y.size
    off = np.abs(x.center) @ y.off + x.off @ y.size
    terms = x.center.shape[1]
    return unit * (1 + 2 * terms * unit) * _MORE * (whole + sums + terms * (off + _TINY * whole))


def product(x: Sized, y: Sized, error: Array) -> Sized:
    """Return a product of computed matrices with a bound of its roundings."""
    center = x.center @ y.center
    off = np.abs(x.center) @ y.off + x.off @ y.size + _TINY * (np.abs(x.center) @ np.abs(y.center))
    return Sized(center, off * _MORE + error)


@dataclass(frozen=True, eq=False)
class Update:
    """One update of the covariance from its center; each number is next to the exact one, see :func:`chain`.

    Parameters
    ----------
    H, R : (m, n) and (m, m).
    before : (n, n), the center.
    S, inverse, K, N, C : as in :mod:`gpbnb.bounds.gain_limits`.
    L, after : (n, n), upper triangular weights before and after it.
    """

    H: Array
    R: Array
    before: Array
    S: Array
    inverse: Array
    K: Array
    N: Array
    C: Array
    L: Array
    after: Array

    @property
    def terms(self) -> Array:
        """Magnitudes of the terms of C, (n, n), however much of them cancels."""
        return np.asarray(np.eye(len(self.C)) + np.abs(self.before) @ np.abs(self.N) @ np.abs(self.H))


class UpdateRoundings(NamedTuple):
    """Roundings of an update: of the covariance and of the gain, entry by entry."""

    covariance: Array
    gain: Array


class Chain(NamedTuple):
    """A step from the center of its covariance: the prediction and the updates."""

    Phi: Array
    Q: Array
    #: (n, n), the center before and after the step, and its upper triangular weights.
    center: Array
    weights: Array
    updates: tuple[Update, ...]
    #: (n, n), a root of Q.
    root: Array


class StepNumbers(NamedTuple):
    """The model of every step as a form uses it, in float64."""

    Phi: Array
    Q: Array
    #: (n, n), the root of Q that the UD form has; zeros in other forms.
    root: Array
    #: H and R of each update.
    measured: Sequence[tuple[Array, Array]]


def chain(given: StepNumbers, P: Array) -> Chain | None:
    """Follow a step from a covariance; None if one of its covariances is nearly singular, or has too many states."""
    if len(P) > _MOST_STATES:
        return None
    try:
        with ctx.workprec(_BITS):
            return _chain(given, P)
    except ZeroDivisionError:  # an innovation covariance may be singular
        return None


def _chain(given: StepNumbers, P: Array) -> Chain | None:
    """Compute in balls, so that each float64 is next to the exact number, whatever cancels."""
    Phi, identity = matrix_of(given.Phi), matrix_of(np.eye(len(P)))
    V, updates = Phi * matrix_of(P) * Phi.transpose() + matrix_of(given.Q), []
    for H, R in given.measured:
        of_H, of_R = matrix_of(H), matrix_of(R)
        V = (V + V.transpose()) / 2
        S = of_H * V * of_H.transpose() + of_R
        inverse = S.inv()
        N = of_H.transpose() * inverse
        K = V * N
        C = identity - K * of_H
        then = C * V * C.transpose() + K * of_R * K.transpose()
        found = [_nearest(each) for each in (V, S, inverse, K, N, C, then)]
        if not _sharp(H, *zip(*found, strict=True)):
            return None
        before, near_S, near_inverse, near_K, near_N, near_C, end = (near for near, _ in found)
        L, after = _upper_factor(before), _upper_factor(end)
        if L is None or after is None:
            return None
        updates.append(Update(H, R, before, near_S, near_inverse, near_K, near_N, near_C, L, after))
        V = then
    weights = _upper_factor(P)
    return None if weights is None else Chain(given.Phi, given.Q, P, weights, tuple(updates), given.root)


def _nearest(X: Any) -> tuple[Array, Array]:
    """Return the midpoints of balls as float64, and their radii."""
    near = [[float(x.mid()) for x in row] for row in X.tolist()]
    off = [[float(x.rad()) for x in row] for row in X.tolist()]
    return np.array(near), np.array(off)


def _sharp(H: Array, numbers: Sequence[Array], radii: Sequence[Array]) -> bool:
    """Whether the balls of an update are far smaller than a float64 of the magnitudes that lead to them."""
    V, S, inverse, _, N, _, after = map(np.abs, numbers)
    of_V, of_S, of_inverse, of_after = (np.sqrt(np.outer(X.diagonal(), X.diagonal())) for X in (V, S, inverse, after))
    aH, of_K = np.abs(H), V @ N
    sizes = of_V, of_S, of_inverse, of_K, aH.T @ inverse, np.eye(len(V)) + of_K @ aH, of_after
    return all((off <= 2.0**-60 * size).all() for off, size in zip(radii, sizes, strict=True))


def _upper_factor(P: Array) -> Array | None:
    """Return an upper triangular L whose square is P but for far less than a rounding, or None."""
    try:
        L = np.ascontiguousarray(np.linalg.cholesky(P[::-1, ::-1])[::-1, ::-1])
    except np.linalg.LinAlgError:
        return None
    Y = np.abs(np.linalg.inv(L))
    off = np.abs(L @ L.T - P) + _TINY * (np.abs(L) @ np.abs(L.T))
    return L if _norm(Y @ off @ Y.T) <= 1e-8 else None


def _norm(X: Array) -> float:
    return float(np.sqrt((X * X).sum()) * _MORE)


def _rows(X: Array) -> Array:
    """Return the norms of the rows."""
    return np.asarray(np.sqrt((X * X).sum(axis=1)) * _MORE)


def _near_factor(xi: float) -> float:
    r"""Bound the norm of G for an upper triangular :math:`(I + G)(I + G)^T = I + X` with a norm of X of at most ξ.

    From :math:`\|G\| \le (\|X\| + \|G\|^2)/\sqrt2` by continuity.
    """
    return math.sqrt(2) * xi / (1 + math.sqrt(1 - 2 * xi)) * _MORE


# -- roundings of the forms ------------------------------------------------------------------------------------------


def predicted_covariance(step: Chain, xi: float, unit: float) -> Array:
    r"""Bound the roundings of :math:`(\Phi P)\Phi^T + Q` for every covariance within ξ."""
    s = _rows(step.weights)
    Phi, P = known(step.Phi), Sized(step.center, xi * np.outer(s, s))
    first = product_error(Phi, P, unit)
    half = product(Phi, P, first)
    second = product_error(half, turned(Phi), unit)
    V = product(half, turned(Phi), second).size + np.abs(step.Q)
    return np.asarray((first @ np.abs(step.Phi.T) + second + unit * V) * _MORE)


def joint_update(u: Update, xi: float, unit: float) -> UpdateRoundings:
    """Bound the roundings of an update by all measurements at once, in the innovation form."""
    s, t = _rows(u.L), _rows(u.H @ u.L)
    H, V = known(u.H), Sized(u.before, xi * np.outer(s, s))
    of_VH = product_error(V, turned(H), unit)
    VH = Sized(u.before @ u.H.T, xi * np.outer(s, t) + of_VH)
    of_S = np.abs(u.H) @ of_VH + product_error(H, VH, unit)
    S = Sized(u.S, xi * np.outer(t, t) + of_S * _MORE)
    of_S += unit * S.size
    inverse, own = _inverse(S._replace(off=S.off + unit * S.size), unit)
    of_inverse = (own + inverse @ of_S @ inverse) * _MORE
    d = np.sqrt(u.inverse.diagonal())
    SI = Sized(u.inverse, xi / (1 - xi) * np.outer(d, d) + of_inverse)
    of_K = (of_VH @ SI.size + VH.size @ of_inverse + product_error(VH, SI, unit)) * _MORE
    K = Sized(u.K, xi / (1 - xi) * np.outer(_rows(u.C @ u.L), _rows(u.N.T @ u.L)) + of_K)
    of_KH = product_error(K, H, unit)
    C = Sized(u.C, K.off @ np.abs(u.H) + of_KH)
    of_C = of_KH + unit * C.size
    rounded = of_C @ V.size + product_error(C._replace(off=C.off + unit * C.size), V, unit)
    HV = np.abs(u.H @ u.before) + xi * np.outer(t, s)
    return UpdateRoundings(np.asarray((rounded + of_K @ HV) * _MORE), of_K)


def _inverse(S: Sized, unit: float) -> tuple[Array, Array]:
    """Bound entries of the inverses of all matrices within S, and the roundings of computing one by elimination."""
    given = enclosed_numbers(S.center, unit, S.off)
    identity = enclosed_numbers(np.eye(len(S.center)), unit)
    found = inverse_in_order(given, identity).matrix
    return (
        np.array([[each.size for each in row] for row in found]),
        np.array([[each.error for each in row] for row in found]),
    )


def predicted_factors(step: Chain, xi: float, unit: float) -> Array:
    """Bound the roundings of Thornton's recursion for every covariance within ξ.

    A factor within the set differs from that of the center by rows whose norms are at most γ times those of the center.
    """
    n, first = len(step.center), step.updates[0]
    # Phi L, and its rows Z with those of the factor of Q
    s, gamma = _rows(step.weights), _near_factor(xi)
    Phi, moved = known(step.Phi), step.Phi @ step.weights
    own = product_error(Phi, known(step.weights), unit)
    more = 1 + 16 * (n + 2) * n * unit  # errors of second order in u
    aside = unit * gamma * (n + 1) * (np.abs(step.Phi) @ s) * more
    size = _rows(first.L) * (1 + xi)
    V = 2 * own @ np.abs(moved).T + 2 * np.outer(_rows(own) + aside, gamma * size) + 2 * np.outer(aside, size)
    whole = _rows(own) + aside
    V += np.outer(whole, whole)
    # The rows as computed, and how far they are from those of the center
    size = (size + whole) * more
    later = np.arange(n - 1, -1, -1.0)  # the number of rows that are subtracted from each
    tau = unit * (later + np.sqrt(later)) * size * more
    after = _near_factor(min(2 * xi, 0.4))
    inverse = np.abs(np.linalg.inv(first.L))
    turn = (after + gamma + _norm((inverse @ (whole + tau))[None])) / (1 - after)
    off = size * (after * (1 + turn) + turn) + tau
    rows = _orthogonal(np.concatenate([moved, step.root], axis=1))
    pivots = np.maximum(np.diag(first.L) - after * size, 0.0)
    between = np.outer(off, pivots + 2 * after * size + off) + np.outer(size, off)
    with np.errstate(divide="ignore"):
        found = (rows.sums + (2 * n + 2) * between) / pivots * (1 + _FLOAT)
    of_products = unit * more * np.minimum(found, (2 * n + 2) * size[:, None])
    share = unit * more * np.minimum(np.diag(found) / pivots, 2 * n + 2)
    of_rows = unit * more * (rows.errors @ np.abs(rows.unit).T + (2 * later * off)[:, None]) + tau[:, None] * turn
    near = after * _rows(first.L)
    V += 2 * unit * more * (rows.errors @ np.abs(rows.given).T + np.outer(2 * later * off, size))
    V += 2 * np.outer(tau, gamma * size + whole) + np.outer(tau, tau)
    V += 2 * _sums_of_rows(of_products + 2 * unit * size[:, None] + of_rows, np.abs(first.L), near)
    V += 3 * float((share + 2 * unit).max()) * _squares(first.L, near)
    return np.asarray((V + V.T) / 2 * more * _MORE)


class _Orthogonal(NamedTuple):
    """Rows made orthogonal by Thornton's recursion, the last one first."""

    given: Array
    #: of length one.
    unit: Array
    #: (n, n), for row i and pivot j, sums of magnitudes of terms, twice, and of partial sums of their product.
    sums: Array
    #: sums of magnitudes of what is subtracted from each entry, and of what is left.
    errors: Array


def _orthogonal(given: Array) -> _Orthogonal:
    Z, n = given.copy(), len(given)
    unit, sums, errors = np.zeros_like(Z), np.zeros((n, n)), np.zeros_like(Z)
    for j in range(n - 1, -1, -1):
        unit[j] = Z[j] / np.sqrt((Z[j] * Z[j]).sum())
        terms = Z[: j + 1] * Z[j]
        sums[: j + 1, j] = 2 * np.abs(terms).sum(axis=1) + np.abs(np.cumsum(terms, axis=1)).sum(axis=1)
        taken = np.outer(Z[:j] @ unit[j], unit[j])
        Z[:j] -= taken
        errors[:j] += np.abs(taken) + np.abs(Z[:j])
    return _Orthogonal(given, unit, sums, errors)


def _sums_of_rows(errors: Array, L: Array, near: Array) -> Array:
    """Bound products of rows with errors and those of a factor, each near to a row of L; see :func:`_squares`."""
    upper = np.triu(errors, 1)
    return np.asarray(upper @ L.T + np.outer(_rows(upper), near))


def _squares(L: Array, near: Array) -> Array:
    """Bound the sums of products of magnitudes of two rows each, if rows differ from those of L by norms of `near`."""
    s = _rows(L)
    return np.asarray(np.abs(L) @ np.abs(L).T + np.outer(s, near) + np.outer(near, s) + np.outer(near, near))


def single_update(u: Update, xi: float, unit: float) -> UpdateRoundings:
    """Bound the roundings of Bierman's update by one measurement."""
    n, r = len(u.before), float(u.R[0, 0])
    gamma, more = _near_factor(xi), 1 + 16 * (n + 4) * n * unit
    s = _rows(u.L)
    L = Sized(u.L, np.outer(s * gamma, np.ones(n)))
    after = np.abs(u.after) + np.outer(_rows(u.after) * _near_factor(min(2 * xi, 0.4)), np.ones(n))
    h = known(u.H)
    of_v = product_error(h, L, unit)[0]
    center = (u.H @ u.L)[0]
    length = float(np.sqrt(center @ center)) * _MORE
    v = np.abs(center) + length * gamma + of_v
    least = r + np.concatenate([[0.0], np.cumsum(np.maximum(np.abs(center) - length * gamma - of_v, 0.0) ** 2)])
    least /= more
    a = least[-1]
    # b after each column, its partial sums and their errors
    terms = L.size * v
    off = s * (3 * gamma * length + 2 * float(np.sqrt(of_v @ of_v)))
    partial = np.abs(np.cumsum(u.L * center, axis=1)) + off[:, None]
    of_b = unit * more * np.cumsum(2 * terms + partial, axis=1)
    b_before = np.concatenate([np.zeros((n, 1)), partial[:, :-1]], axis=1)
    of_b_before = np.concatenate([np.zeros((n, 1)), of_b[:, :-1]], axis=1)
    scale = v / np.sqrt(least[:-1] * least[1:])
    of_U = (unit * after + scale * (of_b_before + b_before * (n + 6) * unit)) * more
    P = 2 * of_U @ after.T + of_U @ of_U.T + (2 * n + 10) * unit * more * after @ after.T
    Lf, Lv, vf = L.size @ of_v, np.abs(u.L @ center) + off, 2 * float(v @ of_v) / a
    P += more * (2 * np.outer(Lf, Lv) / a + np.outer(Lf, Lf) / a + np.outer(Lv, Lv) * vf / a)
    of_K = more * ((of_b[:, -1] + partial[:, -1] * (n + 6) * unit + Lf) / a + Lv / a * vf)
    return UpdateRoundings(np.asarray((P + P.T) / 2 * _MORE), np.asarray(of_K * _MORE)[:, None])


FORMS = (Form.INNOVATION, Form.UD)
"""Forms whose roundings these functions bound."""


class Parts(NamedTuple):
    """Roundings of the parts of a step, and a bound of what is of second order in the end."""

    #: the prediction's, then each update's, of the covariance.
    covariance: list[Array]
    #: each update's, of the gain.
    gain: list[Array]
    #: norms before each update.
    before: list[float]
    second: float


def parts_of_a_step(form: Form, step: Chain, xi: float, unit: float) -> Parts | None:
    """Bound the roundings of a step from every covariance within ξ; None if ξ is too large, or less than they add."""
    if not xi < _LARGEST or not unit * len(step.center) < 0.1:
        return None
    ud, wide = form is Form.UD, xi + 1e-8
    predict, update = (predicted_factors, single_update) if ud else (predicted_covariance, joint_update)
    aPhi = np.abs(step.Phi)
    aQ = np.abs(step.Q) + np.abs(step.root) @ np.abs(step.root.T)
    covariance = [predict(step, wide, unit) + _FLOAT * (aPhi @ np.abs(step.center) @ aPhi.T + aQ)]
    gains, before, second = list[Array](), list[float](), 0.0
    norm = (wide + _whitened(step.updates[0].L, covariance[0])) * _MARGIN
    for u in step.updates:
        if not norm <= min(2 * wide, _LARGEST):
            return None
        before.append(norm)
        try:
            found = update(u, norm, unit)
        except ZeroDivisionError:  # a pivot of an innovation covariance within the set may be zero
            return None
        whole = u.terms
        covariance.append(found.covariance + _FLOAT * (whole @ np.abs(u.before) @ whole.T))
        gains.append(found.gain + _FLOAT * whole @ np.abs(u.before) @ np.abs(u.N))
        grown = norm * norm / (1 - norm)
        second += grown
        norm = (norm + grown + _whitened(u.after, covariance[-1])) * _MARGIN
        if not norm <= 2 * before[-1]:  # near enough to the factor after the update
            return None
    after = step.updates[-1].after
    change = np.abs(step.center - after @ after.T)
    covariance[-1] = covariance[-1] + change
    return Parts(covariance, gains, before, second * (1 + _whitened(step.weights, change)) * _MARGIN)


def _whitened(L: Array, T: Array) -> float:
    """Bound the norm of all matrices whose entries are within T."""
    Y = np.abs(np.linalg.inv(L))
    return _norm(Y @ T @ Y.T) * _MARGIN


def _largest_singular(X: Array) -> float:
    """Bound the largest singular value by the norm of a power of its square."""
    B, root, whole = X.T @ X, 0.5, 1.0
    for _ in range(6):
        size = float(np.sqrt((B * B).sum()))
        if size == 0.0:
            return 0.0
        B = B / size
        whole *= size**root
        B, root = B @ B, root / 2
    return whole * float(np.sqrt((B * B).sum())) ** root * _MARGIN


class _Sums(NamedTuple):
    """What a set with the roundings of its steps leads to."""

    xi: float
    gains: list[Array]


def _sums(step: Chain, start: Array, parts: Parts, xi: float) -> _Sums | None:
    """Sum the effects of all earlier steps on the norm of the covariance's error, and on its part of each gain."""
    n, L = len(step.center), step.weights
    Y, s = np.linalg.inv(L), _rows(L)
    whole = [u.terms for u in step.updates]
    later, size = [np.eye(n)], [np.eye(n)]  # the updates after each part, the last part first
    for u, each in zip(step.updates[::-1], whole[::-1], strict=True):
        later.append(later[-1] @ u.C)
        size.append(size[-1] @ each)
    A, sizes = later[-1] @ step.Phi, size[-1] @ np.abs(step.Phi)
    D, aD = later[::-1], size[::-1]
    ahead, a_ahead, back, a_back = list[Array](), list[Array](), list[Array](), list[Array]()
    B, aB = step.Phi, np.abs(step.Phi)
    for u, each in zip(step.updates, whole, strict=True):  # a gain takes up C B E B' N
        back.append(B.T @ u.N)
        a_back.append(aB.T @ np.abs(u.N))
        B, aB = u.C @ B, each @ aB
        ahead.append(B)
        a_ahead.append(aB)
    total, gains = np.zeros((n, n)), [np.zeros_like(u.K) for u in step.updates]
    squares, residual, first = 0.0, 0.0, 0.0
    begun = [np.zeros_like(u.K) for u in step.updates]
    M, aY = np.eye(n), np.abs(Y)
    for _ in range(_LAGS):
        aM = np.abs(M)
        off = _TINY * 10 * aM @ sizes  # the roundings of M A, as well
        for i, T in enumerate(parts.covariance):
            moved = np.abs(Y @ M @ D[i]) + _TINY * 10 * aY @ aM @ aD[i]
            total += moved @ T @ moved.T
        sigma = _largest_singular(Y @ M @ L) + _TINY * 10 * _norm(aY @ aM @ np.abs(L))
        squares += sigma * sigma
        first = max(first, sigma)
        residual += 2 * xi * _norm((aY @ off @ s)[None]) * _norm((aY @ (aM @ sizes + off) @ s)[None])
        for j in range(len(gains)):
            left = np.abs(ahead[j] @ M) + _TINY * 10 * a_ahead[j] @ aM
            right = np.abs(M.T @ back[j]) + _TINY * 10 * aM.T @ a_back[j]
            for i, T in enumerate(parts.covariance):
                x = np.abs(ahead[j] @ M @ D[i]) + _TINY * 10 * a_ahead[j] @ aM @ aD[i]
                y = np.abs(D[i].T @ M.T @ back[j]) + _TINY * 10 * aD[i].T @ aM.T @ a_back[j]
                gains[j] += x @ T @ y
            into = _rows(ahead[j] @ M @ L) + _TINY * 10 * _rows(a_ahead[j] @ aM @ np.abs(L))
            out = _rows(back[j].T @ M @ L) + _TINY * 10 * _rows(a_back[j].T @ aM @ np.abs(L))
            gains[j] += parts.second * np.outer(into, out)
            gains[j] += 2 * xi * (a_ahead[j] @ off @ np.outer(s, s) @ (aM @ sizes + off).T @ a_back[j])
            begun[j] = np.maximum(begun[j], left @ np.abs(start) @ right)
        M = M @ A
        if sigma < _SMALL:
            break
    else:
        return None
    last = _largest_singular(Y @ M @ L) + _TINY * 10 * _norm(aY @ np.abs(M) @ np.abs(L))
    norm = _norm(total) + squares * parts.second + residual
    norm += max(first * first * _whitened(L, np.abs(start)), last * last * xi)
    for j in range(len(gains)):
        tail = xi * np.outer(a_ahead[j] @ np.abs(M) @ s, (s @ np.abs(M).T @ a_back[j]))
        gains[j] = (gains[j] + np.maximum(begun[j], tail)) * _MARGIN
    return _Sums(norm * _MARGIN, gains)


def _limits(step: Chain, parts: Parts, sums: _Sums) -> list[Array]:
    """Bound the distance of each update's gain from that of its center."""
    found = []
    for j, u in enumerate(step.updates):
        total, xi = sums.gains[j] + parts.gain[j], parts.before[j]
        C, N = _size_of(u), np.abs(u.N)
        for i in range(j, -1, -1):  # the roundings of this step before the update
            total = total + C @ parts.covariance[i] @ N
            if i:
                size = _size_of(step.updates[i - 1])
                C, N = C @ size, size.T @ N
        second = xi * xi / (1 - xi) + (parts.second if j else 0.0)
        total = total + second * np.outer(_rows(u.C @ u.L), _rows(u.N.T @ u.L))
        found.append(total * _MARGIN)
    return found


def _size_of(u: Update) -> Array:
    """Return the magnitudes of C, with its roundings."""
    return np.asarray(np.abs(u.C) + _TINY * u.terms)


class Contracted(NamedTuple):
    """A set that the covariance never leaves, and limits of the gains from its center."""

    #: (n, n), limits for the distance of the covariance from the center.
    covariance: Array
    #: for each update, limits for the distance of its gain from that of the center.
    gains: list[Array]


def contracted(form: Form, step: Chain, start: Array, unit: float) -> Contracted | None:
    """Find a norm that the covariance's distance from the center never exceeds, or None.

    Parameters
    ----------
    form : one of :data:`FORMS`.
    start : (n, n), bound of the distance of the first covariance from the center.
    unit : largest relative error of an operation.
    """
    xi = max(2 * _whitened(step.weights, start), unit)
    for _ in range(_TRIALS):
        parts = parts_of_a_step(form, step, xi, unit)
        if parts is None:  # the set is smaller than what one step adds, or too large
            if xi >= _LARGEST:
                return None
            xi *= 2
            continue
        sums = _sums(step, start, parts, xi)
        if sums is None or not np.isfinite(sums.xi):
            return None
        if sums.xi <= xi:
            s = _rows(step.weights)
            return Contracted(xi * np.outer(s, s), _limits(step, parts, sums))
        xi = 1.1 * sums.xi
    return None


def limits_of_gains(form: Form, given: StepNumbers, P: Array, K: Array, unit: float) -> Enclosure | None:
    """Enclose the gains of a filter whose model is the same in every step.

    Parameters
    ----------
    form : one of :data:`FORMS`.
    P, K : (steps, n, n) and (steps, n, m), covariances and gains after each step so far, to the nearest float64; gains
        of the UD form are those of one measurement after the other.
    unit : largest relative error of an operation.

    Returns
    -------
    enclosure : its set begins when the covariance has come near to its limit; None if none was found.
    """
    center = _settled(given, (P[-1] + P[-1].T) / 2)
    step = None if center is None else chain(given, center)
    if center is None or step is None:
        return None
    Y, off = np.linalg.inv(step.weights), P - center
    far = np.array([_norm(Y @ each @ Y.T) for each in off])
    start = int(np.argmax(far <= 2 * far[-1])) + 1
    s = _rows(step.weights)
    found = contracted(form, step, np.abs(off[start - 1]) + _FLOAT * np.outer(s, s), unit)
    if found is None:
        return None
    columns = [u.K for u in step.updates], found.gains
    near, off_near = (np.concatenate(each, axis=1) for each in columns)
    gains = off_near + np.abs(near - K[start - 1]) + _FLOAT * np.abs(near)
    return Enclosure(start, gains[None], found.covariance[None], center[None])


def _settled(given: StepNumbers, P: Array, most: int = 5_000) -> Array | None:
    """Return the covariance that a step repeats, in float64; None if it is not found."""
    for _ in range(most):
        step = given.Phi @ P @ given.Phi.T + given.Q
        for H, R in given.measured:
            K = np.linalg.solve(H @ step @ H.T + R, H @ step).T
            C = np.eye(len(P)) - K @ H
            step = C @ step @ C.T + K @ R @ K.T
        if not np.abs(step).max() < 1e100:
            return None
        change, P = np.abs(step - P), (step + step.T) / 2
        s = np.sqrt(P.diagonal())
        if (change <= 1e-13 * np.outer(s, s)).all():
            return np.asarray(P)
    return None
