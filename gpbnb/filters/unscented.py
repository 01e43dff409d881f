r"""One step of an unscented Kalman filter, over arrays of numbers that have ``sqrt``.

The points are :math:`x` and :math:`x \pm` the columns of the lower Cholesky factor of :math:`(n + \lambda)P`. With
weights W in means and W' in covariances, and :math:`Y_i = f(X_i)`, :math:`Z_i = h(Y_i)`,

.. math::
    \bar x &= Y_0 + \sum_{i\ge1} W_i (Y_i - Y_0), \quad V = \sum_i W'_i d_i d_i^T + Q, \quad d_i = Y_i - \bar x \\
    \bar z &= Z_0 + \sum_{i\ge1} W_i (Z_i - Z_0), \quad S = \sum_i W'_i e_i e_i^T + R, \quad e_i = Z_i - \bar z \\
    K &= \Big(\sum_i W'_i d_i e_i^T\Big)S^{-1}, \quad x^+ = \bar x + K(z - \bar z), \quad P^+ = V - (KS)K^T

Differences of measurements are those of the model, so that angles wrap. Means are formed from differences to the
central point because the weight of this point may be large and negative.

References
----------
Julier & Uhlmann 2004; Wan & van der Merwe 2000.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.algebra import Algebra, Matrix
from gpbnb.filters.array_steps import if_nonzero
from gpbnb.filters.kalman_step import corrected_by


class UnscentedModel(NamedTuple):
    r"""What one step uses.

    Parameters
    ----------
    f, h : functions of a state (n,).
    difference : function of two measurements (m,).
    scale : :math:`n + \lambda`.
    means, covariances : weights, (2n + 1,).
    Q, R : (n, n) and (m, m).
    """

    f: Callable[[Matrix], Matrix]
    h: Callable[[Matrix], Matrix]
    difference: Callable[[Matrix, Matrix], Matrix]
    scale: Any
    means: Matrix
    covariances: Matrix
    Q: Matrix
    R: Matrix


class UnscentedStep(NamedTuple):
    """Estimate (n,), gain (n, m) and covariance (n, n) after a step, and whether variances and pivots are positive."""

    x: Matrix
    K: Matrix
    P: Matrix
    definite: Any


def unscented_step(algebra: Algebra, model: UnscentedModel, x: Matrix, P: Matrix, z: Matrix) -> UnscentedStep:
    """Take one step."""
    root = lower_root(model.scale * P).T
    Y = [model.f(each) for each in (x, *(x + column for column in root), *(x - column for column in root))]
    Z = [model.h(each) for each in Y]
    ahead, D = _mean(model.means, Y, lambda a, b: a - b)
    expected, E = _mean(model.means, Z, model.difference)
    weighted = D.T * model.covariances
    V = weighted @ D + model.Q
    S = (E.T * model.covariances) @ E + model.R
    inverse, pivots = algebra.invert(S, algebra.identity(len(S)))
    K = (weighted @ E) @ inverse
    P = V - (K @ S) @ K.T
    definite = np.all(np.diagonal(P) > 0)
    for each in pivots:
        definite = definite & np.all(each > 0)
    return UnscentedStep(corrected_by(algebra, K, ahead, model.difference(z, expected)), K, P, definite)


def _mean(weights: Matrix, points: list[Matrix], difference: Callable[[Matrix, Matrix], Matrix]) -> Any:
    """Return the mean of points, and the difference of each point from it, (2n + 1, n)."""
    change = None
    for weight, point in zip(weights[1:], points[1:], strict=True):
        part = weight * difference(point, points[0])
        change = part if change is None else change + part
    mean = points[0] + change
    return mean, np.stack([difference(each, mean) for each in points])


def lower_root(P: Matrix) -> Any:
    """Return the lower Cholesky factor of a covariance (n, n), column by column; a zero pivot gives a zero column."""
    columns: list[Matrix] = []
    n = len(P)
    for j in range(n):
        rest = P[:, j]
        for column in columns:
            rest = rest - column * column[j]
        pivot = rest[j].sqrt()
        columns.append(if_nonzero(pivot, partial(_column, rest, pivot, j), rest * 0))
    return np.stack(columns).T


def _column(rest: Matrix, pivot: Any, j: int) -> Any:
    at = np.arange(len(rest))
    return np.where(at == j, pivot, np.where(at > j, rest / pivot, rest * 0))
