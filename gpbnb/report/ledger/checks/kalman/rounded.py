"""The steps of the filter, (100)-(111), with a rounding of every operation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpbnb.report.kalman import smallest
from gpbnb.report.ledger.tracked import Matrix, product


def predict(fl: Callable[[Any], Any], Phi: Matrix, P: Matrix, Q: Matrix) -> Matrix:
    """Return the rounded (100)."""
    return np.asarray(fl(product(fl, product(fl, Phi, P), Phi.T) + Q))


def reduce(fl: Callable[[Any], Any], K: Matrix, H: Matrix, right: Matrix, unit: Matrix) -> Matrix:
    """Return the rounded (I - KH) times a matrix, as in (101) and (109)."""
    return product(fl, fl(unit - product(fl, K, H)), right)


def first_gain(fl: Callable[[Any], Any], P: Matrix, H: Matrix, R: Matrix, one: Any) -> Matrix:
    """Return the rounded first form of (99) for one measurement."""
    PH = product(fl, P, H.T)
    return product(fl, PH, fl(one / fl(product(fl, H, PH) + R)))


def second_gain(fl: Callable[[Any], Any], P: Matrix, H: Matrix, R_inverse: Matrix) -> Matrix:
    """Return the rounded second form of (99), for a rounded inverse of R."""
    return product(fl, product(fl, P, H.T), R_inverse)


def update(fl: Callable[[Any], Any], F: Matrix, x: Matrix, u: Matrix) -> Matrix:
    """Return the rounded (111)."""
    return np.asarray(fl(product(fl, F, x) + u))


@dataclass
class Step:
    """The computed quantities of one step, in one kind of number."""

    P_kp: Matrix
    K: Matrix
    P: Matrix
    K_2: Matrix
    F: Matrix
    u: Matrix
    x: Matrix


def take(
    fl: Callable[[Any], Any],
    number: Callable[[Any], Matrix],
    case: smallest.Case,
    x: Matrix,
    P: Matrix,
    second: bool = True,
) -> Step:
    """Take one step of a filter with one measurement; the estimate uses the second or the first form of (99)."""
    Phi, H, Q, R, z = map(number, (case.Phi, case.H, case.Q, case.R, case.z[:, None]))
    unit, one = number(np.eye(len(Phi), dtype=int)), number([[1]])
    P_kp = predict(fl, Phi, P, Q)
    K = first_gain(fl, P_kp, H, R, one)
    P_new = reduce(fl, K, H, P_kp, unit)
    K_2 = second_gain(fl, P_new, H, fl(one / R))
    used = K_2 if second else K
    F, u = reduce(fl, used, H, Phi, unit), product(fl, used, z)
    return Step(P_kp, K, P_new, K_2, F, u, update(fl, F, x, u))
