"""gpbnb.geometry.derivation: every step holds, and the algebra means what the numbers do."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import steps
import sympy as sp

from gpbnb import measurement as m
from gpbnb.geometry import derivation, theory

DERIVATIONS = steps.collected(
    derivation.turns,
    derivation.deroll,
    derivation.printed_deroll,
    derivation.first_order_effects,
    derivation.second_order_effects,
    derivation.one_ring,
    derivation.precessions,
)


@steps.each(DERIVATIONS)
def test_each_step(step):
    steps.check(step)


def test_number_of_steps():
    assert steps.lengths(DERIVATIONS) == {
        "turns": 4,
        "deroll": 6,
        "printed_deroll": 6,
        "first_order_effects": 6,
        "second_order_effects": 2,
        "one_ring": 2,
        "precessions": 5,
    }


@pytest.mark.parametrize("sequence", derivation.SEQUENCES)
def test_the_symbolic_rotation_is_the_numeric_one(sequence):
    """Rodrigues' formula here, elementary matrices in gpbnb.measurement."""
    values = (0.3, -0.7, 1.1)
    symbolic = derivation.exact(derivation.ALPHA, sequence).subs(dict(zip(derivation.ALPHA, values, strict=True)))
    # entries up to one, a few roundings each
    assert np.allclose(np.array(symbolic.tolist(), dtype=float), m.rotation(values, sequence), atol=1e-15, rtol=0)


def test_all_orders_agree_to_first_and_not_to_second_order():
    assert derivation.orders_agree()
    seconds = {
        str(derivation.exact(derivation.ALPHA, s).applyfunc(lambda e: derivation.up_to(2, e, derivation.ALPHA)))
        for s in derivation.SEQUENCES
    }
    assert len(seconds) == 6


def test_printed_matrices_are_those_of_the_package():
    values = dict(zip(derivation.ALPHA, (0.5, 0.25, 0.125), strict=True))
    printed = np.array(derivation.printed_small(derivation.ALPHA).subs(values).tolist(), dtype=float)
    assert np.array_equal(printed, m.small_rotation([0.5, 0.25, 0.125]))
    roll = sp.Matrix([[1, 0, 0], [0, derivation.C, derivation.S], [0, -derivation.S, derivation.C]])
    assert np.allclose(np.array(roll.subs(derivation.P, 0.4).tolist(), dtype=float), m.roll(0.4), atol=1e-16)
    assert roll == derivation.turn(1, derivation.P)


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


def test_printed_estimates_are_those_of_theory():
    _, y, z = derivation.aligned(derivation.star())
    values = {derivation.ALPHA[1]: 0.3, derivation.ALPHA[2]: 0.7, derivation.P: 0.9}
    third, second = (float(e.subs(values)) for e in derivation.printed_estimates(y, z))
    readings = [float(y.subs(values)), float(z.subs(values))]
    assert np.allclose(theory.printed_deroll(readings, 0.9), [-third, second], atol=1e-15)


def test_errors_to_third_order_begin_with_those_to_second():
    small = (*derivation.ALPHA, *derivation.BETA, *derivation.GAMMA, *derivation.PHI)
    for second, third in zip(derivation.drift_errors(2), derivation.drift_errors(3), strict=True):
        assert sp.expand(derivation.up_to(2, third, small) - second) == 0
        assert sp.expand(third - second) != 0


def test_a_star_off_the_plane_has_drifts_that_are_not_perpendicular():
    step = DERIVATIONS["precessions"].steps[2]
    assert step.right.subs(sp.Symbol("epsilon", real=True), 0) == 0
    assert step.right != 0
