"""gpbnb.report.kalman.exact_step: a step worked by hand."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.report.kalman import exact_step


def test_a_step_worked_by_hand():
    step = exact_step.exact_step([[2]], [[1]], [[1]], [[4]], [3], [["3/4"]], [10])
    assert step.predicted.tolist() == [[4]]  # 2 · 3/4 · 2 + 1
    assert step.gain.tolist() == [[Fraction(1, 2)]]
    assert (step.P.tolist(), step.x.tolist(), step.innovation.tolist()) == ([[2]], [8], [4])
    assert (step.transition.tolist(), step.innovation_covariance.tolist()) == ([[1]], [[8]])


def test_a_step_is_singular():
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        exact_step.exact_step([[1]], [[1]], [[0]], [[0]], [0], [[0]], [0])
