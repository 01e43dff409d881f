"""gpbnb.filters.simulation: simulated measurements, far finer than their noise."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.filters.model import LinearModel
from gpbnb.filters.simulation import BLOCK, fine_resolution, simulated_measurements


@pytest.mark.parametrize(("variance", "power"), [("1", 0), ("0.99", -1), ("3.99", 0), ("4", 1), ("1e-6", -10)])
def test_measurements_are_multiples_of_a_billionth_of_the_noise(variance, power):
    """The power of two just below the standard deviation, over 2**30."""
    model = LinearModel([[1]], [[1]], [["0.01"]], [[variance]], [0], [[1]])
    (unit,) = fine_resolution(model)
    assert unit == Fraction(2) ** (power - 30)
    z = simulated_measurements(model, 300) / unit
    assert (z == np.rint(z)).all()
    assert 100 < np.count_nonzero(z % 2) < 200  # no coarser


def test_no_noise_is_drawn_twice():
    """Of a constant without process noise, each block of steps has measurements of its own."""
    z = simulated_measurements(LinearModel([[1]], [[1]], [[0]], [[1]], [0], [[0]]), 2 * BLOCK)
    assert len(np.unique(z)) > 2 * BLOCK - 10
