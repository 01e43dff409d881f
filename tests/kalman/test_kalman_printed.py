"""gpbnb.report.kalman.printed: what (125) allows a run, against theory in exact numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, max_norm, row_sum_norm
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import reference
from gpbnb.report.kalman import exact_step, printed, report_bounds

TWO = LinearModel(
    Phi=[[["1", "0.5"], ["0", "0.9"]], [["1", "0.25"], ["0", "0.8"]]],
    H=[["1", "-0.5"]],
    Q=[["0.1", "0"], ["0", "0.2"]],
    R=[["0.5"]],
    x0=["1", "-2"],
    P0=[["4", "1"], ["1", "3"]],
)
Z = np.array([[1.5], [-2.0], [4.0], [0.25], [-3.0]])
FIVE = FloatFormat(10, 5)


@pytest.fixture(scope="module")
def found():
    return printed.terms(TWO, reference(TWO, Z, range(1, len(Z) + 1)))


@pytest.fixture(scope="module")
def steps():
    x, P, result = TWO.x0, TWO.P0, []
    for k, z in enumerate(Z):
        step = exact_step.exact_step(TWO.Phi[k % 2], TWO.H[0], TWO.Q[0], TWO.R[0], x, P, z)
        x, P = step.x, step.P
        result.append((step, step.gain @ np.array([Fraction(each) for each in z])))
    return result


def test_the_terms_are_those_of_exact_steps(found, steps):
    so_far = [steps[: k + 1] for k in range(len(steps))]
    # A few operations of float64 after 31 digits.
    close = {"rtol": 1e-13}
    assert np.allclose(found.x, [float(max_norm(s.x)) for s, _ in steps], **close)
    assert np.allclose(found.u, [float(max(max_norm(u) for _, u in part)) for part in so_far], **close)
    loops = [[s.transition for s, _ in part] for part in so_far]
    assert np.allclose(found.columns, [float(max(map(column_sum_norm, part))) for part in loops], **close)
    assert np.allclose(found.rows, [float(max(map(row_sum_norm, part))) for part in loops], **close)
    assert not np.allclose(found.columns, found.rows)
    assert (found.n, found.m) == (2, 1)


@pytest.mark.parametrize("faults", report_bounds.CORRECTIONS.values())
def test_the_kindest_bound(found, steps, faults):
    for k in (1, 3, 5):
        u = max(max_norm(u) for _, u in steps[:k])
        counts = report_bounds.coefficients(k, 2, 1, **faults)
        expected = report_bounds.state_bound(max_norm(steps[k - 1][0].x), u, FIVE.unit_roundoff, counts)
        assert found.smallest_bound(FIVE, k, **faults) == pytest.approx(float(expected), rel=1e-13)


def test_beyond_the_last_step_its_sizes_are_kept(found):
    first, second = report_bounds.coefficients(1000, 2, 1)
    expected = float(FIVE.unit_roundoff) * (first * found.x[-1] + second * found.u[-1])
    assert found.smallest_bound(FIVE, 1000) == pytest.approx(expected, rel=1e-15)


def test_the_powers(found):
    assert 10 ** found.powers() == pytest.approx(found.columns[-1] ** (len(Z) - 1), rel=1e-12)
