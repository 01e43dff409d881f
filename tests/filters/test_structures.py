"""Structures of digital filters: runs against their bounds, and responses against SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import linalg, signal

from gpbnb import BINARY16, FloatFormat, LinearSystem
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.sections import _filtered, scaled
from gpbnb.filters.structures import STRUCTURES
from gpbnb.wordlength.asked import Asked
from gpbnb.wordlength.judges import judge_for

FORMATS = [
    FloatFormat(2, 11),
    FloatFormat(2, 7, "even"),
    FloatFormat(2, 13, "down"),
    FloatFormat(10, 5),
    FloatFormat(16, 4),
    BINARY16,
    FloatFormat(2, 8, "up", -6, 30, subnormal=False),
]


def random_filter(rng, order):
    """Coefficients b, a of a stable filter, floats, some of them short or zero."""
    poles = rng.uniform(0.2, 0.95, order // 2) * np.exp(1j * rng.uniform(0, math.pi, order // 2))
    zeros = rng.uniform(0.2, 1.2, order // 2) * np.exp(1j * rng.uniform(0, math.pi, order // 2))
    poles, zeros = ([*each, *each.conj(), *([rng.uniform(-0.9, 0.9)] if order % 2 else [])] for each in (poles, zeros))
    b, a = np.poly(zeros).real * rng.uniform(0.1, 2), np.poly(poles).real
    if rng.random() < 0.3:
        b = np.round(b * 64) / 64
        b[0] = b[0] or 1.0
    if rng.random() < 0.2 and order > 1:
        b = b[: rng.integers(1, order + 1)]
    return b, a * rng.choice([1.0, 2.0, -0.5])


@pytest.mark.parametrize("structure", STRUCTURES)
def test_no_run_is_beyond_its_bound(structure):
    """Inputs of full size, among them the signs of the reversed response, which drive an output to its peak."""
    rng = np.random.default_rng([11, STRUCTURES.index(structure)])
    shares = []
    for fmt in FORMATS:
        b, a = random_filter(rng, int(rng.integers(1, 6)))
        system = LinearSystem.from_coefficients(b, a, structure)
        bound = judge_for(Asked(system, [[1.0]], 1, 1.0, "guarantee")).error(fmt).ratio
        if math.isinf(bound):
            continue
        response = system.outputs(np.eye(150, 1))[:, 0, 0]
        for u in (np.where(response[::-1] < 0, -1.0, 1.0), np.ones(150), rng.choice([-1.0, 1.0], 150)):
            found, true = (system.outputs(u[:, None], each) for each in (fmt, None))
            shares.append(np.abs((found - true).sum(axis=-1)).max() / bound)
    assert len(shares) >= 9
    assert 1 / 20 < max(shares) <= 1


@pytest.mark.parametrize("structure", STRUCTURES)
def test_responses_are_those_of_scipy(structure):
    rng = np.random.default_rng(7)
    for order in range(1, 9):
        b, a = random_filter(rng, order)
        system = LinearSystem.from_coefficients(b, a, structure)
        impulse = np.zeros((60, 1))
        impulse[0] = 1
        found = system.outputs(impulse)[:, 0, 0]
        # the accuracy of lfilter itself, whose poles may be as near as 0.1 to each other
        assert found == pytest.approx(signal.lfilter(b, a, impulse[:, 0]), rel=1e-9, abs=1e-9)


def test_a_filter_of_zeros_and_poles_is_that_of_scipy_or_refused():
    """Also with fewer zeros than poles, which are delays; a zero or a pole at 0 counts as one."""
    impulse = np.zeros((60, 1))
    impulse[0] = 1
    for z, p, k in (
        signal.cheby1(5, 1, 0.2, output="zpk"),
        signal.ellip(4, 1, 40, [0.2, 0.5], "band", output="zpk"),
        ([0.5], [0.25, 0.5 + 0.5j, 0.5 - 0.5j], 2.0),
        ([], [0.9], 0.1),
        ([0.0, 0.3], [0.0, 0.0], 1.0),
    ):
        for structure in ("cascade", "direct form II transposed"):
            found = LinearSystem.from_zeros(z, p, k, structure).outputs(impulse)[:, 0, 0]
            b, a = signal.zpk2tf(z, p, k)
            b = np.concatenate([np.zeros(len(a) - len(b)), b])  # in powers of 1/z
            # the accuracy of lfilter itself, as above
            assert found == pytest.approx(signal.lfilter(b, a, impulse[:, 0]), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("form", ["direct form I", "direct form II"])
def test_scaled_sections_hand_on_numbers_within_one_and_beyond_half_of_it(form):
    sos, impulse = signal.butter(6, 0.1, output="sos"), np.eye(1, 3000)[0]
    found = scaled([(exact(20 * row[:3]), exact(row[4:])) for row in sos], form)
    rows = np.array([[*map(float, b), 1, *map(float, a)] for b, a in found])
    for i in (1, 2):
        reached = [signal.sosfilt(rows[:i], impulse)]
        if form == "direct form II":  # the delayed values of the next section
            reached.append(signal.sosfilt([[1, 0, 0, *rows[i, 3:]]], reached[0]))
        assert 1 / 2 < max(np.abs(each).sum() for each in reached) <= 1
    assert signal.sosfilt(rows, impulse) == pytest.approx(20**3 * signal.sosfilt(sos, impulse), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("order", [2, 3, 6, 8, 12])
def test_balanced_states_are_as_easy_to_excite_as_to_observe(order):
    """SciPy solves the two equations in float64, for matrices whose entries have one size."""
    system = LinearSystem.from_sections(signal.butter(order, 0.2, output="sos"), "balanced state space")
    A, B, C, _ = (each.astype(np.float64) for each in system.stored(FloatFormat(2, 53)))
    reached, seen = linalg.solve_discrete_lyapunov(A, B @ B.T), linalg.solve_discrete_lyapunov(A.T, C.T @ C)
    np.testing.assert_allclose(reached, seen, atol=1e-13)
    np.testing.assert_allclose(reached, np.diag(np.diagonal(reached)), atol=1e-13)


def test_a_response_is_that_of_scipy_digit_for_digit():
    rng = np.random.default_rng(3)
    for order in (1, 2, 3, 5):
        b, a = random_filter(rng, order)
        values = rng.standard_normal(200)
        found = _filtered(values, exact(b / a[0]), exact(a / a[0])[1:])
        assert np.array_equal(found, signal.lfilter(b / a[0], a / a[0], values))
