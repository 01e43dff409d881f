"""Inverses computed in formats of a few digits, with all intermediate results, exact."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, inverse_of
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import example, procedure
from gpbnb.report.inversion.theory import Reduction

FOUR = FloatFormat(10, 4)
Matrix = NDArray[Any]


@dataclass(frozen=True)
class Sample:
    """A matrix inverted in a format."""

    matrix: FloatArray
    pivot: bool

    @property
    def beta(self) -> Fraction:
        """Unit roundoff of the format."""
        return self.matrix.format.unit_roundoff

    @cached_property
    def reduction(self) -> Reduction:
        """Stages, right sides and inverse, as Fractions."""
        return procedure.as_fractions(procedure.reduce(self.matrix, self.pivot))

    @cached_property
    def inverse(self) -> Matrix:
        """The true inverse of the given matrix with its rows in the order of elimination."""
        return inverse_of(self.reduction.stages[0])

    @cached_property
    def error(self) -> Matrix:
        """The error of the computed inverse, entry by entry, with its signs."""
        return np.asarray(self.reduction.solution - self.inverse @ self.reduction.rights[0])


@cache
def samples() -> tuple[Sample, ...]:
    """Return random matrices of two to four rows in three formats, with or without pivoting, and that of 11.4."""
    rng = np.random.default_rng(1984)
    found = [Sample(FOUR.array(example.MATRIX), False)]
    for fmt in (FOUR, FloatFormat(10, 7), FloatFormat(2, 11, Rounding.CHOP)):
        for n in (2, 3, 4):
            for i in range(4):
                found.append(Sample(fmt.array(rng.integers(-999, 1000, (n, n)).tolist()), pivot=i % 2 == 0))
    return tuple(found)


def of_example() -> tuple[Sample, float]:
    """Return the example of 11.4 in four digits, and the norm of its error."""
    sample = samples()[0]
    return sample, float(column_sum_norm(sample.error))
