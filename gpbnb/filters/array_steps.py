"""The arithmetic of one step with arrays of a format, for covariances, their factors and their square roots.

Where the compiled loops of ``gpbnb.filters.kernels.step`` have the same form, operations are done in the same order,
so that every digit is the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.array import FloatArray


def inverse(a: FloatArray) -> tuple[FloatArray, bool]:
    """Return the inverse, by elimination without pivoting, and whether all pivots are positive.

    Raises
    ------
    ZeroDivisionError : a pivot is zero.
    """
    m = len(a)
    rows, columns = [a[i] for i in range(m)], list(a.format.array(np.eye(m, dtype=int)))
    definite = True
    for k in range(m):
        definite = definite and bool(rows[k][k] > 0)
        if rows[k][k] == 0:
            raise ZeroDivisionError("a zero pivot in the innovation covariance")
        for i in range(k + 1, m):
            factor = rows[i][k] / rows[k][k]
            rows[i], columns[i] = rows[i] - factor * rows[k], columns[i] - factor * columns[k]
    for k in range(m - 1, -1, -1):
        for i in range(k + 1, m):
            columns[k] = columns[k] - rows[k][i] * columns[i]
        columns[k] = columns[k] / rows[k][k]
    return _stacked(columns), definite


def predict_ud(Phi: FloatArray, U: FloatArray, UQ: FloatArray) -> tuple[FloatArray, bool]:
    """Predict UD factors by Thornton's modified weighted Gram-Schmidt; the diagonals hold the variances."""
    n = len(U)
    W = np.concatenate([Phi @ _unit(U), _unit(UQ)], axis=1)
    D = np.concatenate([np.diagonal(U), np.diagonal(UQ)])
    found, definite = _entries(U * 0), True
    for j in range(n - 1, -1, -1):
        c = D * W[j]
        d = (W[j] * c).sum()
        found[j][j] = d
        definite = definite and bool(d > 0)
        if j and d != 0:
            s = (W[:j] * c).sum(1) / d
            W = np.concatenate([W[:j] - s[:, None] * W[j], W[j:]])
            for i in range(j):
                found[i][j] = s[i]
    return _matrix(found), definite


def observe_ud(
    h: FloatArray, z: FloatArray, r: FloatArray, x: FloatArray, U: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    """Update UD factors by Bierman's method, for one measurement z of h'x with variance r.

    Returns
    -------
    x, U, gain : values after the update.
    definite : whether variances stay positive.

    Raises
    ------
    ZeroDivisionError : the variance of the innovation is zero.
    """
    n = len(x)
    y = z
    for j in range(n):
        if h[j] != 0:
            y = y - h[j] * x[j]
    f = _unit(U).T @ h
    g = np.diagonal(U) * f
    factors, gain = _entries(U), [h[0] * 0 for _ in range(n)]
    a, definite = r, True
    for j in range(n):
        if g[j] != 0:
            before, a = a, a + f[j] * g[j]
            if a == 0:
                raise ZeroDivisionError("a zero pivot in the innovation covariance")
            definite = definite and bool(a > 0)
            factors[j][j] = factors[j][j] * before / a
            factor = -(f[j] / before)
            for k in range(j):
                u, c = factors[k][j], gain[k]
                if c != 0:
                    factors[k][j] = u + factor * c
                gain[k] = c + g[j] * u
        definite = definite and not bool(factors[j][j] < 0)
        gain[j] = g[j]
    K = _stacked(gain) / a
    return x + K * y, _matrix(factors), K, definite


def predict_root(Phi: FloatArray, S: FloatArray, SQ: FloatArray) -> tuple[FloatArray, bool]:
    """Return the upper triangular root of the predicted covariance, by modified Gram-Schmidt on (Phi S, SQ)."""
    n = len(S)
    W = np.concatenate([Phi @ S, SQ], axis=1)
    found, definite = _entries(S * 0), True
    for j in range(n - 1, -1, -1):
        size = (W[j] * W[j]).sum().sqrt()
        found[j][j] = size
        definite = definite and bool(size > 0)
        if j and size != 0:
            direction = W[j] / size
            s = (W[:j] * direction).sum(1)
            W = np.concatenate([W[:j] - s[:, None] * direction, W[j:]])
            for i in range(j):
                found[i][j] = s[i]
    return _matrix(found), definite


def observe_potter(
    h: FloatArray, z: FloatArray, r: FloatArray, x: FloatArray, S: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    r"""Update a square root by Potter's method, for one measurement; see :func:`observe_ud`.

    .. math:: f = S^Th, \quad a = f^Tf + r, \quad K = Sf/a, \quad S^+ = S - \frac{(Sf) f^T}{a + \sqrt{ra}}
    """
    f = S.T @ h
    a = (f * f).sum() + r
    Sf = S @ f
    K = Sf / a
    S = S - (Sf / (a + (r * a).sqrt()))[:, None] * f
    return x + K * (z - h @ x), S, K, bool(a > 0)


def observe_carlson(
    h: FloatArray, z: FloatArray, r: FloatArray, x: FloatArray, S: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, bool]:
    r"""Update an upper triangular root by Carlson's method, for one measurement; see :func:`observe_ud`.

    With :math:`f = S^Th` and :math:`a_j = a_{j-1} + f_j^2`, :math:`a_0 = r`, column j becomes
    :math:`\sqrt{a_{j-1}/a_j}\,S_j - f_j\,k_{j-1}/\sqrt{a_{j-1}a_j}`, and :math:`k_j = k_{j-1} + f_jS_j`; K is
    :math:`k_n/a_n`.
    """
    n = len(x)
    f = S.T @ h
    a, k = r, x * 0
    columns: list[FloatArray] = []
    for j in range(n):
        before, column = a, S[:, j]
        if f[j] != 0:
            a = before + f[j] * f[j]
            columns.append((before / a).sqrt() * column - f[j] / (before * a).sqrt() * k)
            k = k + f[j] * column
        else:
            columns.append(column)
    K = k / a
    return x + K * (z - h @ x), _stacked(columns).T, K, bool(a > 0)


def decorrelated(UR: FloatArray, a: FloatArray) -> FloatArray:
    """Return the inverse of the unit upper triangle of R = U D U' times a, by back substitution."""
    m = len(UR)
    rows = [a[i] for i in range(m)]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            if UR[i, k] != 0:
                rows[i] = rows[i] - UR[i, k] * rows[k]
    return _stacked(rows)


def root_of_factors(U: FloatArray) -> FloatArray:
    r"""Return :math:`U\sqrt{D}` for the factors of U D U'."""
    return _unit(U) * np.sqrt(np.diagonal(U))


def _unit(U: FloatArray) -> Any:
    """Return the upper triangle with ones on its diagonal."""
    return np.where(np.eye(len(U), dtype=bool), 1, U)


def _entries(a: FloatArray) -> list[list[FloatArray]]:
    return [[a[i, j] for j in range(a.shape[1])] for i in range(a.shape[0])]


def _matrix(entries: list[list[FloatArray]]) -> FloatArray:
    return _stacked([_stacked(row) for row in entries])


def _stacked(parts: list[FloatArray]) -> Any:
    return np.stack(parts)
