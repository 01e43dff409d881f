"""Numbers that keep their derivatives by every rounding error, and the largest errors that roundings can cause."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import exact

Matrix = NDArray[Any]
_NEW = itertools.count()


class Rounded:
    """A number and its derivatives by the rounding errors on which it depends, as python-flint's rationals."""

    def __init__(self, value: fmpq, slopes: dict[int, fmpq] | None = None) -> None:
        self.value, self.slopes = value, slopes or {}

    def _combined(self, value: fmpq, own: Any, other: Rounded, by: Any) -> Rounded:
        slopes = {key: own * slope for key, slope in self.slopes.items()}
        for key, slope in other.slopes.items():
            slopes[key] = slopes.get(key, 0) + by * slope
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

    def moved(self, size: fmpq) -> Rounded:
        """Add an error of at most this size, times β, that depends on nothing else."""
        return Rounded(self.value, {**self.slopes, next(_NEW): size})


def rounded(x: Any) -> Any:
    """Round numbers or matrices of numbers: each gets a relative error of its own."""
    if isinstance(x, Rounded):
        return x.moved(x.value)
    return np.vectorize(rounded, otypes=[object])(x)


def tracked(x: Any, sizes: Any = None) -> Matrix:
    """Return exact numbers as numbers with errors of at most these sizes, times β; without errors by default."""
    found = np.vectorize(lambda each: Rounded(_rational(each)), otypes=[object])(exact(x))
    if sizes is None:
        return found
    return np.vectorize(lambda each, size: each.moved(_rational(size)), otypes=[object])(found, exact(sizes))


def without_errors(x: Matrix) -> Matrix:
    """Return each entry without its errors."""
    return np.vectorize(lambda each: _fraction(each.value), otypes=[object])(x)


def largest(x: Matrix) -> Matrix:
    """Return the largest error of each entry over β."""
    return np.vectorize(lambda each: _fraction(sum(map(abs, each.slopes.values()), fmpq(0))), otypes=[object])(x)


def _rational(x: Fraction) -> fmpq:
    return fmpq(x.numerator, x.denominator)


def _fraction(x: fmpq) -> Fraction:
    return Fraction(int(x.p), int(x.q))
