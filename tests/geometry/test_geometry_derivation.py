"""gpbnb.report.geometry.derivation: every step holds, and the algebra means what the numbers do."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import steps
import sympy as sp

from gpbnb.report import measurement as m
from gpbnb.report.geometry import derivation

NAMES = {
    "first_order_effects": {
        "telescope, first row: β is fixed in the spacecraft, so the deroll rotates it": (
            "-alpha_3 - beta_3*cos(psi) - beta_2*sin(psi)"
        ),
        "gyro, first row: β and γ appear": ("-theta_3 - (beta_3 + gamma_3)*cos(psi) - (beta_2 + gamma_2)*sin(psi)"),
        r"gyro less telescope, with $\varphi=\theta-\alpha$, first row: β cancels, γ does not": (
            "-varphi_3 - gamma_3*cos(psi) - gamma_2*sin(psi)"
        ),
        "gyro less telescope, second row": "varphi_2 + gamma_2*cos(psi) - gamma_3*sin(psi)",
        "mean over a roll of the remaining γ, first row": "0",
        "the same for the second row": "0",
    },
    "second_order_effects": {
        "mean error of the difference, first row": "(alpha_1 + beta_1 + gamma_1)*varphi_2 + gamma_1*alpha_2",
        "mean error of the difference, second row": "(alpha_1 + beta_1 + gamma_1)*varphi_3 + gamma_1*alpha_3",
    },
    "precessions": {
        "mean field along the axis of the Earth": "omega_E/2",
        "mean field across it, in the plane of the orbit": "0",
        r"inner product of the two drifts; it vanishes for a star in the plane of the orbit, $\epsilon=0$": (
            "-omega_E*sin(2*epsilon)*sin(delta)/4"
        ),
        "for such a star: frame dragging along the normal of the orbit": "omega_E*cos(delta)/2",
        "for such a star: frame dragging in the plane of the orbit": "0",
    },
}
"""What each step derives, beside its name; see `steps.check`."""


@pytest.mark.parametrize("name", NAMES)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check(getattr(derivation, name), NAMES[name])


@pytest.mark.parametrize(
    ("function", "name", "integrand"),
    [
        (
            "first_order_effects",
            "mean over a roll of the remaining γ, first row",
            "-gamma_3*cos(psi) - gamma_2*sin(psi)",
        ),
        ("first_order_effects", "the same for the second row", "gamma_2*cos(psi) - gamma_3*sin(psi)"),
        ("precessions", "mean field along the axis of the Earth", "omega_E*(3*sin(u)**2 - 1)"),
        ("precessions", "mean field across it, in the plane of the orbit", "3*omega_E*cos(u)*sin(u)"),
    ],
)
def test_each_mean_is_of_what_its_name_says(function, name, integrand):
    (step,) = (step for step in getattr(derivation, function)() if step.name == name)
    (integral,) = step.left.atoms(sp.Integral)
    assert steps.equal(integral.function, steps.written(integrand, step))


def test_the_fewest_signs_are_two_and_only_one_pair_does():
    """Checked again by numbers, over all 64 patterns."""
    assert derivation.fewest_signs() == ((2, 5),)
    alpha, phase = np.array([0, 0.3, 0.7]), np.linspace(0, 6, 5)
    y, z = m.deroll(np.broadcast_to([-0.7, 0.3], (5, 2)), -phase).T
    C, S = np.cos(phase), np.sin(phase)
    working = []
    for signs in itertools.product((1, -1), repeat=6):
        third = signs[0] * (signs[2] * C * y + signs[3] * S * z)
        second = -signs[1] * (-signs[4] * S * y + signs[5] * C * z)
        if np.allclose(third, alpha[2]) and np.allclose(second, alpha[1]):
            working.append(signs.count(-1))
    assert sorted(working)[0] == 2
    assert working.count(2) == 1


def test_a_star_off_the_plane_has_drifts_that_are_not_perpendicular():
    step = derivation.precessions()[2]
    assert step.right.subs(sp.Symbol("epsilon", real=True), 0) == 0
    assert step.right != 0
