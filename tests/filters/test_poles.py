"""Poles and responses of stored coefficients, against SciPy's evaluation of the same coefficients."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from gpbnb import FloatFormat, LinearSystem
from gpbnb.arithmetic.rational import eigenvalues
from gpbnb.filters.poles import stored_response


@pytest.mark.parametrize("digits", [11, 16, 24])
@pytest.mark.parametrize(("order", "cutoff"), [(2, 0.02), (4, 0.05), (8, 0.2)])
def test_the_change_of_a_response_is_that_of_scipy(order, cutoff, digits):
    """Within the pass band, where both grids find the largest change; SciPy evaluates sections, not matrices."""
    sos = signal.butter(order, cutoff, output="sos")
    fmt = FloatFormat(2, digits)
    stored = np.array([[float(fmt.round(float(c))) for c in row] for row in sos])
    found = stored_response(LinearSystem.from_sections(sos), fmt)
    grid = np.concatenate([np.linspace(0, 0.5, 20_001), [found.frequency]])
    given, other = (np.abs(signal.freqz_sos(each, grid, fs=1)[1]) for each in (sos, stored))
    heard = given >= 1e-3 * given.max()
    expected = np.abs(20 * np.log10(other[heard] / given[heard]))
    assert found.change == pytest.approx(expected[-1], rel=1e-6, abs=1e-9)  # float64 evaluates both
    assert expected.max() * 0.99 - 1e-9 <= found.change
    assert found.pole == pytest.approx(max(abs(p) for row in sos for p in np.roots(row[3:])), rel=1e-9)
    assert found.stored_pole == pytest.approx(max(abs(p) for row in stored for p in np.roots(row[3:])), rel=1e-9)


def test_a_change_counts_down_to_60_decibels_below_the_peak():
    """The response is zero at half of the sampling rate, where any change of it is infinite."""
    b, a = [0.1, 0.2003, 0.1003], [1, -0.5]
    found = stored_response(LinearSystem.from_coefficients(b, a), FloatFormat(2, 10))
    (response,) = np.abs(signal.freqz(b, a, [found.frequency], fs=1)[1])
    assert 1e-3 <= response / (sum(b) / sum(a)) < 1.02e-3


def test_eigenvalues_of_a_cascade_are_those_of_its_sections():
    A = np.array([[0.999, 0, 0], [1e6, 0.999, 0], [1e12, 1e6, 0.999]])
    assert np.abs(np.linalg.eigvals(A)).max() == pytest.approx(0.999)
    assert eigenvalues(A).tolist() == [0.999] * 3
    turn = np.array([[0, -0.25], [1, 0]])
    assert sorted(eigenvalues(turn), key=lambda z: z.imag) == pytest.approx([-0.5j, 0.5j])
