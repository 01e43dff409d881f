"""One step with factors or square roots of the covariance, over arrays of numbers of any kind; roots need ``sqrt``.

:mod:`gpbnb.filters.recording` runs them on arrays that record their operations. :mod:`gpbnb.filters.kalman_step` has
the forms that compute the covariance itself.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.algebra import Matrix, as_computed

Times = Callable[[Matrix, Matrix], Matrix]
"""A product of matrices."""


class BlockStorage(NamedTuple):
    """How each block of a filter takes numbers from the model or from another block; by default as they are."""

    state: Callable[[Matrix], Matrix] = as_computed
    gain: Callable[[Matrix], Matrix] = as_computed
    covariance: Callable[[Matrix], Matrix] = as_computed
    innovation: Callable[[Matrix], Matrix] = as_computed


ONE_FORMAT = BlockStorage()
"""All blocks compute with the same numbers."""


def predict_ud(Phi: Matrix, U: Matrix, UQ: Matrix, times: Times = operator.matmul) -> tuple[Matrix, Any]:
    """Predict UD factors by Thornton's modified weighted Gram-Schmidt; the diagonals hold D, which may have zeros.

    Also return whether no entry of D is negative, and the variance of each state positive.
    """
    n = len(U)
    W = np.concatenate([times(Phi, _unit(U)), _unit(UQ)], axis=1)
    D = np.concatenate([np.diagonal(U), np.diagonal(UQ)])
    found: list[list[Matrix]] = _entries(U * 0)
    definite: Any = True
    for j in range(n - 1, -1, -1):
        c = D * W[j]
        d = (W[j] * c).sum()
        found[j][j] = d
        definite = definite & np.logical_not(d < 0)
        if j:
            s = if_nonzero(d, _share(W[:j], c, d), U[:j, j] * 0)
            W = np.concatenate([W[:j] - s[:, None] * W[j], W[j:]])
            for i in range(j):
                found[i][j] = s[i]
    for i in range(n):
        definite = definite & (_one_of_variance(found, i) > 0)
    return _matrix(found), definite


def _one_of_variance(factors: list[list[Matrix]], i: int) -> Any:
    """Return an entry of D that adds to the variance of state i, or zero if none does."""
    found = factors[i][i]
    for u, d in ((factors[i][j], factors[j][j]) for j in range(i + 1, len(factors))):
        found = _chosen(found, found, _chosen(u, d, found))
    return found


def _chosen(x: Any, a: Any, b: Any) -> Any:
    return if_nonzero(x, lambda: [a], [b])[0]


def _share(W: Matrix, c: Matrix, d: Matrix) -> Callable[[], Matrix]:
    return lambda: (W * c).sum(1) / d


def if_nonzero(x: Any, changed: Callable[[], Any], unchanged: Any) -> Any:
    """Return changed numbers if x is not zero, else the unchanged ones.

    A number that records its operations, see :mod:`gpbnb.arithmetic.traced`, records both.
    """
    if hasattr(type(x), "if_nonzero"):  # arrays would look for names that are spelled alike
        return x.if_nonzero(changed, unchanged)
    return changed() if x != 0 else unchanged


def check_nonzero(a: Any) -> None:
    """Refuse a variance of the innovation that is zero; a number that records its operations records the check."""
    if hasattr(type(a), "check_nonzero"):
        a.check_nonzero()
    elif a == 0:
        raise ZeroDivisionError("a zero pivot in the innovation covariance")


def observe_ud(
    h: Matrix, z: Matrix, r: Matrix, x: Matrix, U: Matrix, stored: BlockStorage = ONE_FORMAT
) -> tuple[Matrix, Matrix, Matrix, bool]:
    """Update UD factors by Bierman's method, for one measurement z of h'x with variance r.

    Parameters
    ----------
    h (n,), r : in the innovation block. z, x (n,) : in the state block. U (n, n) : in the covariance block.
    stored : how a block takes numbers from another one.

    Returns
    -------
    x, U, gain : values after the update.
    definite : whether variances stay positive.
    """
    n = len(x)
    y, c = z, stored.state(h)
    for j in range(n):
        y = y - c[j] * x[j]
    seen = stored.innovation(U)
    f = _unit(seen).T @ h
    g = np.diagonal(seen) * f
    taken, moved = stored.gain(g), stored.covariance(f)
    factors, gain = _entries(U), [stored.gain(h[0] * 0) for _ in range(n)]
    a, observed, definite = r, h[0] * 0, True
    for j in range(n):
        before, a = a, a + f[j] * g[j]
        check_nonzero(a)
        definite = definite & (a > 0)
        column = [factors[k][j] for k in range(j + 1)]
        known = [stored.covariance(each) for each in gain[:j]]
        change = _updated(column, known, moved[j], stored.covariance(before), stored.covariance(a), observed)
        updated, observed = if_nonzero(g[j], change, column), _chosen(g[j], g[j], observed)
        for k in range(j):
            gain[k] = gain[k] + taken[j] * stored.gain(column[k])
        for k in range(j + 1):
            factors[k][j] = updated[k]
        definite = definite & np.logical_not(factors[j][j] < 0)
        gain[j] = taken[j]
    K = _stacked(gain) / stored.gain(a)
    return x + stored.state(K) * y, _matrix(factors), K, definite


def _updated(
    column: list[Matrix], gain: list[Matrix], f: Matrix, before: Matrix, a: Matrix, observed: Any
) -> Callable[[], Any]:
    """Return a function that updates a column of U, whose last entry is a variance.

    Entries above it change only if `observed`, an entry of an earlier column, is not zero; otherwise the gain is zero.
    """

    def moved() -> list[Matrix]:
        factor = -(f / before)
        return [u + factor * c for u, c in zip(column, gain, strict=False)]

    return lambda: [*if_nonzero(observed, moved, column[:-1]), column[-1] * before / a]


def predict_root(Phi: Matrix, S: Matrix, SQ: Matrix, times: Times = operator.matmul) -> tuple[Matrix, Any]:
    """Return the upper triangular root of the predicted covariance, by modified Gram-Schmidt on (Phi S, SQ)."""
    n = len(S)
    W = np.concatenate([times(Phi, S), SQ], axis=1)
    found = _entries(S * 0)
    for j in range(n - 1, -1, -1):
        size = (W[j] * W[j]).sum().sqrt()
        found[j][j] = size
        if j:
            s, above = if_nonzero(size, partial(_projected, W, j, size), [W[:j, 0] * 0, W[:j]])
            W = np.concatenate([above, W[j:]])
            for i in range(j):
                found[i][j] = s[i]
    root = _matrix(found)
    return root, np.all(np.any(root != 0, axis=1))


def _projected(W: Matrix, j: int, size: Matrix) -> list[Matrix]:
    """Return the shares of the first rows in the direction of row j, and these rows without them."""
    direction = W[j] / size
    s = (W[:j] * direction).sum(1)
    return [s, W[:j] - s[:, None] * direction]


def observe_potter(h: Matrix, z: Matrix, r: Matrix, x: Matrix, S: Matrix) -> tuple[Matrix, Matrix, Matrix, bool]:
    r"""Update a square root by Potter's method, for one measurement; see :func:`observe_ud`.

    .. math:: f = S^Th, \quad a = f^Tf + r, \quad K = Sf/a, \quad S^+ = S - \frac{(Sf) f^T}{a + \sqrt{ra}}
    """
    f = S.T @ h
    a = (f * f).sum() + r
    Sf = S @ f
    K = Sf / a
    S = S - (Sf / (a + (r * a).sqrt()))[:, None] * f
    return x + K * (z - h @ x), S, K, a > 0


def observe_carlson(h: Matrix, z: Matrix, r: Matrix, x: Matrix, S: Matrix) -> tuple[Matrix, Matrix, Matrix, bool]:
    r"""Update an upper triangular root by Carlson's method, for one measurement; see :func:`observe_ud`.

    With :math:`f = S^Th` and :math:`a_j = a_{j-1} + f_j^2`, :math:`a_0 = r`, column j becomes
    :math:`\sqrt{a_{j-1}/a_j}\,S_j - f_j\,k_{j-1}/\sqrt{a_{j-1}a_j}`, and :math:`k_j = k_{j-1} + f_jS_j`; K is
    :math:`k_n/a_n`.
    """
    n = len(x)
    f = S.T @ h
    a, k = r, x * 0
    columns: list[Matrix] = []
    for j in range(n):
        a, column, k = if_nonzero(f[j], partial(_carlson, a, f[j], S[:, j], k), [a, S[:, j], k])
        columns.append(column)
    K = k / a
    return x + K * (z - h @ x), _stacked(columns).T, K, a > 0


def _carlson(before: Matrix, f: Matrix, column: Matrix, k: Matrix) -> list[Matrix]:
    a = before + f * f
    return [a, (before / a).sqrt() * column - f / (before * a).sqrt() * k, k + f * column]


def decorrelated(UR: Matrix, a: Matrix) -> Matrix:
    """Return the inverse of the unit upper triangle of R = U D U' times a, by back substitution."""
    m = len(UR)
    rows = [a[i] for i in range(m)]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            rows[i] = rows[i] - UR[i, k] * rows[k]
    return _stacked(rows)


class FactoredStep(NamedTuple):
    """The estimate (n,), the factors or root (n, n), the gains (n,) one by one, and whether variances stay positive."""

    x: Matrix
    P: Matrix
    gains: list[Matrix]
    definite: bool


Observe = Callable[[Matrix, Matrix, Matrix, Matrix, Matrix], tuple[Matrix, Matrix, Matrix, bool]]
"""An update by one measurement, such as :func:`observe_ud`."""


def observed(
    observe: Observe,
    H: Matrix,
    UR: Matrix,
    z: Sequence[Any] | Matrix,
    ahead: Matrix,
    P: Matrix,
    stored: BlockStorage = ONE_FORMAT,
) -> FactoredStep:
    """Update a predicted estimate and its factors or root by measurements, decorrelated and one by one.

    Parameters
    ----------
    H (m, n), UR (m, m) : measurement matrix, and factors of R. z (m,), ahead (n,), P (n, n) : measurements, predicted
        estimate, and its factors or root.
    stored : how a block takes numbers from the model.
    """
    UR, of_state = stored.innovation(UR), stored.state(UR)
    rows, values, gains, x, definite = (
        decorrelated(UR, stored.innovation(H)),
        decorrelated(of_state, z),
        [],
        ahead,
        True,
    )
    for i in range(len(UR)):
        x, P, K, positive = observe(rows[i], values[i], UR[i, i], x, P)
        gains.append(K)
        definite = definite & positive
    return FactoredStep(x, P, gains, definite)


def root_of_factors(U: Matrix) -> Matrix:
    r"""Return :math:`U\sqrt{D}` for the factors of U D U'."""
    return _unit(U) * np.sqrt(np.diagonal(U))


def _unit(U: Matrix) -> Any:
    """Return the upper triangle with ones on its diagonal."""
    return np.where(np.eye(len(U), dtype=bool), 1, U)


def _entries(a: Matrix) -> list[list[Matrix]]:
    return [[a[i, j] for j in range(a.shape[1])] for i in range(a.shape[0])]


def _matrix(entries: list[list[Matrix]]) -> Matrix:
    return _stacked([_stacked(row) for row in entries])


def _stacked(parts: list[Matrix]) -> Any:
    return np.stack(parts)
