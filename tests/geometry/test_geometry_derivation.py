"""gpbnb.report.geometry.derivation: the algebra means what the numbers do."""

from __future__ import annotations

import itertools

import numpy as np
import sympy as sp

from gpbnb.report import measurement as m
from gpbnb.report.geometry import derivation


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
