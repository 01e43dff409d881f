"""gpbnb.report.geometry.theory: closed forms against the expansion by sympy and against sums written out."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
import sympy as sp

from gpbnb.report.geometry import derivation, theory
from gpbnb.report.geometry.derivation import ALPHA, BETA, GAMMA, PHI
from gpbnb.report.geometry.theory import Misalignments
from gpbnb.report.measurement import ARCSEC, MAS, deroll


@cache
def mean_errors(order):
    """Errors of y and z over a mean of whole rolls, from sympy."""
    C, S = derivation.C, derivation.S
    polynomials = (sp.Poly(error, C, S).terms() for error in derivation.drift_errors(order))
    return [sum(factor * derivation.mean(C**i * S**j).doit() for (i, j), factor in terms) for terms in polynomials]


def test_second_order_of_a_rolling_spacecraft_is_that_of_sympy():
    rng = np.random.default_rng(4)
    for _ in range(5):
        values = rng.uniform(-1, 1, 12) * 1e-4
        case = Misalignments(tuple(values[:3]), tuple(values[3:6]), tuple(values[6:9]), drift=(values[10], values[11]))
        numbers = dict(zip((*ALPHA, *BETA, *GAMMA, *PHI), values, strict=True))
        y, z = (float(e.subs(numbers)) for e in mean_errors(2))
        # products of two numbers of 1e-4; sympy and numpy round them differently by an ulp or two
        assert np.allclose(theory.measured(case, True, 1.0), [z, -y], rtol=1e-12, atol=1e-22)
        for phase in (0.0, 0.7):
            turn = {derivation.C: math.cos(phase), derivation.S: math.sin(phase)}
            y, z = (float(each.subs(numbers | turn)) for each in derivation.drift_errors(2))
            # products of three angles of 1e-4
            assert theory.measured(case, False, 1.0, phase) == pytest.approx([z, -y], rel=0, abs=1e-11)


def test_without_roll_the_readout_misalignment_stands_and_the_telescope_one_cancels():
    g = 1e-4
    assert theory.measured(Misalignments(gamma=(0, g, 0)), False) == pytest.approx([g, 0], abs=g**2)
    assert theory.measured(Misalignments(gamma=(0, 0, g)), False) == pytest.approx([0, g], abs=g**2)
    assert theory.measured(Misalignments(beta=(0, g, g)), False) == pytest.approx([0, 0], abs=1e-20)
    quarter = theory.measured(Misalignments(gamma=(0, g, 0)), False, phase=math.pi / 2)
    assert quarter == pytest.approx([0, g], abs=g**2)


def test_rolling_removes_what_stands():
    effect = theory.effect(Misalignments(beta=(0, 1e-4, 2e-4), gamma=(0, 1e-4, -3e-4)), True)
    assert effect.angle == effect.drift == (0, 0)
    assert effect.line == pytest.approx(math.hypot(1e-4, 3e-4), rel=1e-4)
    assert theory.effect(Misalignments(gamma=(0, 1e-4, 0)), False).line == 0


def test_effect_of_a_twist_in_milliarcseconds():
    for name in ("alpha1", "beta1", "gamma1"):
        drift = theory.effect(Misalignments().with_angle(name, 20 * ARCSEC), True).drift
        # 20" in radians times 0.04" and 6.6"
        assert drift[0] / MAS == pytest.approx(20 / 206264.806 * 40, rel=1e-6)
        assert drift[1] / MAS == pytest.approx(-20 / 206264.806 * 6600, rel=1e-6)


def test_printed_deroll_rolls_twice():
    inertial = np.array([-0.7, 0.3])
    phase = np.linspace(0, 6, 9)
    readings = deroll(np.broadcast_to(inertial, (9, 2)), -phase)
    assert np.allclose(theory.printed_deroll(readings, phase), -deroll(readings, -phase))
    assert np.allclose(theory.printed_deroll(readings, phase), -deroll(np.broadcast_to(inertial, (9, 2)), -2 * phase))


@pytest.mark.parametrize("rolls", [9, 40])
def test_leaks_are_the_sums_written_out(rolls):
    samples = 1000
    k = np.arange(samples * rolls)
    turning = np.exp(2j * np.pi * k / samples)
    time = (k - k.mean()) / len(k)
    slope = abs(np.sum(time * turning) / np.sum(time**2))
    # with n samples per roll, n sin(pi/n) replaces pi
    assert theory.line_fit_leak(1, rolls) == pytest.approx(slope, rel=2 * math.pi**2 / 6 / samples**2)


def test_aberration():
    """The constant of aberration is 20.4955 arcseconds; the Earth's orbit is not quite a circle."""
    year, orbit = theory.aberration(640e3)
    assert year == pytest.approx(20.4955 * ARCSEC, rel=2e-4)
    period = 2 * math.pi * (theory.RADIUS + 640e3) / (orbit * theory.LIGHT)
    assert period == pytest.approx(97.5 * 60, rel=1e-2)
