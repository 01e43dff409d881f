"""Exact covariances and gains from what filters in factored form store, as Fractions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.definiteness import factor
from gpbnb.arithmetic.rational import exact, inverse_of


def upper_factors(covariance: NDArray[Any]) -> NDArray[Any]:
    """Return exact factors U D U' of a covariance (n, n): D is the diagonal, U the unit triangle above it."""
    lower, d = factor(covariance[::-1, ::-1])
    return np.triu(lower[::-1, ::-1], 1) + np.diag(d[::-1])


def unit_triangle(factors: NDArray[Any]) -> NDArray[Any]:
    """Return the unit upper triangle that is stored above the diagonal of a matrix (n, n)."""
    return np.triu(factors, 1) + exact(np.eye(len(factors), dtype=int))


def covariance_of_factors(factors: NDArray[Any]) -> NDArray[Any]:
    """Return :math:`U D U^T`, (n, n): D is the diagonal, U the unit triangle above it."""
    triangle = unit_triangle(factors)
    return np.asarray((triangle * factors.diagonal()) @ triangle.T)


def combined_gain(columns: Sequence[NDArray[Any]], UR: NDArray[Any], H: NDArray[Any]) -> NDArray[Any]:
    """Return the gain (n, m) for all measurements together.

    Parameters
    ----------
    columns : m gains (n,), each for one decorrelated measurement after the other.
    UR : (m, m), the factors of R.
    H : (m, n).
    """
    decorrelation = inverse_of(unit_triangle(UR))
    rows = decorrelation @ H
    gain = np.array(columns, dtype=object).T
    for i, column in enumerate(columns):
        for j in range(i):
            gain[:, j] -= column * (rows[i] @ gain[:, j])
    return np.asarray(gain @ decorrelation)
