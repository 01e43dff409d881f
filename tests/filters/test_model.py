"""gpbnb.filters.model: how entries are read, and the model of Gravity Probe B against its geometry."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.definiteness import factor
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import INPUTS, LETTERS, LinearModel
from gpbnb.report.gravity_probe_b.model import STATES, YEAR, gravity_probe_b

GOOD = {
    "Phi": [["0.9", "0.1"], [0, "0.8"]],
    "H": [[1, 0]],
    "Q": [["0.01", 0], [0, "0.02"]],
    "R": [["0.5"]],
    "x0": [1, 2],
    "P0": [[1, "0.5"], ["0.5", 1]],
}


def test_entries_are_read_exactly_and_held_for_ever():
    given = GOOD | {"B": exact([[1], [2]]), "u": exact([[3]]), "b": exact([4, 5]), "d": exact([6])}
    model = LinearModel(**given)
    for letter in INPUTS:
        given[letter][:] = 7
        assert np.ravel(getattr(model, letter)).tolist() == {"B": [1, 2], "u": [3], "b": [4, 5], "d": [6]}[letter]
    assert not any(getattr(model, letter).flags.writeable for letter in (*LETTERS, *INPUTS))
    assert (model.n, model.m, model.cycle) == (2, 1, 1)
    assert model.Phi[0, 0, 0] == Fraction(9, 10)
    assert model.Phi.shape == (1, 2, 2)
    assert model.to_float()["P0"].tolist() == [[1.0, 0.5], [0.5, 1.0]]


def test_cycles_of_matrices_have_periods_of_their_own():
    model = LinearModel(**(GOOD | {"H": [[[1, 0]], [[0, 1]]], "R": [[["0.5"]], [[1]], [[2]]]}))
    assert model.cycle == 6
    assert model.H[1].tolist() == [[0, 1]]


def test_semidefiniteness_is_decided_exactly():
    rank_one = [[1, 2], [2, 4]]
    assert LinearModel(**(GOOD | {"Q": rank_one, "P0": [[0, 0], [0, 0]]})).Q[0, 1, 1] == 4
    below = Fraction(4) - Fraction(1, 10**40)
    with pytest.raises(ValueError, match="got Q with a least eigenvalue"):
        LinearModel(**(GOOD | {"Q": [[1, 2], [2, below]]}))


def test_only_roundings_are_advised_away():
    """A negative variance that no rounding explains is an error of the model, and so is a zero in R."""
    for letter, value, advised in (("Q", [[1, 0], [0, -1]], False), ("Q", [[1, 0], [0, "-1e-9"]], True),
                                   ("R", [[1, 0], [0, "-1e-9"]], False)):  # fmt: skip
        with pytest.raises(ValueError, match="needed a positive") as error:
            LinearModel(**(GOOD | {"H": [[1, 0], [0, 1]], "R": [[1, 0], [0, 1]], letter: value}))
        assert ("add a little to its diagonal" in str(error.value)) is advised


def test_factors_of_covariances_multiply_to_them():
    rng = np.random.default_rng(5)
    A = np.array([[Fraction(int(k)) for k in row] for row in rng.integers(-5, 6, (4, 2))], dtype=object)
    covariance = A @ A.T
    lower, d = factor(covariance)
    assert np.array_equal((lower * d) @ lower.T, covariance)
    assert (d >= 0).all()
    assert (d > 0).sum() == 2
    with pytest.raises(ValueError, match="semidefinite"):
        factor(-covariance)


def test_the_gp_b_model_has_the_periods_of_roll_and_orbit():
    assert YEAR == 365 * 24 * 3600 // 10
    model = gravity_probe_b()
    assert (model.n, model.m, model.cycle) == (10, 2, 2340)
    assert len(STATES) == 10
    # 60 steps of a roll, 585 of an orbit: the smallest common multiple
    assert math.lcm(60, 585) == 2340
    for k in (0, 7, 77, 2339):
        assert model.H[k][:, :9].tolist() == model.H[(k + 60) % 2340][:, :9].tolist()
    # cos a cos b + sin a sin b = cos(a - b), of orbit and roll, from directions to six decimals
    for k in range(2340):
        angle = 2 * math.pi * 10 * (k + 1) * (1 / 5850 - 1 / 600)
        assert float(model.H[k, 0, 9]) == pytest.approx(5.2 * math.cos(angle), abs=5.2 * 2e-6)


def test_the_gp_b_model_is_that_of_the_geometry_to_first_order():
    """(1) and (2) of hung1982, ch. IV, multiplied out with small angles in place of the model's own formula."""
    model, rng = gravity_probe_b(), np.random.default_rng(4)
    size = 1e-6  # products of two angles are below 1e-11

    def small(angles):
        one, two, three = angles
        return np.array([[1, three, -two], [-three, 1, one], [two, -one, 1]])

    for k in (0, 11, 500):
        alpha, beta, gamma, psi = size * rng.standard_normal((4, 3))
        angle = 2 * math.pi * 10 * (k + 1) / 600
        c, s = math.cos(angle), math.sin(angle)
        turn = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
        telescope = small(beta) @ turn @ small(alpha) @ [1, 0, 0]
        gyro = small(gamma) @ small(beta) @ turn @ small(psi + alpha) @ [1, 0, 0]
        state = np.array([psi[1], psi[2], 0, 0, alpha[1], alpha[2], beta[1], gamma[1], 0, 0])
        shown = model.H[k].astype(float) @ state
        # six decimals of the directions, and the second order
        assert np.abs(shown - [gyro[2], telescope[2]]).max() < 4 * 1e-6 * size * 4 + 20 * size**2


# -- names of forms -------------------------------------------------------------------------------------------------

NAMES = {
    "innovation": Form.INNOVATION, "Joseph": Form.JOSEPH, "ud": Form.UD, "symmetrized": Form.SYMMETRIZED,
    "symmetrised": Form.SYMMETRIZED, "compensated": Form.COMPENSATED, "Potter": Form.POTTER, "Carlson": Form.CARLSON,
    "Cholesky": Form.CARLSON, "square root": Form.CARLSON, "square-root": Form.CARLSON, "hung": Form.HUNG,
    "Hung second gain": Form.HUNG_SECOND_GAIN,
}  # fmt: skip


def test_a_form_has_its_usual_names_and_the_one_that_is_shown():
    for name, form in (*NAMES.items(), *((str(form), form) for form in Form)):
        assert form_named(name) is form_named(f" {name.upper()} ") is Form(name) is form
