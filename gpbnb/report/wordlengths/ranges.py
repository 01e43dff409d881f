"""Ranges of the numbers that a filter stores and computes, as powers of two."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import log_spaced, reference


class BinaryRange(NamedTuple):
    """Powers of two between which the magnitudes of nonzero numbers lie."""

    name: str
    least: int
    largest: int


def binary_ranges(model: LinearModel, z: NDArray[Any]) -> tuple[BinaryRange, ...]:
    """Return the ranges of a model, and of its estimates, gains and covariances at sixteen steps per decade.

    Numbers that are all zero have no range.
    """
    checkpoints = reference(model, z, log_spaced(len(z), 16))
    given = np.concatenate([getattr(model, letter).ravel() for letter in ("Phi", "H", "Q", "R", "P0")])
    numbers = {"model": given, "estimate": checkpoints.x, "gain": checkpoints.K, "covariance": checkpoints.P}
    result = []
    for name, values in numbers.items():
        powers = [math.frexp(abs(float(value)))[1] - 1 for value in values.ravel() if value]
        if powers:
            result.append(BinaryRange(name, min(powers), max(powers)))
    return tuple(result)
