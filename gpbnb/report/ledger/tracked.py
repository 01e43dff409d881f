"""Numbers that keep their derivatives by every rounding error, and the largest errors that roundings can cause."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import exact

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
    if isinstance(x, Rounded):
        return x.moved(x.value)
    return np.vectorize(rounded, otypes=[object])(x)


def tracked(x: Any, sizes: Any = None) -> Matrix:
    """Return exact numbers as numbers with errors of at most these sizes, times β; without errors by default."""
    found = np.vectorize(Rounded, otypes=[object])(exact(x))
    return found if sizes is None else np.vectorize(Rounded.moved, otypes=[object])(found, exact(sizes))


def largest(x: Matrix) -> Matrix:
    """Return the largest error of each entry over β."""
    return np.vectorize(lambda each: sum(map(abs, each.slopes.values()), Fraction(0)), otypes=[object])(x)
