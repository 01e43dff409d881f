"""Checkpoints of a run, and their differences from those of a reference."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.filters.checkpoints import Checkpoints, exactly
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run

TENTH = Fraction(1, 10)


def saved(steps, numbers, fmt):
    """Checkpoints with one number, the same for state, gain and covariance."""
    each = [exactly(numbers.reshape(1, *(1,) * k, *numbers.shape[1:]), fmt) for k in (1, 2, 2)]
    return Checkpoints(steps, *each)


def test_a_difference_below_what_double_double_resolves_is_correctly_rounded():
    fmt = FloatFormat(10, 3)
    near = double_doubles(np.array([TENTH]))
    run = saved((2,), fmt.backend.pack(fmt.array(["0.1"]).components), fmt)
    true = Checkpoints(
        (2, 5), *(exactly(np.concatenate([near, near]).reshape(2, *(1,) * k, 2), None) for k in (1, 2, 2))
    )
    off = float(TENTH - Fraction(near[0, 0]) - Fraction(near[0, 1]))
    assert 0 < abs(off) < 2.0**-107
    assert [each.ravel().tolist() for each in run.minus(true)] == [[off]] * 3
    assert true.to_float("K").ravel().tolist() == [0.1, 0.1]


def test_the_parts_of_a_double_double_are_added_exactly():
    given = LinearModel([[1]], [[1]], [[1]], [[1]], [0], [[1]])
    parts = np.array([[1.5, 2.0**-70], [2.0**-60, -(2.0**-130)], [3.0, 0.0]])
    found = Run(given, None, Form.INNOVATION, ()).exactly(parts)
    assert found.tolist() == [Fraction(3, 2) + Fraction(1, 2**70), Fraction(2**70 - 1, 2**130), 3]
