"""Exact vectors and random numbers, as printed relations name them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

BETA = Fraction(1, 10**40)
"""Unit roundoff of the instances for first-order statements, so small that its square is negligible."""


class IndexedVector(dict[int, Fraction]):
    """A vector with indices from 1; ``a.T*b`` is the inner product."""

    @property
    def T(self) -> _Row:
        """The vector as a row."""
        return _Row(self)


@dataclass(frozen=True)
class _Row:
    vector: IndexedVector

    def __mul__(self, other: IndexedVector) -> Fraction:
        return sum((self.vector[i] * other[i] for i in self.vector), start=Fraction(0))


def numbered(values: Sequence[Fraction]) -> IndexedVector:
    """Return values by their indices from 1."""
    return IndexedVector(enumerate(values, start=1))


def fractions(rng: np.random.Generator, count: int) -> list[Fraction]:
    """Draw random numbers of either sign between 1 and 10 in size, with three decimals."""
    numerators = rng.integers(1001, 9999, count) * rng.choice([-1, 1], count)
    return [Fraction(int(numerator), 1000) for numerator in numerators]


def small(rng: np.random.Generator, count: int) -> list[Fraction]:
    """Draw random rounding errors of at most :data:`BETA`."""
    return [BETA * Fraction(int(k), 1000) for k in rng.integers(-1000, 1001, count)]
