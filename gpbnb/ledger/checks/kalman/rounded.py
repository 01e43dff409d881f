"""The steps of the filter in numbers that keep their derivatives by every rounding error."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import exact
from gpbnb.kalman import smallest

Matrix = NDArray[Any]
_NEW = itertools.count()


class Rounded:
    """A number and its derivatives by the rounding errors on which it depends."""

    def __init__(self, value: Any, slopes: dict[int, Fraction] | None = None) -> None:
        self.value, self.slopes = value, slopes or {}

    def _combined(self, value: Any, own: Any, other: Rounded, by: Any) -> Rounded:
        slopes = {key: own * slope for key, slope in self.slopes.items()}
        for key, slope in other.slopes.items():
            slopes[key] = slopes.get(key, Fraction(0)) + by * slope
        return Rounded(value, slopes)

    def __add__(self, other: Rounded) -> Rounded:
        return self._combined(self.value + other.value, 1, other, 1)

    def __sub__(self, other: Rounded) -> Rounded:
        return self._combined(self.value - other.value, 1, other, -1)

    def __mul__(self, other: Rounded) -> Rounded:
        return self._combined(self.value * other.value, other.value, other, self.value)

    def __truediv__(self, other: Rounded) -> Rounded:
        value = self.value / other.value
        return self._combined(value, 1 / other.value, other, -value / other.value)

    def moved(self, size: Any) -> Rounded:
        """Add an error of at most this size, times β, that depends on nothing else."""
        return Rounded(self.value, {**self.slopes, next(_NEW): size})


def rounded(x: Any) -> Any:
    """Round numbers or matrices of numbers: each gets a relative error of its own."""
    return np.vectorize(lambda each: each.moved(each.value), otypes=[object])(x)


def tracked(x: Any, sizes: Any = None) -> Matrix:
    """Return exact numbers as numbers with errors of at most these sizes, times β; without errors by default."""
    found = np.vectorize(Rounded, otypes=[object])(exact(x))
    return found if sizes is None else np.vectorize(Rounded.moved, otypes=[object])(found, exact(sizes))


def largest(x: Matrix) -> Matrix:
    """Return the largest error of each entry over β."""
    return np.vectorize(lambda each: sum(map(abs, each.slopes.values()), Fraction(0)), otypes=[object])(x)


def product(fl: Callable[[Any], Any], A: Matrix, B: Matrix) -> Matrix:
    """Multiply two matrices with each operation rounded, and add from left to right."""
    total = fl(np.multiply.outer(A[:, 0], B[0]))
    for k in range(1, len(B)):
        total = fl(total + fl(np.multiply.outer(A[:, k], B[k])))
    return np.asarray(total)


# -- the steps of (100)-(111), each with all of its roundings -------------------------------------


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
